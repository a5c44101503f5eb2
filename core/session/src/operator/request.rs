//! What a client may ask, line by line.

use std::fmt;

use serde::Deserialize;
use serde::de::{Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use tandem_host::Command;

use super::reply::Problem;
use crate::jog::{JogMessage, ReachMessage};

/// Lowest rate of a subscription, Hz: a line in a minute and a half. What is slower asks for a status when it wants one.
pub const MIN_RATE_HZ: f64 = 0.01;
/// Highest rate of a subscription, Hz: the status is made once in a rough period.
pub const MAX_RATE_HZ: f64 = 100.0;

/// One line of a client, understood.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// A command for the machine.
    Command(Command),
    /// Status lines at this rate, Hz, [`MIN_RATE_HZ`] to [`MAX_RATE_HZ`]; none ends them.
    Subscribe(Option<f64>),
    /// One status line.
    Status,
    /// The control lease.
    Lease(LeaseWord),
    /// A jog, or its keep-alive; none lets go of what moves.
    Jog(Option<JogMessage>),
    /// Who the client is, over TCP.
    Token(String),
}

/// What is asked of the control lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LeaseWord {
    /// To have it, where nobody holds it or its holder says nothing any more.
    Take,
    /// To have it, whoever holds it.
    #[serde(rename = "take-over")]
    TakeOver,
    /// To give it back.
    Release,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    command: Option<String>,
    value: Option<Scalar>,
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

/// The value of a command as text. Lists and objects are skipped without recursion: how deep they nest is the client's
/// choice, how deep the stack is, is not.
struct Scalar(String);

impl<'de> Deserialize<'de> for Scalar {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ScalarVisitor)
    }
}

struct ScalarVisitor;

