//! The follower of a plan on its own, on one axis.

use rtrb::RingBuffer;
use tandem_rings::Queued;
use tandem_sdk::{AxisLimits, AxisVector, Limits, Segment, SegmentFlags};

use super::*;

const PERIOD_S: f64 = 0.001;
const ACCELERATION: f64 = 1000.0;
const JERK: f64 = 20_000.0;

/// X along this path at a programmed feed.
fn segment(path: [f64; 6], feed_mm_per_s: f64, duration_s: f64) -> Segment {
    let mut segment = Segment::rest(&AxisVector::ZERO, duration_s);
    segment.coefficients[0] = path;
    segment.path = path;
    segment.feed_mm_per_s = feed_mm_per_s;
    segment.flags = SegmentFlags::default();
    segment
}

/// In front of these segments, on a machine that is planned at twice the feed.
fn follower(order: u32, segments: &[Segment]) -> PlanFollower {
    let axis = AxisLimits {
        min_mm: -1000.0,
        max_mm: 1000.0,
        feed_mm_per_s: 1000.0,
        rapid_mm_per_s: 1000.0,
        acceleration_mm_per_s2: ACCELERATION,
        jerk_mm_per_s3: JERK,
        speed_difference_mm_per_s: 0.0,
    };
    let config = FineConfig {
        order,
        max_feed_ratio: 2.0,
        ..FineConfig::new(PERIOD_S, Limits::new(&[axis]).unwrap())
    };
    let (mut input, output) = RingBuffer::new(16);
    let mut start_s = 0.0;
    for segment in segments {
        let queued = Queued::Segment {
            start_s,
            segment: *segment,
        };
        input.push(queued).unwrap();
        start_s += segment.duration_s;
    }
    PlanFollower::new(&config, Cursor::new(output, &AxisVector::ZERO))
}

fn request(ask: Ask) -> Request {
    Request {
        ask,
        ratios: AT_THE_FEED,
        single_block: false,
        max_rate: 1.0,
        stop_deceleration_mm_per_s2: ACCELERATION,
    }
}

const AT_THE_FEED: Ratios = Ratios {
    feed: 1.0,
    mean_feed: 1.0,
    rapid: 1.0,
};

#[test]
fn halving_finds_the_highest_rate_that_is_kept_and_gives_that_one_up_where_none_is() {
    let mut follower = follower(2, &[]);
    for highest in [0.01, 0.3, 0.5, 0.77] {
        let found = follower.kept_by_halving(0.8, |_, sigma| sigma <= highest);
        assert!(found <= highest && highest - found < 1e-6, "{found}");
    }
    assert_eq!(follower.kept_by_halving(0.8, |_, _| false), 0.8);
    assert!(follower.kept_by_halving(0.8, |_, _| true) > 0.799_999);
}

/// The plan gets from rest to rest in a period, in the mean twice as fast as the feed: v = 12·F·τ·(1 − τ) at the share τ of it. At a
/// rate below 1 its end is the faster place: 12·σ²·(1 − σ) of the feed.
#[test]
fn a_rate_from_rest_keeps_the_feed_at_its_end_and_in_its_mean() {
    let feed = 10.0;
    let (first, second) = (12.0 * feed / PERIOD_S, 12.0 * feed / PERIOD_S / PERIOD_S);
    let bump = segment(
        [0.0, 0.0, first / 2.0, -second / 3.0, 0.0, 0.0],
        feed,
        PERIOD_S,
    );
    let mut follower = follower(2, &[bump, segment([0.0; 6], feed, 1.0)]);
    let sigma = follower.kept_from_rest(1.0, &AT_THE_FEED, f64::INFINITY);
    let share = 12.0 * sigma * sigma * (1.0 - sigma);
    assert!(
        (share - 1.0).abs() < 1e-5 && sigma < 0.4,
        "{sigma}: {share}"
    );
}

