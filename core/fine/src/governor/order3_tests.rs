//! What is chosen for a period where jerk is limited, on its own: the laws, what a governor without a way does, and the way it follows.

use super::*;
use crate::plan_ahead::{Ahead, TWO_LINEAR};
use proptest::prelude::*;
use tandem_sdk::{AxisLimits, AxisVector, MAX_AXES, Segment, SegmentFlags, derivatives};

const PERIOD_S: f64 = 0.001;

pub fn limits(acceleration: f64, jerk: f64) -> [AxisLimits; MAX_AXES] {
    [AxisLimits {
        min_mm: -1000.0,
        max_mm: 1000.0,
        feed_mm_per_s: 1000.0,
        rapid_mm_per_s: 1000.0,
        acceleration_mm_per_s2: acceleration,
        jerk_mm_per_s3: jerk,
        speed_difference_mm_per_s: 0.0,
    }; MAX_AXES]
}

/// Along X, with these derivatives at its start.
fn along_x([speed, acceleration, jerk]: [f64; 3], duration_s: f64) -> Segment {
    let mut segment = Segment::rest(&AxisVector::ZERO, duration_s);
    segment.coefficients[0] = [0.0, speed, acceleration / 2.0, jerk / 6.0, 0.0, 0.0];
    segment.path = segment.coefficients[0];
    segment.flags = SegmentFlags::default();
    segment
}

/// A governor of a machine of 1000 mm/s² and 10 000 mm/s³ at the start of `segment`, at this rate, and what it looks at.
fn governor_on(segment: &Segment, sigma: f64, rate_per_s: f64) -> (Governor, Horizon) {
    let limits = limits(1000.0, 10_000.0);
    let mut governor = Governor::new(&limits, 2, PERIOD_S);
    governor.sigma = sigma;
    governor.rate_per_s = rate_per_s;
    let mut horizon = Horizon::new(&limits, 2, PERIOD_S);
    horizon.fill(&Ahead::new(segment, Some(0.0), 0, None), PERIOD_S);
    (governor, horizon)
}

fn to_rest_from(path: [f64; 3]) -> Aim {
    Aim {
        goal: Goal::Rest { sigma: 1.0 },
        ratio: f64::INFINITY,
        kept_rate: 1.0,
        path,
    }
}

/// The plan gets faster with all that the axis has while σ rises: that is more than it has, and to bring it down within the period takes
/// more jerk than there is.
#[test]
fn where_both_cannot_be_kept_acceleration_is_kept_and_jerk_goes_beyond_its_limit() {
    let (speed, acceleration) = (50.0, 1000.0);
    let segment = along_x([speed, acceleration, 0.0], 0.1);
    let (mut governor, horizon) = governor_on(&segment, 0.95, 2.5);
    let chosen = governor.relaxed(&horizon, &Steps::default());
    assert!(chosen.relaxed);
    let (sigma, rate) = (governor.sigma(), governor.rate_per_s());
    let driven = sigma * sigma * acceleration + rate * (speed + acceleration * chosen.delta_s);
    assert!((980.0..=1000.0).contains(&driven), "{driven} mm/s²");
    let jerk = 3.0 * acceleration * 0.95 * 2.5 + speed * (rate - 2.5) / PERIOD_S;
    assert!((-60_000.0..-11_000.0).contains(&jerk), "{jerk} mm/s³");
}

/// Too fast for its limit to bring σ̇ down before the end of the range, the jerk goes beyond it evenly, and not all at once there.
#[test]
fn the_rate_comes_to_an_end_of_its_range_without_a_step() {
    const SPEED: f64 = 50.0;
    let segment = along_x([SPEED, 0.0, 0.0], 10.0);
    for (from, rate, end) in [(0.99, 2.5, 1.0), (0.01, -2.5, 0.0)] {
        let (mut governor, horizon) = governor_on(&segment, from, rate);
        for _ in 0..20 {
            let before = governor.rate_per_s();
            governor.relaxed(&horizon, &Steps::default());
            let jerk = SPEED * (governor.rate_per_s() - before) / PERIOD_S;
            assert!(jerk.abs() < 20_000.0, "{jerk} mm/s³ towards {end}");
        }
        assert_eq!(governor.rate_per_s().abs(), 0.0);
        let short = (governor.sigma() - end).abs();
        assert!(short <= PERIOD_S * rate.abs(), "{short} short of {end}");
    }
}

