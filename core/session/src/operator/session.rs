//! One client's conversation, without its socket.

use std::sync::Arc;
use std::time::Instant;

use serde_json::json;
use tandem_host::Command;

use super::hub::OperatorHub;
use super::lease::{ANSWER_WITHIN, Lease};
use super::reply::{self, Problem};
use super::request::{LeaseWord, Request, parse};
use super::rhythm::Rhythm;
use super::role::Role;
use super::token::Tokens;
use crate::jog::JogMessage;

/// Most clients that are known, at one listener.
pub const MAX_OWNERS: usize = 16;

/// What a line led to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
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
    /// The tokens of which the first line must name one.
    tokens: Option<Arc<Tokens>>,
    role: Role,
    /// Whether its listener has a place for one more who has named the token.
    pub has_place: bool,
    lines: u64,
    subscription: Option<Rhythm>,
}

impl Session {
    /// A client that has just come; over TCP its first line names one of `tokens`.
    pub fn new(client: u64, tokens: Option<Arc<Tokens>>) -> Self {
        Self {
            client,
            tokens,
            role: Role::SetUp,
            has_place: true,
            lines: 0,
            subscription: None,
        }
    }

    /// Whether the client has said who it is, or need not.
    pub fn is_known(&self) -> bool {
        self.tokens.is_none()
    }

    /// Answers a line.
    pub fn line(
        &mut self,
        text: &str,
        hub: &OperatorHub,
        lease: &mut Lease,
        now: Instant,
    ) -> Answer {
        self.lines += 1;
        lease.hears(self.client);
        let request = match parse(text) {
            Ok(request) => request,
            // Who has not said yet who it is has one line.
            Err(problem) if problem.ends_connection() || !self.is_known() => {
                return self.close(&problem);
            }
            Err(problem) => {
                return Answer {
                    line: reply::error(self.lines, &problem),
                    last: false,
                };
            }
        };
        if let Some(tokens) = self.tokens.take() {
            let answer = self.introduce(&tokens, &request);
            // A stranger stays one: it gets none of the owner's places while its last line is on the way.
            self.tokens = answer.last.then_some(tokens);
            return answer;
        }
        match self.grant(&request, hub, lease, now) {
            Ok(line) => Answer { line, last: false },
            Err(problem) => Answer {
                line: reply::error(self.lines, &problem),
                last: false,
            },
        }
    }

    /// The end of a client that is not understood.
    pub fn close(&self, problem: &Problem) -> Answer {
        Answer {
            line: reply::error(self.lines, problem),
            last: true,
        }
    }

    /// A line was cut off before it was read.
    pub fn too_long(&mut self, most: usize) -> Answer {
        self.lines += 1;
        self.close(&Problem::malformed(
            "the whole line",
            &format!("it is longer than {most} bytes"),
        ))
    }

    /// Whether a status line is due now.
    pub fn is_due(&mut self, now: Instant) -> bool {
        self.subscription
            .as_mut()
            .is_some_and(|rhythm| rhythm.is_due(now))
    }

    /// When the next status line is due.
    pub fn due(&self) -> Option<Instant> {
        self.subscription.as_ref().map(Rhythm::due)
    }

    fn introduce(&mut self, expected: &Tokens, request: &Request) -> Answer {
        let Request::Token(given) = request else {
            return self.close(&Problem::refused(
                "the whole line",
                "the first line over TCP is {\"token\":\"…\"}".to_string(),
            ));
        };
        let Some(role) = expected.role_of(given) else {
            return self.close(&Problem::refused(
                "key \"token\"",
                "it is another token".to_string(),
            ));
        };
        if !self.has_place {
            return self.close(&Problem::crowded(MAX_OWNERS));
        }
        self.role = role;
        Answer {
            line: reply::ok(&json!({ "client": self.client })),
            last: false,
        }
    }

