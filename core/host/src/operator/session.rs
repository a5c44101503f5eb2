//! One client's conversation, without its socket.

use std::time::{Duration, Instant};

use serde_json::json;

use super::desk::Desk;
use super::lease::Lease;
use super::reply::{self, Problem};
use super::request::{LeaseWord, Request, parse};
use super::token;
use crate::command::Command;
use crate::jog::JogWords;

/// What a line led to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// The line to send.
    pub line: String,
    /// The connection closes when it is sent.
    pub last: bool,
}

/// One client's conversation.
#[derive(Debug)]
pub struct Session {
    /// The client's number.
    pub client: u64,
    /// The token that the first line must name.
    token: Option<String>,
    lines: u64,
    subscription: Option<Subscription>,
}

#[derive(Debug)]
struct Subscription {
    every: Duration,
    due: Instant,
}

impl Session {
    /// A client that has just come; over TCP its first line names `token`.
    pub fn new(client: u64, token: Option<String>) -> Self {
        Self { client, token, lines: 0, subscription: None }
    }

    /// Whether the client has said who it is, or need not.
    pub fn is_known(&self) -> bool {
        self.token.is_none()
    }

    /// Answers a line.
    pub fn line(&mut self, text: &str, desk: &Desk, lease: &mut Lease, now: Instant) -> Answer {
        self.lines += 1;
        let request = match parse(text) {
            Ok(request) => request,
            Err(problem) => return self.close(&problem),
        };
        if let Some(token) = self.token.take() {
            return self.introduce(&token, &request);
        }
        match self.grant(&request, desk, lease, now) {
            Ok(line) => Answer { line, last: false },
            Err(problem) => Answer { line: reply::error(self.lines, &problem), last: false },
        }
    }

    /// The end of a client that is not understood.
    pub fn close(&self, problem: &Problem) -> Answer {
        Answer { line: reply::error(self.lines, problem), last: true }
    }

    /// A line was cut off before it was read.
    pub fn too_long(&mut self, most: usize) -> Answer {
        self.lines += 1;
        self.close(&Problem::malformed("the whole line", &format!("it is longer than {most} bytes")))
    }

    /// Whether a status line is due now.
    pub fn is_due(&mut self, now: Instant) -> bool {
        let Some(subscription) = self.subscription.as_mut().filter(|s| s.due <= now) else { return false };
        // After a stall the rate starts anew: what was missed is not made up for.
        subscription.due = (subscription.due + subscription.every).max(now);
        true
    }

    /// When the next status line is due.
    pub fn due(&self) -> Option<Instant> {
        self.subscription.as_ref().map(|s| s.due)
    }

    fn introduce(&self, expected: &str, request: &Request) -> Answer {
        match request {
            Request::Token(given) if token::is_same(given, expected) => {
                Answer { line: reply::ok(&json!({ "client": self.client })), last: false }
            }
            Request::Token(_) => self.close(&Problem::refused("key \"token\"", "it is another token".to_string())),
            _ => self
                .close(&Problem::refused("the whole line", "the first line over TCP is {\"token\":\"…\"}".to_string())),
        }
    }

    fn grant(&mut self, request: &Request, desk: &Desk, lease: &mut Lease, now: Instant) -> Result<String, Problem> {
        match request {
            Request::Command(command) => self.command(*command, desk, lease),
            Request::Status => Ok(reply::status(&desk.status())),
            Request::Jog(words) => self.jog(words.as_ref(), desk, lease),
            Request::Lease(word) => self.lease(*word, lease),
            Request::Token(_) => Err(Problem::refused("key \"token\"", "no token is asked for here".to_string())),
            Request::Subscribe(rate_hz) => {
                let every = (*rate_hz > 0.0).then(|| Duration::from_secs_f64(1.0 / rate_hz));
                self.subscription = every.map(|every| Subscription { every, due: now });
                Ok(reply::ok(&json!({ "subscribe": { "rate_hz": rate_hz } })))
            }
        }
    }

    fn command(&self, command: Command, desk: &Desk, lease: &Lease) -> Result<String, Problem> {
        // Safety needs no lease.
        let free = matches!(command, Command::Hold | Command::EmergencyStop);
        if !free && !lease.is_held_by(self.client) {
            return Err(Problem::refused("key \"command\"", without_lease(lease)));
        }
        let tick = desk.give(command).map_err(|why| Problem::refused("key \"value\"", why))?;
        Ok(reply::ok(&json!({ "command": command.name(), "tick": tick })))
    }

    fn jog(&self, words: Option<&JogWords>, desk: &Desk, lease: &Lease) -> Result<String, Problem> {
        let refused = |why: String| Problem::refused("key \"jog\"", why);
        // To stop is safety.
        if words.is_some() && !lease.is_held_by(self.client) {
            return Err(refused(without_lease(lease)));
        }
        let tick = desk.jog(words).map_err(refused)?;
        let axis = words.map(|words| words.axis.to_ascii_lowercase());
        Ok(reply::ok(&json!({ "jog": axis.map_or(json!("stop"), |axis| json!({ "axis": axis })), "tick": tick })))
    }

    fn lease(&self, word: LeaseWord, lease: &mut Lease) -> Result<String, Problem> {
        let refused = |why: String| Problem::refused("key \"lease\"", why);
        match word {
            LeaseWord::Take => lease
                .take(self.client)
                .map(|()| reply::ok(&json!({ "lease": "take", "client": self.client })))
                .map_err(|holder| refused(format!("client {holder} holds the lease"))),
            LeaseWord::Release if lease.release(self.client) => {
                Ok(reply::ok(&json!({ "lease": "release", "client": self.client })))
            }
            LeaseWord::Release => Err(refused("this client does not hold the lease".to_string())),
        }
    }
}

fn without_lease(lease: &Lease) -> String {
    let holder = lease.holder().map_or("nobody holds it".to_string(), |client| format!("client {client} holds it"));
    format!("it needs the control lease, and {holder}; only hold, emergency-stop and the stop of a jog need none")
}

#[cfg(test)]
#[path = "session_tests.rs"]
mod tests;