/// To come evenly to the end of the range may take more jerk than there is, though less would have done in this period: that is said.
#[test]
fn jerk_beyond_the_limit_is_told_where_only_the_end_of_the_range_asks_for_it() {
    let segment = along_x([50.0, 0.0, 0.0], 10.0);
    for (from, is_beyond) in [(0.99, true), (0.5, false)] {
        let (mut governor, horizon) = governor_on(&segment, from, 2.5);
        let chosen = governor.relaxed(&horizon, &Steps::default());
        let jerk = 50.0 * (governor.rate_per_s() - 2.5) / PERIOD_S;
        assert_eq!(jerk < -10_000.0, is_beyond, "{jerk} mm/s³ from {from}");
        assert_eq!(chosen.relaxed, is_beyond, "from {from}");
    }
}

const SIGMA: f64 = 0.5;

/// σ̈ that Y asks for, which is slow to turn round, on the way to rest from `path` along X.
fn wanted_by_y(path: [f64; 3], y: [f64; 6], rate_per_s: f64) -> f64 {
    let mut limits = limits(1000.0, 1e6);
    limits[1].jerk_mm_per_s3 = 1000.0;
    let mut segment = along_x(path, 0.2);
    segment.coefficients[1] = y;
    let ahead = Ahead::new(&segment, Some(0.0), 0, None);
    let mut horizon = Horizon::new(&limits, 2, PERIOD_S);
    horizon.fill(&ahead, PERIOD_S);
    let mut governor = Governor::new(&limits, 2, PERIOD_S);
    (governor.sigma, governor.rate_per_s) = (SIGMA, rate_per_s);
    governor.wanted_by_slowest(&to_rest_from(path), &horizon, &ahead.place(TWO_LINEAR))
}

/// Y decides how the rate goes down; of the jerk that it is to have, the plan's own is a part, as it is driven at the third power of
/// the rate.
#[test]
fn the_jerk_of_the_plan_counts_in_the_stop_of_the_slowest_axis() {
    let driven = |jerk: f64| {
        let y = [0.0, 0.5, 50.0, jerk / 6.0, 0.0, 0.0];
        SIGMA.powi(3) * jerk + 0.5 * wanted_by_y([50.0, 100.0, 0.0], y, -0.5)
    };
    let without = driven(0.0);
    assert!(without.is_finite(), "Y decides");
    for jerk in [-400.0, 400.0] {
        let with = driven(jerk);
        assert!((with - without).abs() < 1e-6, "{with}, {without}");
    }
}

/// What turns Y round is a part of its jerk too, by how fast the rate changes: from the same velocity and acceleration it is driven
/// with the same jerk.
#[test]
fn the_acceleration_of_the_plan_counts_in_the_stop_of_the_slowest_axis() {
    let driven = |turning: f64| {
        let y = [0.0, 0.5, turning / 2.0, 0.0, 0.0, 0.0];
        // Y accelerates by 20 mm/s².
        let rate_per_s = (20.0 - SIGMA * SIGMA * turning) / 0.5;
        let change = wanted_by_y([50.0, 0.0, 0.0], y, rate_per_s);
        3.0 * SIGMA * turning * rate_per_s + 0.5 * change
    };
    let without = driven(80.0);
    assert!(without.is_finite(), "Y decides");
    for turning in [81.0, 82.0, 84.0] {
        let with = driven(turning);
        let differs = (with - without).abs();
        assert!(differs < 1e-6, "{turning}: {with}, {without}");
    }
}

