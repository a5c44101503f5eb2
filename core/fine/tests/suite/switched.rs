//! What a fault and an emergency stop switch off, and when, whatever the machine is doing.

use crate::common;

use std::sync::atomic::Ordering::Relaxed;

use common::{Bench, KEPT_OUTPUT};
use proptest::prelude::*;
use tandem_fine::GuardMode;
use tandem_rings::{FLOOD, MIST, MachineState, Sample, Switched, SwitchedBy};
use tandem_sdk::EventKind;

/// What the machine is doing when it happens.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Doing {
    Running,
    StoppingForHold,
    Held,
    Dwelling,
    Probing,
    RampingOut,
    Aborted,
    Standstill,
}

/// What happens.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Happens {
    EmergencyStop,
    SoftFault,
    DriverFails,
    FeedbackIsNoNumber,
    PeriodsAreMissed,
}

const DOING: [Doing; 8] = [
    Doing::Running,
    Doing::StoppingForHold,
    Doing::Held,
    Doing::Dwelling,
    Doing::Probing,
    Doing::RampingOut,
    Doing::Aborted,
    Doing::Standstill,
];
const HAPPENS: [Happens; 5] = [
    Happens::EmergencyStop,
    Happens::SoftFault,
    Happens::DriverFails,
    Happens::FeedbackIsNoNumber,
    Happens::PeriodsAreMissed,
];

const KEPT: u64 = 1 << KEPT_OUTPUT;

fn tick(bench: &mut Bench, periods: u32) -> Vec<Sample> {
    let mut samples = vec![];
    for _ in 0..periods {
        bench.fine.tick();
        samples.extend(std::iter::from_fn(|| bench.host.samples.pop().ok()));
    }
    samples
}

/// Everything is switched on, and then the machine moves.
fn switched_on(probes: bool, cruise_s: f64) -> Bench {
    let mut bench = Bench::new(GuardMode::Stop);
    bench.event(EventKind::Spindle, 0, 100.0);
    for kind in [EventKind::Mist, EventKind::Flood] {
        bench.event(kind, 0, 1.0);
    }
    for output in [0, KEPT_OUTPUT.cast_signed(), 61] {
        bench.event(EventKind::DigitalOutput, output, 1.0);
    }
    if probes {
        bench.probe();
    }
    bench.accelerate();
    bench.cruise(cruise_s);
    bench.brake();
    bench.dwell(2.0);
    bench
}

/// The machine in that state, `later` periods after it has got there, and its last sample.
fn doing(doing: Doing, later: u32) -> (Bench, Sample) {
    let short = matches!(doing, Doing::Dwelling | Doing::Standstill);
    let mut bench = switched_on(doing == Doing::Probing, if short { 0.1 } else { 5.0 });
    tick(&mut bench, if short { 400 } else { 300 });
    let controls = &bench.host.controls;
    match doing {
        Doing::StoppingForHold | Doing::Held => controls.hold.store(true, Relaxed),
        Doing::Aborted => controls.abort.store(true, Relaxed),
        Doing::RampingOut => bench.fail_drives(),
        _ => {}
    }
    // 20 mm/s at 1000 mm/s²: rest is 20 periods away.
    let on_the_way = matches!(doing, Doing::StoppingForHold | Doing::RampingOut);
    let there = match doing {
        Doing::Held | Doing::Aborted => 40,
        Doing::Standstill => 2500,
        _ => 0,
    };
    let samples = tick(
        &mut bench,
        there + 1 + if on_the_way { later % 15 } else { later },
    );
    let last = *samples
        .last()
        .expect("a machine that has started gives samples");
    let state = match doing {
        Doing::Running | Doing::Dwelling | Doing::Probing => MachineState::Running,
        Doing::StoppingForHold | Doing::Held => MachineState::Holding,
        Doing::RampingOut => MachineState::Stopping,
        Doing::Aborted | Doing::Standstill => MachineState::Standstill,
    };
    if doing != Doing::RampingOut || !later.is_multiple_of(15) {
        assert_eq!(last.state, state, "{doing:?}");
    }
    (bench, last)
}