/// The plan has 1 mm/s at the end of its first period, by constant acceleration or by constant jerk: the rate from rest is as high as keeps
/// the feed there.
#[test]
fn a_rate_from_rest_is_as_high_as_keeps_the_feed() {
    let second = 1.0 / (2.0 * PERIOD_S);
    let third = 1.0 / (3.0 * PERIOD_S * PERIOD_S);
    for (path, power) in [
        ([0.0, 0.0, second, 0.0, 0.0, 0.0], 2),
        ([0.0, 0.0, 0.0, third, 0.0, 0.0], 3),
    ] {
        for feed in [0.01, 0.1, 0.5] {
            let mut follower = follower(2, &[segment(path, feed, 1.0)]);
            let sigma = follower.ratio_from_rest(&AT_THE_FEED, f64::INFINITY);
            let share = sigma.powi(power) / feed;
            // What its logarithm is off by is halved in each round.
            let least = feed.powf(2.0 * 0.5f64.powf(REST_ROUNDS.into()));
            assert!(
                share > 0.999 * least && share < 1.0 + 1e-9,
                "{share} of {feed}"
            );
        }
    }
}

/// Under constant acceleration the speed after some periods grows with the rate too: at the geometric mean of two rates it is kept.
#[test]
fn a_rate_to_begin_with_is_as_high_as_keeps_the_feed_for_some_periods() {
    for feed in [0.5, 2.0, 5.0] {
        let mut follower = follower(3, &[segment([0.0, 0.0, 500.0, 0.0, 0.0, 0.0], feed, 1.0)]);
        follower.governor.jump(1.0);
        follower.begin_below(&AT_THE_FEED);
        let soon_s = f64::from(BEGINNING_PERIODS) * PERIOD_S;
        let highest = (feed / (ACCELERATION * soon_s)).sqrt();
        let sigma = follower.governor.sigma();
        assert!(
            sigma <= highest && sigma > 0.99 * highest,
            "{sigma}, {highest}"
        );
        follower.governor.jump(0.5 * highest);
        follower.begin_below(&AT_THE_FEED);
        assert_eq!(follower.governor.sigma(), 0.5 * highest);
    }
}

/// Without a jerk limit no more program time passes while slowing down than at the present rate; with one it may.
#[test]
fn what_lies_beyond_a_period_at_the_present_rate_counts_only_where_it_may_be_reached() {
    for (order, ask, share) in [
        (2, Ask::Run, 1.0),
        (2, Ask::Hold, 0.5),
        (2, Ask::Stop, 0.5),
        (2, Ask::Starve, 0.5),
        (3, Ask::Run, 1.0),
        (3, Ask::Hold, 1.0),
    ] {
        let mut follower = follower(order, &[segment([0.0, 5.0, 0.0, 0.0, 0.0, 0.0], 10.0, 1.0)]);
        follower.cursor.advance(0.1, |_| false);
        follower.governor.jump(0.5);
        follower.govern(request(ask));
        let covered = follower.points.covered_s / PERIOD_S;
        assert!((covered - share).abs() < 1e-9, "{order} {ask:?}: {covered}");
    }
}

/// At twice the feed of a line, next to one of a higher feed that begins within the period: the rate does not rise before it has begun.
#[test]
fn the_feed_of_a_line_counts_to_its_end() {
    let line = |feed| segment([0.0, 20.0, 0.0, 0.0, 0.0, 0.0], feed, 1.0);
    for (left, feeds) in [(0.3, [10.0, 15.0]), (0.3, [10.0, 10.0])] {
        let mut follower = follower(3, &feeds.map(line));
        follower.cursor.advance(1.0 - left * PERIOD_S, |_| false);
        follower.governor.jump(0.5);
        let delta_s = follower.govern(request(Ask::Run)).delta_s;
        assert!(
            delta_s <= 0.5 * PERIOD_S * (1.0 + 1e-9),
            "{feeds:?}: {delta_s}"
        );
        assert!(delta_s > 0.49 * PERIOD_S, "{feeds:?}: {delta_s}");
    }
    // Behind the border it rises.
    let mut follower = follower(3, &[10.0, 15.0].map(line));
    follower.cursor.advance(1.0 + 0.1 * PERIOD_S, |_| false);
    follower.governor.jump(0.5);
    assert!(follower.govern(request(Ask::Run)).delta_s > 0.5 * PERIOD_S * (1.0 + 1e-6));
}

