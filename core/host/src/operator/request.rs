//! What a client may ask, line by line.

use serde::Deserialize;
use serde_json::Value;

use super::reply::Problem;
use crate::command::Command;
use crate::jog::{JogWords, ReachWords};

/// Highest rate of a subscription, Hz: the status is made once in a rough period.
pub const MAX_RATE_HZ: f64 = 100.0;

/// One line of a client, understood.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// A command for the machine.
    Command(Command),
    /// Status lines at this rate, Hz; 0 ends them.
    Subscribe(f64),
    /// One status line.
    Status,
    /// The control lease.
    Lease(LeaseWord),
    /// A jog, or its keep-alive; none lets go of what moves.
    Jog(Option<JogWords>),
    /// Who the client is, over TCP.
    Token(String),
}

/// What is asked of the control lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LeaseWord {
    /// To have it.
    Take,
    /// To give it back.
    Release,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    command: Option<String>,
    value: Option<Value>,
    subscribe: Option<Subscribe>,
    status: Option<Empty>,
    lease: Option<LeaseWord>,
    jog: Option<JogLine>,
    token: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Subscribe {
    rate_hz: f64,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct JogLine {
    axis: Option<char>,
    direction: Option<i64>,
    distance_mm: Option<f64>,
    distance_deg: Option<f64>,
    feed_mm_per_min: Option<f64>,
    feed_deg_per_min: Option<f64>,
    stop: Option<bool>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Empty {}

/// Understands a line.
///
/// # Errors
/// The line is malformed: what, where, why.
pub fn parse(text: &str) -> Result<Request, Problem> {
    let line: Line = serde_json::from_str(text).map_err(|error| Problem::of_json(&error))?;
    let Line { command, value, subscribe, status, lease, jog, token } = line;
    let commands = command.map(|name| to_command(&name, value.as_ref()));
    if commands.is_none() && value.is_some() {
        return Err(Problem::malformed("key \"value\"", "it goes with \"command\""));
    }
    let requests = [
        commands.transpose()?,
        subscribe.map(rate).transpose()?,
        status.map(|_| Request::Status),
        lease.map(Request::Lease),
        jog.map(|line| line.read().map_err(|why| Problem::malformed("key \"jog\"", why))).transpose()?,
        token.map(Request::Token),
    ];
    let mut requests = requests.into_iter().flatten();
    match (requests.next(), requests.next()) {
        (Some(request), None) => Ok(request),
        (None, _) => Err(Problem::malformed("the whole line", "it has none of command, subscribe, status, lease, jog")),
        (Some(_), Some(_)) => Err(Problem::malformed("the whole line", "it asks for more than one thing")),
    }
}

fn to_command(name: &str, value: Option<&Value>) -> Result<Request, Problem> {
    let text = value.map(|value| match value {
        Value::String(text) => text.clone(),
        Value::Bool(on) => u8::from(*on).to_string(),
        other => other.to_string(),
    });
    let place = if value.is_some() { "keys \"command\" and \"value\"" } else { "key \"command\"" };
    Command::parse(name, text.as_deref()).map(Request::Command).map_err(|why| Problem::malformed(place, &why))
}

impl JogLine {
    fn read(&self) -> Result<Request, &'static str> {
        let of_jog = [self.distance_mm, self.distance_deg, self.feed_mm_per_min, self.feed_deg_per_min];
        let stops = self.stop == Some(true);
        if stops && self.axis.is_none() && self.direction.is_none() && of_jog.iter().all(Option::is_none) {
            return Ok(Request::Jog(None));
        }
        if self.stop.is_some() {
            return Err("\"stop\" is true and stands alone");
        }
        let (feed_per_min, degrees) = match (self.feed_mm_per_min, self.feed_deg_per_min) {
            (Some(feed), None) => (feed, false),
            (None, Some(feed)) => (feed, true),
            _ => return Err("it needs one of feed_mm_per_min and feed_deg_per_min"),
        };
        let distance = if degrees { self.distance_deg } else { self.distance_mm };
        if self.distance_mm.or(self.distance_deg) != distance {
            return Err("feed and distance are both in mm or both in deg");
        }
        let reach = match (self.direction, distance) {
            (Some(direction @ (1 | -1)), None) => ReachWords::On { positive: direction == 1 },
            (None, Some(distance)) => ReachWords::By(distance),
            (Some(_), None) => return Err("\"direction\" is 1 or -1"),
            _ => return Err("it needs one of direction and distance"),
        };
        let axis = self.axis.ok_or("it needs an axis")?;
        Ok(Request::Jog(Some(JogWords { axis, reach, feed_per_min, degrees: Some(degrees) })))
    }
}

fn rate(Subscribe { rate_hz }: Subscribe) -> Result<Request, Problem> {
    if (0.0..=MAX_RATE_HZ).contains(&rate_hz) {
        return Ok(Request::Subscribe(rate_hz));
    }
    Err(Problem::malformed("key \"rate_hz\"", &format!("{rate_hz} is not within 0 to {MAX_RATE_HZ}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn jog(reach: ReachWords, degrees: bool) -> Request {
        Request::Jog(Some(JogWords { axis: 'x', reach, feed_per_min: 600.0, degrees: Some(degrees) }))
    }

    #[test]
    fn every_request() {
        for (text, request) in [
            (r#"{"command":"hold"}"#, Request::Command(Command::Hold)),
            (r#"{"command":"feed-override","value":0.5}"#, Request::Command(Command::FeedOverride(0.5))),
            (r#"{"command":"single-block","value":true}"#, Request::Command(Command::SingleBlock(true))),
            (r#"{"command":"optional-stop","value":0}"#, Request::Command(Command::OptionalStop(false))),
            (r#"{"command":"emergency-stop"}"#, Request::Command(Command::EmergencyStop)),
            (r#"{"subscribe":{"rate_hz":20}}"#, Request::Subscribe(20.0)),
            (r#"{"status":{}}"#, Request::Status),
            (r#"{"lease":"take"}"#, Request::Lease(LeaseWord::Take)),
            (r#" { "lease" : "release" } "#, Request::Lease(LeaseWord::Release)),
            (r#"{"jog":{"stop":true}}"#, Request::Jog(None)),
            (
                r#"{"jog":{"axis":"x","feed_mm_per_min":600,"direction":-1}}"#,
                jog(ReachWords::On { positive: false }, false),
            ),
            (r#"{"jog":{"axis":"x","distance_deg":0.1,"feed_deg_per_min":600}}"#, jog(ReachWords::By(0.1), true)),
            (r#"{"token":"abc"}"#, Request::Token("abc".to_string())),
        ] {
            assert_eq!(parse(text), Ok(request), "{text}");
        }
    }

    #[test]
    fn malformed_lines_say_what_where_why() {
        for (text, place, why) in [
            ("", "column 0", "EOF"),
            ("hold", "column 1", "expected value"),
            (r#"{"command":"hold""#, "column 17", "EOF"),
            ("{}", "the whole line", "none of"),
            ("[]", "column", "invalid"),
            (r#"{"comand":"hold"}"#, "column 9", "unknown field `comand`"),
            (r#"{"command":"hodl"}"#, "\"command\"", "no command is called \"hodl\""),
            (r#"{"command":"hold","value":1}"#, "\"value\"", "takes no value"),
            (r#"{"command":"feed-override"}"#, "\"command\"", "needs a value"),
            (r#"{"command":"feed-override","value":-1}"#, "\"value\"", "zero or more"),
            (r#"{"command":"feed-override","value":{}}"#, "\"value\"", "not a number"),
            (r#"{"value":1,"status":{}}"#, "\"value\"", "goes with"),
            (r#"{"status":{},"lease":"take"}"#, "the whole line", "more than one"),
            (r#"{"lease":"steal"}"#, "column", "unknown variant"),
            (r#"{"subscribe":{"rate_hz":1000}}"#, "\"rate_hz\"", "within 0 to 100"),
            (r#"{"jog":{}}"#, "\"jog\"", "feed_mm_per_min"),
            (r#"{"jog":{"axis":"xy","feed_mm_per_min":1,"direction":1}}"#, "column", "character"),
            (r#"{"jog":{"feed_mm_per_min":1,"direction":1}}"#, "\"jog\"", "an axis"),
            (r#"{"jog":{"axis":"x","feed_mm_per_min":1,"direction":2}}"#, "\"jog\"", "1 or -1"),
            (r#"{"jog":{"axis":"x","feed_mm_per_min":1,"distance_deg":2}}"#, "\"jog\"", "both in mm"),
            (r#"{"jog":{"axis":"x","feed_mm_per_min":1}}"#, "\"jog\"", "direction and distance"),
            (r#"{"jog":{"stop":true,"axis":"x"}}"#, "\"jog\"", "alone"),
            (r#"{"status":{},"status":{}}"#, "column", "duplicate field"),
        ] {
            let problem = parse(text).expect_err(text);
            assert!(problem.place.contains(place) && problem.why.contains(why), "{text}: {problem:?}");
        }
    }
}
