//! Ways on which a feed is kept, on their own.

use super::super::{Goal, Governor, order3};
use super::*;
use crate::plan_ahead::{Ahead, TWO_LINEAR};
use crate::steps::Recent;
use proptest::prelude::*;
use tandem_sdk::{AxisLimits, AxisVector, MAX_AXES, Segment, derivatives};

/// A constant rate at the present place of a plan.
fn at_rate<'a>(sigma: f64, ahead: &'a Ahead<'a>) -> RateState<'a> {
    RateState {
        sigma,
        rate_per_s: 0.0,
        place: ahead.place(TWO_LINEAR),
        recent: Recent::default(),
    }
}

/// A way begins with single periods, and the farther it is, the more of them it takes in a step: no step is a large share of it.
#[test]
fn the_steps_of_a_way_grow_with_it() {
    const MOST: u32 = 2000;
    let (mut passed, mut steps) = (0, 0);
    while passed < MOST {
        let periods = periods_of_step(passed);
        assert!(
            periods == 1 || 4 * periods <= passed,
            "{periods} behind {passed}"
        );
        (passed, steps) = (passed + periods, steps + 1);
    }
    assert!(4 * steps < MOST, "{steps} steps");
}

/// X is slower than Y.
fn limits(acceleration: f64, slower: f64, jerk: f64) -> [AxisLimits; MAX_AXES] {
    let mut limits = order3::tests::limits(acceleration, jerk);
    limits[0].acceleration_mm_per_s2 *= slower;
    limits[0].jerk_mm_per_s3 *= slower;
    limits
}

/// A way may last as long as the slowest axis takes to stop, and as the work of a period allows.
#[test]
fn a_way_may_last_as_long_as_the_slowest_stop() {
    for (acceleration, building_s, stop_s) in [(0.5, 0.05, 0.8), (40.0, 0.1, 1.5)] {
        let mut limits = limits(acceleration, 0.5, acceleration / building_s);
        for axis in &mut limits {
            axis.rapid_mm_per_s = 0.5 * acceleration * stop_s;
            axis.feed_mm_per_s = 0.1 * axis.rapid_mm_per_s;
        }
        let horizon = Horizon::new(&limits, 2, 1e-3);
        let longest_s = 1e-3 * f64::from(most_periods(1e-3, &horizon));
        assert!(longest_s > stop_s + building_s, "{longest_s} s of {stop_s}");
        assert!(
            longest_s < 1.1 * stop_s + 10.0 * building_s,
            "{longest_s} s"
        );
    }
    let slow = limits(0.01, 1.0, 1.0);
    let most = most_periods(1e-3, &Horizon::new(&slow, 2, 1e-3));
    assert_eq!(f64::from(most), FEED_WAY_PERIODS[1]);
}

/// A rate of 10 per second that is braked with 1000/s² goes on by 0.05 and comes back: beyond the range only from near its end.
#[test]
fn a_rate_turns_beyond_its_range_only_near_an_end_of_it() {
    let segment = Segment::rest(&AxisVector::ZERO, 0.1);
    let ahead = Ahead::new(&segment, Some(0.0), 0, None);
    for (sigma, rate_per_s, step_s, expected) in [
        (0.96, 10.0, 0.02, true),
        (0.94, 10.0, 0.02, false),
        (0.04, -10.0, 0.02, true),
        (0.06, -10.0, 0.02, false),
        // The step ends before it turns.
        (0.96, 10.0, 0.009, false),
        (0.04, -10.0, 0.009, false),
    ] {
        let from = RateState {
            sigma,
            rate_per_s,
            place: ahead.place(TWO_LINEAR),
            recent: Recent::default(),
        };
        let change = -100.0 * rate_per_s;
        assert_eq!(
            turns_beyond(&from, change, step_s),
            expected,
            "{sigma} {step_s}"
        );
    }
}

/// The ratio has become a lower one: the speed need not be below it at once, but on no way does it rise beyond what it is.
#[test]
fn a_way_that_begins_above_the_feed_does_not_rise_before_it_is_below() {
    const PERIOD_S: f64 = 1e-3;
    let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
    segment.coefficients[0][1] = 10.0;
    segment.coefficients[0][2] = 50.0;
    segment.path = segment.coefficients[0];
    segment.feed_mm_per_s = 10.0;
    let ahead = Ahead::new(&segment, Some(0.0), 0, None);
    let here = at_rate(0.5, &ahead);
    // At 5 mm/s, where 4 are asked for, the plan gets faster by 5 % in ten periods.
    for (rate_per_s, is_kept) in [(0.0, false), (-3.0, true)] {
        let mut watch = Watch::new(&here, 0.4);
        let mut way = RateState { rate_per_s, ..here };
        way.pass(0.0, 10.0 * PERIOD_S);
        let goes_on = watch.is_kept(&way, 0.4, 10.0 * PERIOD_S);
        assert_eq!(goes_on, is_kept, "{rate_per_s}: {}", way.sigma);
        // Below the feed it may rise.
        let mut watch = Watch::new(&here, 0.6);
        assert!(watch.is_kept(&way, 0.6, 10.0 * PERIOD_S));
    }
}

