//! Conversations without sockets.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use serde_json::Value;
use tandem_machine::Machine;
use tandem_rings::{MachineState, Sample, Status};
use tandem_sdk::AxisVector;

use super::*;

fn machine() -> Machine {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/mill-3axis.toml");
    let ratio = ("motion.max_feed_ratio".to_string(), "1.5".to_string());
    Machine::read(&path, &[ratio]).unwrap()
}

struct Room {
    hub: OperatorHub,
    lease: Lease,
    now: Instant,
}

impl Room {
    fn new() -> Self {
        Self {
            hub: OperatorHub::new(&machine(), Arc::default(), Arc::default()),
            lease: Lease::default(),
            now: Instant::now(),
        }
    }

    /// The answer to a line, and whether it is the last.
    fn ask(&mut self, session: &mut Session, line: &str) -> (Value, bool) {
        let answer = session.line(line, &self.hub, &mut self.lease, self.now);
        assert_eq!(answer.line.matches('\n').count(), 1, "one line each");
        (serde_json::from_str(&answer.line).unwrap(), answer.last)
    }

    fn is_refused(&mut self, session: &mut Session, line: &str, why: &str) {
        let (answer, last) = self.ask(session, line);
        let said = answer["error"]["why"].as_str().unwrap_or_default();
        assert!(said.contains(why) && !last, "{line}: {answer}");
    }

    fn is_granted(&mut self, session: &mut Session, line: &str) -> Value {
        let (answer, last) = self.ask(session, line);
        assert!(!answer["ok"].is_null() && !last, "{line}: {answer}");
        answer["ok"].clone()
    }
}

/// Samples come later than the word of the fine loop: a place that is older than a motion is none where the machine rests.
#[test]
fn it_rests_where_it_is_shown_or_not_yet() {
    let status = Arc::<Status>::default();
    let hub = OperatorHub::new(&machine(), Arc::default(), Arc::clone(&status));
    let sample = |tick: u64, x_mm: f64, feed_mm_per_s: f64| {
        let sample = Sample {
            tick,
            command: AxisVector::from_slice(&[x_mm]),
            feed_mm_per_s,
            state: MachineState::Holding,
            ..Sample::default()
        };
        hub.sample(&sample, 0.0);
        hub.is_at_rest()
    };
    status.state.store(MachineState::Holding as u32, Relaxed);
    assert!(hub.is_at_rest(), "nothing has moved");
    // It moves from period 3 and stands again from period 10 on, while the host sees what was before.
    status.rests_from_tick.store(10, Relaxed);
    let shown = [(2, 0.0, 0.0), (5, 0.1, 8.0), (9, 0.2, 1.0)];
    assert!(
        shown
            .iter()
            .all(|(tick, x, feed)| !sample(*tick, *x, *feed))
    );
    assert!(sample(10, 0.2, 0.0));
    // The next job counts from 0 again.
    hub.stands_at(&AxisVector::from_slice(&[0.2]));
    assert!(hub.is_at_rest() && sample(0, 0.2, 0.0));
}

const TAKE: &str = r#"{"lease":"take"}"#;
const RELEASE: &str = r#"{"lease":"release"}"#;
const RESUME: &str = r#"{"command":"resume"}"#;