fn happens(bench: &mut Bench, what: Happens) {
    let controls = &bench.host.controls;
    match what {
        Happens::EmergencyStop => controls.emergency_stop.store(true, Relaxed),
        Happens::SoftFault => controls.soft_fault.store(true, Relaxed),
        Happens::DriverFails => bench.fail_drives(),
        Happens::FeedbackIsNoNumber => bench.spoil_feedback(),
        Happens::PeriodsAreMissed => bench.fine.missed(50, 50),
    }
}

fn sent(switched: &Switched) -> (u64, f64) {
    (switched.outputs, switched.spindle_rad_per_s)
}

/// What must be sent in each sample behind `before`, once that has happened.
fn judge(state: Doing, what: Happens, before: &Sample, samples: &[Sample]) {
    let all_on = (1 | KEPT | 1 << 61 | 1 << MIST | 1 << FLOOD, 100.0);
    let on = if state == Doing::Aborted {
        (1 | KEPT | 1 << 61, 0.0)
    } else {
        all_on
    };
    assert_eq!(sent(&before.switched), on, "{state:?}");
    let resting = matches!(
        state,
        Doing::Held | Doing::Dwelling | Doing::Aborted | Doing::Standstill
    );
    if what == Happens::PeriodsAreMissed && resting {
        assert!(
            samples.iter().all(|sample| sent(&sample.switched) == on),
            "{state:?}: nothing moved"
        );
        return;
    }
    let off = if what == Happens::EmergencyStop {
        0
    } else {
        samples
            .iter()
            .position(|sample| sample.state == MachineState::Fault)
            .expect("a fault, and rest")
    };
    let by = if what == Happens::EmergencyStop {
        SwitchedBy::EmergencyStop
    } else {
        SwitchedBy::Fault
    };
    for (number, sample) in samples.iter().enumerate() {
        let (expected, said) = (
            if number < off { on } else { (KEPT, 0.0) },
            format!("{state:?}, {what:?}, {number}"),
        );
        assert_eq!(sent(&sample.switched), expected, "{said}");
        assert!(
            number < off || sample.switched.by == by,
            "{said}: {:?}",
            sample.switched.by
        );
    }
    if what != Happens::EmergencyStop {
        let last = if off == 0 { before } else { &samples[off - 1] };
        assert_eq!(
            samples[off].command, last.command,
            "{state:?}, {what:?}: at rest and no sooner"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn an_emergency_stop_at_once_and_a_fault_at_rest(
        state in prop::sample::select(&DOING[..]), what in prop::sample::select(&HAPPENS[..]), later in 0..60u32,
    ) {
        let (mut bench, before) = doing(state, later);
        happens(&mut bench, what);
        let samples = tick(&mut bench, 60);
        judge(state, what, &before, &samples);
        let left = bench.fine.left().switched;
        prop_assert_eq!(sent(&left), sent(&samples.last().expect("samples").switched));
    }
}

/// Every pair of them, once.
#[test]
fn in_every_state_each_of_them() {
    for state in DOING {
        for what in HAPPENS {
            let (mut bench, before) = doing(state, 7);
            happens(&mut bench, what);
            judge(state, what, &before, &tick(&mut bench, 60));
        }
    }
}

/// It is in no sample: the drives are sent it, and who asks what was left is told.
#[test]
fn what_the_last_period_of_a_program_switches_is_left() {
    let mut bench = Bench::new(GuardMode::Stop);
    bench.event(EventKind::Spindle, 0, 100.0);
    bench.accelerate();
    bench.brake();
    bench.event(EventKind::Spindle, 0, 0.0);
    bench.event(EventKind::ProgramEnd, 0, 0.0);
    let samples = tick(&mut bench, 400);
    assert!(bench.fine.is_over());
    assert_eq!(
        samples
            .last()
            .map(|sample| sample.switched.spindle_rad_per_s),
        Some(100.0)
    );
    assert_eq!(bench.fine.left().switched.spindle_rad_per_s, 0.0);
}
