//! What is asked of the controller, without loops.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use tandem_gcode::Item;
use tandem_host::{Registry, planner};
use tandem_machine::Machine;
use tandem_rings::{Controls, Rest, RestCause};
use tandem_sdk::{AxisVector, StopOn};

use super::{JogController, JogEnd, JogMessage, JogRest, ReachMessage};

struct Rig {
    jogs: JogController,
    controls: Arc<Controls>,
}

impl Rig {
    fn new() -> Self {
        let path =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/mill-4axis.toml");
        let machine = Machine::read(&path, &[]).unwrap();
        let mut registry = Registry::default();
        registry.register(tandem_look_ahead::PLUGIN).unwrap();
        let jogs = JogController::new(&machine, planner(&machine, &registry).unwrap());
        let controls = Arc::<Controls>::default();
        jogs.enable(Arc::clone(&controls), true, 0);
        Self { jogs, controls }
    }

    fn ask(&self, axis: char, reach: ReachMessage) -> Result<(), String> {
        let words = JogMessage {
            axis,
            reach,
            feed_per_min: 600.0,
            degrees: None,
        };
        self.jogs.ask(words.on(&self.jogs.machine().axes)?)
    }

    fn on(&self, axis: char, positive: bool) -> Result<(), String> {
        self.ask(axis, ReachMessage::On { positive })
    }

    /// The end of the next block, if one begins.
    fn begins(&self) -> Option<AxisVector> {
        let mut items = vec![];
        self.jogs.next(&mut items);
        items.first().map(|item| {
            if let Item::Block(block, _) = item {
                block.end
            } else {
                unreachable!("only lines")
            }
        })
    }

    fn is_let_go(&self) -> bool {
        self.controls.jog.let_go.load(Relaxed)
    }

    fn rests_at(&self, x_mm: f64) -> Option<JogRest> {
        self.jogs.rests(&Rest {
            epoch: 0,
            cause: RestCause::Abort,
            tick: 0,
            block: 0,
            line: 1,
            stop_on: StopOn::default(),
            position: AxisVector::from_slice(&[x_mm]),
            latch: None,
            program_time_s: 0.0,
            path_mm: 0.0,
        })
    }
}

#[test]
fn the_same_jog_again_is_a_keep_alive_and_another_one_stops_it() {
    let rig = Rig::new();
    rig.on('x', true).unwrap();
    assert_eq!(rig.begins().unwrap()[0], 250.0);
    assert_eq!(rig.controls.jog.max_periods.load(Relaxed), 200);
    let beats = rig.controls.jog.beats.load(Relaxed);
    rig.on('x', true).unwrap();
    assert!(!rig.is_let_go() && rig.controls.jog.beats.load(Relaxed) == beats + 1);
    rig.on('x', false).unwrap();
    rig.on('x', false).unwrap();
    assert!(rig.is_let_go());
    let rest = rig.rests_at(12.0).unwrap();
    assert_eq!(
        (rest.end, rest.position[0], rig.is_let_go()),
        (JogEnd::LetGo, 12.0, false)
    );
    assert_eq!(rig.begins().unwrap()[0], -250.0);
    assert!(rig.begins().is_none(), "once");
}

#[test]
fn a_keep_alive_that_comes_while_the_machine_stops_starts_it_again() {
    let rig = Rig::new();
    rig.on('x', true).unwrap();
    rig.begins();
    // As the fine loop does.
    rig.controls.jog.let_go.store(true, Relaxed);
    rig.on('x', true).unwrap();
    assert_eq!(rig.rests_at(3.0).unwrap().end, JogEnd::LetGo);
    assert_eq!(rig.begins().unwrap()[0], 250.0);
    assert_eq!(
        rig.rests_at(4.0).unwrap().end,
        JogEnd::Late,
        "nobody has asked for this rest"
    );
    assert!(rig.begins().is_none());
}