/// Where the axes go a longer way than the path coordinate says, by a margin more than that; not where that is no measure of it.
#[test]
fn the_way_of_a_period_is_longer_by_what_the_axes_go_beyond_the_path() {
    const SLIGHTLY: f64 = f64::midpoint(1.0, MAX_LONGER);
    for (x_speed, expected) in [
        (10.0, 1.0),
        (
            10.0 * SLIGHTLY,
            1.0 + (1.0 + LONGER_MARGIN) * (SLIGHTLY - 1.0),
        ),
        (10.0 * MAX_LONGER + 1.0, 1.0),
    ] {
        let mut line = segment([1.0, 10.0, 0.0, 0.0, 0.0, 0.0], 10.0, 1.0);
        line.coefficients[0][1] = x_speed;
        let mut follower = follower(2, &[line]);
        follower.cursor.advance(0.1, |_| false);
        follower.governor.jump(0.5);
        let longer = follower.longer();
        assert!((longer - expected).abs() < 1e-9, "{x_speed}: {longer}");
    }
    // From 10 mm/s on the axis gets faster than the path: of a period at half the rate that is 0.003, and a whole one sees twice of it.
    for (sigma, more) in [(0.5, 0.003), (1.0, 0.006)] {
        let mut line = segment([1.0, 10.0, 0.0, 0.0, 0.0, 0.0], 10.0, 1.0);
        line.coefficients[0] = [0.6, -2.0, 60.0, 0.0, 0.0, 0.0];
        let mut follower = follower(2, &[line]);
        follower.cursor.advance(0.1, |_| false);
        follower.governor.jump(sigma);
        let longer = follower.longer();
        let expected = 1.0 + (1.0 + LONGER_MARGIN) * more;
        assert!((longer - expected).abs() < 1e-6, "{sigma}: {longer}");
    }
}

/// The plan gets from 5 to 6 mm/s in a period, by way of 5.5 in the mean; the feed is 5.2.
#[test]
fn a_period_is_asked_for_its_end_and_for_its_mean() {
    let line = segment([0.0, 4.0, 500.0, 0.0, 0.0, 0.0], 5.2, 1.0);
    let mut follower = follower(2, &[line]);
    follower.cursor.advance(0.001, |_| false);
    for (delta_s, end, mean) in [(0.001, 6.0, 5.5), (0.000_5, 5.5, 5.25), (0.0, 5.2, 5.2)] {
        let asked = follower.asked_of_period(delta_s, &AT_THE_FEED, f64::INFINITY);
        assert!((asked.at_end - 5.2 / end).abs() < 1e-6, "{}", asked.at_end);
        assert!((asked.mean - 5.2 / mean).abs() < 1e-6, "{}", asked.mean);
    }
    let asked = follower.asked_of_period(
        0.0,
        &Ratios {
            mean_feed: 0.5,
            ..AT_THE_FEED
        },
        f64::INFINITY,
    );
    assert!((asked.mean - 2.6 / 5.0).abs() < 1e-9, "{}", asked.mean);
    let asked = follower.asked_of_period(0.001, &AT_THE_FEED, 3.0);
    assert!((asked.at_end - 3.0 / 6.0).abs() < 1e-9, "{}", asked.at_end);
}

/// With a jerk limit nothing is asked of the speed until braking may wait no longer.
#[test]
fn braking_for_a_place_ahead_waits_until_it_has_to_begin() {
    let mut follower = follower(3, &[segment([0.0, 20.0, 0.0, 0.0, 0.0, 0.0], 20.0, 1.0)]);
    follower.cursor.advance(0.1, |_| false);
    follower.request = request(Ask::Run);
    follower.horizon.fill(&follower.cursor.ahead(), PERIOD_S);
    for end in [0.0, 5.0, 12.0] {
        let way_mm = follower.along().way_to_mm(end);
        let soon_mm = PERIOD_S * (BRAKING_PERIODS * 20.0 + SETTLING_PERIODS * end);
        let begins_mm = follower.cursor.path_mm() + way_mm + soon_mm;
        assert!(way_mm > 1e-3, "{way_mm}");
        assert_eq!(
            follower.speed_towards(&follower.along(), begins_mm + 1e-6, end),
            f64::INFINITY
        );
        assert_eq!(
            follower.speed_towards(&follower.along(), begins_mm - 1e-6, end),
            end
        );
    }
}

