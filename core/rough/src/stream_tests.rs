//! What the rough loop does with a program: words and events at their place, rests that end an epoch, inputs that are waited for.

use std::sync::{Arc, Mutex};

use tandem_gcode::{Input, InputMode, InputWait, Item};
use tandem_rings::{FineEnd, HostEnd, Queued, Rest, RestCause, Sizes, bridge};
use tandem_sdk::{
    Accepted, AxisVector, Block, BlockKind, BlockReport, Curve, Edge, Event, EventKind, Segment,
    SegmentFlags, SegmentSink, StopOn,
};

use std::sync::atomic::Ordering::Relaxed;

use super::*;
use crate::doubles::{
    Answer, Fake, Plans, ROUGH_PERIOD_S, Script, block, block_of, probe, report, rest,
};

/// Program time of each block, s, and the path that it is long, mm.
const BLOCK_S: f64 = 0.02;
const BLOCK_MM: f64 = 3.0;

/// Blocks that the planner holds at most.
const MAX_HELD: usize = 3;

/// Each block is one piece from rest to rest; those that it was reset at are remembered.
#[derive(Default)]
struct Pieces {
    held: Vec<u64>,
    finished: bool,
    path_mm: f64,
    resets: Arc<Mutex<Vec<AxisVector>>>,
}

impl Plans for Pieces {
    fn accept(&mut self, block: &Block) -> Accepted {
        if self.held.len() == MAX_HELD {
            return Accepted::Full;
        }
        self.held.push(block.index);
        self.finished = false;
        Accepted::Accepted
    }

    fn finish(&mut self) {
        self.finished = true;
    }

    fn advance(&mut self, _duration_s: f64, sink: &mut dyn SegmentSink) -> (f64, bool) {
        if self.held.is_empty() {
            return (0.0, self.finished);
        }
        let index = self.held.remove(0);
        let mut segment = Segment::rest(&AxisVector::ZERO, BLOCK_S);
        segment.flags = SegmentFlags::ENDS_AT_REST;
        segment.block = index;
        segment.path = [self.path_mm, 0.0, 0.0, 0.0, 0.0, 0.0];
        self.path_mm += BLOCK_MM;
        sink.segment(&segment);
        sink.block(&report(index));
        (BLOCK_S, self.finished && self.held.is_empty())
    }

    fn reset(&mut self, position: &AxisVector) {
        self.held = vec![];
        self.finished = false;
        self.path_mm = 0.0;
        self.resets.lock().unwrap().push(*position);
    }
}

/// A rough loop on a program, and a fine loop that drives at once what is queued.
struct Rig {
    rough: RoughLoop,
    fine: FineEnd,
    _host: HostEnd,
    told: Arc<Mutex<Vec<Answer>>>,
    resets: Arc<Mutex<Vec<AxisVector>>>,
    seen: Seen,
    driven: Vec<Queued>,
}

#[derive(Default)]
struct Seen {
    blocks: Vec<u64>,
    rests: Vec<RestCause>,
}

impl Observer for Seen {
    fn block(&mut self, block: &Block, _curve: Option<Curve<'_>>, report: &BlockReport) {
        assert_eq!(block.index, report.block);
        self.blocks.push(block.index);
    }

    fn rest(&mut self, rest: &Rest) {
        self.rests.push(rest.cause);
    }
}

impl Rig {
    fn of(lists: Vec<Vec<Item>>) -> Self {
        Self::with(lists, |_, _| ())
    }

    fn with(lists: Vec<Vec<Item>>, set: impl FnOnce(&mut Script, &mut RoughConfig)) -> Self {
        let mut script = Script::of(lists.into_iter().map(Ok).collect());
        let mut config = RoughConfig::new(ROUGH_PERIOD_S, ROUGH_PERIOD_S);
        set(&mut script, &mut config);
        let planner = Pieces::default();
        let (told, resets) = (Arc::clone(&script.told), Arc::clone(&planner.resets));
        let (rough, fine, host) = bridge(Sizes::default());
        let rough = RoughLoop::new(config, Box::new(script), Box::new(Fake(planner)), rough);
        Self {
            rough,
            fine,
            _host: host,
            told,
            resets,
            seen: Seen::default(),
            driven: vec![],
        }
    }

    /// One rough period in which nothing is driven.
    fn step(&mut self) -> Progress {
        self.rough.step(&mut self.seen).unwrap()
    }