/// A plan that ends at rest with a speed that rounding has left below zero is not too fast there.
#[test]
fn the_rounding_of_a_rest_ahead_lowers_no_rate() {
    let mut segment = Segment::rest(&AxisVector::ZERO, 0.1);
    segment.coefficients[0][1] = 0.1;
    segment.coefficients[0][2] = -0.5;
    segment.path = segment.coefficients[0];
    segment.path[1] -= 1e-17;
    segment.feed_mm_per_s = 1.0;
    let ahead = Ahead::new(&segment, Some(0.0), 0, None);
    let here = at_rate(1.0, &ahead);
    let aim = Aim {
        goal: Goal::run(1.0, 1.0, None),
        ratio: 1.0,
        kept_rate: 0.5,
        path: [0.1, -1.0, 0.0],
    };
    assert!(Below::new(&aim, &here, 1e-3).is_kept_at(1.0));
}

/// The plan gets too fast for some periods, far ahead, where places lie apart.
#[test]
fn a_short_peak_between_two_places_ahead_counts_as_high_as_it_is() {
    const PEAK: f64 = 10.0;
    for meets_s in (10..60).map(|n| 1e-3 * f64::from(n)) {
        let mut segment = Segment::rest(&AxisVector::ZERO, 0.1);
        // Speed is PEAK − 2000 (t − meets)² and a term of third order.
        let [square, cube] = [-2000.0, 4000.0];
        let at = |t: f64| {
            let off = t - meets_s;
            [
                PEAK + off * off * (square + cube * off),
                off * (2.0 * square + 3.0 * cube * off),
                square + 3.0 * cube * off,
                cube,
            ]
        };
        let [speed, rise, second, third] = at(0.0);
        segment.coefficients[0] = [0.0, speed, rise / 2.0, second / 3.0, third / 4.0, 0.0];
        segment.path = segment.coefficients[0];
        segment.feed_mm_per_s = 1.0;
        let ahead = Ahead::new(&segment, Some(0.0), 0, None);
        let here = at_rate(0.5, &ahead);
        let aim = Aim {
            goal: Goal::run(1.0, 5.0, None),
            ratio: 5.0,
            kept_rate: 0.3,
            path: [speed, rise, 0.0],
        };
        let mut below = Below::new(&aim, &here, 1e-3);
        assert!(below.is_kept_at(0.5 * (1.0 - 2e-5)), "{meets_s}");
        assert!(!below.is_kept_at(0.5 * (1.0 + 2e-5)), "{meets_s}");
    }
}

/// At twice the feed on a line: lowering the rate to where the feed is kept takes little more than the shortest time.
#[test]
fn a_rate_is_lowered_to_the_feed_without_delay() {
    for period_s in [1e-3, 5e-4] {
        let limits = limits(100.0, 1.0, 1000.0);
        let mut segment = Segment::rest(&AxisVector::ZERO, 10.0);
        segment.coefficients[0][1] = 20.0;
        segment.path[1] = 20.0;
        segment.feed_mm_per_s = 10.0;
        let horizon = Horizon::new(&limits, 2, period_s);
        let mut ways = WaySearch::new(period_s);
        let ahead = Ahead::new(&segment, Some(0.0), 0, None);
        let here = at_rate(1.0, &ahead);
        let aim = Aim {
            goal: Goal::run(1.0, 10.0, None),
            ratio: 1.0,
            kept_rate: 0.5,
            path: [20.0, 0.0, 0.0],
        };
        let mut below = Below::new(&aim, &here, period_s);
        below.steps_left = FEED_WAY_STEPS;
        let watch = Watch::new(&here, aim.ratio);
        assert!(below.becomes_slow((here, watch), &mut ways, &horizon));
        let (mut way, mut periods) = (here, 0.0);
        while let Some((change, _)) = ways.tried.next() {
            way.pass(change, period_s);
            periods += 1.0;
        }
        assert!(
            (0.44..=0.5).contains(&way.sigma),
            "it ends at {}",
            way.sigma
        );
        assert!(way.rate_per_s.abs() < 1e-9, "{} 1/s", way.rate_per_s);
        // From 20 to 9 mm/s, with 1000 mm/s³.
        let shortest_s = 2.0 * f64::sqrt(11.0 / 1000.0);
        let took = periods * period_s / shortest_s;
        assert!((0.9..1.05).contains(&took), "{took} of the shortest time");
    }
}