/// With a jerk limit the speed that is there a period later decides how soon that is; what gets slower is as fast as now.
#[test]
fn braking_for_a_place_ahead_counts_on_what_the_speed_gains_in_a_period() {
    let mut follower = follower(3, &[segment([0.0, 20.0, 0.0, 0.0, 0.0, 0.0], 20.0, 1.0)]);
    follower.cursor.advance(0.1, |_| false);
    follower.request = request(Ask::Run);
    follower.horizon.fill(&follower.cursor.ahead(), PERIOD_S);
    for (acceleration, speed_a_period_later) in [(500.0, 20.5), (-500.0, 20.0)] {
        let along = Along {
            acceleration_mm_per_s2: acceleration,
            ..follower.along()
        };
        let soon_mm = BRAKING_PERIODS * PERIOD_S * speed_a_period_later;
        let begins_mm = follower.cursor.path_mm() + along.way_to_mm(0.0) + soon_mm;
        let towards = |off_mm: f64| follower.speed_towards(&along, begins_mm + off_mm, 0.0);
        assert_eq!([-1e-6, 1e-6].map(towards), [0.0, f64::INFINITY]);
    }
}

/// Less is asked for than the whole rate where a lower feed ahead is met: its share of what is planned here.
#[test]
fn a_lower_feed_ahead_asks_for_its_share_of_the_speed() {
    let at_its_feed = |speed: f64| segment([0.0, speed, 0.0, 0.0, 0.0, 0.0], speed, 1.0);
    let mut follower = follower(2, &[at_its_feed(20.0), at_its_feed(10.0)]);
    follower.cursor.advance(0.99, |_| false);
    follower.request = request(Ask::Run);
    follower.speed_for_places(&AT_THE_FEED, None);
    assert_eq!(follower.chosen.least_asked, 0.5);
}

/// The plan is twice as fast as the feed: the rate is to be low there where a lower one than planned is asked for, and only there.
#[test]
fn feeds_ahead_are_looked_at_where_less_is_asked_for_than_is_planned() {
    let line = segment([0.0, 20.0, 0.0, 0.0, 0.0, 0.0], 10.0, 1.0);
    let mut follower = follower(2, &[line]);
    follower.cursor.advance(0.1, |_| false);
    let planned = Ratios {
        feed: 2.0,
        mean_feed: 2.0,
        ..AT_THE_FEED
    };
    for (ratios, rate) in [(AT_THE_FEED, 0.5), (planned, 1.0), (AT_THE_FEED, 0.5)] {
        follower.look_at_feeds(&ratios);
        let found = follower.governor.rate_in_time(0.001);
        assert!((found - rate).abs() < 1e-6, "{ratios:?}: {found}");
    }
}

/// A rapid that is driven at half of its speed was asked for so, until it is; where nothing was, a lower rate is unasked.
#[test]
fn a_rate_that_a_lower_ratio_of_rapids_asks_for_is_not_unasked() {
    let mut rapid = segment([0.0, 20.0, 0.0, 0.0, 0.0, 0.0], 20.0, 1.0);
    rapid.flags = SegmentFlags::RAPID;
    for order in [2, 3] {
        for (ratio, is_unasked) in [(0.5, false), (1.0, true)] {
            let mut follower = follower(order, &[rapid]);
            follower.cursor.advance(0.1, |_| false);
            follower.governor.jump(0.6);
            let ratios = Ratios {
                feed: 2.0,
                mean_feed: 2.0,
                rapid: ratio,
            };
            let chosen = follower.govern(Request {
                ratios,
                ..request(Ask::Run)
            });
            assert_eq!(chosen.is_unasked, is_unasked, "{order} {ratio}");
            let sigma = follower.governor.sigma();
            assert_eq!(sigma > 0.6, is_unasked, "{order} {ratio}: {sigma}");
        }
    }
}