    /// Drives what is queued: what it was.
    fn drive(&mut self) {
        while let Ok(queued) = self.fine.segments.pop() {
            if let Queued::Segment { start_s, segment } = &queued {
                self.fine
                    .status
                    .program_time_s
                    .store(start_s + segment.duration_s);
            }
            self.driven.push(queued);
        }
        self.fine.status.idle.store(true, Relaxed);
    }

    /// Rough periods until the program is over.
    fn drive_to_the_end(&mut self) {
        for _ in 0..100 {
            let progress = self.step();
            self.drive();
            if progress == Progress::Done {
                return;
            }
        }
        panic!("the program does not end");
    }

    fn rests(&mut self, rest: Rest) {
        self.fine.status.program_time_s.store(rest.program_time_s);
        self.fine.rests.push(rest).unwrap();
    }

    fn told(&self) -> Vec<Answer> {
        self.told.lock().unwrap().clone()
    }

    /// What was driven in short: blocks by their number, events by that before which they act, with the program time and the epoch.
    fn driven(&self) -> Vec<(&'static str, u64, f64, u32)> {
        let short = |queued: &Queued| match queued {
            Queued::Segment { start_s, segment } => {
                ("block", segment.block, *start_s, segment.epoch)
            }
            Queued::Event(event) => {
                let name = if event.kind == EventKind::ProgramEnd {
                    "end"
                } else {
                    "event"
                };
                (name, event.before_block, event.program_time_s, event.epoch)
            }
        };
        self.driven.iter().map(short).collect()
    }
}

fn event(before_block: u64) -> Item {
    Item::Event(Event::new(EventKind::Mist, 1, before_block, 1, 0.0))
}

fn wait(input: Input, mode: InputMode, timeout_s: f64) -> Item {
    Item::Wait(InputWait {
        line: 1,
        before_block: 1,
        input,
        mode,
        timeout_s,
    })
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-12
}

#[test]
fn words_act_where_they_stand_and_blocks_are_told_in_their_order() {
    let lists = vec![
        vec![event(0), block(0), block(1), event(2)],
        vec![block(2), block(3), event(4), event(4)],
        vec![block(4), event(5), Item::End],
    ];
    let mut rig = Rig::of(lists);
    rig.drive_to_the_end();
    let at = |blocks: u32| f64::from(blocks) * BLOCK_S;
    let expected = [
        ("event", 0, at(0)),
        ("block", 0, at(0)),
        ("block", 1, at(1)),
        ("event", 2, at(2)),
        ("block", 2, at(2)),
        ("block", 3, at(3)),
        ("event", 4, at(4)),
        ("event", 4, at(4)),
        ("block", 4, at(4)),
        ("event", 5, at(5)),
        ("end", 5, at(5)),
    ];
    let driven = rig.driven();
    assert_eq!(driven.len(), expected.len(), "{driven:?}");
    for (is, (name, number, at_s)) in driven.iter().zip(expected) {
        assert!(
            (is.0, is.1, is.3) == (name, number, 0) && near(is.2, at_s),
            "{is:?}, not {name} {number} at {at_s} s"
        );
    }
    assert_eq!(rig.seen.blocks, [0, 1, 2, 3, 4]);
}

/// Nothing of what was read counts, not what waits for room in the planner, nor an input that is awaited.
#[test]
fn behind_an_abort_only_what_the_program_gives_then_is_driven_from_there() {
    for goes_on in [true, false] {
        // Some of the words wait for their blocks when the machine stops.
        let first = (0..9).flat_map(|n| [event(n), block(n)]).collect();
        let lists = vec![first, vec![event(20), block(20)], vec![Item::End]];
        let mut rig = Rig::with(lists, |script, _| script.goes_on = goes_on);
        rig.step();
        // The fine loop throws away what is queued.
        while rig.fine.segments.pop().is_ok() {}
        let stop = rest(RestCause::Abort);
        rig.rests(stop);
        rig.drive_to_the_end();
        assert_eq!(rig.told(), [Answer::Rest(stop)]);
        assert_eq!(*rig.resets.lock().unwrap(), [stop.position]);
        assert_eq!(rig.seen.rests, [RestCause::Abort]);
        let behind = stop.program_time_s;
        let expected = [
            ("event", 20, behind, 1),
            ("block", 20, behind, 1),
            ("end", 21, behind + BLOCK_S, 1),
        ];
        if goes_on {
            assert_eq!(rig.driven(), expected);
            let Queued::Segment { segment, .. } = &rig.driven[1] else {
                panic!("{:?}", rig.driven[1]);
            };
            assert_eq!(segment.path[0], stop.path_mm, "the path goes on");
        } else {
            let driven = rig.driven();
            assert!(
                matches!(driven[..], [("end", _, at_s, 1)] if at_s == behind),
                "{driven:?}"
            );
        }
    }
}

