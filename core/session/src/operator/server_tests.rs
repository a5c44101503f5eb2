//! The room without its thread and doors: what one client does to the others.

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
use crate::operator::listen::Stream;

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

fn room() -> Room {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/mill-3axis.toml");
    let machine = Machine::read(&path, &[]).unwrap();
    Room::new(
        Arc::new(OneRun(Arc::new(OperatorHub::new(
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

impl Room {
    fn comes(&mut self, stream: Box<dyn Stream>, token: Option<&str>, now: Instant) {
        self.comers += 1;
        let talk = self.house.newcomer(self.comers, token.map(tokens_of));
        self.clients.push(Client::new(stream, false, talk, 0, now));
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
    let (mut room, now) = (room(), Instant::now());
    let (ours, theirs) = UnixStream::pair().unwrap();
    let mut friend = room.friend(now);
    let defect = || panic!("a defect in the handling of a client, on purpose");
    room.comes(Box::new(WhenRead(ours, defect)), None, now);
    room.lease.take(2, now).unwrap();
    assert!(room.ask(&mut friend, r#"{"command":"hold"}"#, now)["ok"].is_object());
    assert_eq!(hear(&mut BufReader::new(theirs))["error"]["what"], "failed");
    assert!(
        !room
            .clients
            .iter()
            .any(|client| client.number() == 2 && client.is_talking())
    );
    assert!(
        room.ask(&mut friend, r#"{"lease":"take"}"#, now)["ok"].is_object(),
        "the lease went with it"
    );
    room.round(now);
    assert!(room.ask(&mut friend, r#"{"command":"resume"}"#, now)["ok"].is_object());
}

#[test]
fn a_hung_holder_of_the_lease_loses_it_to_who_asks_twice_and_is_told() {
    let (mut room, now) = (room(), Instant::now());
    let (mut hung, mut other) = (room.friend(now), room.friend(now));
    let take = r#"{"lease":"take"}"#;
    room.ask(&mut hung, take, now);
    let refusal = room.ask(&mut other, take, now);
    assert!(
        refusal["error"]["why"]
            .as_str()
            .unwrap()
            .contains("client 1 holds the lease"),
        "{refusal}"
    );
    assert_eq!(hear(&mut hung)["lease"]["asked_by"], 2);
    let later = now + Duration::from_secs(4);
    assert!(room.ask(&mut other, take, later)["error"].is_object());
    let late = now + Duration::from_secs(5);
    assert!(room.ask(&mut other, take, late)["ok"].is_object());
    assert_eq!(hear(&mut hung)["lease"]["lost_to"], 2);
    assert!(room.ask(&mut other, r#"{"command":"resume"}"#, late)["ok"].is_object());
    assert!(room.ask(&mut hung, r#"{"command":"resume"}"#, late)["error"].is_object());
}

#[test]
fn a_holder_that_says_anything_keeps_the_lease() {
    let (mut room, start) = (room(), Instant::now());
    let (mut holder, mut other) = (room.friend(start), room.friend(start));
    let take = r#"{"lease":"take"}"#;
    room.ask(&mut holder, take, start);
    for turn in 0..10 {
        let now = start + Duration::from_secs(4 * turn);
        assert!(room.ask(&mut other, take, now)["error"].is_object());
        assert_eq!(hear(&mut holder)["lease"]["asked_by"], 2);
        assert!(room.ask(&mut holder, r#"{"status":{}}"#, now)["ok"].is_object());
    }
    assert!(room.ask(&mut holder, r#"{"command":"resume"}"#, start)["ok"].is_object());
}

#[test]
fn the_lease_is_taken_over_from_whoever_holds_it_by_an_explicit_request() {
    let (mut room, now) = (room(), Instant::now());
    let (mut holder, mut other) = (room.friend(now), room.friend(now));
    room.ask(&mut holder, r#"{"lease":"take"}"#, now);
    assert!(room.ask(&mut other, r#"{"lease":"take-over"}"#, now)["ok"].is_object());
    assert_eq!(hear(&mut holder)["lease"]["lost_to"], 2);
    assert!(room.ask(&mut holder, r#"{"command":"abort"}"#, now)["error"].is_object());
    assert!(
        room.ask(&mut holder, r#"{"command":"hold"}"#, now)["ok"].is_object(),
        "to hold needs no lease"
    );
    assert!(room.ask(&mut other, r#"{"command":"resume"}"#, now)["ok"].is_object());
}

#[test]
fn whoever_asks_is_answered_before_the_status_lines_of_all_the_others() {
    let (mut room, now) = (room(), Instant::now());
    let mut watchers: Vec<_> = (0..14).map(|_| room.friend(now)).collect();
    for watcher in &mut watchers {
        writeln!(watcher.get_mut(), r#"{{"subscribe":{{"rate_hz":50}}}}"#).unwrap();
    }
    let mut friend = room.friend(now);
    // Everybody has subscribed in this round, and some of them have their first line.
    assert!(room.ask(&mut friend, r#"{"status":{}}"#, now)["ok"].is_object());
    let owed = |room: &Room| {
        let due = room.clients.iter().filter_map(Client::due);
        due.filter(|due| *due <= now).count()
    };
    assert_eq!(owed(&room), 10);
    assert!(room.ask(&mut friend, r#"{"status":{}}"#, now)["ok"].is_object());
    assert_eq!(owed(&room), 6);
    room.round(now);
    room.round(now);
    assert_eq!(owed(&room), 0);
    for watcher in &mut watchers {
        assert!(hear(watcher)["ok"].is_object());
        assert_eq!(hear(watcher)["lost"], 0);
    }
}

/// Most who look on say nothing for hours, and one of them is told something nearly every millisecond.
#[test]
fn whoever_says_nothing_is_not_read_in_a_round_and_whoever_hangs_up_is_noticed_at_once() {
    let (mut room, now) = (room(), Instant::now());
    let reads = Arc::new(AtomicUsize::new(0));
    let mut silent: Vec<_> = (0..15)
        .map(|_| {
            let (ours, theirs) = UnixStream::pair().unwrap();
            ours.set_nonblocking(true).unwrap();
            let reads = Arc::clone(&reads);
            let count = move || _ = reads.fetch_add(1, Relaxed);
            room.comes(Box::new(WhenRead(ours, count)), None, now);
            theirs
        })
        .collect();
    let mut friend = room.friend(now);
    for _ in 0..10 {
        writeln!(friend.get_mut(), r#"{{"status":{{}}}}"#).unwrap();
        room.sleep(LONGEST_SLEEP);
        room.round(now);
        assert!(hear(&mut friend)["ok"].is_object());
    }
    assert_eq!(reads.load(Relaxed), 0);
    drop(silent.pop());
    room.sleep(LONGEST_SLEEP);
    room.round(now);
    room.round(now);
    assert_eq!(room.clients.len(), 15, "who has gone is gone");
    // What one says just before the end is heard, though the system was asked before it.
    room.sleep(Duration::ZERO);
    let mut last = silent.remove(0);
    writeln!(last, r#"{{"command":"hold"}}"#).unwrap();
    last.shutdown(std::net::Shutdown::Write).unwrap();
    drop((silent, friend));
    room.farewell();
    drop(room);
    let mut said = String::new();
    last.read_to_string(&mut said).unwrap();
    assert!(said.starts_with(r#"{"ok":{"command":"hold""#), "{said}");
}