/// On a line the path and its axes need the same time to rest but for rounding, and of a stop in a few periods a fifth is less than one:
/// an axis decides where it needs so much more, and two periods.
#[test]
fn an_axis_decides_how_a_stop_begins_where_it_needs_clearly_longer_than_the_path() {
    let path = [50.0, 100.0, 0.0];
    let mut is_near = [false; 2];
    for n in 0..200 {
        let mut limits = limits(1e6, 1e6);
        limits[1].jerk_mm_per_s3 = 1e6 * 0.95f64.powi(n);
        let mut segment = along_x(path, 0.2);
        segment.coefficients[1] = [0.0, 0.5, 50.0, 0.0, 0.0, 0.0];
        let ahead = Ahead::new(&segment, Some(0.0), 0, None);
        let mut horizon = Horizon::new(&limits, 2, PERIOD_S);
        horizon.fill(&ahead, PERIOD_S);
        let mut governor = Governor::new(&limits, 2, PERIOD_S);
        (governor.sigma, governor.rate_per_s) = (SIGMA, -0.5);
        let (speed, along) = (SIGMA * path[0], SIGMA * SIGMA * path[1] - 0.5 * path[0]);
        let jerk = ORDER3_LIMIT_SHARE * horizon.path_jerk_to_rest(SIGMA, speed, along);
        let path_s = stop_s(speed, along, f64::INFINITY, jerk);
        let changing = SIGMA * SIGMA * 100.0 - 0.5 * 0.5;
        let jerk = ORDER3_LIMIT_SHARE * limits[1].jerk_mm_per_s3;
        let axis_s = stop_s(0.5 * SIGMA, changing, 1e6, jerk);
        let more = (axis_s - CLEARLY_LONGER * path_s) / PERIOD_S;
        let place = ahead.place(TWO_LINEAR);
        let wanted = governor.wanted_by_slowest(&to_rest_from(path), &horizon, &place);
        assert_eq!(wanted.is_finite(), more > 2.0, "{more} periods");
        is_near[usize::from(more > 2.0)] |= (more - 2.0).abs() < 2.0;
    }
    assert_eq!(is_near, [true; 2]);
}

/// Where no way is known a rate becomes constant at once, or by as much as the jerk limit allows; neither is beyond the limit.
#[test]
fn a_rate_without_a_way_becomes_constant_within_the_jerk_limit() {
    let segment = along_x([50.0, 0.0, 0.0], 0.2);
    // In a period 10 000 mm/s³ change a rate along 50 mm/s by 0.2 per second.
    let most = ORDER3_LIMIT_SHARE * 0.2;
    for (rate, expected) in [
        (0.1, 0.0),
        (-0.1, 0.0),
        (0.5, 0.5 - most),
        (-0.5, most - 0.5),
    ] {
        let (mut governor, horizon) = governor_on(&segment, 0.5, rate);
        let chosen = governor.relaxed(&horizon, &Steps::default());
        assert!(!chosen.relaxed, "{rate}");
        let found = governor.rate_per_s();
        assert!((found - expected).abs() < 1e-9, "{rate}: {found}");
    }
}