    fn grant(
        &mut self,
        request: &Request,
        hub: &OperatorHub,
        lease: &mut Lease,
        now: Instant,
    ) -> Result<String, Problem> {
        self.may(request)?;
        match request {
            Request::Command(command) => self.command(*command, hub, lease),
            Request::Status => Ok(reply::status(&hub.status())),
            Request::Jog(words) => self.jog(words.as_ref(), hub, lease),
            Request::Lease(word) => self.lease(*word, lease, now),
            Request::Token(_) => Err(Problem::refused(
                "key \"token\"",
                "no token is asked for here".to_string(),
            )),
            Request::Subscribe(rate_hz) => {
                self.subscription = rate_hz.map(|rate_hz| Rhythm::new(rate_hz, now));
                Ok(reply::ok(
                    &json!({ "subscribe": { "rate_hz": rate_hz.unwrap_or(0.0) } }),
                ))
            }
        }
    }

    /// Whoever may watch looks, and stops the machine.
    fn may(&self, request: &Request) -> Result<(), Problem> {
        let (drives, place) = match request {
            Request::Command(command) => (!is_free(*command), "key \"command\""),
            Request::Jog(words) => (words.is_some(), "key \"jog\""),
            Request::Lease(_) => (true, "key \"lease\""),
            Request::Subscribe(_) | Request::Status | Request::Token(_) => (false, ""),
        };
        if drives && self.role < Role::Operate {
            let why = "its token lets it watch and stop the machine, and no more";
            return Err(Problem::refused(place, why.to_string()));
        }
        Ok(())
    }

    fn command(
        &self,
        command: Command,
        hub: &OperatorHub,
        lease: &Lease,
    ) -> Result<String, Problem> {
        if !is_free(command) && !lease.is_held_by(self.client) {
            return Err(Problem::refused("key \"command\"", without_lease(lease)));
        }
        let tick = hub
            .give(command)
            .map_err(|why| Problem::refused("key \"value\"", why))?;
        Ok(reply::ok(
            &json!({ "command": command.name(), "tick": tick }),
        ))
    }

    fn jog(
        &self,
        words: Option<&JogMessage>,
        hub: &OperatorHub,
        lease: &Lease,
    ) -> Result<String, Problem> {
        let refused = |why: String| Problem::refused("key \"jog\"", why);
        // To stop is safety.
        if words.is_some() && !lease.is_held_by(self.client) {
            return Err(refused(without_lease(lease)));
        }
        let tick = hub.jog(words).map_err(refused)?;
        let axis = words.map(|words| words.axis.to_ascii_lowercase());
        Ok(reply::ok(
            &json!({ "jog": axis.map_or(json!("stop"), |axis| json!({ "axis": axis })), "tick": tick }),
        ))
    }

    fn lease(&self, word: LeaseWord, lease: &mut Lease, now: Instant) -> Result<String, Problem> {
        let refused = |why: String| Problem::refused("key \"lease\"", why);
        match word {
            LeaseWord::Take => lease
                .take(self.client, now)
                .map(|()| reply::ok(&json!({ "lease": "take", "client": self.client })))
                .map_err(|holder| refused(held_by(holder))),
            LeaseWord::TakeOver => {
                lease.take_over(self.client);
                Ok(reply::ok(
                    &json!({ "lease": "take-over", "client": self.client }),
                ))
            }
            LeaseWord::Release if lease.release(self.client) => Ok(reply::ok(
                &json!({ "lease": "release", "client": self.client }),
            )),
            LeaseWord::Release => Err(refused("this client does not hold the lease".to_string())),
        }
    }
}

/// Safety needs no lease, and no role.
fn is_free(command: Command) -> bool {
    matches!(command, Command::Hold | Command::EmergencyStop)
}

fn held_by(holder: u64) -> String {
    let within_s = ANSWER_WITHIN.as_secs();
    format!(
        "client {holder} holds the lease; it is asked whether it is there, and the next \"take\" is granted once it has \
         said nothing for {within_s} s; \"take-over\" takes it now"
    )
}

fn without_lease(lease: &Lease) -> String {
    let holder = lease
        .holder()
        .map_or("nobody holds it".to_string(), |client| {
            format!("client {client} holds it")
        });
    format!(
        "it needs the control lease, and {holder}; only hold, emergency-stop and the stop of a jog need none"
    )
}

#[cfg(test)]
#[path = "session_tests.rs"]
mod tests;