/// A queue that is too short for the whole rate is the cause where the machine is slower for it, and not where it is held.
#[test]
fn the_queue_limits_a_rate_where_it_is_lower_for_it_and_nothing_stops_the_machine() {
    let line = segment([0.0, 20.0, 0.0, 0.0, 0.0, 0.0], 20.0, 1.0);
    for order in [2, 3] {
        for (ask, max_rate, is_limited) in [
            (Ask::Run, 0.5, true),
            (Ask::Run, 1.0, false),
            (Ask::Hold, 0.5, false),
        ] {
            let mut follower = follower(order, &[line]);
            follower.cursor.advance(0.1, |_| false);
            follower.governor.jump(0.6);
            let chosen = follower.govern(Request {
                max_rate,
                ..request(ask)
            });
            assert_eq!(chosen.is_queue_limited, is_limited, "{order} {max_rate}");
        }
    }
}

/// At twice the feed: what a period begins with is in its mean, and does not make up for its end.
#[test]
fn the_feed_is_kept_where_it_is_at_the_end_of_a_period_and_in_its_mean() {
    for (from, to, is_kept) in [
        (0.5, 0.5, true),
        (0.2, 0.4, true),
        (0.8, 0.4, false),
        (0.2, 0.6, false),
        (0.6, 0.6, false),
    ] {
        let line = segment([0.0, 10.0, 0.0, 0.0, 0.0, 0.0], 5.0, 1.0);
        let mut follower = follower(2, &[line]);
        follower.cursor.advance(0.1, |_| false);
        follower.governor.jump(from);
        let found = follower.is_feed_kept(to, &AT_THE_FEED);
        assert_eq!(found, is_kept, "from {from} to {to}");
    }
}

/// A feed is the speed of rotary axes only on a machine that has some: what is limited beside the axes is none.
#[test]
fn only_axes_of_the_machine_are_rotary() {
    let mut limits = AxisLimits::unlimited();
    limits.acceleration_mm_per_s2 = ACCELERATION;
    for (linear, rotary) in [(0b111, 0), (0b011, 0b100), (0, 0b111)] {
        let config = FineConfig {
            linear,
            ..FineConfig::new(PERIOD_S, Limits::new(&[limits; 3]).unwrap())
        };
        let cursor = Cursor::new(RingBuffer::new(1).1, &AxisVector::ZERO);
        assert_eq!(PlanFollower::new(&config, cursor).axes.rotary, rotary);
    }
}

/// A stop has most of the deceleration that the queue leaves, in proportion to it.
#[test]
fn a_stop_brakes_with_a_share_of_what_the_queue_leaves() {
    let mut follower = follower(2, &[]);
    let mut brakes_with = |stop_deceleration_mm_per_s2: f64| {
        follower.request = Request {
            stop_deceleration_mm_per_s2,
            ..request(Ask::Stop)
        };
        follower.along().max_mm_per_s2 / stop_deceleration_mm_per_s2
    };
    let share = brakes_with(1000.0);
    assert!((0.9..1.0).contains(&share), "{share}");
    assert!((brakes_with(1.0) - share).abs() < 1e-9);
}

/// The plan passes a hump within the period that begins at the feed: it is to end so low that its mean keeps the feed.
#[test]
fn a_period_that_begins_at_the_feed_keeps_it_in_its_mean() {
    // From 10 mm/s by way of 13 mm/s to 10 mm/s.
    let hump = segment([0.0, 10.0, 6000.0, -4e6, 0.0, 0.0], 10.0, 0.0012);
    let mut follower = follower(2, &[hump]);
    follower.cursor.advance(1e-9, |_| false);
    let sigma = follower.ratio_target(&AT_THE_FEED, f64::INFINITY);
    let way_mm = hump.path_mm(f64::midpoint(1.0, sigma) * PERIOD_S);
    let mean_mm_per_s = way_mm / PERIOD_S;
    assert!((9.8..10.01).contains(&mean_mm_per_s), "{mean_mm_per_s}");
}