/// Where a period may change much of the rate, the end of its approach to 1 is not taken where the plan is a little faster than the feed.
#[test]
fn the_end_of_an_approach_keeps_the_feed() {
    const SPEED: f64 = 0.0255;
    let limits = limits(17_000.0, 1e6);
    let segment = along_x([SPEED, 0.0, 0.0], 10.0);
    let mut horizon = Horizon::new(&limits, 2, PERIOD_S);
    horizon.fill(&Ahead::new(&segment, Some(0.0), 0, None), PERIOD_S);
    for (over, ends_at_1) in [(1e-5, false), (-1e-5, true)] {
        let feed = SPEED * (1.0 - over);
        let aim = Aim {
            goal: Goal::run(1.0, feed, None),
            ratio: 1.0,
            kept_rate: 0.9,
            path: [SPEED, 0.0, 0.0],
        };
        let mut governor = Governor::new(&limits, 2, PERIOD_S);
        governor.jump(0.999);
        let mut at_s = 0.0;
        for _ in 0..60 {
            let ahead = Ahead::new(&segment, Some(at_s), 0, None);
            let place = ahead.place(TWO_LINEAR);
            at_s += governor
                .smooth(&aim, &horizon, place, Recent::default())
                .delta_s;
            assert!(governor.sigma() * SPEED <= feed.min(SPEED) * (1.0 + 1e-7));
        }
        assert_eq!(governor.sigma() == 1.0, ends_at_1);
    }
}

/// At half the rate on a plan of 50 mm/s that starts with this acceleration and jerk: what is driven of jerk along the path, mm/s³, by what
/// is wanted to keep a feed, mm/s, while the rate changes by `rate_per_s`.
fn wanted_path_jerk(feed: f64, rate_per_s: f64, [acceleration, jerk]: [f64; 2]) -> (f64, f64) {
    let path = [50.0, acceleration, jerk];
    let (governor, horizon) = governor_on(&along_x(path, 0.2), 0.5, rate_per_s);
    let goal = Goal::run(1.0, feed, None);
    let change = governor.wanted(
        &Aim {
            goal,
            ..to_rest_from(path)
        },
        &horizon,
    );
    let driven = 0.125 * jerk + 1.5 * rate_per_s * acceleration + 50.0 * change;
    (driven, change)
}

/// A feed that is met with the acceleration still there asks for more jerk than its approach began with, but no more than
/// so many times as much.
#[test]
fn an_approach_may_end_so_many_times_as_fast_as_it_begins() {
    // 100 mm/s² are to be gone, or to come to nothing from the other side, within a hundredth of a mm/s.
    for (feed, rate_per_s) in [(24.99, -2.0), (25.01, 2.0)] {
        let (driven, _) = wanted_path_jerk(feed, rate_per_s, [0.0, 0.0]);
        let most = APPROACH_END_FACTOR * ORDER3_LIMIT_SHARE * 10_000.0;
        let expected = -rate_per_s.signum() * most;
        assert!((driven - expected).abs() < 1.0, "{driven} of {expected}");
    }
}

/// Exactly at its feed a rate that does not change goes on so, whatever the plan's own jerk is; one that rises is brought down.
#[test]
fn at_the_feed_only_what_changes_is_changed() {
    for jerk in [-1000.0, 0.0, 1000.0] {
        assert_eq!(wanted_path_jerk(25.0, 0.0, [0.0, jerk]).1, 0.0, "{jerk}");
    }
    assert!(wanted_path_jerk(25.0, 0.5, [0.0, 0.0]).0 < -5000.0);
}

/// What is wanted from `sigma` on to a rate of 1 along a plan that starts like `path`, and what the law of the rate says.
fn wanted_and_law(sigma: f64, feed_mm_per_s: f64, path: [f64; 3]) -> (f64, f64) {
    let (governor, horizon) = governor_on(&along_x(path, 0.2), sigma, 0.0);
    let aim = Aim {
        goal: Goal::run(1.0, feed_mm_per_s, None),
        ..to_rest_from(path)
    };
    let most = ORDER3_LIMIT_SHARE * horizon.rate_change_per_s2;
    let law = governor.approach(sigma - 1.0, horizon.approach_jerk_share * most, most);
    (governor.wanted(&aim, &horizon), law)
}

