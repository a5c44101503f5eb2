//! How deep the queue must be: the worst stop v/a, not v/(2a).

use crate::rig::Rig;

/// So fast that the way to rest takes far longer than the margins of the queue.
const FAST_MM_PER_S: f64 = 240.0;

/// A way of many blocks with a corner, at full speed.
fn fast(rig: &mut Rig) {
    for block in 1..=60 {
        rig.line([f64::from(block) * 4.0, 0.0], FAST_MM_PER_S);
    }
    for block in 1..=30 {
        rig.line([240.0, f64::from(block) * 4.0], FAST_MM_PER_S);
    }
}

/// Drives it with the rough loop late by `stalled` rough periods after `before`; gives the starvations and the samples
/// that move.
fn driven(depth_factor: f64, before: usize, stalled: usize) -> (u64, usize) {
    let mut rig = Rig::with_depth(depth_factor);
    fast(&mut rig);
    rig.rough_periods(before);
    rig.stall(stalled);
    rig.until_driven();
    rig.assert_smooth();
    let off_path = rig
        .samples
        .iter()
        .map(|s| s.command)
        .find(|at| at[1].abs() > 1e-9 && (at[0] - 240.0).abs() > 1e-9);
    assert_eq!(off_path, None);
    (
        rig.fine.counters().starvations,
        rig.samples
            .iter()
            .filter(|sample| sample.feed_mm_per_s > 0.0)
            .count(),
    )
}

/// What the starvation scenarios ask for: nothing starves that is not stalled, three rough periods are not noticed,
/// longer ones stop the machine on the path, once, and it goes on.
fn passes(depth_factor: f64) -> bool {
    let (starved, free) = driven(depth_factor, 0, 0);
    let unnoticed = (1..free / 8)
        .step_by(7)
        .all(|before| driven(depth_factor, before, 3) == (starved, free));
    let once = (1..free / 8)
        .step_by(7)
        .all(|before| driven(depth_factor, before, 60).0 <= 1);
    starved == 0 && unnoticed && once && driven(depth_factor, 60, 60).0 == 1
}

#[test]
fn the_worst_stop_is_deep_enough_and_half_of_it_is_not() {
    assert!(passes(1.0));
    assert!(!passes(0.5), "v/(2a)");
    let (starved, samples) = driven(0.5, 0, 0);
    let (_, enough) = driven(1.0, 0, 0);
    assert!(
        starved > 0 && samples > enough,
        "it stops again and again: {starved} times, {samples} for {enough} samples"
    );
}