/// X at this path on a machine of 1000 mm/s² and 10 000 mm/s³, at a programmed feed of 10 mm/s.
fn along_x(path: [f64; 6]) -> Segment {
    let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
    segment.coefficients[0] = path;
    segment.path = path;
    segment.feed_mm_per_s = 10.0;
    segment
}

/// What is to be kept from there on: 10 mm/s, which the plan keeps at `kept_rate` wherever it is.
fn the_feed(kept_rate: f64, segment: &Segment) -> Aim {
    Aim {
        goal: Goal::run(1.0, 10.0, None),
        ratio: 1.0,
        kept_rate,
        path: derivatives(&segment.path, 0.0),
    }
}

/// A period at the feed keeps it, however its way is rounded; a millionth more does not.
#[test]
fn a_period_at_the_feed_keeps_it_at_its_end_and_in_its_mean() {
    for number in 1..200 {
        let (period_s, at_s) = (1e-5 * f64::from(number), 1.7e-3 * f64::from(number));
        let speed = 10.0 + 0.37 * f64::from(number);
        let segment = along_x([0.0, speed, 0.0, 0.0, 0.0, 0.0]);
        let ahead = Ahead::new(&segment, Some(at_s), 0, None);
        for (beyond, is_kept) in [(1.0, true), (1.0 + 1e-6, false)] {
            let here = at_rate(10.0 / speed, &ahead);
            let mut watch = Watch::new(&here, 1.0);
            let mut way = at_rate(beyond * 10.0 / speed, &ahead);
            way.pass(0.0, period_s);
            way.sigma = 10.0 / speed;
            assert_eq!(
                watch.is_kept(&way, 1.0, period_s),
                is_kept,
                "{number}: its mean"
            );
            let mut watch = Watch::new(&here, 1.0);
            let mut way = here;
            way.pass(0.0, period_s);
            way.sigma = beyond * 10.0 / speed;
            assert_eq!(
                watch.is_kept(&way, 1.0, period_s),
                is_kept,
                "{number}: its end"
            );
        }
    }
}

/// A ratio that has become a lower one leaves time to come down to it, once: what has come below it stays there.
#[test]
fn a_way_that_has_come_below_the_feed_does_not_go_above_it_again() {
    const PERIOD_S: f64 = 1e-3;
    let segment = along_x([0.0, 20.0, 0.0, 0.0, 0.0, 0.0]);
    let ahead = Ahead::new(&segment, Some(0.0), 0, None);
    let mut way = at_rate(0.8, &ahead);
    let mut watch = Watch::new(&way, 1.0);
    let steps = [
        (0.7, true),
        (0.65, true),
        (0.45, true),
        (0.45, true),
        (0.6, false),
    ];
    for (number, (sigma, is_kept)) in steps.into_iter().enumerate() {
        way.pass(0.0, PERIOD_S);
        way.sigma = sigma;
        assert_eq!(watch.is_kept(&way, 1.0, PERIOD_S), is_kept, "{number}");
    }
}

/// At twice the feed just below it, and rising: only what lowers the rate leaves a way, and one is found, along which the feed is kept.
#[test]
fn where_only_a_lower_rate_leaves_a_way_it_is_found() {
    const PERIOD_S: f64 = 1e-3;
    let segment = along_x([0.0, 20.0, 0.0, 0.0, 0.0, 0.0]);
    let horizon = Horizon::new(&limits(1000.0, 1.0, 10_000.0), 2, PERIOD_S);
    let ahead = Ahead::new(&segment, Some(0.0), 0, None);
    for rate_per_s in [0.5, 1.0, 2.0] {
        // Brought to nothing at the limit in every period it just reaches the feed.
        let rises = 1.1 * rate_per_s * rate_per_s / (2.0 * 10_000.0 / 20.0);
        let here = RateState {
            rate_per_s,
            ..at_rate(0.5 - rises - 0.55 * rate_per_s * PERIOD_S, &ahead)
        };
        let mut ways = WaySearch::new(PERIOD_S);
        let mut below = Below::new(&the_feed(0.4999, &segment), &here, PERIOD_S);
        let chosen = below.recoverable(1e6, &here, &mut ways, &horizon);
        let change = chosen.unwrap_or_else(|| panic!("no way from {rate_per_s} 1/s"));
        assert!(change < 0.0, "{change}");
        let (mut way, mut periods) = (here, 0);
        way.pass(change, PERIOD_S);
        while let Some((change, _)) = ways.found.next() {
            assert!(
                way.sigma * 20.0 <= 10.0 * (1.0 + TOLERANCE),
                "{}",
                way.sigma
            );
            way.pass(change, PERIOD_S);
            periods += 1;
        }
        assert!(periods > 0 && way.rate_per_s.abs() < 1e-9 && way.sigma <= 0.5);
    }
}

