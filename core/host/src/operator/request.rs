//! What a client may ask, line by line.

use serde::Deserialize;
use serde_json::Value;

use super::reply::Problem;
use crate::command::Command;

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
    token: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Subscribe {
    rate_hz: f64,
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
    let Line { command, value, subscribe, status, lease, token } = line;
    let commands = command.map(|name| to_command(&name, value.as_ref()));
    if commands.is_none() && value.is_some() {
        return Err(Problem::malformed("key \"value\"", "it goes with \"command\""));
    }
    let requests = [
        commands.transpose()?,
        subscribe.map(rate).transpose()?,
        status.map(|_| Request::Status),
        lease.map(Request::Lease),
        token.map(Request::Token),
    ];
    let mut requests = requests.into_iter().flatten();
    match (requests.next(), requests.next()) {
        (Some(request), None) => Ok(request),
        (None, _) => Err(Problem::malformed("the whole line", "it has none of command, subscribe, status, lease")),
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

fn rate(Subscribe { rate_hz }: Subscribe) -> Result<Request, Problem> {
    if (0.0..=MAX_RATE_HZ).contains(&rate_hz) {
        return Ok(Request::Subscribe(rate_hz));
    }
    Err(Problem::malformed("key \"rate_hz\"", &format!("{rate_hz} is not within 0 to {MAX_RATE_HZ}")))
}

#[cfg(test)]
mod tests {
    use super::*;

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
            (r#"{"status":{},"status":{}}"#, "column", "duplicate field"),
        ] {
            let problem = parse(text).expect_err(text);
            assert!(problem.place.contains(place) && problem.why.contains(why), "{text}: {problem:?}");
        }
    }
}