/// What waits for room in the ring, and what the planner has emitted in motion, is over too.
#[test]
fn behind_a_rest_nothing_counts_that_was_emitted_before() {
    struct UntilReset {
        stands: bool,
    }
    impl Plans for UntilReset {
        fn advance(&mut self, duration_s: f64, sink: &mut dyn SegmentSink) -> (f64, bool) {
            if self.stands {
                return (0.0, true);
            }
            for _ in 0..4 {
                sink.segment(&Segment::rest(&AxisVector::ZERO, duration_s / 4.0));
            }
            (duration_s, false)
        }
        fn reset(&mut self, _position: &AxisVector) {
            self.stands = true;
        }
    }
    let sizes = Sizes {
        segments: 3,
        ..Sizes::default()
    };
    let script = Script::of(vec![Ok(vec![block(0), Item::End]), Ok(vec![block(1)])]);
    let (rough, mut fine, _host) = bridge(sizes);
    let config = RoughConfig::new(ROUGH_PERIOD_S, ROUGH_PERIOD_S);
    let planner = Box::new(Fake(UntilReset { stands: false }));
    let mut rough = RoughLoop::new(config, Box::new(script), planner, rough);
    assert_eq!(rough.step(&mut ()).unwrap(), Progress::Working);
    assert!(rough.queue.is_waiting_for_room());
    while fine.segments.pop().is_ok() {}
    let stop = rest(RestCause::Corrected);
    fine.status.program_time_s.store(stop.program_time_s);
    fine.rests.push(stop).unwrap();
    assert_eq!(rough.step(&mut ()).unwrap(), Progress::Done);
    // The program was over: it is not asked for more.
    let Ok(Queued::Event(event)) = fine.segments.pop() else {
        panic!("something was left in the queue");
    };
    assert_eq!(event.kind, EventKind::ProgramEnd);
    assert!(fine.segments.pop().is_err());
}

#[test]
fn an_abort_ends_a_wait_for_an_input_and_its_time() {
    let lists = vec![
        vec![
            wait(Input::Digital(1), InputMode::High, 1.0),
            block(0),
            Item::End,
        ],
        vec![wait(Input::Digital(1), InputMode::High, 0.05), Item::End],
    ];
    let mut rig = Rig::of(lists);
    for _ in 0..30 {
        rig.step();
        rig.drive();
    }
    assert!(rig.rough.is_waiting() && rig.told().is_empty());
    rig.rests(rest(RestCause::Abort));
    let mut periods = 0;
    while !rig.told().contains(&Answer::Input(-1.0)) {
        rig.step();
        rig.drive();
        periods += 1;
        assert!(periods < 100, "it is never answered");
    }
    // Its own time begins with it, and nobody waits for the first one any more.
    assert!((5..=8).contains(&periods), "{periods} periods");
}

/// What follows a probe in its line is driven where it has touched; a dwell there rests there.
#[test]
fn behind_an_edge_the_rest_of_the_line_counts_at_the_new_place() {
    let dwell = Block {
        kind: BlockKind::Dwell,
        dwell_s: 1.0,
        ..block_of(1)
    };
    let lists = vec![
        vec![probe(0), Item::Block(dwell, None), event(2)],
        vec![block(2), Item::End],
    ];
    let mut rig = Rig::of(lists);
    for _ in 0..10 {
        rig.step();
        rig.drive();
    }
    assert_eq!(
        rig.driven().len(),
        1,
        "nothing behind the probe is planned before it has touched"
    );
    let Queued::Segment { segment, .. } = &rig.driven[0] else {
        panic!("{:?}", rig.driven[0]);
    };
    assert_eq!(segment.stop_on.edge, Edge::Rising);
    let touched = rest(RestCause::Edge);
    rig.rests(touched);
    rig.driven.clear();
    rig.rough.take_rests(&mut rig.seen).unwrap();
    let Item::Block(dwell, _) = &rig.rough.items[rig.rough.next] else {
        panic!("{:?}", rig.rough.items);
    };
    assert_eq!(
        (dwell.start, dwell.end),
        (touched.position, touched.position)
    );
    rig.drive_to_the_end();
    let order: Vec<_> = rig.driven().iter().map(|of| (of.0, of.1)).collect();
    assert_eq!(
        order,
        [("block", 1), ("event", 2), ("block", 2), ("end", 3)]
    );
    let Queued::Segment { segment, .. } = &rig.driven[0] else {
        panic!("{:?}", rig.driven[0]);
    };
    assert_eq!(segment.stop_on.edge, Edge::None);
}

