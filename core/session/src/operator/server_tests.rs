//! The server's loop without its thread and listeners: what one client does to the others.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use serde_json::Value;
use tandem_machine::Machine;

use super::*;
use crate::operator::stream::Stream;

/// A client in whose reading something is done first.
struct WhenRead<F>(UnixStream, F);

impl<F: FnMut()> Read for WhenRead<F> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        (self.1)();
        self.0.read(bytes)
    }
}

impl<F> Write for WhenRead<F> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

impl<F: FnMut() + Send> Stream for WhenRead<F> {
    fn fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }

    fn end_writing(&self) {
        let _ = self.0.shutdown(std::net::Shutdown::Write);
    }
}

fn server() -> ServerLoop {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/mill-3axis.toml");
    let machine = Machine::read(&path, &[]).unwrap();
    ServerLoop::new(
        Arc::new(RunService(Arc::new(OperatorHub::new(
            &machine,
            Arc::default(),
            Arc::default(),
        )))),
        vec![],
    )
}

fn tokens_of(token: &str) -> Arc<crate::operator::Tokens> {
    Arc::new(crate::operator::Tokens::of_owner(token.to_string()))
}

impl ServerLoop {
    fn comes(&mut self, stream: Box<dyn Stream>, token: Option<&str>, now: Instant) {
        self.connections += 1;
        let protocol = self
            .service
            .new_client(self.connections, token.map(tokens_of));
        self.clients
            .push(Client::new(stream, false, protocol, 0, now));
    }

    /// A client that is known, with its end.
    fn friend(&mut self, now: Instant) -> BufReader<UnixStream> {
        let (ours, theirs) = UnixStream::pair().unwrap();
        ours.set_nonblocking(true).unwrap();
        self.comes(Box::new(ours), None, now);
        BufReader::new(theirs)
    }

    fn ask(&mut self, client: &mut BufReader<UnixStream>, line: &str, now: Instant) -> Value {
        writeln!(client.get_mut(), "{line}").unwrap();
        self.round(now);
        hear(client)
    }
}

fn hear(client: &mut BufReader<UnixStream>) -> Value {
    let mut line = String::new();
    client.read_line(&mut line).unwrap();
    serde_json::from_str(&line).unwrap()
}