/// Where no feed is asked for, and where the plan stands still, the law of the rate alone says how it comes to its aim.
#[test]
fn without_a_feed_or_a_speed_the_rate_goes_to_its_aim_by_its_own_law() {
    for path in [[50.0, 100.0, 1000.0], [50.0, 0.0, 0.0]] {
        let (wanted, law) = wanted_and_law(0.2, f64::INFINITY, path);
        assert_eq!(wanted, law, "{path:?}");
    }
    let (wanted, law) = wanted_and_law(0.2, 10.0, [0.0, 0.0, 5000.0]);
    assert_eq!(wanted, law, "from rest");
}

/// With a feed that is far the law of the rate decides near its own aim; far from that too, it only says that it is far.
#[test]
fn near_its_aim_the_rate_goes_by_its_own_law_though_the_feed_is_far() {
    let path = [50.0, 0.0, 0.0];
    let (wanted, law) = wanted_and_law(0.9999, 500.0, path);
    assert_eq!(wanted, law);
    let (wanted, law) = wanted_and_law(0.2, 500.0, path);
    assert!(wanted > law, "{wanted}, {law}");
}

/// A way that keeps a feed may begin where σ is constant, and goes on from there; any other is over there. What has begun to change goes on
/// the way that was found for it, to its end, where the rate is exactly constant.
#[test]
fn the_way_that_was_found_is_followed_to_its_end() {
    let segment = along_x([50.0, 0.0, 0.0], 0.2);
    let way = [-100.0, -50.0, 100.0, 50.0];
    for (rate_per_s, keeps_feed, is_followed) in [
        (0.0, true, true),
        (0.0, false, false),
        (-0.2, true, true),
        (-0.2, false, true),
    ] {
        let (mut governor, horizon) = governor_on(&segment, 0.9, rate_per_s);
        governor.ways.found.clear();
        governor.ways.found.keeps_feed = keeps_feed;
        for change in way {
            governor.ways.found.push(change);
        }
        for (passed, change) in way.into_iter().enumerate() {
            let before = governor.rate_per_s();
            let chosen = governor.go_on(&horizon, &Steps::default());
            assert!(!chosen.relaxed);
            let expected = match (is_followed, passed + 1 == way.len()) {
                (false, _) => before,
                (true, false) => before + change * PERIOD_S,
                (true, true) => 0.0,
            };
            assert_eq!(governor.rate_per_s(), expected, "{rate_per_s} {passed}");
        }
        assert_eq!(governor.ways.found.peek().is_none(), is_followed);
    }
}

/// A state from which the jerk `coming_in`, mm/s³, brings a speed to nothing in whole periods, mm/s and mm/s².
fn coming_in_with(coming_in: f64, periods: i32) -> [f64; 2] {
    let time_s = f64::from(periods) * PERIOD_S;
    [coming_in * time_s * time_s / 2.0, -coming_in * time_s]
}

/// A speed comes in to its feed with the share of the jerk that the horizon says, also where another state would have it come in harder.
#[test]
fn an_approach_comes_in_with_its_share_of_the_jerk() {
    for (share, periods) in [(0.97, 12), (0.8, 13), (0.5, 14)] {
        let path = [50.0, 0.0, 0.0];
        let coming_in = share * ORDER3_LIMIT_SHARE * 10_000.0;
        let [over, along] = coming_in_with(coming_in, periods);
        let (governor, mut horizon) = governor_on(&along_x(path, 0.2), 0.8, along / path[0]);
        horizon.approach_jerk_share = share;
        let aim = Aim {
            goal: Goal::run(1.0, 40.0 - over, None),
            ..to_rest_from(path)
        };
        let driven = 50.0 * governor.wanted(&aim, &horizon);
        assert!(
            (driven / coming_in - 1.0).abs() < 1e-6,
            "{driven} of {coming_in}"
        );
    }
}

