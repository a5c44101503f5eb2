//! Planners that never come to an end end in words, and a rough period is bounded work.

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicBool, AtomicU64};

use tandem_gcode::Item;
use tandem_rings::{FineEnd, HostEnd, Rest, Sizes, bridge};
use tandem_sdk::{Accepted, AxisVector, Block, Segment, SegmentFlags, SegmentSink};

use super::*;
use crate::doubles::{Fake, Plans, ROUGH_PERIOD_S, Script, block};

/// Program time emitted by a call that is asked for this much, and what it says of it: duration and whether it is done.
type Emits = fn(f64, &mut dyn SegmentSink) -> (f64, bool);

struct Emitting {
    emits: Emits,
    calls: Arc<AtomicU64>,
}

impl Plans for Emitting {
    fn advance(&mut self, duration_s: f64, sink: &mut dyn SegmentSink) -> (f64, bool) {
        self.calls.fetch_add(1, Relaxed);
        (self.emits)(duration_s, sink)
    }
}

/// A rough loop with this planner, how often it is advanced, and the other ends.
fn with(emits: Emits) -> (RoughLoop, Arc<AtomicU64>, (FineEnd, HostEnd)) {
    with_ring(Sizes::default(), emits)
}

fn with_ring(sizes: Sizes, emits: Emits) -> (RoughLoop, Arc<AtomicU64>, (FineEnd, HostEnd)) {
    let calls = Arc::new(AtomicU64::new(0));
    let planner = Box::new(Fake(Emitting {
        emits,
        calls: Arc::clone(&calls),
    }));
    // The program is over at once: the planner has its whole plan to emit.
    let over = Script::of(vec![Ok(vec![Item::End])]);
    let (rough, fine, host) = bridge(sizes);
    (
        RoughLoop::new(
            RoughConfig::new(ROUGH_PERIOD_S, ROUGH_PERIOD_S),
            Box::new(over),
            planner,
            rough,
        ),
        calls,
        (fine, host),
    )
}

fn piece(duration_s: f64, flags: SegmentFlags, sink: &mut dyn SegmentSink) {
    let mut segment = Segment::rest(&AxisVector::ZERO, duration_s);
    segment.flags = flags;
    sink.segment(&segment);
}

#[test]
fn a_planner_that_says_it_emitted_and_did_not_is_named_within_one_period() {
    let (mut rough, calls, _ends) = with(|duration_s, _| (duration_s, false));
    let error = rough
        .step(&mut ())
        .expect_err("nothing was emitted")
        .to_string();
    assert!(error.contains("hardly gets on"), "{error}");
    assert!(calls.load(Relaxed) <= u64::from(MAX_SHORT_ADVANCES) + 1);
}

#[test]
fn a_planner_that_is_never_done_is_named_within_one_period() {
    let (mut rough, _, _ends) = with(|_, _| (0.0, false));
    let error = rough
        .step(&mut ())
        .expect_err("it is never done")
        .to_string();
    assert!(error.contains("hardly gets on"), "{error}");
}

#[test]
fn a_plan_that_is_done_in_motion_is_refused() {
    let (mut rough, _, _ends) = with(|duration_s, sink| {
        piece(duration_s, SegmentFlags::default(), sink);
        (duration_s, true)
    });
    let error = rough
        .step(&mut ())
        .expect_err("it ends in motion")
        .to_string();
    assert!(error.contains("does not end at rest"), "{error}");
}

#[test]
fn a_rough_period_asks_for_the_depth_and_for_no_more() {
    let (mut rough, calls, (_fine, host)) = with(|duration_s, sink| {
        piece(duration_s, SegmentFlags::default(), sink);
        (duration_s, false)
    });
    rough.step(&mut ()).unwrap();
    // Two rough periods and the margin of three: what nothing that moves needs.
    assert!((5..=6).contains(&calls.swap(0, Relaxed)));
    for period in 1..100 {
        rough.step(&mut ()).unwrap();
        assert_eq!(calls.swap(0, Relaxed), 0, "nothing was driven since");
        host.status
            .program_time_s
            .store(f64::from(period) * ROUGH_PERIOD_S);
        rough.step(&mut ()).unwrap();
        assert!(calls.swap(0, Relaxed) <= 2, "one period was driven");
    }
}

/// What was emitted counts by how much of what was asked for it is, not by the number of calls.
#[test]
fn a_planner_that_emits_most_of_what_it_is_asked_for_may_be_asked_as_often_as_the_depth_takes() {
    let sizes = Sizes {
        segments: 4096,
        ..Sizes::default()
    };
    let (mut rough, calls, _ends) = with_ring(sizes, |duration_s, sink| {
        let mut segment = Segment::rest(&AxisVector::ZERO, 0.6 * duration_s);
        segment.flags = SegmentFlags::default();
        // A stop takes 8 s, which is more than a thousand of these pieces.
        (segment.path[1], segment.stop_deceleration_mm_per_s2) = (40.0, 5.0);
        sink.segment(&segment);
        (0.6 * duration_s, false)
    });
    assert_eq!(rough.step(&mut ()).unwrap(), Progress::Working);
    assert!(calls.load(Relaxed) > u64::from(MAX_SHORT_ADVANCES));
}

