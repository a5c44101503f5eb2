//! What clients are told, a JSON line each.

use serde::Serialize;
use serde_json::{Value, json};

use super::lease::{ANSWER_WITHIN, News};
use super::status::StatusLine;

/// What [`Problem::what`] says where the connection stays.
const REFUSED: &str = "refused";

/// What is wrong with a request.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Problem {
    /// What happened.
    pub what: &'static str,
    /// Where in the line.
    #[serde(rename = "where")]
    pub place: String,
    /// The cause.
    pub why: String,
}

impl Problem {
    /// A line that cannot be understood: the connection closes.
    pub fn malformed(place: &str, why: &str) -> Self {
        Self {
            what: "malformed line",
            place: place.to_string(),
            why: why.to_string(),
        }
    }

    /// A line that is no JSON, or JSON of the wrong form.
    pub fn of_json(error: &serde_json::Error) -> Self {
        let text = error.to_string();
        // The line within the text is always the first.
        let why = text.split(" at line ").next().unwrap_or(&text);
        Self::malformed(&format!("column {}", error.column()), why)
    }

    /// A request in whose handling the host failed: the connection closes.
    pub fn defect() -> Self {
        let why = "a defect of tandem: this connection ends, everything else goes on; standard error has the words";
        Self {
            what: "failed",
            place: "the whole line".to_string(),
            why: why.to_string(),
        }
    }

    /// There is no place for one more of a client's kind, of which there may be `most`.
    pub fn crowded(most: usize) -> Self {
        Self::refused("the connection", format!("{most} clients are here already"))
    }

    /// Whether the client cannot be understood any further.
    pub fn ends_connection(&self) -> bool {
        self.what != REFUSED
    }

    /// A request that is understood and not granted: the connection stays.
    pub fn refused(place: &str, why: String) -> Self {
        Self {
            what: REFUSED,
            place: place.to_string(),
            why,
        }
    }
}

/// The answer to a request that was not granted, on line `number` of the connection.
pub fn error(number: u64, problem: &Problem) -> String {
    let Problem { what, place, why } = problem;
    line(
        &json!({ "error": { "what": what, "where": format!("line {number}: {place}"), "why": why } }),
    )
}

/// The answer to a request that was granted.
pub fn ok(value: &Value) -> String {
    line(&json!({ "ok": value }))
}

/// The answer to a status request.
pub fn status(status: &StatusLine) -> String {
    #[derive(Serialize)]
    struct Answer<'a> {
        ok: Inner<'a>,
    }
    #[derive(Serialize)]
    struct Inner<'a> {
        status: &'a StatusLine,
    }
    line(&Answer {
        ok: Inner { status },
    })
}

/// A status line that was subscribed to; `lost` of them did not fit since the last one.
pub fn telemetry(status: &str, lost: u64) -> String {
    format!("{{\"status\":{status},\"lost\":{lost}}}\n")
}

/// What becomes of the lease, to the client that holds it or held it; it is no answer.
pub fn lease(news: News) -> String {
    let words = match news {
        News::AskedBy(client) => {
            json!({ "asked_by": client, "answer_within_s": ANSWER_WITHIN.as_secs_f64() })
        }
        News::LostTo(client) => json!({ "lost_to": client }),
    };
    line(&json!({ "lease": words }))
}

/// The last line of a run.
pub fn ended(status: &StatusLine, lost: u64) -> String {
    #[derive(Serialize)]
    struct Last<'a> {
        ended: End<'a>,
        status: &'a StatusLine,
        lost: u64,
    }
    #[derive(Serialize)]
    struct End<'a> {
        fault: Option<&'a str>,
        stopped: Option<&'a str>,
    }
    let end = End {
        fault: status.fault.as_deref(),
        stopped: status.stopped.as_deref(),
    };
    line(&Last {
        ended: end,
        status,
        lost,
    })
}

fn line(value: &impl Serialize) -> String {
    // Numbers and text only: there is nothing in it that JSON cannot say.
    let mut text = serde_json::to_string(value).unwrap_or_default();
    text.push('\n');
    text
}