#[test]
fn steps_wait_for_each_other_and_are_forgotten_at_a_stop() {
    let rig = Rig::new();
    for _ in 0..3 {
        rig.ask('x', ReachMessage::By(100.0))
            .unwrap_or_else(|why| assert!(why.contains("300 mm"), "{why}"));
    }
    assert_eq!(rig.begins().unwrap()[0], 100.0);
    assert_eq!(
        rig.controls.jog.max_periods.load(Relaxed),
        0,
        "a step needs no keep-alive"
    );
    let rest = rig.jogs.arrived().unwrap();
    assert_eq!((rest.end, rest.position[0]), (JogEnd::Arrived, 100.0));
    assert_eq!(rig.begins().unwrap()[0], 200.0);
    rig.ask('x', ReachMessage::By(1.0)).unwrap();
    rig.jogs.let_go();
    assert_eq!(rig.rests_at(150.0).unwrap().end, JogEnd::LetGo);
    assert!(rig.begins().is_none() && rig.jogs.is_still());
    let crowd = (0..20)
        .filter_map(|_| rig.ask('x', ReachMessage::By(1.0)).err())
        .collect::<Vec<_>>();
    assert_eq!(
        (crowd.len(), crowd[0].as_str()),
        (4, "16 steps wait already")
    );
}

#[test]
fn degrees_become_radians_and_units_must_fit() {
    let rig = Rig::new();
    rig.ask('a', ReachMessage::By(90.0)).unwrap();
    assert_eq!(rig.begins().unwrap()[3], 90f64.to_radians());
    let words = JogMessage {
        axis: 'a',
        reach: ReachMessage::By(1.0),
        feed_per_min: 1.0,
        degrees: Some(false),
    };
    assert!(
        words
            .on(&rig.jogs.machine().axes)
            .unwrap_err()
            .contains("a is a rotary axis")
    );
    for (reach, feed_per_min, why) in [
        (ReachMessage::By(0.0), 1.0, "goes nowhere"),
        (ReachMessage::By(f64::NAN), 1.0, "goes nowhere"),
        (ReachMessage::By(1.0), 0.0, "not above zero"),
        (ReachMessage::By(1.0), f64::INFINITY, "not above zero"),
    ] {
        let words = JogMessage {
            axis: 'x',
            reach,
            feed_per_min,
            degrees: None,
        };
        assert!(
            words
                .on(&rig.jogs.machine().axes)
                .unwrap_err()
                .contains(why),
            "{words:?}"
        );
    }
}

#[test]
fn a_machine_that_is_not_enabled_is_not_jogged() {
    let rig = Rig::new();
    rig.jogs.disable(AxisVector::from_slice(&[250.0]));
    assert!(rig.on('x', false).unwrap_err().contains("not enabled"));
    rig.jogs.enable(Arc::clone(&rig.controls), false, 0);
    assert!(rig.on('x', false).unwrap_err().contains("not ready"));
    assert!(rig.begins().is_none());
    assert_eq!(
        rig.on('x', true).unwrap_err(),
        "x stands at its travel limit, 250 mm"
    );
    rig.jogs.end();
    assert!(rig.on('x', false).is_err());
}

/// A beat that was on its way for too long finds the machine at rest, and it stays so.
#[test]
fn what_keeps_a_jog_alive_begins_none() {
    let rig = Rig::new();
    let words = JogMessage {
        axis: 'x',
        reach: ReachMessage::On { positive: true },
        feed_per_min: 600.0,
        degrees: None,
    };
    let jog = words.on(&rig.jogs.machine().axes).unwrap();
    let beats = || rig.controls.jog.beats.load(Relaxed);
    assert!(rig.jogs.keep_alive(jog).is_err() && rig.begins().is_none());
    rig.on('x', true).unwrap();
    // Also while it waits for the loop that drives.
    rig.jogs.keep_alive(jog).unwrap();
    assert!(rig.begins().is_some());
    let before = beats();
    rig.jogs.keep_alive(jog).unwrap();
    assert_eq!(beats(), before + 1);
    rig.jogs.let_go();
    assert!(rig.jogs.keep_alive(jog).is_err());
    assert!(rig.rests_at(1.0).is_some());
    assert!(rig.jogs.keep_alive(jog).is_err() && rig.begins().is_none());
    assert_eq!(beats(), before + 1);
}