/// At the ratio that it is made for a plan says by itself how fast it is: neither the feed nor the way of the axes slows it.
#[test]
fn at_the_ratio_of_the_plan_its_own_speed_is_driven() {
    let planned = Ratios {
        feed: 2.0,
        mean_feed: 2.0,
        rapid: 1.0,
    };
    // A little beyond twice the feed, as a fit leaves it; and the axes by as little beyond the path.
    let mut line = segment([1.0, 20.1, 0.0, 0.0, 0.0, 0.0], 10.0, 1.0);
    line.coefficients[0][1] = 20.2;
    for (order, rapid) in [(2, 1.0), (2, 0.9), (3, 1.0), (3, 0.9)] {
        let mut follower = follower(order, &[line]);
        follower.cursor.advance(0.1, |_| false);
        follower.governor.jump(0.98);
        for _ in 0..100 {
            let chosen = follower.govern(Request {
                ratios: Ratios { rapid, ..planned },
                ..request(Ask::Run)
            });
            let delta_s = chosen.delta_s;
            follower.cursor.advance(delta_s, |_| false);
        }
        let sigma = follower.governor.sigma();
        assert_eq!(sigma, 1.0, "{order}, rapids at {rapid}");
    }
}

/// The plan goes on at its own rate without a look ahead only where nothing asks for another one.
#[test]
fn a_plan_runs_as_it_is_where_nothing_asks_for_less() {
    let line = segment([0.0, 20.0, 0.0, 0.0, 0.0, 0.0], 20.0, 1.0);
    let mut follower = follower(3, &[line]);
    follower.cursor.advance(0.1, |_| false);
    let full = request(Ask::Run);
    let slower_rapids = Ratios {
        rapid: 0.9,
        ..AT_THE_FEED
    };
    for (request, below, ratios, sigma, runs) in [
        (full, false, AT_THE_FEED, 1.0, true),
        (full, false, AT_THE_FEED, 0.9, false),
        (full, true, AT_THE_FEED, 1.0, false),
        (full, false, slower_rapids, 1.0, false),
        (request(Ask::Hold), false, AT_THE_FEED, 1.0, false),
        (request(Ask::Starve), false, AT_THE_FEED, 1.0, false),
        (
            Request {
                single_block: true,
                ..full
            },
            false,
            AT_THE_FEED,
            1.0,
            false,
        ),
        (
            Request {
                max_rate: 0.9,
                ..full
            },
            false,
            AT_THE_FEED,
            1.0,
            false,
        ),
    ] {
        follower.request = request;
        follower.governor.jump(sigma);
        follower.points.fill(&follower.cursor.ahead(), PERIOD_S);
        let found = follower.runs_as_planned(request.ask, below, &ratios);
        assert_eq!(found, runs, "{request:?} {below} {ratios:?} at {sigma}");
    }
}

/// From rest to rest in so many periods, in the mean so many times as fast as the feed: at the rate to begin with neither the end of a period nor
/// its mean is beyond the feed, whether it ends on the way or at the rest behind it.
#[test]
fn a_rate_to_begin_with_keeps_the_feed_on_a_way_that_is_over_within_a_few_periods() {
    let feed = 10.0;
    for (lasts, mean) in [0.5, 0.9, 1.0, 1.7, 2.5, 3.3, 4.9]
        .into_iter()
        .flat_map(|lasts| [1.1, 1.6, 2.0, 5.0, 30.0].map(|mean| (lasts, mean)))
    {
        let duration_s = lasts * PERIOD_S;
        let first = 6.0 * mean * feed / duration_s;
        let path = [0.0, 0.0, first / 2.0, -first / duration_s / 3.0, 0.0, 0.0];
        let bump = segment(path, feed, duration_s);
        let mut rest = segment([0.0; 6], feed, 1.0);
        rest.path[0] = bump.path_mm(duration_s);
        let mut steep = follower(2, &[bump, rest]);
        let sigma = steep.ratio_from_rest(&AT_THE_FEED, f64::INFINITY);
        let asked = steep.asked_of_period(sigma * PERIOD_S, &AT_THE_FEED, f64::INFINITY);
        let most = asked.at_end.min(asked.mean) * (1.0 + 1e-6);
        assert!(
            sigma > 0.0 && sigma <= most,
            "{lasts} {mean}: {sigma} of {most}"
        );
        let mut follower = follower(3, &[bump, rest]);
        follower.governor.jump(1.0);
        follower.begin_below(&AT_THE_FEED);
        let sigma = follower.governor.sigma();
        assert!(sigma > 0.0);
        let at = |periods: f64| (periods * sigma * PERIOD_S).min(duration_s);
        for period in (1..=BEGINNING_PERIODS).map(f64::from) {
            let way_mm = bump.path_mm(at(period)) - bump.path_mm(at(period - 1.0));
            let end_mm_per_s = sigma * bump.path_speed_mm_per_s(at(period));
            let fastest = end_mm_per_s.max(way_mm / PERIOD_S);
            assert!(
                fastest <= feed * (1.0 + 1e-6),
                "{fastest} in period {period} of a way of {lasts}, {mean} times as fast: {sigma}"
            );
        }
    }
}