#[test]
fn a_probe_that_finds_nothing_ends_the_run_only_where_that_is_a_fault() {
    let stop_on = |edge, miss_is_fault| StopOn {
        input: 5,
        edge,
        miss_is_fault,
    };
    for (cause, edge, fault, words) in [
        (
            RestCause::Missed,
            Edge::Rising,
            1,
            Some("line 3: input 5 was not tripped before"),
        ),
        (
            RestCause::Missed,
            Edge::Falling,
            1,
            Some("line 3: input 5 was not released before"),
        ),
        (RestCause::Missed, Edge::Rising, 0, None),
        (
            RestCause::Already,
            Edge::Rising,
            0,
            Some("input 5 was already tripped when"),
        ),
        (
            RestCause::Already,
            Edge::Falling,
            1,
            Some("input 5 was already released when"),
        ),
        (RestCause::Edge, Edge::Rising, 1, None),
        (RestCause::Corrected, Edge::None, 0, None),
    ] {
        let mut rig = Rig::of(vec![vec![block(0)], vec![block(1), Item::End]]);
        rig.step();
        let stop = Rest {
            stop_on: stop_on(edge, fault),
            ..rest(cause)
        };
        rig.rests(stop);
        match (rig.rough.step(&mut rig.seen), words) {
            (Err(error), Some(words)) => {
                assert!(error.to_string().contains(words), "{error}");
                assert_eq!(rig.told(), []);
            }
            (Ok(_), None) => assert_eq!(rig.told(), [Answer::Rest(stop)]),
            (other, _) => panic!("{cause:?} {edge:?} {fault}: {other:?}"),
        }
        assert_eq!(rig.seen.rests, [cause]);
    }
}

#[test]
fn nothing_is_planned_before_the_joints_hold_and_then_from_where_they_stand() {
    let lists = vec![vec![block(0), Item::End]];
    let mut rig = Rig::with(lists, |_, config| config.awaits_drives = true);
    for _ in 0..10 {
        assert_eq!(rig.step(), Progress::Working);
        rig.drive();
    }
    assert_eq!(rig.driven(), []);
    let attached = rest(RestCause::Attached);
    rig.rests(attached);
    rig.drive_to_the_end();
    assert_eq!(*rig.resets.lock().unwrap(), [attached.position]);
    assert_eq!(rig.seen.rests, [], "nobody has stopped anything");
    let from_s = attached.program_time_s;
    let expected = [("block", 0, from_s, 1), ("end", 1, from_s + BLOCK_S, 1)];
    assert_eq!(rig.driven(), expected);
}

#[test]
fn an_input_is_read_where_the_machine_rests_and_what_follows_waits_for_it() {
    use InputMode::{Fall, High, Immediate, Low, Rise};
    for (mode, bits, answer) in [
        (High, 0b1000, Some(1.0)),
        (High, 0b0111, None),
        (Rise, 0b1000, Some(1.0)),
        (Rise, 0b0111, None),
        (Low, 0b0111, Some(0.0)),
        (Low, 0b1000, None),
        (Fall, 0b0111, Some(0.0)),
        (Fall, 0b1000, None),
        (Immediate, 0b1000, Some(1.0)),
        (Immediate, 0b0111, Some(0.0)),
    ] {
        let timeout_s = if mode == Immediate { 0.0 } else { 0.1 };
        let lists = vec![
            vec![block(0), wait(Input::Digital(3), mode, timeout_s)],
            vec![block(1), Item::End],
        ];
        let mut rig = Rig::of(lists);
        rig.fine.status.inputs.store(bits, Relaxed);
        for _ in 0..20 {
            rig.step();
        }
        assert_eq!(rig.told(), [], "the block before it is not driven yet");
        assert!(rig.rough.is_waiting());
        rig.drive();
        rig.fine.status.idle.store(false, Relaxed);
        rig.step();
        assert_eq!(rig.told(), [], "the machine does not rest yet");
        rig.fine.status.idle.store(true, Relaxed);
        let mut periods = 0;
        while rig.told().is_empty() {
            assert_eq!(rig.driven().len(), 1, "what follows waits");
            rig.step();
            rig.drive();
            periods += 1;
        }
        assert_eq!(
            rig.told(),
            [Answer::Input(answer.unwrap_or(-1.0))],
            "{mode:?} {bits:b}"
        );
        if answer.is_some() {
            assert_eq!(periods, 1);
        } else {
            let most = (timeout_s / ROUGH_PERIOD_S) as u32;
            assert!((most..=most + 2).contains(&periods), "{periods} periods");
        }
        rig.drive_to_the_end();
        assert!(!rig.rough.is_waiting());
        assert_eq!(rig.driven().len(), 3);
    }
    let lists = vec![vec![
        wait(Input::Analog(0), Immediate, 0.0),
        block(0),
        Item::End,
    ]];
    let mut rig = Rig::of(lists);
    rig.drive_to_the_end();
    assert_eq!(rig.told(), [Answer::Input(0.0)]);
}