#[test]
fn commands_need_the_lease_and_safety_needs_none() {
    let mut room = Room::new();
    let (mut a, mut b) = (Session::new(1, None), Session::new(2, None));
    room.is_refused(&mut a, RESUME, "nobody holds it");
    room.is_granted(&mut a, TAKE);
    room.is_granted(&mut a, TAKE);
    room.is_refused(&mut b, TAKE, "client 1 holds the lease");
    room.is_granted(&mut b, r#"{"command":"hold"}"#);
    assert!(room.hub.controls().hold.load(Relaxed));
    for command in ["resume", "abort"] {
        room.is_refused(
            &mut b,
            &format!("{{\"command\":\"{command}\"}}"),
            "client 1 holds it",
        );
    }
    room.is_refused(
        &mut b,
        r#"{"command":"feed-override","value":0}"#,
        "client 1 holds it",
    );
    room.is_granted(&mut a, RESUME);
    assert!(!room.hub.controls().hold.load(Relaxed));
    room.is_granted(&mut b, r#"{"command":"emergency-stop"}"#);
    assert!(room.hub.controls().emergency_stop.load(Relaxed));
    room.is_refused(&mut b, RELEASE, "does not hold");
    room.is_granted(&mut a, RELEASE);
    room.is_granted(&mut b, TAKE);
}

#[test]
fn overrides_beyond_the_machine_are_refused_not_clamped() {
    let mut room = Room::new();
    let mut session = Session::new(1, None);
    room.is_granted(&mut session, TAKE);
    room.is_granted(&mut session, r#"{"command":"feed-override","value":1.5}"#);
    room.is_refused(
        &mut session,
        r#"{"command":"feed-override","value":1.6}"#,
        "motion.max_feed_ratio, which is 1.5",
    );
    room.is_refused(
        &mut session,
        r#"{"command":"rapid-override","value":1.1}"#,
        "above 1",
    );
    room.is_refused(
        &mut session,
        r#"{"command":"stall-rough","value":3}"#,
        "for tests",
    );
    assert_eq!(room.hub.controls().feed_override.load(), 1.5);
    assert_eq!(room.hub.controls().rapid_override.load(), 1.0);
}

#[test]
fn a_malformed_line_is_the_last() {
    let mut room = Room::new();
    let mut session = Session::new(1, None);
    room.is_granted(&mut session, r#"{"status":{}}"#);
    let (answer, last) = room.ask(&mut session, r#"{"command":"hodl"}"#);
    assert!(last);
    assert_eq!(answer["error"]["what"], "malformed line");
    assert_eq!(answer["error"]["where"], "line 2: key \"command\"");
    assert!(session.too_long(4096).line.contains("longer than 4096"));
}

#[test]
fn over_tcp_the_first_line_is_the_token() {
    let mut room = Room::new();
    let token = || Some(Arc::new(Tokens::of_owner("0123456789abcdef".to_string())));
    for (line, why) in [
        (r#"{"token":"0123456789abcdee"}"#, "another token"),
        (r#"{"command":"hold"}"#, "the first line over TCP"),
        ("GET / HTTP/1.1\r", "expected value"),
    ] {
        let mut session = Session::new(1, token());
        let (answer, last) = room.ask(&mut session, line);
        assert!(
            last && answer["error"]["why"].as_str().unwrap().contains(why),
            "{answer}"
        );
    }
    assert!(!room.hub.controls().hold.load(Relaxed));
    let mut session = Session::new(1, token());
    assert!(!session.is_known());
    room.is_granted(&mut session, r#"{"token":"0123456789abcdef"}"#);
    assert!(session.is_known());
    room.is_granted(&mut session, r#"{"command":"hold"}"#);
}

#[test]
fn a_subscription_keeps_its_rate_and_makes_up_for_nothing() {
    let mut room = Room::new();
    let mut session = Session::new(1, None);
    let start = room.now;
    assert!(!session.is_due(start));
    room.is_granted(&mut session, r#"{"subscribe":{"rate_hz":10}}"#);
    let due = |session: &mut Session, ms: u64| session.is_due(start + Duration::from_millis(ms));
    let seen: Vec<u64> = (0..=500).filter(|ms| due(&mut session, *ms)).collect();
    assert_eq!(seen.len(), 6, "{seen:?}");
    assert_eq!(seen[0], 0);
    assert!(
        seen[1..].windows(2).all(|two| two[1] - two[0] == 100),
        "{seen:?}"
    );
    assert!(due(&mut session, 5000) && !due(&mut session, 5000));
    let after = (5001..5400).filter(|ms| due(&mut session, *ms)).count();
    assert!((3..=4).contains(&after), "{after}");
    room.is_granted(&mut session, r#"{"subscribe":{"rate_hz":0}}"#);
    assert!(session.due().is_none());
}

#[test]
fn the_status_is_in_the_machines_units() {
    let mut room = Room::new();
    let mut session = Session::new(1, None);
    let status = room.is_granted(&mut session, r#"{"status":{}}"#)["status"].clone();
    for key in [
        "state",
        "tick",
        "line",
        "feed_mm_per_min",
        "sigma",
        "feed_override",
        "counters",
        "fault",
    ] {
        assert!(status.get(key).is_some(), "{key}: {status}");
    }
    assert_eq!(status["position"]["x_mm"], 0.0);
    assert_eq!(status["counters"]["starvations"], 0);
}
