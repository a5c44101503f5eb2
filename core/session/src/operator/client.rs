//! One client: its socket, what it has sent, what waits to be sent.

use std::io::{ErrorKind, Read};
use std::time::{Duration, Instant};

use rustix::event::PollFlags;

use super::lease::Lease;
use super::outbox::Outbox;
use super::reply::Problem;
use super::service::{Protocol, StatusText};
use super::session::Answer;
use super::stream::Stream;

/// Bytes that are read of a client at a time.
const CHUNK: usize = 4096;
/// Most lines of a client that are answered in a round: what it sends without end waits, and the others do not.
const MAX_LINES: usize = 8;
/// How long a client may take to read its last line.
const PATIENCE: Duration = Duration::from_secs(5);
/// How long a client may take to say who it is.
const TOKEN_WITHIN: Duration = Duration::from_secs(2);

/// Who a client is, as far as that is known: each kind has places of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClientKind {
    /// Runs as the same user as this program, or as root, or has named the token.
    Owner,
    /// Another user, let in by the mode of the socket's file.
    Guest,
    /// Has not said who it is.
    Stranger,
}

/// One client.
pub struct Client {
    stream: Box<dyn Stream>,
    /// The listener it came through.
    pub listener: usize,
    is_guest: bool,
    incoming: Vec<u8>,
    /// So many bytes of it hold no end of a line.
    looked_at: usize,
    /// Whole lines wait in it for the next round.
    owes: bool,
    /// The system was asked, and has nothing of it: reading would find nothing.
    is_quiet: bool,
    hearing: Hearing,
    outbox: Outbox,
    session: Box<dyn Protocol>,
    phase: Phase,
    /// Since when it is in its phase.
    since: Instant,
}

/// Whether it goes on speaking.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hearing {
    Speaks,
    /// It says no more, and waits for answers.
    Listens,
    /// Its answers are there: with the next round it leaves.
    Parts,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Talking,
    /// Its last line is on the way.
    Leaving,
    /// Everything is sent: what it still says is read and dropped, so that its last line is not lost with the connection.
    Left,
    Gone,
}

impl Client {
    /// A client that has just come.
    pub fn new(
        stream: Box<dyn Stream>,
        is_guest: bool,
        session: Box<dyn Protocol>,
        listener: usize,
        now: Instant,
    ) -> Self {
        let mut outbox = Outbox::default();
        if let Some(greeting) = session.greeting() {
            // There is nothing in it yet.
            let _ = outbox.answer(&greeting);
        }
        Self {
            stream,
            listener,
            is_guest,
            incoming: vec![],
            looked_at: 0,
            owes: false,
            is_quiet: false,
            hearing: Hearing::Speaks,
            outbox,
            session,
            phase: Phase::Talking,
            since: now,
        }
    }

    /// Who it is.
    pub fn kind(&self) -> ClientKind {
        match (self.is_guest, self.session.is_known()) {
            (true, _) => ClientKind::Guest,
            (false, true) => ClientKind::Owner,
            (false, false) => ClientKind::Stranger,
        }
    }

    /// How long it has been what it is.
    pub fn age(&self, now: Instant) -> Duration {
        now.duration_since(self.since)
    }

    /// Who it is, in words.
    pub fn name(&self) -> String {
        self.session.name()
    }

    /// The client's number.
    pub fn number(&self) -> u64 {
        self.session.client()
    }

    /// Whether it may give commands, as far as its connection goes.
    pub fn is_talking(&self) -> bool {
        self.phase == Phase::Talking && self.session.is_known()
    }

    /// Whether there is nothing left to do for it.
    pub fn is_gone(&self) -> bool {
        self.phase == Phase::Gone
    }

    /// The socket, and what it is waited for.
    pub fn interest(&self) -> (&dyn Stream, PollFlags) {
        let mut flags = PollFlags::empty();
        // One that has said its last word would be ready for reading all the time.
        let reads = self.phase != Phase::Leaving
            && self.hearing == Hearing::Speaks
            && self.session.takes_bytes();
        flags.set(PollFlags::IN, reads);
        flags.set(PollFlags::OUT, !self.outbox.is_empty());
        (self.stream.as_ref(), flags)
    }

    /// What the system said of its socket when it was asked for that which [`Client::interest`] names; `None` where nobody asked.
    pub fn hears(&mut self, said: Option<PollFlags>) {
        let asked = self.interest().1.contains(PollFlags::IN);
        self.is_quiet =
            asked && said.is_some_and(|said| said.difference(PollFlags::OUT).is_empty());
    }

    /// When it is to be looked at again, though it says nothing: its next status line, or lines that wait.
    pub fn due(&self) -> Option<Instant> {
        let owed = (self.owes || self.hearing == Hearing::Parts).then_some(self.since);
        let due = [owed, self.session.due()].into_iter().flatten().min();
        due.filter(|_| self.phase == Phase::Talking)
    }

    /// Reads, answers, sends: whatever can be done without waiting. A stranger that names the token becomes an owner
    /// where its listener `has_place` for one.
    pub fn serve(&mut self, lease: &mut Lease, has_place: bool, now: Instant) {
        self.session.set_has_place(has_place);
        self.read(lease, now);
        if self.phase == Phase::Talking {
            let line = self.session.turn(lease, now);
            self.take(&Answer { line, last: false }, now);
        }
        self.send(now);
        let most = if self.phase == Phase::Talking {
            TOKEN_WITHIN
        } else {
            PATIENCE
        };
        if self.age(now) > most && (self.phase != Phase::Talking || !self.session.is_known()) {
            self.phase = Phase::Gone;
        }
        if self.phase != Phase::Talking {
            lease.release(self.number());
        }
    }