#[test]
fn a_source_that_waits_for_the_rest_is_asked_when_all_is_driven() {
    let lists = vec![vec![block(0)], vec![block(1)], vec![Item::End]];
    let mut rig = Rig::with(lists, |script, _| script.waits_for_rest = true);
    rig.fine.status.idle.store(true, Relaxed);
    for blocks in 1..=2 {
        for _ in 0..5 {
            rig.step();
        }
        rig.fine.status.idle.store(false, Relaxed);
        assert_eq!(rig.seen.blocks.len(), blocks);
        rig.drive();
    }
    rig.drive_to_the_end();
    assert_eq!(rig.driven().len(), 3);
}

#[test]
fn what_a_planner_must_not_emit_is_named() {
    type Breaks = fn(&mut dyn SegmentSink);
    struct Broken(Breaks);
    impl Plans for Broken {
        fn advance(&mut self, _duration_s: f64, sink: &mut dyn SegmentSink) -> (f64, bool) {
            (self.0)(sink);
            (BLOCK_S, true)
        }
    }
    let cases: [(Breaks, Option<&str>); 7] = [
        (
            |sink| sink.segment(&Segment::rest(&AxisVector::ZERO, f64::NAN)),
            Some("not finite"),
        ),
        (
            |sink| sink.segment(&Segment::rest(&AxisVector::ZERO, -1e-9)),
            Some("negative"),
        ),
        (
            |sink| {
                sink.segment(&Segment::rest(&AxisVector([f64::INFINITY; MAX_AXES]), 1.0));
            },
            Some("not finite"),
        ),
        (
            |sink| sink.block(&report(3)),
            Some("a block that it was not given"),
        ),
        (
            |sink| {
                sink.block(&report(1));
                sink.block(&report(0));
            },
            Some("a block that it was not given"),
        ),
        (
            |sink| {
                sink.block(&report(0));
                sink.block(&report(0));
            },
            Some("a block that it was not given"),
        ),
        (
            |sink| {
                sink.block(&report(0));
                sink.block(&report(1));
            },
            None,
        ),
    ];
    for (n, (breaks, words)) in cases.into_iter().enumerate() {
        let script = Script::of(vec![Ok(vec![block(0), block(1), Item::End])]);
        let (rough, _fine, _host) = bridge(Sizes::default());
        let config = RoughConfig::new(ROUGH_PERIOD_S, ROUGH_PERIOD_S);
        let planner = Box::new(Fake(Broken(breaks)));
        let mut rough = RoughLoop::new(config, Box::new(script), planner, rough);
        match (rough.step(&mut ()), words) {
            (Err(error), Some(words)) => {
                let error = error.to_string();
                assert!(
                    error.starts_with("planner: ") && error.contains(words),
                    "{n}: {error}"
                );
            }
            (Ok(_), None) => {}
            (other, _) => panic!("{n}: {other:?}"),
        }
    }
}

