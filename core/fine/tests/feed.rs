//! No sample is faster than the programmed feed, where the plan goes beyond it because a higher feed may be asked for.

#[allow(dead_code)] // what other tests need of it
mod common;

use common::{Bench, FEED_MM_PER_S};

/// What the oracle forgives a feed, and the rounding of positions over a period.
const MOST: f64 = 1.0 + 1e-6;
const ROUNDING_MM_PER_S: f64 = 1e-9;

/// The plan gets faster with all that the axis has, and brakes as hard at once: at every phase of the period.
#[test]
fn the_feed_is_kept_where_the_plan_turns_from_getting_faster_to_braking_within_a_period() {
    for step in 0..200 {
        let peak = FEED_MM_PER_S * (1.0 + f64::from(step) / 200.0);
        let mut bench = Bench::planned_at(2.0);
        bench.peak(peak);
        let mut fastest = 0.0_f64;
        let mut before_mm = 0.0;
        for _ in 0..200 {
            bench.fine.tick();
            while let Ok(sample) = bench.host.samples.pop() {
                fastest = fastest.max((sample.command[0] - before_mm) / common::PERIOD_S);
                before_mm = sample.command[0];
            }
        }
        assert_eq!(bench.fine.fault(), None, "peak {peak}");
        assert!(fastest < FEED_MM_PER_S * MOST + ROUNDING_MM_PER_S, "peak {peak}: {fastest}");
        assert!(fastest > 0.97 * FEED_MM_PER_S, "peak {peak}: {fastest}");
    }
}