    /// Sends the status line that is due, if one is; whether one was.
    pub fn show_status(&mut self, look: &mut StatusText, now: Instant) -> bool {
        let is_due = self.phase == Phase::Talking && self.session.is_due(now);
        if is_due {
            self.outbox
                .telemetry(|lost| self.session.telemetry(lost, look));
            self.send(now);
        }
        is_due
    }

    /// The run is over: its last line.
    pub fn dismiss(&mut self, now: Instant) {
        if self.is_talking() {
            self.outbox.last(|lost| self.session.ended(lost));
        }
        self.leave(now);
    }

    /// Says why, as far as its socket takes that now, and closes: it gets no more of the others' time.
    pub fn turn_away(&mut self, problem: &Problem, now: Instant) {
        let answer = self.session.close(problem);
        self.take(&answer, now);
        self.send(now);
    }

    /// Nothing more is done for it.
    pub fn drop_now(&mut self) {
        self.phase = Phase::Gone;
    }

    /// Something went wrong in its handling: it is told so, if it can be, and closes.
    pub fn fail(&mut self, lease: &mut Lease, now: Instant) {
        lease.release(self.number());
        if self.phase == Phase::Talking {
            self.turn_away(&Problem::defect(), now);
        } else {
            self.phase = Phase::Gone;
        }
    }

    /// The lease was asked for, or lost.
    pub fn tell_of_lease(&mut self, news: super::lease::News, now: Instant) {
        let line = self.session.tell_of_lease(news);
        self.tell(&line, now);
    }

    /// A line that the client has not asked for.
    pub fn post(&mut self, line: &str, now: Instant) {
        let line = self.session.told(line);
        if !line.is_empty() {
            self.tell(&line, now);
        }
    }

    /// A line that it has not asked for.
    pub fn tell(&mut self, line: &str, now: Instant) {
        self.take(
            &Answer {
                line: line.to_string(),
                last: false,
            },
            now,
        );
        self.send(now);
    }

    /// A frame of a stream that it has asked for; lost where it does not keep up.
    pub fn show(&mut self, frame: &str, now: Instant) {
        if self.phase == Phase::Talking {
            self.outbox.frame(|lost| self.session.frame(lost, frame));
            self.send(now);
        }
    }

    fn read(&mut self, lease: &mut Lease, now: Instant) {
        if self.phase == Phase::Talking && !self.session.takes_bytes() {
            return;
        }
        if self.phase == Phase::Talking && self.owes {
            self.lines(lease, now);
            return;
        }
        if self.phase == Phase::Talking && self.hearing != Hearing::Speaks {
            // What it waited for is handed out behind this round.
            if self.hearing == Hearing::Parts {
                self.leave(now);
            } else if !self.session.is_busy() {
                self.hearing = Hearing::Parts;
            }
            return;
        }
        if std::mem::take(&mut self.is_quiet) {
            return;
        }
        let mut chunk = [0; CHUNK];
        // One chunk a round: a client that never stops sending does not keep the others waiting.
        match self.stream.read(&mut chunk) {
            Ok(0) => self.hang_up(now),
            Ok(count) if self.phase == Phase::Talking && self.session.is_raw() => {
                let answer = self.session.bytes(&chunk[..count], lease, now);
                self.take(&answer, now);
            }
            Ok(count) if self.phase == Phase::Talking => {
                self.incoming.extend_from_slice(&chunk[..count]);
                self.lines(lease, now);
            }
            Err(error)
                if !matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) =>
            {
                self.phase = Phase::Gone;
            }
            _ => {}
        }
    }

    /// It says no more; what it has asked for is still sent.
    fn hang_up(&mut self, now: Instant) {
        match self.phase {
            Phase::Talking if self.session.is_busy() => self.hearing = Hearing::Listens,
            Phase::Talking => self.leave(now),
            Phase::Leaving => {}
            _ => self.phase = Phase::Gone,
        }
    }

    fn lines(&mut self, lease: &mut Lease, now: Instant) {
        self.owes = false;
        for _ in 0..MAX_LINES {
            if self.phase != Phase::Talking {
                return;
            }
            let most = self.session.max_line_bytes();
            let unseen = &self.incoming[self.looked_at..];
            let end = unseen.iter().position(|byte| *byte == b'\n');
            let answer = match end.map(|end| self.looked_at + end) {
                Some(end) if end <= most => {
                    let line: Vec<u8> = self.incoming.drain(..=end).collect();
                    self.looked_at = 0;
                    self.session
                        .line(&String::from_utf8_lossy(&line[..end]), lease, now)
                }
                None if self.incoming.len() <= most => {
                    self.looked_at = self.incoming.len();
                    return;
                }
                _ => self.session.too_long(),
            };
            self.take(&answer, now);
        }
        self.owes = true;
    }

    fn take(&mut self, answer: &Answer, now: Instant) {
        let fits = self.outbox.answer(&answer.line);
        if answer.last || !fits {
            self.leave(now);
        }
    }

    fn leave(&mut self, now: Instant) {
        if self.phase == Phase::Talking {
            (self.phase, self.since) = (Phase::Leaving, now);
        }
    }

    fn send(&mut self, now: Instant) {
        if self.outbox.send(&mut self.stream).is_err() {
            self.phase = Phase::Gone;
        } else if self.phase == Phase::Leaving && self.outbox.is_empty() {
            self.stream.end_writing();
            (self.phase, self.since) = (Phase::Left, now);
        }
    }
}