/// So does a rate that no feed bounds, in small steps while it begins and in some times as large ones where it ends.
#[test]
fn a_rate_comes_in_to_its_aim_with_its_share_in_small_steps() {
    let segment = along_x([50.0, 0.0, 0.0], 0.2);
    for (share, periods) in [(0.97, 12), (0.8, 13), (0.5, 14)] {
        let (_, mut horizon) = governor_on(&segment, 0.5, 0.0);
        horizon.approach_jerk_share = share;
        let coming_in = share * ORDER3_LIMIT_SHARE * horizon.rate_change_per_s2;
        let [off, rate] = coming_in_with(coming_in, periods);
        let (governor, _) = governor_on(&segment, 0.5, rate);
        let found = governor.freely(0.5 - off, &horizon);
        assert!(
            (found / coming_in - 1.0).abs() < 1e-6,
            "{found} of {coming_in}"
        );
    }
    for hurried in [false, true] {
        for (rate, [most_down, most_up]) in [
            (-0.1, [1.0, APPROACH_END_FACTOR]),
            (0.0, [APPROACH_END_FACTOR, 1.0]),
            (0.1, [APPROACH_END_FACTOR, 1.0]),
        ] {
            let (governor, mut horizon) = governor_on(&segment, 0.5, rate);
            if hurried {
                horizon.hurry();
            }
            let small = horizon.small_change_per_s2();
            for share in [-9.0, -4.0, -1.0, -0.7, 0.0, 0.7, 1.0, 4.0, 9.0] {
                let expected = small * f64::clamp(share, -most_down, most_up);
                assert_eq!(governor.small(share * small, &horizon), expected);
            }
        }
    }
}

/// An axis that brakes harder than what is left of its velocity takes is brought to rest in two periods: behind the first its velocity is what
/// the second takes to bring its acceleration to nothing, whichever way it goes.
#[test]
fn next_to_its_rest_the_slowest_axis_is_brought_to_it_in_two_periods() {
    const JERK: f64 = 1000.0;
    let mut limits = limits(1000.0, 1e6);
    limits[1].jerk_mm_per_s3 = JERK;
    let path = [0.02, 0.0, 0.0];
    for sign in [-1.0, 1.0] {
        for (left, braking) in [(0.02, 1.0), (0.05, 1.2), (0.1, 1.4), (0.2, 1.5)] {
            let velocity = sign * left * JERK * PERIOD_S * PERIOD_S;
            let acceleration = -sign * braking * JERK * PERIOD_S;
            let mut segment = along_x(path, 0.2);
            let planned = [velocity / SIGMA, acceleration / SIGMA / SIGMA];
            segment.coefficients[1] = [0.0, planned[0], planned[1] / 2.0, 0.0, 0.0, 0.0];
            let ahead = Ahead::new(&segment, Some(0.0), 0, None);
            let mut horizon = Horizon::new(&limits, 2, PERIOD_S);
            horizon.fill(&ahead, PERIOD_S);
            let mut governor = Governor::new(&limits, 2, PERIOD_S);
            governor.jump(SIGMA);
            let place = ahead.place(TWO_LINEAR);
            let jerk =
                planned[0] * governor.wanted_by_slowest(&to_rest_from(path), &horizon, &place);
            assert!(jerk.is_finite(), "Y decides");
            let then = acceleration + PERIOD_S * jerk;
            let left = velocity + f64::midpoint(acceleration, then) * PERIOD_S;
            let off = (left + then * PERIOD_S / 2.0) / velocity;
            assert!(off.abs() < 1e-6, "{off} of {velocity} mm/s");
        }
    }
}