/// The feed falls with every segment of 6 ms: those that a stop from here may have to be over before are looked for, and those far behind
/// are left for later.
#[test]
fn lower_feeds_are_looked_for_as_far_as_a_stop_and_a_few_periods_go() {
    let segments: Vec<_> = (0..15)
        .map(|number| {
            let speed_mm_per_s = 20.0;
            let from_mm = speed_mm_per_s * 0.006 * f64::from(number);
            let path = [from_mm, speed_mm_per_s, 0.0, 0.0, 0.0, 0.0];
            segment(path, 20.0 - f64::from(number), 0.006)
        })
        .collect();
    for deceleration in [400.0, 1000.0, 4000.0] {
        let mut follower = follower(2, &segments);
        follower.cursor.advance(0.003, |_| false);
        follower.request = Request {
            stop_deceleration_mm_per_s2: deceleration,
            ..request(Ask::Run)
        };
        follower.speed_for_places(&AT_THE_FEED, None);
        let seen = follower.slowdowns.to_meet(0.0, f64::INFINITY).count();
        let stop_s = 20.0 / deceleration + ACCELERATION / JERK;
        let periods = (0.006 * seen as f64 - 0.003 - stop_s) / PERIOD_S;
        let all = seen + 1 == segments.len();
        assert!(
            all || (0.0..16.0).contains(&(periods + 6.0)),
            "{deceleration}: {seen}, {periods} periods"
        );
        assert_eq!(all, deceleration == 400.0, "{seen} of them");
    }
}

/// With a jerk limit a stop at the end of a line is sought by itself: what is asked of the speed is rest, once next to nothing is left.
#[test]
fn at_the_end_of_a_line_next_to_nothing_is_left_before_the_speed_is_to_be_none() {
    let mut follower = follower(3, &[segment([7.0, 20.0, 0.0, 0.0, 0.0, 0.0], 20.0, 1.0)]);
    follower.cursor.advance(0.1, |_| false);
    for (left_mm, asked) in [
        (1.0, f64::INFINITY),
        (1.01 * AT_LINE_END_MM, f64::INFINITY),
        (0.99 * AT_LINE_END_MM, 0.0),
        (0.0, 0.0),
    ] {
        let end = EndOfLine {
            path_mm: follower.cursor.path_mm() + left_mm,
            stop_deceleration_mm_per_s2: ACCELERATION,
        };
        assert_eq!(follower.speed_to_rest(&end), asked, "{left_mm} mm");
    }
}

/// A rapid is no feed: at half of the feed it is driven as it is planned, and slower only where rapids are.
#[test]
fn a_lower_ratio_of_feeds_does_not_slow_a_rapid() {
    let mut rapid = segment([0.0, 20.0, 0.0, 0.0, 0.0, 0.0], 10.0, 1.0);
    rapid.flags = SegmentFlags::RAPID;
    for order in [2, 3] {
        for ratio in [1.0, 0.6] {
            let mut follower = follower(order, &[rapid]);
            follower.cursor.advance(0.1, |_| false);
            follower.governor.jump(0.95);
            for _ in 0..150 {
                let ratios = Ratios {
                    rapid: ratio,
                    ..AT_THE_FEED
                };
                let chosen = follower.govern(Request {
                    ratios,
                    ..request(Ask::Run)
                });
                let delta_s = chosen.delta_s;
                follower.cursor.advance(delta_s, |_| false);
            }
            let sigma = follower.governor.sigma();
            assert!((sigma - ratio).abs() < 1e-6, "{order} {ratio}: {sigma}");
        }
    }
}