impl<'de> Visitor<'de> for ScalarVisitor {
    type Value = Scalar;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, true, false or text")
    }

    fn visit_bool<E>(self, on: bool) -> Result<Scalar, E> {
        Ok(Scalar(u8::from(on).to_string()))
    }

    fn visit_u64<E>(self, number: u64) -> Result<Scalar, E> {
        Ok(Scalar(number.to_string()))
    }

    fn visit_i64<E>(self, number: i64) -> Result<Scalar, E> {
        Ok(Scalar(number.to_string()))
    }

    fn visit_f64<E>(self, number: f64) -> Result<Scalar, E> {
        Ok(Scalar(number.to_string()))
    }

    fn visit_str<E>(self, text: &str) -> Result<Scalar, E> {
        Ok(Scalar(text.to_string()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Scalar, A::Error> {
        while list.next_element::<IgnoredAny>()?.is_some() {}
        Ok(Scalar("[…]".to_string()))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<Scalar, A::Error> {
        while object.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {}
        Ok(Scalar("{…}".to_string()))
    }
}

/// Understands a line.
///
/// # Errors
/// The line is malformed: what, where, why.
pub fn parse(text: &str) -> Result<Request, Problem> {
    let line: Line = serde_json::from_str(text).map_err(|error| Problem::of_json(&error))?;
    let Line {
        command,
        value,
        subscribe,
        status,
        lease,
        jog,
        token,
    } = line;
    let commands = command.map(|name| to_command(&name, value.as_ref()));
    if commands.is_none() && value.is_some() {
        return Err(Problem::malformed(
            "key \"value\"",
            "it goes with \"command\"",
        ));
    }
    let requests = [
        commands.transpose()?,
        subscribe.map(rate).transpose()?,
        status.map(|_| Request::Status),
        lease.map(Request::Lease),
        jog.map(|line| {
            line.read()
                .map_err(|why| Problem::malformed("key \"jog\"", why))
        })
        .transpose()?,
        token.map(Request::Token),
    ];
    let mut requests = requests.into_iter().flatten();
    match (requests.next(), requests.next()) {
        (Some(request), None) => Ok(request),
        (None, _) => Err(Problem::malformed(
            "the whole line",
            "it has none of command, subscribe, status, lease, jog, token",
        )),
        (Some(_), Some(_)) => Err(Problem::malformed(
            "the whole line",
            "it asks for more than one thing",
        )),
    }
}

fn to_command(name: &str, value: Option<&Scalar>) -> Result<Request, Problem> {
    let text = value.map(|Scalar(text)| text.as_str());
    let place = if value.is_some() {
        "keys \"command\" and \"value\""
    } else {
        "key \"command\""
    };
    Command::parse(name, text)
        .map(Request::Command)
        .map_err(|why| Problem::malformed(place, &why))
}

impl JogLine {
    fn read(&self) -> Result<Request, &'static str> {
        let of_jog = [
            self.distance_mm,
            self.distance_deg,
            self.feed_mm_per_min,
            self.feed_deg_per_min,
        ];
        let stops = self.stop == Some(true);
        if stops
            && self.axis.is_none()
            && self.direction.is_none()
            && of_jog.iter().all(Option::is_none)
        {
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
        let distance = if degrees {
            self.distance_deg
        } else {
            self.distance_mm
        };
        if self.distance_mm.or(self.distance_deg) != distance {
            return Err("feed and distance are both in mm or both in deg");
        }
        let reach = match (self.direction, distance) {
            (Some(direction @ (1 | -1)), None) => ReachMessage::On {
                positive: direction == 1,
            },
            (None, Some(distance)) => ReachMessage::By(distance),
            (Some(_), None) => return Err("\"direction\" is 1 or -1"),
            _ => return Err("it needs one of direction and distance"),
        };
        let axis = self.axis.ok_or("it needs an axis")?;
        Ok(Request::Jog(Some(JogMessage {
            axis,
            reach,
            feed_per_min,
            degrees: Some(degrees),
        })))
    }
}

fn rate(Subscribe { rate_hz }: Subscribe) -> Result<Request, Problem> {
    if rate_hz == 0.0 {
        return Ok(Request::Subscribe(None));
    }
    if (MIN_RATE_HZ..=MAX_RATE_HZ).contains(&rate_hz) {
        return Ok(Request::Subscribe(Some(rate_hz)));
    }
    let why = format!("{rate_hz} is neither 0 nor within {MIN_RATE_HZ} to {MAX_RATE_HZ}");
    Err(Problem::refused("key \"rate_hz\"", why))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn jog(reach: ReachMessage, degrees: bool) -> Request {
        Request::Jog(Some(JogMessage {
            axis: 'x',
            reach,
            feed_per_min: 600.0,
            degrees: Some(degrees),
        }))
    }

    #[test]
    fn every_request() {
        for (text, request) in [
            (r#"{"command":"hold"}"#, Request::Command(Command::Hold)),
            (
                r#"{"command":"feed-override","value":0.5}"#,
                Request::Command(Command::FeedOverride(0.5)),
            ),
            (
                r#"{"command":"single-block","value":true}"#,
                Request::Command(Command::SingleBlock(true)),
            ),
            (
                r#"{"command":"optional-stop","value":0}"#,
                Request::Command(Command::OptionalStop(false)),
            ),
            (
                r#"{"command":"emergency-stop"}"#,
                Request::Command(Command::EmergencyStop),
            ),
            (
                r#"{"subscribe":{"rate_hz":20}}"#,
                Request::Subscribe(Some(20.0)),
            ),
            (
                r#"{"subscribe":{"rate_hz":-0.0}}"#,
                Request::Subscribe(None),
            ),
            (r#"{"status":{}}"#, Request::Status),
            (r#"{"lease":"take"}"#, Request::Lease(LeaseWord::Take)),
            (
                r#"{"lease":"take-over"}"#,
                Request::Lease(LeaseWord::TakeOver),
            ),
            (
                r#" { "lease" : "release" } "#,
                Request::Lease(LeaseWord::Release),
            ),
            (r#"{"jog":{"stop":true}}"#, Request::Jog(None)),
            (
                r#"{"jog":{"axis":"x","feed_mm_per_min":600,"direction":-1}}"#,
                jog(ReachMessage::On { positive: false }, false),
            ),
            (
                r#"{"jog":{"axis":"x","distance_deg":0.1,"feed_deg_per_min":600}}"#,
                jog(ReachMessage::By(0.1), true),
            ),
            (r#"{"token":"abc"}"#, Request::Token("abc".to_string())),
        ] {
            assert_eq!(parse(text), Ok(request), "{text}");
        }
    }

    #[test]
    fn a_value_that_nests_deeper_than_a_stack_is_refused_like_any_other() {
        let deep = format!(
            r#"{{"command":"feed-override","value":{}1{}}}"#,
            "[".repeat(120),
            "]".repeat(120)
        );
        assert!(parse(&deep).unwrap_err().why.contains("not a number"));
        let deeper = format!(
            r#"{{"command":"feed-override","value":{}"#,
            "{\"a\":".repeat(800)
        );
        assert!(parse(&deeper).is_err());
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
            (
                r#"{"command":"hodl"}"#,
                "\"command\"",
                "no command is called \"hodl\"",
            ),
            (
                r#"{"command":"hold","value":1}"#,
                "\"value\"",
                "takes no value",
            ),
            (
                r#"{"command":"feed-override"}"#,
                "\"command\"",
                "needs a value",
            ),
            (
                r#"{"command":"feed-override","value":-1}"#,
                "\"value\"",
                "zero or more",
            ),
            (
                r#"{"command":"feed-override","value":{}}"#,
                "\"value\"",
                "not a number",
            ),
            (r#"{"value":1,"status":{}}"#, "\"value\"", "goes with"),
            (
                r#"{"status":{},"lease":"take"}"#,
                "the whole line",
                "more than one",
            ),
            (r#"{"lease":"steal"}"#, "column", "unknown variant"),
            (
                r#"{"subscribe":{"rate_hz":1000}}"#,
                "\"rate_hz\"",
                "within 0.01 to 100",
            ),
            (
                r#"{"subscribe":{"rate_hz":1e-21}}"#,
                "\"rate_hz\"",
                "within 0.01 to 100",
            ),
            (
                r#"{"subscribe":{"rate_hz":-1}}"#,
                "\"rate_hz\"",
                "within 0.01 to 100",
            ),
            (r#"{"jog":{}}"#, "\"jog\"", "feed_mm_per_min"),
            (
                r#"{"jog":{"axis":"xy","feed_mm_per_min":1,"direction":1}}"#,
                "column",
                "character",
            ),
            (
                r#"{"jog":{"feed_mm_per_min":1,"direction":1}}"#,
                "\"jog\"",
                "an axis",
            ),
            (
                r#"{"jog":{"axis":"x","feed_mm_per_min":1,"direction":2}}"#,
                "\"jog\"",
                "1 or -1",
            ),
            (
                r#"{"jog":{"axis":"x","feed_mm_per_min":1,"distance_deg":2}}"#,
                "\"jog\"",
                "both in mm",
            ),
            (
                r#"{"jog":{"axis":"x","feed_mm_per_min":1}}"#,
                "\"jog\"",
                "direction and distance",
            ),
            (r#"{"jog":{"stop":true,"axis":"x"}}"#, "\"jog\"", "alone"),
            (r#"{"status":{},"status":{}}"#, "column", "duplicate field"),
        ] {
            let problem = parse(text).expect_err(text);
            assert!(
                problem.place.contains(place) && problem.why.contains(why),
                "{text}: {problem:?}"
            );
        }
    }
}