/// Which way an axis goes is no matter: it decides alike how a stop begins.
#[test]
fn the_slowest_axis_decides_alike_in_both_directions() {
    for (y, rate_per_s) in [
        ([0.0, 0.5, 50.0, 0.0, 0.0, 0.0], -0.5),
        ([0.0, 0.5, 40.0, 70.0, 0.0, 0.0], 0.1),
    ] {
        let path = [50.0, 100.0, 0.0];
        let wanted = wanted_by_y(path, y, rate_per_s);
        assert!(wanted.is_finite(), "Y decides");
        let mirrored = wanted_by_y(path, y.map(|c| -c), rate_per_s);
        assert_eq!(wanted, mirrored, "{y:?}");
        // It gets faster: first that is to end, with all that a stop may begin with.
        let planned = SIGMA.powi(3) * 6.0 * y[3] + 3.0 * SIGMA * 2.0 * y[2] * rate_per_s;
        let most = APPROACH_END_FACTOR * ORDER3_LIMIT_SHARE * 1000.0;
        let driven = planned + y[1] * wanted;
        assert!((driven / -most - 1.0).abs() < 1e-9, "{driven} of {most}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// A stop from constant speed on a line takes next to the shortest time, whatever the speed is; its deceleration rises,
    /// stays and falls, once each.
    #[test]
    fn a_stop_on_a_line_takes_next_to_the_shortest_time_and_comes_in_without_chatter(
        speed_digits in -1.0..2.3f64, stop_s in 0.15..1.0f64, held in 0.0..0.7f64,
    ) {
        let speed = 10f64.powf(speed_digits);
        // Of the stop the share `held` is at the highest deceleration.
        let ramp_s = stop_s * (1.0 - held) / 2.0;
        let acceleration = speed / (stop_s - ramp_s);
        let limits = limits(acceleration, acceleration / ramp_s);
        let segment = along_x([speed, 0.0, 0.0], 10.0);
        let (mut governor, mut horizon) =
            (Governor::new(&limits, 2, PERIOD_S), Horizon::new(&limits, 2, PERIOD_S));
        let (mut at_s, mut rates) = (0.0, vec![]);
        while governor.sigma() > 0.0 {
            let ahead = Ahead::new(&segment, Some(at_s), 0, None);
            horizon.fill(&ahead, PERIOD_S);
            let place = ahead.place(TWO_LINEAR);
            let aim = to_rest_from([speed, 0.0, 0.0]);
            let chosen = governor.smooth(&aim, &horizon, place, Recent::default());
            prop_assert!(!chosen.relaxed);
            at_s += chosen.delta_s;
            rates.push(governor.rate_per_s());
            prop_assert!((rates.len() as f64) * PERIOD_S < 1.05 * stop_s + 6.0 * PERIOD_S, "of {stop_s} s");
        }
        prop_assert!((rates.len() as f64) * PERIOD_S > 0.99 * stop_s);
        let most = rates.iter().copied().fold(0.0, f64::min);
        let eases = |pair: &[f64]| pair[1] > pair[0] - 1e-3 * most;
        let since = rates.windows(2).position(eases).unwrap_or(rates.len());
        for pair in rates[since..].windows(2) {
            prop_assert!(pair[1] >= pair[0] + 1e-2 * most, "it brakes anew: {pair:?} of {most}");
        }
    }

    /// Far above a speed that is asked for, the path is braked as hard on a plan that gets faster or slower by itself as on one of
    /// constant speed: of the jerk that is asked for, the plan's own is a part.
    #[test]
    fn the_jerk_of_the_plan_counts_in_what_is_asked_for(
        sigma in 0.5..1.0f64, rate in -1.0..0.0f64, speed in 50.0..100.0f64,
        acceleration in -100.0..100.0f64, jerk in -3000.0..3000.0f64,
    ) {
        let limits = limits(1000.0, 10_000.0);
        let mut governor = Governor::new(&limits, 2, PERIOD_S);
        (governor.sigma, governor.rate_per_s) = (sigma, rate);
        let driven = |[acceleration, jerk]: [f64; 2]| {
            let path = [speed, acceleration, jerk];
            let segment = along_x(path, 0.2);
            let mut horizon = Horizon::new(&limits, 2, PERIOD_S);
            horizon.fill(&Ahead::new(&segment, Some(0.0), 0, None), PERIOD_S);
            let goal = Goal::run(1.0, 0.01 * speed, None);
            let change = governor.wanted(&Aim { goal, ..to_rest_from(path) }, &horizon);
            sigma.powi(3) * jerk + 3.0 * sigma * rate * acceleration + speed * change
        };
        let (changing, constant) = (driven([acceleration, jerk]), driven([0.0, 0.0]));
        prop_assert!(constant < -9_000.0, "{constant} mm/s³");
        prop_assert!((changing - constant).abs() < 1.0, "{changing} mm/s³, {constant} at constant speed");
    }

    /// Where no way is known jerk may go beyond its limit, but by no more than it must; the end of the period counts as its start does.
    #[test]
    fn where_no_way_is_known_jerk_is_looked_at_at_both_ends_of_the_period(
        from in -0.9..0.9f64, to in -0.9..0.9f64, speed in 10.0..100.0f64,
    ) {
        const JERK: f64 = 10_000.0;
        let limits = limits(1000.0, JERK);
        let mut segment = along_x([speed, 0.0, from * JERK], 0.1);
        // Its jerk changes to that of the end within the period.
        segment.coefficients[0][4] = (to - from) * JERK / (24.0 * PERIOD_S);
        let governor = Governor::new(&limits, 2, PERIOD_S);
        let mut horizon = Horizon::new(&limits, 2, PERIOD_S);
        horizon.fill(&Ahead::new(&segment, Some(0.0), 0, None), PERIOD_S);
        let mut range = Interval::ALL;
        governor.jerks(&horizon, &Steps::default(), 0.0, &mut range);
        for (change, sign) in [(range.low, -1.0), (range.high, 1.0)] {
            let at = |share: f64| sign * (share * JERK + speed * change) / JERK;
            let most = at(from).max(at(to));
            prop_assert!((0.98..=1.02).contains(&most), "{most} of the jerk for {change}");
        }
    }

    /// Where no way is known the bounds of σ̈ are those with which an axis comes to its limits, in the period itself: the rate changes in it,
    /// by so much that its start says little of its end.
    #[test]
    fn where_no_way_is_known_both_limits_are_those_at_the_rates_of_the_period(
        sigma in 0.4..0.9f64, rate in -60.0..60.0f64, speed in 15.0..30.0f64,
        acceleration in -0.9..0.9f64, jerk in -0.5..0.5f64,
    ) {
        let path = [speed, 1000.0 * acceleration, 10_000.0 * jerk];
        let segment = along_x(path, 0.1);
        let (governor, horizon) = governor_on(&segment, sigma, rate);
        // What is driven of both with what the plan does at `at_s`, where the share `part` of the period has passed.
        let driven = |part: f64, at_s: f64, change: f64| {
            let time_s = part * PERIOD_S;
            let (sigma, rate) = (sigma + time_s * (rate + time_s * change / 2.0), rate + time_s * change);
            let [speed, acceleration, jerk] = derivatives(&segment.coefficients[0], at_s);
            let jerked = sigma.powi(3) * jerk + 3.0 * sigma * rate * acceleration + speed * change;
            [(sigma * sigma * acceleration + rate * speed).abs(), jerked.abs()]
        };
        let mut range = Interval::ALL;
        governor.accelerations(&horizon, &Steps::default(), &mut range);
        for change in [range.low, range.high] {
            let share = [0.0, PERIOD_S].map(|at_s| driven(1.0, at_s, change)[0] / 1000.0);
            let highest = share[0].max(share[1]);
            prop_assert!((0.98..1.02).contains(&highest), "{share:?} of the acceleration for {change}");
        }
        let mut range = Interval::ALL;
        governor.jerks(&horizon, &Steps::default(), 0.0, &mut range);
        if !range.is_empty() {
            for change in [range.low, range.high] {
                let share = [0.0, 1.0].map(|part| driven(part, part * PERIOD_S, change)[1] / 10_000.0);
                let highest = share[0].max(share[1]);
                prop_assert!((0.93..1.07).contains(&highest), "{share:?} of the jerk for {change}");
            }
        }
    }
}
