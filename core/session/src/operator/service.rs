//! What the thread that serves clients asks of the machine: a run with its protocol, or a controller that stays with another.

use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use super::hub::OperatorHub;
use super::lease::Lease;
use super::reply::{self, Problem};
use super::session::{Answer, Session};
use super::token::Tokens;

/// The machine as everybody is shown it whose status line is due: it is looked at and made into text once for all of them.
#[derive(Debug, Default)]
pub struct StatusText(Option<String>);

impl StatusText {
    /// What was seen, as JSON; whoever asks first looks.
    pub fn text<S: Serialize>(&mut self, look: impl FnOnce() -> S) -> &str {
        // What is shown has neither a map with other keys than words nor anything else that is no JSON.
        let seen = || serde_json::to_string(&look()).unwrap_or_default();
        self.0.get_or_insert_with(seen)
    }
}

/// One client's conversation, in whichever protocol. On the thread that serves clients.
pub trait Protocol: Send {
    /// The client's number.
    fn client(&self) -> u64;
    /// Whether the client has said who it is, or need not.
    fn is_known(&self) -> bool;
    /// Whether its listener has a place for one more who has named the token.
    fn set_has_place(&mut self, has_place: bool);
    /// What the client is told before it says anything.
    fn greeting(&self) -> Option<String> {
        None
    }
    /// Who the client is, in words, as others are told who holds the lease.
    fn name(&self) -> String {
        format!("client {}", self.client())
    }
    /// Whether the client sends bytes that act one by one, beside lines: then [`Protocol::bytes`] takes them.
    fn is_raw(&self) -> bool {
        false
    }
    /// Whether bytes may be read of a raw client now; what is not read waits with the system.
    fn takes_bytes(&self) -> bool {
        true
    }
    /// Takes bytes of a raw client.
    fn bytes(&mut self, _bytes: &[u8], _lease: &mut Lease, _now: Instant) -> Answer {
        Answer::default()
    }
    /// Whether answers are still to come.
    fn is_busy(&self) -> bool {
        false
    }
    /// What there is to say though nobody has asked; called once a round.
    fn turn(&mut self, _lease: &mut Lease, _now: Instant) -> String {
        String::new()
    }
    /// A line for this client that it has not asked for, as it reads it.
    fn told(&mut self, line: &str) -> String {
        line.to_string()
    }
    /// Longest line, bytes.
    fn max_line_bytes(&self) -> usize;
    /// Answers a line.
    fn line(&mut self, text: &str, lease: &mut Lease, now: Instant) -> Answer;
    /// The end of a client that is not understood.
    fn close(&self, problem: &Problem) -> Answer;
    /// A line was cut off before it was read.
    fn too_long(&mut self) -> Answer;
    /// Whether a status line is due now.
    fn is_due(&mut self, now: Instant) -> bool;
    /// When the next status line is due.
    fn due(&self) -> Option<Instant>;
    /// A status line that was subscribed to; so many were lost before it.
    fn telemetry(&mut self, lost: u64, look: &mut StatusText) -> String;
    /// The last line.
    fn ended(&self, lost: u64) -> String;
    /// A frame of a stream that the client has asked for; so many were lost before it.
    fn frame(&self, _lost: u64, frame: &str) -> String {
        frame.to_string()
    }
    /// The lease was asked for, or lost.
    fn tell_of_lease(&self, news: super::lease::News) -> String {
        reply::lease(news)
    }
}

/// What the thread that serves clients needs of the machine.
pub trait Service: Send + Sync {
    /// A client has come, whose first line must name one of `tokens`.
    fn new_client(&self, number: u64, tokens: Option<Arc<Tokens>>) -> Box<dyn Protocol>;
    /// A sender of grbl's protocol has come, at the listener named `place`; none where this service does not speak it.
    fn sender(&self, _number: u64, _place: &str) -> Option<Box<dyn Protocol>> {
        None
    }
    /// So many clients could give commands now.
    fn set_clients(&self, count: usize);
    /// Lines for a client, or for all, that nobody has asked for in this moment.
    fn post(&self) -> Vec<(Option<u64>, String)> {
        vec![]
    }
    /// Frames of streams: a client that does not keep up loses some, and is told how many.
    fn frames(&self) -> Vec<(u64, String)> {
        vec![]
    }
    /// Becomes readable when there is post.
    fn bell(&self) -> Option<&std::os::unix::net::UnixStream> {
        None
    }
}

/// A run, or a session of runs, that ends with its process.
pub struct RunService(pub Arc<OperatorHub>);

impl Service for RunService {
    fn new_client(&self, number: u64, tokens: Option<Arc<Tokens>>) -> Box<dyn Protocol> {
        Box::new(Protocol1 {
            hub: Arc::clone(&self.0),
            session: Session::new(number, tokens),
        })
    }

    fn set_clients(&self, count: usize) {
        self.0.set_clients(count);
    }
}

/// Longest line of the protocol of a run, bytes.
pub const MAX_LINE: usize = 4096;

/// The protocol of a run.
struct Protocol1 {
    hub: Arc<OperatorHub>,
    session: Session,
}

impl Protocol for Protocol1 {
    fn client(&self) -> u64 {
        self.session.client
    }

    fn is_known(&self) -> bool {
        self.session.is_known()
    }

    fn set_has_place(&mut self, has_place: bool) {
        self.session.has_place = has_place;
    }

    fn max_line_bytes(&self) -> usize {
        MAX_LINE
    }

    fn line(&mut self, text: &str, lease: &mut Lease, now: Instant) -> Answer {
        self.session.line(text, &self.hub, lease, now)
    }

    fn close(&self, problem: &Problem) -> Answer {
        self.session.close(problem)
    }

    fn too_long(&mut self) -> Answer {
        self.session.too_long(MAX_LINE)
    }

    fn is_due(&mut self, now: Instant) -> bool {
        self.session.is_due(now)
    }

    fn due(&self) -> Option<Instant> {
        self.session.due()
    }

    fn telemetry(&mut self, lost: u64, look: &mut StatusText) -> String {
        reply::telemetry(look.text(|| self.hub.status()), lost)
    }

    fn ended(&self, lost: u64) -> String {
        reply::ended(&self.hub.status(), lost)
    }
}
