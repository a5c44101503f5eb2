//! Progress of program time: slow is not still, and still is a fault.

use crate::common;

use std::sync::atomic::Ordering::Relaxed;

use common::Bench;
use tandem_fine::{FaultKind, GuardMode};
use tandem_rings::MachineState;
use tandem_sdk::EventKind;

/// Drives `periods`, and takes the samples.
fn tick(bench: &mut Bench, periods: u32) {
    for _ in 0..periods {
        bench.fine.tick();
        while bench.host.samples.pop().is_ok() {}
    }
}

/// More than a window of this machine: 4·0.1 s, and 32 periods.
const LONG: u32 = 2000;

fn moving() -> Bench {
    let mut bench = Bench::new(GuardMode::Stop);
    bench.accelerate();
    for _ in 0..20 {
        bench.cruise(0.2);
    }
    bench.brake();
    tick(&mut bench, 300);
    assert!(bench.host.status.feed_mm_per_s.load() > 0.0);
    bench
}

#[test]
fn what_is_slow_held_or_stopped_by_an_override_is_no_loss_of_progress() {
    let mut bench = moving();
    for (hold, feed_override) in [
        (false, 1e-4),
        (true, 1.0),
        (false, 0.0),
        (false, 1e-6),
        (false, 0.3),
        (true, 0.2),
    ] {
        bench.host.controls.hold.store(hold, Relaxed);
        bench.host.controls.feed_override.store(feed_override);
        tick(&mut bench, LONG);
        assert_eq!(
            bench.fine.fault(),
            None,
            "hold {hold}, override {feed_override}"
        );
    }
    bench.host.controls.hold.store(false, Relaxed);
    bench.host.controls.feed_override.store(1.0);
    bench.event(EventKind::ProgramEnd, 0, 0.0);
    tick(&mut bench, 5000);
    assert!(
        bench.fine.is_over() && bench.fine.fault().is_none(),
        "{:?}",
        bench.fine.fault()
    );
}

#[test]
fn a_machine_at_rest_that_waits_for_work_makes_no_fault_of_it() {
    let mut bench = Bench::new(GuardMode::Stop);
    bench.accelerate();
    bench.brake();
    tick(&mut bench, 10 * LONG);
    assert_eq!(bench.fine.fault(), None);
}

/// A filter that has settled stands so, and the rough loop is late.
#[test]
fn a_plan_that_stands_where_what_is_queued_ends_starves_and_makes_no_fault_of_it() {
    let mut bench = Bench::new(GuardMode::Stop);
    bench.stand(0.5);
    tick(&mut bench, LONG);
    assert_eq!(bench.fine.fault(), None);
    assert_eq!(bench.state(), MachineState::Starved);
    bench.accelerate();
    bench.brake();
    tick(&mut bench, LONG);
    assert_eq!(bench.fine.fault(), None);
    assert_ne!(bench.state(), MachineState::Starved);
}

#[test]
fn program_time_that_does_not_pass_though_nothing_stops_it_is_a_fault_by_its_name() {
    // What is queued ends in motion, and the rough loop says that it ends at rest: the cursor stands at its end.
    let mut bench = Bench::new(GuardMode::Count);
    bench.accelerate();
    bench.cruise(0.1);
    bench.say_that_it_ends_at_rest();
    tick(&mut bench, 150);
    assert_eq!(bench.fine.fault(), None);
    tick(&mut bench, LONG);
    let Some(FaultKind::NoProgress {
        periods,
        grown_s,
        asked,
    }) = bench.fine.fault().map(|fault| fault.kind)
    else {
        panic!("{:?}", bench.fine.fault())
    };
    assert_eq!(
        (periods, grown_s, asked),
        (433, 0.0, 1.0),
        "the window of 4·V/A and 32 periods"
    );
}