#[test]
fn a_planner_that_is_full_and_emits_nothing_is_named_with_the_line() {
    struct Full;
    impl Plans for Full {
        fn accept(&mut self, _block: &Block) -> Accepted {
            Accepted::Full
        }
        fn advance(&mut self, _duration_s: f64, _sink: &mut dyn SegmentSink) -> (f64, bool) {
            (0.0, false)
        }
    }
    let script = Script::of(vec![Ok(vec![block(0), Item::End])]);
    let (rough, _fine, _host) = bridge(Sizes::default());
    let config = RoughConfig::new(ROUGH_PERIOD_S, ROUGH_PERIOD_S);
    let mut rough = RoughLoop::new(config, Box::new(script), Box::new(Fake(Full)), rough);
    let error = rough.step(&mut ()).expect_err("it is full");
    assert_eq!(
        error.with_planner("mine"),
        "planner mine: line 1: it is full, and advance emits nothing"
    );
}

/// A planner with room for two blocks that are over as soon as they begin, as dwells of nothing are.
#[test]
fn blocks_that_take_no_time_make_room_for_those_behind_them() {
    #[derive(Default)]
    struct Timeless {
        held: u64,
        passed: u64,
    }
    impl Plans for Timeless {
        fn accept(&mut self, _block: &Block) -> Accepted {
            if self.held == 2 {
                return Accepted::Full;
            }
            self.held += 1;
            Accepted::Accepted
        }
        fn advance(&mut self, duration_s: f64, sink: &mut dyn SegmentSink) -> (f64, bool) {
            self.passed += std::mem::take(&mut self.held);
            if self.passed < 7 {
                return (0.0, false);
            }
            let mut segment = Segment::rest(&AxisVector::ZERO, duration_s);
            segment.flags = SegmentFlags::ENDS_AT_REST;
            sink.segment(&segment);
            (duration_s, true)
        }
    }
    let items = (0..7).map(block).chain([Item::End]).collect();
    let script = Script::of(vec![Ok(items)]);
    let (rough, _fine, _host) = bridge(Sizes::default());
    let config = RoughConfig::new(ROUGH_PERIOD_S, ROUGH_PERIOD_S);
    let planner = Box::new(Fake(Timeless::default()));
    let mut rough = RoughLoop::new(config, Box::new(script), planner, rough);
    assert_eq!(rough.step(&mut ()).unwrap(), Progress::Done);
}

/// A rough period is bounded work too where a program has nothing but blocks that take no time.
#[test]
fn a_program_of_blocks_that_take_no_time_is_planned_a_bounded_number_in_a_period() {
    struct Timeless(Arc<Mutex<u32>>);
    impl Plans for Timeless {
        fn accept(&mut self, _block: &Block) -> Accepted {
            let mut offered = self.0.lock().unwrap();
            *offered += 1;
            if offered.is_multiple_of(2) {
                Accepted::Full
            } else {
                Accepted::Accepted
            }
        }
        fn advance(&mut self, _duration_s: f64, _sink: &mut dyn SegmentSink) -> (f64, bool) {
            (0.0, false)
        }
    }
    let offered = Arc::default();
    let script = Script::of(vec![Ok((0..5000).map(block).collect())]);
    let (rough, _fine, _host) = bridge(Sizes::default());
    let config = RoughConfig::new(ROUGH_PERIOD_S, ROUGH_PERIOD_S);
    let planner = Box::new(Fake(Timeless(Arc::clone(&offered))));
    let mut rough = RoughLoop::new(config, Box::new(script), planner, rough);
    for period in 1..=3 {
        assert_eq!(rough.step(&mut ()).unwrap(), Progress::Working);
        let most = period * 2 * (MAX_SHORT_ADVANCES + 1);
        assert!(*offered.lock().unwrap() <= most, "period {period}");
    }
}

/// Steps count of which a sample shows a thousandth of what an axis accelerates by, or 0.5 % of its jerk: on slow machines and
/// short periods small ones.
#[test]
fn the_slower_an_axis_and_the_shorter_the_period_the_smaller_are_the_steps_that_count() {
    for period_s in [0.25e-3, 1e-3] {
        let mut config = RoughConfig::new(8e-3, period_s);
        config.count_steps_of(1e9, 1e15);
        assert_eq!(config.seam_rounding, ROUNDING, "a machine without limits");
        config.count_steps_of(10.0, 1e3);
        let of_velocity = (10e-3 * period_s).min(5.0 * period_s * period_s);
        let expected = [of_velocity, 5.0 * period_s];
        for (is, expected) in config.seam_rounding.into_iter().zip(expected) {
            assert!((is / expected - 1.0).abs() < 1e-12, "{is} {expected}");
        }
        let before = config.seam_rounding;
        config.count_steps_of(1e9, 1e15);
        assert_eq!(config.seam_rounding, before, "the slowest axis counts");
    }
}
