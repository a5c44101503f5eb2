//! Jogs that are let go, or not kept alive.

use std::sync::atomic::Ordering::Relaxed;

use tandem_rings::{MachineState, RestCause, StopCause};

use crate::FEED_MM_PER_S;
use crate::rig::{ACCELERATION_MM_PER_S2, PERIOD_S, Rig};

/// A rig that moves along X at full feed.
fn moving() -> Rig {
    let mut rig = Rig::new();
    rig.line([300.0, 0.0], FEED_MM_PER_S);
    rig.rough_periods(30);
    assert!(is_full(rig.last().feed_mm_per_s));
    rig
}

fn is_full(feed_mm_per_s: f64) -> bool {
    (feed_mm_per_s - FEED_MM_PER_S).abs() < 1e-6
}

#[test]
fn a_late_keep_alive_stops_the_machine_while_the_rough_loop_does_nothing() {
    const PERIODS: usize = 20;
    let mut rig = moving();
    rig.host.controls.jog.beats.fetch_add(1, Relaxed);
    rig.host
        .controls
        .jog
        .max_periods
        .store(PERIODS as u64, Relaxed);
    let before = rig.samples.len();
    rig.stall(5);
    let sample = |period: usize| rig.samples[before + period];
    // The first period sees the beat; the twentieth after it is the first slower one.
    assert!(
        is_full(sample(PERIODS - 1).feed_mm_per_s) && sample(PERIODS - 1).cause == StopCause::None
    );
    assert!(sample(PERIODS).feed_mm_per_s < FEED_MM_PER_S - 0.1);
    assert_eq!(sample(PERIODS).cause, StopCause::Abort);
    let began_mm = sample(PERIODS - 1).command[0];
    let rest = rig.until_rest();
    let ideal_mm = FEED_MM_PER_S * FEED_MM_PER_S / (2.0 * ACCELERATION_MM_PER_S2);
    let took_mm = rest.position[0] - began_mm;
    assert_eq!(rest.cause, RestCause::Abort);
    assert!(
        (took_mm - ideal_mm).abs() <= FEED_MM_PER_S * PERIOD_S,
        "{took_mm} mm instead of {ideal_mm}"
    );
    rig.host.controls.jog.let_go.store(false, Relaxed);
    rig.line([0.0, 0.0], FEED_MM_PER_S);
    rig.host.controls.jog.max_periods.store(0, Relaxed);
    rig.until_driven();
    rig.assert_smooth();
}

#[test]
fn beats_keep_it_alive() {
    let mut rig = moving();
    rig.host.controls.jog.max_periods.store(20, Relaxed);
    for _ in 0..20 {
        rig.host.controls.jog.beats.fetch_add(1, Relaxed);
        rig.rough_periods(2);
    }
    assert!(rig.rests().is_empty() && is_full(rig.last().feed_mm_per_s));
}

#[test]
fn a_jog_that_is_let_go_leaves_a_hold_as_it_is() {
    let mut rig = moving();
    rig.host.controls.hold.store(true, Relaxed);
    rig.rough_periods(30);
    rig.host.controls.jog.let_go.store(true, Relaxed);
    let rest = rig.until_rest();
    rig.host.controls.jog.let_go.store(false, Relaxed);
    rig.line([0.0, 0.0], FEED_MM_PER_S);
    rig.rough_periods(30);
    assert_eq!(
        (rig.state(), rig.last().command),
        (MachineState::Holding, rest.position)
    );
    rig.host.controls.hold.store(false, Relaxed);
    rig.until_driven();
    rig.assert_smooth();
}
