//! Rests that end an epoch: where the machine stands, what is forgotten, and that it goes on from there.

mod depth;
mod jog;
mod rig;

use std::sync::atomic::Ordering::Relaxed;

use rig::{ACCELERATION_MM_PER_S2, PERIOD_S, Rig};
use tandem_fine::FaultKind;
use tandem_rings::{MachineState, RestCause};
use tandem_sdk::{AxisVector, Edge, EventKind, StopOn};

const FEED_MM_PER_S: f64 = 80.0;
const TOUCH: StopOn = StopOn {
    input: 0,
    edge: Edge::Rising,
    miss_is_fault: 0,
};
const LEAVE: StopOn = StopOn {
    input: 0,
    edge: Edge::Falling,
    miss_is_fault: 0,
};

/// Along X, then along Y, with an output that switches between.
fn corner(rig: &mut Rig) {
    rig.line([20.0, 0.0], FEED_MM_PER_S);
    rig.event(EventKind::DigitalOutput, 5, 1.0);
    rig.line([20.0, 20.0], FEED_MM_PER_S);
}

/// Distance from the path of [`corner`], mm.
fn off_corner_mm(position: &AxisVector) -> f64 {
    let along_x = position[1].abs() + (position[0] - 20.0).max(0.0);
    let along_y = (position[0] - 20.0).abs();
    along_x.min(along_y)
}

#[test]
fn an_abort_rests_on_the_path_and_the_session_goes_on_from_there() {
    for period in 1..75 {
        let mut rig = Rig::new();
        corner(&mut rig);
        rig.rough_periods(period);
        rig.abort();
        let rest = rig.until_rest();
        assert_eq!((rest.cause, rest.epoch), (RestCause::Abort, 0), "{period}");
        assert!(
            off_corner_mm(&rest.position) < 1e-9,
            "{period}: {:?}",
            rest.position
        );
        rig.rough_periods(20);
        assert_eq!(
            (rig.state(), rig.last().command),
            (MachineState::Standstill, rest.position),
            "{period}"
        );
        let before_mm = rest.position[1];
        rig.line([rest.position[0] - 7.0, rest.position[1]], FEED_MM_PER_S);
        rig.line([0.0, -3.0], FEED_MM_PER_S);
        rig.until_driven();
        rig.assert_smooth();
        assert_eq!(rig.last().command, AxisVector::from_slice(&[0.0, -3.0]));
        // What was queued behind the rest is not driven, and nothing of it a second time.
        let after = rig.samples.iter().filter(|sample| sample.tick >= rest.tick);
        assert!(
            after
                .map(|s| s.command)
                .all(|c| c[1] <= before_mm && c[0] <= rest.position[0]),
            "{period}"
        );
    }
}

#[test]
fn feed_and_line_of_the_samples_go_on_over_the_epochs() {
    let mut rig = Rig::new();
    corner(&mut rig);
    rig.rough_periods(12);
    rig.abort();
    let rest = rig.until_rest();
    rig.line([-30.0, 0.0], FEED_MM_PER_S);
    rig.until_driven();
    let feed = rig.samples.iter().map(|s| s.feed_mm_per_s);
    assert!(
        feed.clone()
            .all(|feed| (0.0..=FEED_MM_PER_S * (1.0 + 1e-9)).contains(&feed)),
        "no jump of the path"
    );
    let way_mm: f64 = feed.map(|feed| feed * PERIOD_S).sum();
    assert!(
        (way_mm - (2.0 * rest.position[0] + 30.0)).abs() < 1e-9,
        "{way_mm}"
    );
    assert_eq!((rig.last().line, rig.last().block), (3, 2));
}

#[test]
fn an_abort_ends_a_hold_and_is_harmless_where_nothing_moves() {
    let mut rig = Rig::new();
    rig.rough_periods(3);
    rig.abort();
    rig.until_rest();
    corner(&mut rig);
    rig.rough_periods(20);
    rig.host.controls.hold.store(true, Relaxed);
    rig.rough_periods(30);
    assert_eq!(rig.state(), MachineState::Holding);
    rig.abort();
    let held = rig.until_rest();
    rig.abort();
    let again = rig.until_rest();
    assert_eq!(
        (held.epoch, again.epoch, held.position),
        (1, 2, again.position)
    );
    rig.line([0.0, 0.0], FEED_MM_PER_S);
    rig.until_driven();
    rig.assert_smooth();
}