/// Emits a little, and then says that it is done though it is in motion.
struct Fails {
    emitted: bool,
}

impl Plans for Fails {
    fn advance(&mut self, _duration_s: f64, sink: &mut dyn SegmentSink) -> (f64, bool) {
        if std::mem::replace(&mut self.emitted, true) {
            return (0.0, true);
        }
        piece(0.001, SegmentFlags::default(), sink);
        (0.001, false)
    }
}

/// A queue that gets no deeper is started with as it is: where the plan is over, and where the planner has failed.
#[test]
fn what_is_queued_is_driven_though_it_is_short_where_nothing_follows() {
    let (mut rough, _calls, (fine, _host)) = with(|_, sink| {
        piece(0.001, SegmentFlags::ENDS_AT_REST, sink);
        (0.001, true)
    });
    rough.step(&mut ()).unwrap();
    assert!(fine.depth.may_start(0.0), "the program is over");
    let (rough, fine, _host) = bridge(Sizes::default());
    let config = RoughConfig::new(ROUGH_PERIOD_S, ROUGH_PERIOD_S);
    let over = Box::new(Script::of(vec![Ok(vec![Item::End])]));
    let mut rough = RoughLoop::new(
        config,
        over,
        Box::new(Fake(Fails { emitted: false })),
        rough,
    );
    rough.step(&mut ()).expect_err("it is done in motion");
    assert!(fine.depth.may_start(0.0), "the planner has failed");
}

/// It drives on as planned while the rough loop is late by no more than the rate that it tells holds for, and not much longer.
#[test]
fn a_rough_loop_that_is_late_leaves_what_the_worst_stop_asks_for() {
    let (mut rough, _calls, (fine, _host)) = with(|duration_s, sink| {
        piece(duration_s, SegmentFlags::default(), sink);
        (duration_s, false)
    });
    rough.step(&mut ()).unwrap();
    let late_s = (1.0 + SERVED_FOR_PERIODS) * ROUGH_PERIOD_S;
    assert!(fine.depth.may_start(late_s - 1e-9));
    assert!(!fine.depth.may_start(late_s + 2.0 * ROUGH_PERIOD_S));
}

#[test]
fn a_ring_that_gets_room_is_filled_in_the_same_period_and_said_to_be_full() {
    // Eight entries hold far less than the depth asks for, and one call emits more than has room beside what is there.
    let sizes = Sizes {
        segments: 8,
        ..Sizes::default()
    };
    let (mut rough, calls, (mut fine, host)) = with_ring(sizes, |duration_s, sink| {
        (0..5).for_each(|_| piece(duration_s / 10.0, SegmentFlags::default(), sink));
        (duration_s / 2.0, false)
    });
    rough.step(&mut ()).unwrap();
    assert!(fine.depth.full.load(Relaxed));
    for period in 1..20 {
        calls.store(0, Relaxed);
        host.status
            .program_time_s
            .store(f64::from(period) * 0.5 * ROUGH_PERIOD_S);
        (0..5).for_each(|_| assert!(fine.segments.pop().is_ok()));
        rough.step(&mut ()).unwrap();
        assert_eq!(calls.load(Relaxed), 1);
        assert!(fine.segments.slots() == 8 && fine.depth.full.load(Relaxed));
    }
}

/// A sender that gives a line in each of the first periods, and then nothing.
struct Sender {
    lines: u64,
    given: u64,
    period: bool,
}

impl Source for Sender {
    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        if std::mem::take(&mut self.period) && self.given < self.lines {
            self.given += 1;
            items.push(block(self.given));
        }
        Ok(true)
    }
    fn period(&mut self) {
        self.period = true;
    }
    fn streams(&self) -> bool {
        true
    }
    fn provide_input(&mut self, _value: f64) {}
    fn provide_rest(&mut self, _rest: &Rest) -> bool {
        true
    }
}

/// Each of its blocks takes three rough periods, of which the last is not planned before the next block or the end is known.
struct Waits {
    left_s: f64,
    finished: Arc<AtomicBool>,
}

const BLOCK_S: f64 = 3.0 * ROUGH_PERIOD_S;

impl Plans for Waits {
    fn accept(&mut self, _block: &Block) -> Accepted {
        self.left_s += BLOCK_S;
        self.finished.store(false, Relaxed);
        Accepted::Accepted
    }

    fn finish(&mut self) {
        self.finished.store(true, Relaxed);
    }

    fn advance(&mut self, duration_s: f64, sink: &mut dyn SegmentSink) -> (f64, bool) {
        let finished = self.finished.load(Relaxed);
        let kept_s = if finished { 0.0 } else { ROUGH_PERIOD_S };
        let emitted_s = duration_s.min(self.left_s - kept_s).max(0.0);
        self.left_s -= emitted_s;
        let done = finished && self.left_s < 1e-9;
        if emitted_s > 0.0 {
            let flags = [SegmentFlags::default(), SegmentFlags::ENDS_AT_REST];
            piece(emitted_s, flags[usize::from(done)], sink);
        }
        (emitted_s, done)
    }
}

