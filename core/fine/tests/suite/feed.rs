//! No sample is faster than the programmed feed, where the plan goes beyond it because a higher feed may be asked for.

use crate::common;
use crate::smooth;

use common::{Bench, FEED_MM_PER_S};
use smooth::{LIMITS, Machine, Plan, profile};

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
        assert!(
            fastest < FEED_MM_PER_S * MOST + ROUNDING_MM_PER_S,
            "peak {peak}: {fastest}"
        );
        assert!(fastest > 0.97 * FEED_MM_PER_S, "peak {peak}: {fastest}");
    }
}

/// Lines with all the jerk that there is, from some that reach their feed in three periods to some that take a hundred.
#[test]
fn the_feed_is_kept_where_the_plan_uses_all_the_jerk_to_go_beyond_it() {
    for feed in [0.04, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 80.0] {
        for ratio in [1.02, 1.1, 1.3, 1.6, 2.0] {
            let planned = ratio * feed;
            let pieces = profile(
                0.6 * planned,
                planned,
                0.999 * LIMITS.acceleration,
                0.999 * LIMITS.jerk,
            );
            let plan = Plan::new(pieces, planned, |s| [0.8 * s, 0.6 * s]);
            let machine = Machine::planned_at(&plan, ratio);
            let done = machine.run_to_end();
            let what = format!("feed {feed} planned at {ratio} times it");
            done.assert_kept(&what);
            assert_eq!(done.relaxed, 0, "{what}");
            let fastest = done.speeds().into_iter().fold(0.0, f64::max);
            assert!(
                fastest < feed * MOST + ROUNDING_MM_PER_S,
                "{what}: {fastest}"
            );
            assert!(fastest > 0.999 * feed, "{what}: {fastest}");
        }
    }
}

/// On a circle an axis has no acceleration or jerk left where it turns round.
#[test]
fn the_feed_is_kept_on_a_circle_that_leaves_little_to_slow_down_with() {
    for (radius_mm, planned, share) in [(20.0, 60.0, 0.5), (3.0, 25.0, 0.6), (0.5, 10.0, 0.5)] {
        for ratio in [1.05, 1.3, 2.0] {
            let length_mm = 1.5 * std::f64::consts::TAU * radius_mm;
            let pieces = profile(
                length_mm,
                planned,
                share * LIMITS.acceleration,
                share * LIMITS.jerk,
            );
            let plan = Plan::new(pieces, planned, move |s| {
                [
                    radius_mm * (s / radius_mm).cos() - radius_mm,
                    radius_mm * (s / radius_mm).sin(),
                ]
            });
            let done = Machine::planned_at(&plan, ratio).run_to_end();
            let what = format!("radius {radius_mm}, planned at {ratio}");
            done.assert_kept(&what);
            let fastest = done.speeds().into_iter().fold(0.0, f64::max);
            assert!(
                fastest < planned / ratio * MOST + ROUNDING_MM_PER_S,
                "{what}: {fastest}"
            );
        }
    }
}

/// The path coordinate is a polynomial of its own: where it falls short of what the axes drive, their way is what a feed is of.
#[test]
fn the_feed_is_that_of_the_axes_where_the_path_coordinate_falls_short_of_their_way() {
    for share in [1.0, 0.998, 0.995] {
        let mut bench = Bench::planned_at(2.0);
        bench.shorten_path(share);
        bench.peak(1.5 * FEED_MM_PER_S);
        let (mut fastest, mut before_mm) = (0.0_f64, 0.0);
        for _ in 0..200 {
            bench.fine.tick();
            while let Ok(sample) = bench.host.samples.pop() {
                fastest = fastest.max((sample.command[0] - before_mm) / common::PERIOD_S);
                before_mm = sample.command[0];
            }
        }
        assert!(
            fastest < FEED_MM_PER_S * MOST + ROUNDING_MM_PER_S,
            "{share}: {fastest}"
        );
        assert!(fastest > 0.97 * FEED_MM_PER_S, "{share}: {fastest}");
    }
}

/// A lower feed is kept from where the program asks for it, and braking for it begins no earlier than that takes.
#[test]
fn a_lower_feed_ahead_is_kept_from_its_place_on_and_slows_nothing_long_before() {
    let (planned, share, line_mm) = (80.0, 0.6, 120.0);
    let pieces = profile(
        line_mm,
        planned,
        0.999 * LIMITS.acceleration,
        0.999 * LIMITS.jerk,
    );
    let middle_s = pieces.iter().map(|(_, duration)| duration).sum::<f64>() / 2.0;
    // A segment begins every 4 ms.
    let from_s = 4e-3 * (middle_s / 4e-3).round();
    let plan = Plan::new(pieces, planned, |s| [0.8 * s, 0.6 * s]).with_next_line(from_s, share);
    let place_mm = line_mm / 2.0 + planned * (from_s - middle_s);
    let done = Machine::planned_at(&plan, 2.0).run_to_end();
    done.assert_kept("a lower feed ahead");
    let (mut has_reached, mut passed) = (false, 0);
    for pair in done.sent.windows(2) {
        let at = |sample: &[f64; 2]| sample[0].hypot(sample[1]);
        let speed = (at(&pair[1]) - at(&pair[0])) / smooth::PERIOD_S;
        has_reached |= speed > 0.999 * planned / 2.0;
        if at(&pair[1]) < place_mm - 5.0 && has_reached {
            assert!(
                speed > 0.99 * planned / 2.0,
                "{speed} at {} mm",
                at(&pair[1])
            );
            passed += 1;
        }
        if at(&pair[0]) > place_mm {
            let lower = share * planned / 2.0;
            assert!(
                speed < lower * MOST + ROUNDING_MM_PER_S,
                "{speed} for {lower}"
            );
        }
    }
    assert!(passed > 500, "only {passed} samples at the higher feed");
}