#[test]
fn an_abort_stops_the_spindle_and_an_edge_does_not() {
    let mut rig = Rig::new();
    rig.event(EventKind::Spindle, 0, 50.0);
    rig.probe([30.0, 0.0], FEED_MM_PER_S, TOUCH);
    rig.until_rest();
    assert_eq!(rig.last().spindle_rad_per_s, 50.0);
    rig.event(EventKind::Spindle, 0, -70.0);
    rig.line([0.0, 0.0], FEED_MM_PER_S);
    rig.rough_periods(12);
    rig.abort();
    assert_eq!(
        rig.last().spindle_rad_per_s,
        -70.0,
        "until the machine rests"
    );
    rig.until_rest();
    assert_eq!(rig.last().spindle_rad_per_s, 0.0);
}

#[test]
fn a_probe_that_touches_rests_behind_the_edge_and_latches_it() {
    for feed in [1.0, 10.0, 60.0] {
        let mut rig = Rig::new();
        rig.line([5.0, 0.0], FEED_MM_PER_S);
        rig.probe([30.0, 0.0], feed, TOUCH);
        let rest = rig.until_rest();
        let latch = rest.latch.expect("an edge");
        assert_eq!(
            (rest.cause, rest.line, rest.stop_on),
            (RestCause::Edge, 2, TOUCH)
        );
        assert!(
            latch[0] > 12.5 && latch[0] <= 12.5 + feed * PERIOD_S,
            "{feed}: {latch:?}"
        );
        let ideal_mm = feed * feed / (2.0 * ACCELERATION_MM_PER_S2);
        let beyond_mm = rest.position[0] - latch[0];
        assert!(
            (beyond_mm - ideal_mm).abs() <= feed * PERIOD_S,
            "{feed}: {beyond_mm} instead of {ideal_mm}"
        );
        // Back off: the other edge, then away.
        rig.probe([-30.0, 0.0], feed, LEAVE);
        let back = rig.until_rest();
        let latch = back.latch.expect("an edge");
        assert!(
            latch[0] <= 12.5 && latch[0] > 12.5 - feed * PERIOD_S - 1e-9,
            "{feed}: {latch:?}"
        );
        rig.line([0.0, 0.0], FEED_MM_PER_S);
        rig.until_driven();
        rig.assert_smooth();
    }
}

#[test]
fn a_probe_that_touches_nothing_rests_at_its_end_and_goes_on() {
    let mut rig = Rig::new();
    rig.probe([10.0, 0.0], FEED_MM_PER_S, TOUCH);
    let rest = rig.until_rest();
    assert_eq!(
        (rest.cause, rest.latch, rest.position[0]),
        (RestCause::Missed, None, 10.0)
    );
    rig.line([0.0, 4.0], FEED_MM_PER_S);
    rig.until_driven();
    rig.assert_smooth();
}

#[test]
fn where_a_miss_is_a_fault_and_where_the_probe_is_tripped_before_the_run_ends_at_rest() {
    let must_touch = StopOn {
        miss_is_fault: 1,
        ..TOUCH
    };
    for (from_mm, stop_on, words) in [
        (
            5.0,
            must_touch,
            "line 2: input 0 was not tripped before the motion ended",
        ),
        (
            15.0,
            TOUCH,
            "line 2: input 0 was already tripped when the motion began",
        ),
        (
            5.0,
            LEAVE,
            "line 2: input 0 was already released when the motion began",
        ),
    ] {
        let mut rig = Rig::new();
        rig.line([from_mm, 0.0], FEED_MM_PER_S);
        rig.probe([from_mm, 8.0], FEED_MM_PER_S, stop_on);
        rig.until(|rig| rig.error.is_some());
        assert_eq!(rig.error.as_ref().unwrap().to_string(), words);
        let moved_mm = rig.last().command[1];
        // It has begun: one period to see it, and the stop.
        let begun_mm = 2.0 * ACCELERATION_MM_PER_S2 * PERIOD_S.powi(2);
        assert!(
            stop_on == must_touch || moved_mm <= begun_mm,
            "{moved_mm} mm against a tripped probe"
        );
        rig.assert_smooth();
        rig.host.controls.soft_fault.store(true, Relaxed);
        rig.rough_periods(2);
        assert_eq!(
            rig.fine.fault().map(|f| (f.kind, f.line)),
            Some((FaultKind::Soft, 2))
        );
    }
}