#[test]
fn what_a_sender_has_sent_is_driven_as_far_as_it_is_known_before_its_end_is_planned() {
    const LINES: u64 = 12;
    let finished = Arc::new(AtomicBool::new(false));
    let planner = Box::new(Fake(Waits {
        left_s: 0.0,
        finished: Arc::clone(&finished),
    }));
    let sender = Sender {
        lines: LINES,
        given: 0,
        period: false,
    };
    let (rough, _fine, host) = bridge(Sizes::default());
    let config = RoughConfig::new(ROUGH_PERIOD_S, ROUGH_PERIOD_S);
    let mut rough = RoughLoop::new(config, Box::new(sender), planner, rough);
    let mut now_s = 0.0;
    let whole_s = LINES as f64 * BLOCK_S;
    let mut ahead_s = 0.0;
    while !finished.load(Relaxed) {
        ahead_s = rough.queue.emitted_s() - now_s;
        rough.step(&mut ()).unwrap();
        // What is queued is driven, once there is as much as a stop asks for: two rough periods.
        if rough.queue.emitted_s() - now_s >= 2.0 * ROUGH_PERIOD_S {
            now_s += ROUGH_PERIOD_S;
            host.status.program_time_s.store(now_s);
        }
        assert!(now_s < whole_s, "the end is never planned");
    }
    // Its end is planned while as much is queued as a stop asks for.
    assert!(ahead_s >= 2.0 * ROUGH_PERIOD_S - 1e-9, "{ahead_s} s");
    // All but what depends on what follows, and no more left in the queue than a stop asks for and one period.
    assert!(
        now_s >= whole_s - (1.0 + 2.0 + 1.0) * ROUGH_PERIOD_S - 1e-9,
        "{now_s} of {whole_s} s"
    );
}

/// A file: a line whenever it is asked for more, without end.
struct File(Arc<AtomicU64>);

impl Source for File {
    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        items.push(block(self.0.fetch_add(1, Relaxed)));
        Ok(true)
    }
    fn provide_input(&mut self, _value: f64) {}
    fn provide_rest(&mut self, _rest: &Rest) -> bool {
        true
    }
}

/// Takes no more than two blocks for each time that it emits.
struct Few(u64);

impl Plans for Few {
    fn accept(&mut self, _block: &Block) -> Accepted {
        if self.0 == 2 {
            return Accepted::Full;
        }
        self.0 += 1;
        Accepted::Accepted
    }
    fn advance(&mut self, duration_s: f64, sink: &mut dyn SegmentSink) -> (f64, bool) {
        self.0 = 0;
        piece(duration_s, SegmentFlags::default(), sink);
        (duration_s, false)
    }
}

#[test]
fn a_file_is_read_no_further_while_the_queue_is_deep() {
    let read = Arc::new(AtomicU64::new(0));
    let planner = Box::new(Fake(Few(0)));
    let (rough, _fine, _host) = bridge(Sizes::default());
    let config = RoughConfig::new(ROUGH_PERIOD_S, ROUGH_PERIOD_S);
    let file = Box::new(File(Arc::clone(&read)));
    let mut rough = RoughLoop::new(config, file, planner, rough);
    rough.step(&mut ()).unwrap();
    let first = read.load(Relaxed);
    assert!(first > 0);
    (0..10).for_each(|_| assert!(rough.step(&mut ()).is_ok()));
    assert_eq!(read.load(Relaxed), first, "nothing was driven since");
}

/// A sender has few places to wait in: a line that waits there keeps the next one from being sent.
#[test]
fn lines_of_a_sender_are_taken_as_they_come_though_the_queue_is_deep() {
    struct Counts(Arc<AtomicU64>);

    impl Plans for Counts {
        fn accept(&mut self, _block: &Block) -> Accepted {
            self.0.fetch_add(1, Relaxed);
            Accepted::Accepted
        }
        /// More than it is asked for, by which the queue gets deeper than it has to be.
        fn advance(&mut self, duration_s: f64, sink: &mut dyn SegmentSink) -> (f64, bool) {
            piece(20.0 * duration_s, SegmentFlags::default(), sink);
            (20.0 * duration_s, false)
        }
    }

    const LINES: u64 = 20;
    let accepted = Arc::new(AtomicU64::new(0));
    let planner = Box::new(Fake(Counts(Arc::clone(&accepted))));
    let sender = Sender {
        lines: LINES,
        given: 0,
        period: false,
    };
    let (rough, _fine, _host) = bridge(Sizes::default());
    let config = RoughConfig::new(ROUGH_PERIOD_S, ROUGH_PERIOD_S);
    let mut rough = RoughLoop::new(config, Box::new(sender), planner, rough);
    (0..2 * LINES).for_each(|_| assert!(rough.step(&mut ()).is_ok()));
    // Nothing is driven, so it stays deep.
    assert!(rough.queue.is_deep(MARGIN_PERIODS * ROUGH_PERIOD_S));
    assert_eq!(accepted.load(Relaxed), LINES);
}