/// From rest the plan gets faster evenly, to twice the feed, which it comes to after so many periods: where these are enough to lower the rate
/// it begins with all of it, and the fewer they are the lower, but never below the one that is kept anyway.
#[test]
fn from_rest_the_rate_begins_as_high_as_can_be_lowered_in_time() {
    const PERIOD_S: f64 = 1e-3;
    let mut before = 1.0;
    for periods in [400, 200, 100, 25, 20, 16, 14, 12, 8, 4] {
        let meets_s = f64::from(periods) * PERIOD_S;
        let mut segment = along_x([0.0, 0.0, 10.0 / meets_s / 2.0, 0.0, 0.0, 0.0]);
        segment.duration_s = 2.0 * meets_s;
        let horizon = Horizon::new(&limits(1000.0, 1.0, 10_000.0), 2, PERIOD_S);
        let ahead = Ahead::new(&segment, Some(0.0), 0, None);
        let here = at_rate(1.0, &ahead);
        let mut ways = WaySearch::new(PERIOD_S);
        let mut below = Below::new(&the_feed(0.5, &segment), &here, PERIOD_S);
        let found = below.rate_to_begin_with(here, &mut ways, &horizon);
        let rate = found.unwrap_or(0.5);
        assert!(rate <= before && rate >= 0.5, "{rate} after {before}");
        assert!(rate == 1.0 || periods < 100, "{rate} of {periods} periods");
        before = rate;
    }
    assert!(before < 1.0);
}

/// Where nothing ahead is too fast a rise goes on to a rate that is higher, and is not taken back to the one that is kept anyway.
#[test]
fn a_rise_ends_where_it_comes_to_if_the_feed_is_kept_there() {
    const PERIOD_S: f64 = 1e-3;
    let segment = along_x([0.0, 10.0, 0.0, 0.0, 0.0, 0.0]);
    let horizon = Horizon::new(&limits(1000.0, 1.0, 10_000.0), 2, PERIOD_S);
    let ahead = Ahead::new(&segment, Some(0.0), 0, None);
    for rate_per_s in [0.1, 2.0, 10.0] {
        let here = RateState {
            rate_per_s,
            ..at_rate(0.5, &ahead)
        };
        let mut ways = WaySearch::new(PERIOD_S);
        let mut below = Below::new(&the_feed(0.3, &segment), &here, PERIOD_S);
        below.steps_left = FEED_WAY_STEPS;
        assert!(below.leaves_way(0.0, &here, &mut ways, &horizon));
        let mut way = here;
        way.pass(0.0, PERIOD_S);
        let mut rates = vec![way.rate_per_s];
        while let Some((change, _)) = ways.found.next() {
            way.pass(change, PERIOD_S);
            rates.push(way.rate_per_s);
        }
        assert!(way.sigma > 0.5 && way.rate_per_s.abs() < 1e-9, "{way:?}");
        assert!(rates.is_sorted_by(|a, b| a >= b), "{rates:?}");
    }
}