#[test]
fn a_panic_in_the_handling_of_a_client_ends_that_client_and_no_other() {
    let (mut server, now) = (server(), Instant::now());
    let (ours, theirs) = UnixStream::pair().unwrap();
    let mut friend = server.friend(now);
    let defect = || panic!("a defect in the handling of a client, on purpose");
    server.comes(Box::new(WhenRead(ours, defect)), None, now);
    server.lease.take(2, now).unwrap();
    assert!(server.ask(&mut friend, r#"{"command":"hold"}"#, now)["ok"].is_object());
    assert_eq!(hear(&mut BufReader::new(theirs))["error"]["what"], "failed");
    assert!(
        !server
            .clients
            .iter()
            .any(|client| client.number() == 2 && client.is_talking())
    );
    assert!(
        server.ask(&mut friend, r#"{"lease":"take"}"#, now)["ok"].is_object(),
        "the lease went with it"
    );
    server.round(now);
    assert!(server.ask(&mut friend, r#"{"command":"resume"}"#, now)["ok"].is_object());
}

#[test]
fn a_hung_holder_of_the_lease_loses_it_to_who_asks_twice_and_is_told() {
    let (mut server, now) = (server(), Instant::now());
    let (mut hung, mut other) = (server.friend(now), server.friend(now));
    let take = r#"{"lease":"take"}"#;
    server.ask(&mut hung, take, now);
    let refusal = server.ask(&mut other, take, now);
    assert!(
        refusal["error"]["why"]
            .as_str()
            .unwrap()
            .contains("client 1 holds the lease"),
        "{refusal}"
    );
    assert_eq!(hear(&mut hung)["lease"]["asked_by"], 2);
    let later = now + Duration::from_secs(4);
    assert!(server.ask(&mut other, take, later)["error"].is_object());
    let late = now + Duration::from_secs(5);
    assert!(server.ask(&mut other, take, late)["ok"].is_object());
    assert_eq!(hear(&mut hung)["lease"]["lost_to"], 2);
    assert!(server.ask(&mut other, r#"{"command":"resume"}"#, late)["ok"].is_object());
    assert!(server.ask(&mut hung, r#"{"command":"resume"}"#, late)["error"].is_object());
}

#[test]
fn a_holder_that_says_anything_keeps_the_lease() {
    let (mut server, start) = (server(), Instant::now());
    let (mut holder, mut other) = (server.friend(start), server.friend(start));
    let take = r#"{"lease":"take"}"#;
    server.ask(&mut holder, take, start);
    for turn in 0..10 {
        let now = start + Duration::from_secs(4 * turn);
        assert!(server.ask(&mut other, take, now)["error"].is_object());
        assert_eq!(hear(&mut holder)["lease"]["asked_by"], 2);
        assert!(server.ask(&mut holder, r#"{"status":{}}"#, now)["ok"].is_object());
    }
    assert!(server.ask(&mut holder, r#"{"command":"resume"}"#, start)["ok"].is_object());
}

#[test]
fn the_lease_is_taken_over_from_whoever_holds_it_by_an_explicit_request() {
    let (mut server, now) = (server(), Instant::now());
    let (mut holder, mut other) = (server.friend(now), server.friend(now));
    server.ask(&mut holder, r#"{"lease":"take"}"#, now);
    assert!(server.ask(&mut other, r#"{"lease":"take-over"}"#, now)["ok"].is_object());
    assert_eq!(hear(&mut holder)["lease"]["lost_to"], 2);
    assert!(server.ask(&mut holder, r#"{"command":"abort"}"#, now)["error"].is_object());
    assert!(
        server.ask(&mut holder, r#"{"command":"hold"}"#, now)["ok"].is_object(),
        "to hold needs no lease"
    );
    assert!(server.ask(&mut other, r#"{"command":"resume"}"#, now)["ok"].is_object());
}

#[test]
fn whoever_asks_is_answered_before_the_status_lines_of_all_the_others() {
    let (mut server, now) = (server(), Instant::now());
    let mut watchers: Vec<_> = (0..14).map(|_| server.friend(now)).collect();
    for watcher in &mut watchers {
        writeln!(watcher.get_mut(), r#"{{"subscribe":{{"rate_hz":50}}}}"#).unwrap();
    }
    let mut friend = server.friend(now);
    // Everybody has subscribed in this round, and some of them have their first line.
    assert!(server.ask(&mut friend, r#"{"status":{}}"#, now)["ok"].is_object());
    let owed = |server: &ServerLoop| {
        let due = server.clients.iter().filter_map(Client::due);
        due.filter(|due| *due <= now).count()
    };
    assert_eq!(owed(&server), 10);
    assert!(server.ask(&mut friend, r#"{"status":{}}"#, now)["ok"].is_object());
    assert_eq!(owed(&server), 6);
    server.round(now);
    server.round(now);
    assert_eq!(owed(&server), 0);
    for watcher in &mut watchers {
        assert!(hear(watcher)["ok"].is_object());
        assert_eq!(hear(watcher)["lost"], 0);
    }
}

/// Most who look on say nothing for hours, and one of them is told something nearly every millisecond.
#[test]
fn whoever_says_nothing_is_not_read_in_a_round_and_whoever_hangs_up_is_noticed_at_once() {
    let (mut server, now) = (server(), Instant::now());
    let reads = Arc::new(AtomicUsize::new(0));
    let mut silent: Vec<_> = (0..15)
        .map(|_| {
            let (ours, theirs) = UnixStream::pair().unwrap();
            ours.set_nonblocking(true).unwrap();
            let reads = Arc::clone(&reads);
            let count = move || _ = reads.fetch_add(1, Relaxed);
            server.comes(Box::new(WhenRead(ours, count)), None, now);
            theirs
        })
        .collect();
    let mut friend = server.friend(now);
    for _ in 0..10 {
        writeln!(friend.get_mut(), r#"{{"status":{{}}}}"#).unwrap();
        server.sleep(LONGEST_SLEEP);
        server.round(now);
        assert!(hear(&mut friend)["ok"].is_object());
    }
    assert_eq!(reads.load(Relaxed), 0);
    drop(silent.pop());
    server.sleep(LONGEST_SLEEP);
    server.round(now);
    server.round(now);
    assert_eq!(server.clients.len(), 15, "who has gone is gone");
    // What one says just before the end is heard, though the system was asked before it.
    server.sleep(Duration::ZERO);
    let mut last = silent.remove(0);
    writeln!(last, r#"{{"command":"hold"}}"#).unwrap();
    last.shutdown(std::net::Shutdown::Write).unwrap();
    drop((silent, friend));
    server.farewell();
    drop(server);
    let mut said = String::new();
    last.read_to_string(&mut said).unwrap();
    assert!(said.starts_with(r#"{"ok":{"command":"hold""#), "{said}");
}