/// A hundred metres on, the way of a period of next to nothing is known to a few digits: what rounding makes of a plan at the feed is not
/// too fast.
#[test]
fn the_rounding_of_a_long_path_is_not_above_the_feed() {
    let mut follower = follower(2, &[segment([1e5, 10.0, 0.0, 0.0, 0.0, 0.0], 10.0, 1.0)]);
    for number in 1..500 {
        follower.cursor.advance(1e-3, |_| false);
        let delta_s = 3.7e-9 * f64::from(number);
        let asked = follower.asked_of_period(delta_s, &AT_THE_FEED, f64::INFINITY);
        assert_eq!(asked.mean, 1.0, "{delta_s} s");
    }
}

/// The path gets twice as fast as the feed behind the second piece, and the axis has not enough to lower the rate in it alone: at the end of
/// the period the rate is low enough for what comes, wherever in the pieces that is.
#[test]
fn a_period_that_is_laid_out_in_pieces_ends_low_enough_for_what_is_ahead() {
    let mut lowered = 0;
    for shares in [[0.4, 0.3], [0.2, 0.6], [0.1, 0.9], [0.55, 0.2]] {
        let mut from_mm = 0.0;
        let segments = [(5.0, shares[0]), (5.0, shares[1]), (20.0, 100.0)].map(|(speed, share)| {
            let duration_s = share * PERIOD_S;
            let mut piece = segment([from_mm, speed, 0.0, 0.0, 0.0, 0.0], 10.0, duration_s);
            piece.coefficients[0] = [0.0, 5.0, 0.0, 0.0, 0.0, 0.0];
            from_mm += speed * duration_s;
            piece
        });
        let mut follower = follower(2, &segments);
        follower.cursor.advance(1e-9, |_| false);
        follower.look_at_feeds(&AT_THE_FEED);
        let begins = follower.governor.rate_in_time(0.0);
        follower.governor.jump(begins);
        let ahead = follower.cursor.ahead();
        follower.points.fill(&ahead, PERIOD_S);
        let bounds = Bounds {
            ratios: &AT_THE_FEED,
            way_speed_mm_per_s: f64::INFINITY,
            limit: 1.0,
        };
        let points = &mut follower.points;
        let laid = Laid::out(&ahead, &follower.governor, points, PERIOD_S, &bounds);
        let most = follower.governor.rate_in_time(laid.passed_s);
        assert!(laid.sigma <= 1.03 * most, "{shares:?}: {laid:?}, {most}");
        lowered += usize::from(laid.sigma < begins - 0.05);
    }
    assert!(lowered > 2, "{lowered}");
}

/// What is asked for at the least is the share of the planned feed, or the ratio of rapids where that is less, or what the queue allows.
#[test]
fn the_least_that_is_asked_for_is_a_share_of_what_is_planned() {
    let line = segment([0.0, 20.0, 0.0, 0.0, 0.0, 0.0], 10.0, 1.0);
    for order in [2, 3] {
        for (feed, rapid, max_rate, asked) in [
            (2.0, 1.0, 1.0, 1.0),
            (1.5, 1.0, 1.0, 0.75),
            (0.5, 1.0, 1.0, 0.25),
            (1.5, 0.4, 1.0, 0.4),
            (1.5, 1.0, 0.3, 0.3),
        ] {
            let mut follower = follower(order, &[line]);
            follower.cursor.advance(0.1, |_| false);
            let ratios = Ratios {
                feed,
                mean_feed: feed,
                rapid,
            };
            let chosen = follower.govern(Request {
                ratios,
                max_rate,
                ..request(Ask::Run)
            });
            assert_eq!(
                chosen.least_asked, asked,
                "{order}: {feed} {rapid} {max_rate}"
            );
        }
    }
}

/// Standing inside the plan, at twice the feed: the period may end at the rate that keeps it, and at no higher one.
#[test]
fn from_a_standstill_inside_the_plan_the_rate_is_as_high_as_keeps_the_feed() {
    let line = segment([0.0, 10.0, 0.0, 0.0, 0.0, 0.0], 5.0, 1.0);
    let mut follower = follower(2, &[line]);
    follower.cursor.advance(0.1, |_| false);
    follower.governor.jump(0.0);
    let kept = follower.kept_from_standstill(0.9, &AT_THE_FEED);
    assert!((kept - 0.5).abs() < 1e-6, "{kept}");
}