/// What has gone beyond an end of the range comes back only by turning round there: that is no way.
#[test]
fn a_way_does_not_leave_the_range_of_rates() {
    const PERIOD_S: f64 = 1e-3;
    let segment = along_x([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
    let horizon = Horizon::new(&limits(1000.0, 1.0, 10_000.0), 2, PERIOD_S);
    let ahead = Ahead::new(&segment, Some(0.0), 0, None);
    for (sigma, rate_per_s, leaves) in [
        (0.01, -20.0, false),
        (0.99, 20.0, false),
        (0.5, -20.0, true),
        (0.5, 20.0, true),
    ] {
        let here = RateState {
            rate_per_s,
            ..at_rate(sigma, &ahead)
        };
        let mut ways = WaySearch::new(PERIOD_S);
        let mut below = Below::new(&the_feed(1.0, &segment), &here, PERIOD_S);
        below.steps_left = FEED_WAY_STEPS;
        let found = below.leaves_way(0.0, &here, &mut ways, &horizon);
        assert_eq!(found, leaves, "{rate_per_s} 1/s at {sigma}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// X turns with much of its jerk, or all of it, which leaves little to lower σ with, while Y gets faster than the feed. From the
    /// rate at which the plan keeps the feed everywhere σ rises, and no sample is beyond the feed or the jerk limit.
    #[test]
    fn where_an_axis_turns_before_the_plan_is_too_fast_no_sample_is_beyond_the_feed(
        acceleration in 10.0..1000.0f64, building_s in 0.02..0.2f64, slower in 0.01..1.0f64, period_s in 5e-4..2e-3f64,
        used in 0.3..1.0f64, gain in 0.5..4.0f64, long in 0.3..1.0f64, ratio in 0.2..2.0f64,
    ) {
        let jerk = acceleration / building_s;
        let (turning, time_s) = (used * slower * jerk, long * building_s);
        let from = turning * time_s * time_s / 4.0;
        // What is driven of it ends before it does: the plan does not rest there.
        let mut segment = Segment::rest(&AxisVector::ZERO, 1.5 * time_s);
        segment.coefficients[0] = [0.0, from, 0.0, -turning / 6.0, 0.0, 0.0];
        segment.coefficients[1] = [0.0, 0.0, gain * from / time_s / 2.0, 0.0, 0.0, 0.0];
        segment.feed_mm_per_s = from;
        let coefficients = segment.coefficients;
        let speed_at = |t: f64| {
            let [x, y] = [0, 1].map(|axis| derivatives(&coefficients[axis], t)[0]);
            x.hypot(y)
        };
        let speeds = || (0..=1000).map(|step| speed_at(1.5 * time_s * f64::from(step) / 1000.0));
        let fastest = speeds().fold(0.0, f64::max);
        let kept_rate = 0.999 * (ratio * from / fastest).min(1.0);
        // The path coordinate runs behind.
        segment.path[1] = speeds().fold(f64::INFINITY, f64::min);
        let limits = limits(acceleration, slower, jerk);
        let (mut governor, mut horizon) = (Governor::new(&limits, 2, period_s), Horizon::new(&limits, 2, period_s));
        governor.jump(kept_rate);
        let (mut at_s, mut samples) = (0.0, Vec::new());
        while at_s < time_s {
            samples.push(segment.position(at_s));
            let ahead = Ahead::new(&segment, Some(at_s), 0, None);
            horizon.fill(&ahead, period_s);
            let rise = (speed_at(at_s + 1e-6) - speed_at(at_s - 1e-6)) / 2e-6;
            let aim = Aim {
                goal: Goal::run(1.0, ratio * from, None), ratio, kept_rate, path: [speed_at(at_s), rise, 0.0],
            };
            let chosen = governor.smooth(&aim, &horizon, ahead.place(TWO_LINEAR), Recent::default());
            prop_assert!(!chosen.relaxed && chosen.delta_s > 0.0, "{chosen:?} at {at_s} of {time_s} s");
            at_s += chosen.delta_s;
        }
        let kept = time_s / kept_rate / period_s;
        prop_assert!(samples.len() as f64 <= 1.2 * kept + 2.0, "{} periods where the rate so far takes {kept}", samples.len());
        for (number, pair) in samples.windows(2).enumerate() {
            let way = [0, 1].map(|axis| pair[1][axis] - pair[0][axis]);
            let speed = way[0].hypot(way[1]) / period_s;
            prop_assert!(speed <= ratio * from * (1.0 + 1e-6), "sample {number} of {}: {speed} for {}", samples.len(), ratio * from);
        }
        for (number, four) in samples.windows(4).enumerate() {
            for (axis, limit) in limits[..2].iter().enumerate() {
                let change = four[3][axis] - 3.0 * four[2][axis] + 3.0 * four[1][axis] - four[0][axis];
                let asked = change.abs() / (period_s * period_s * period_s);
                let rounding = 1e-15 * four[3][axis].abs() / (period_s * period_s * period_s);
                prop_assert!(asked <= 1.01 * limit.jerk_mm_per_s3 + rounding, "sample {number}, axis {axis}: {asked} for {limit:?}");
            }
        }
    }
}
