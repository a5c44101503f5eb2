//! A way on which the feed is kept to its end. A change of the rate of program time is begun only where there is one: no later
//! sample is then beyond the feed, whatever the plan does in between.
//!
//! From the end of the period on σ either becomes constant, at a rate at which no place ahead is too fast, or it is lowered
//! as far as the limits allow, until it is constant at the rate at which the plan keeps the feed everywhere. Either is tried
//! out on the queued plan period by period, with the same bounds as the period that is driven. So it does not matter that an
//! axis which turns leaves nothing to lower σ with just before the plan is too fast: a rate from which it would have to be
//! lowered there is never reached. The way that was found is kept, and is gone where the next period finds no better one.

use super::Aim;
use super::interval::Interval;
use super::keep_limits::{RateState, WaySearch, nearest_with_way};
use super::tuning::{
    FEED_POINT_MIN_RATE, FEED_POINT_SPACING, FEED_WAY_LANDING_SHARE, FEED_WAY_PERIODS,
    FEED_WAY_RAMPS, FEED_WAY_SINGLE_PERIODS, FEED_WAY_STEPS, MAX_LOWERING,
};
use crate::horizon::Horizon;
use crate::plan_ahead::{Pace, PlanCursor};

/// Tries between the σ̈ wanted and the one that lowers σ as far as the limits allow.
const HALVINGS: u32 = 3;
/// Places ahead at which a constant rate is looked at.
const PLACES: usize = 48;
/// Rates with which it may begin from rest.
const BEGINNINGS: u32 = 5;
/// How often the feed is looked at in a step of a way that lasts for as many periods or more.
const LOOKS: u32 = 4;
/// Relative tolerance on the feed.
const TOLERANCE: f64 = 1e-7;

/// Which speed is to be kept ahead.
#[derive(Debug)]
pub(super) struct Below<'a> {
    /// Share of the programmed feeds.
    ratio: f64,
    /// Rate at which the plan keeps that share wherever it is.
    pub kept_rate: f64,
    /// The highest rates at places ahead, nearest first. Each is looked at when it is first asked for.
    most: [f64; PLACES],
    seen: usize,
    place: PlanCursor<'a>,
    /// The speed at the last one seen, as a share of the one asked for.
    begun: Option<f64>,
    /// Program time from the last one seen to the next, s.
    step_s: f64,
    /// Steps on ways that may still be tried in this period.
    steps_left: u32,
}

impl<'a> Below<'a> {
    /// What is asked for, from `here` on.
    pub(super) fn new(aim: &Aim, here: &RateState<'a>, period_s: f64) -> Self {
        let mut place = here.place;
        place.go(period_s * here.sigma);
        Self {
            ratio: aim.ratio,
            kept_rate: aim.kept_rate,
            most: [0.0; PLACES],
            seen: 0,
            place,
            begun: None,
            step_s: period_s * here.sigma.max(FEED_POINT_MIN_RATE),
            steps_left: 0,
        }
    }

    /// The highest rate from the place before to the one of this number; `None` after the last, and where nothing moves there.
    fn rate_at(&mut self, number: usize) -> Option<f64> {
        if number == self.seen && number < PLACES {
            self.most[number] = self.most_on_the_way()?;
            self.step_s *= FEED_POINT_SPACING;
            self.seen += 1;
        }
        self.most[..self.seen].get(number).copied()
    }

    /// Moves on to the next place, and gives the highest rate on the way there, by the middle and the ends of what it passes of each
    /// segment: places far ahead lie so far apart that an axis may get too fast, and slow again, between two of them.
    fn most_on_the_way(&mut self) -> Option<f64> {
        let (mut left_s, mut highest) = (self.step_s, 0.0_f64);
        loop {
            let stretch_s = self.place.stretch_s(left_s);
            let begun = self.begun;
            self.place.advance(stretch_s / 2.0);
            let middle = self.share_here()?;
            self.place.advance(stretch_s / 2.0);
            let end = self.share_here()?;
            self.begun = Some(end);
            highest = highest.max(highest_of([begun.unwrap_or(middle), middle, end]));
            left_s -= stretch_s;
            if left_s <= 0.0 {
                return Some(1.0 / highest);
            }
            self.place.step();
            self.begun = self.share_here();
            let Some(begun) = self.begun else {
                return (highest > 0.0).then_some(1.0 / highest);
            };
            highest = highest.max(begun);
        }
    }

    /// The speed of the plan at the place as a share of the one asked for; `None` where nothing moves.
    fn share_here(&self) -> Option<f64> {
        let pace = self.place.pace()?;
        Some(pace.speed / (self.ratio * self.place.feed_mm_per_s()))
    }

    /// Whether at the rate `sigma` no place ahead is too fast, which is mostly said by the first that is.
    fn is_kept_at(&mut self, sigma: f64) -> bool {
        sigma <= self.kept_rate
            || (0..)
                .map_while(|number| self.rate_at(number))
                .all(|most| sigma < most)
    }
}

/// The highest of the parabola through the values at the beginning, in the middle and at the end of a stretch.
fn highest_of([begin, middle, end]: [f64; 3]) -> f64 {
    let bend = 2.0 * middle - begin - end;
    let slope = end - begin;
    if slope.abs() < 2.0 * bend {
        middle + slope * slope / (8.0 * bend)
    } else {
        begin.max(middle).max(end)
    }
}

/// Where a way has come, and whether it has been below the feed.
#[derive(Clone, Copy, Debug)]
struct Watch {
    before: Option<Pace>,
    limit_mm_per_s: f64,
    was_below: bool,
    /// The speed at which it began.
    begun_mm_per_s: f64,
}

impl Watch {
    fn new(here: &RateState<'_>, ratio: f64) -> Self {
        let before = here.place.pace();
        let limit_mm_per_s = ratio * here.place.feed_mm_per_s();
        let is_below = |pace: &Pace| here.sigma * pace.speed <= limit_mm_per_s * (1.0 + TOLERANCE);
        Self {
            was_below: before.as_ref().is_none_or(is_below),
            begun_mm_per_s: here.sigma * before.map_or(0.0, |pace| pace.speed),
            before,
            limit_mm_per_s,
        }
    }

    /// Whether the feed is kept in a period that ends at `to`, at its end and in its mean. Where it was not before, it need not
    /// be yet: the ratio has just become a lower one. But then the speed does not rise any more, so that it stays below what was asked
    /// for before.
    fn is_kept(&mut self, to: &RateState<'_>, ratio: f64, h: f64) -> bool {
        let Some(pace) = to.place.pace() else {
            self.before = None;
            return true;
        };
        let limit = ratio * to.place.feed_mm_per_s();
        let keeps = |at_end_mm_per_s: f64, mean_mm_per_s: f64| {
            to.sigma * pace.speed <= at_end_mm_per_s * (1.0 + TOLERANCE)
                && self.before.is_none_or(|before| {
                    before.way_to_mm(&pace) <= mean_mm_per_s * (1.0 + TOLERANCE) * h
                })
        };
        let kept = keeps(limit, limit.max(self.limit_mm_per_s));
        let was_below = self.was_below;
        let goes_on = kept || !was_below && keeps(self.begun_mm_per_s, self.begun_mm_per_s);
        *self = Self {
            before: Some(pace),
            limit_mm_per_s: limit,
            was_below: was_below || kept,
            ..*self
        };
        goes_on
    }
}

impl Below<'_> {
    /// The σ̈ nearest to `wanted` from which there is a way below the feed, with that way in [`WaySearch::found`]; `None` where none
    /// is found.
    pub(super) fn recoverable(
        &mut self,
        wanted: f64,
        here: &RateState<'_>,
        ways: &mut WaySearch,
        horizon: &Horizon,
    ) -> Option<f64> {
        let h = ways.period_s;
        self.steps_left = FEED_WAY_STEPS;
        let range = ways.range(here, h, horizon)?;
        let kept = ways.found.peek().filter(|_| ways.found.keeps_feed);
        let good = kept.unwrap_or(range.nearest(-MAX_LOWERING / (h * h)));
        let found = nearest_with_way(range.nearest(wanted), good, HALVINGS, |change| {
            self.leaves_way(change, here, ways, horizon)
        });
        // A way that has come to its end goes on at the rate that it has come to, which keeps what it was sought for.
        found.or_else(|| {
            let stays = here.rate_per_s == 0.0 && range.contains(0.0);
            (stays && self.leaves_way(0.0, here, ways, horizon)).then_some(0.0)
        })
    }

    /// From rest, where any rate is as good: one from which there is a way below the feed, the rate so far or one that is nearer to
    /// the one at which the plan keeps it everywhere. `None` where that one is left.
    pub(super) fn rate_to_begin_with(
        &mut self,
        mut here: RateState<'_>,
        ways: &mut WaySearch,
        horizon: &Horizon,
    ) -> Option<f64> {
        let above = here.sigma - self.kept_rate;
        self.steps_left = BEGINNINGS * FEED_WAY_STEPS;
        (0..BEGINNINGS).find_map(|halvings| {
            here.sigma = self.kept_rate + above / f64::from(1_u32 << halvings);
            self.leaves_way(0.0, &here, ways, horizon)
                .then_some(here.sigma)
        })
    }

    /// Whether after a period with σ̈ of `change` there is a way below the feed; it is noted in [`WaySearch::found`].
    fn leaves_way(
        &mut self,
        change: f64,
        here: &RateState<'_>,
        ways: &mut WaySearch,
        horizon: &Horizon,
    ) -> bool {
        let h = ways.period_s;
        let mut watch = Watch::new(here, self.ratio);
        let mut way = *here;
        way.pass(change, h);
        let found = !turns_beyond(here, change, h)
            && watch.is_kept(&way, self.ratio, h)
            && (self.becomes_constant((way, watch), ways, horizon)
                || self.becomes_slow((way, watch), ways, horizon));
        if found {
            ways.keep_tried();
            ways.found.keeps_feed = true;
        }
        found
    }

    /// Whether σ becomes constant, soonest, at a rate at which no place ahead is too fast.
    fn becomes_constant(
        &mut self,
        (mut way, mut watch): (RateState<'_>, Watch),
        ways: &mut WaySearch,
        horizon: &Horizon,
    ) -> bool {
        ways.tried.clear();
        let (mut passed, most) = (0, most_periods(ways.period_s, horizon));
        while passed < most && (0.0..=1.0).contains(&way.sigma) {
            if way.rate_per_s == 0.0 {
                return self.is_kept_at(way.sigma);
            }
            let periods = periods_of_step(passed);
            let step_s = f64::from(periods) * ways.period_s;
            let steady = -way.rate_per_s / step_s;
            let mut on = (&mut way, &mut watch);
            if self.go(&mut on, steady, periods, (ways, horizon)).is_none() {
                return false;
            }
            passed += periods;
        }
        false
    }

    /// Whether σ becomes constant at the rate at which the plan keeps the feed everywhere, lowered as far as the limits allow.
    fn becomes_slow(
        &mut self,
        (mut way, mut watch): (RateState<'_>, Watch),
        ways: &mut WaySearch,
        horizon: &Horizon,
    ) -> bool {
        ways.tried.clear();
        let (mut passed, most) = (0, most_periods(ways.period_s, horizon));
        let mut raisable = f64::INFINITY;
        while passed < most && (0.0..=1.0).contains(&way.sigma) {
            let (sigma, rate) = (way.sigma, way.rate_per_s);
            // While σ̇ is brought to nothing.
            let falling = rate * rate / (2.0 * raisable).max(f64::MIN_POSITIVE);
            let is_enough = rate <= 0.0 && sigma - falling <= self.kept_rate;
            if rate == 0.0 && is_enough {
                return true;
            }
            let periods = periods_of_step(passed);
            let step_s = f64::from(periods) * ways.period_s;
            let steady = -rate / step_s;
            let wanted = if is_enough {
                steady
            } else {
                // As low as leaves another such step to bring σ̇ to nothing.
                let landing = FEED_WAY_LANDING_SHARE * self.kept_rate - sigma - 1.5 * step_s * rate;
                (landing.max(-MAX_LOWERING) / (step_s * step_s)).min(steady)
            };
            let mut on = (&mut way, &mut watch);
            let Some(range) = self.go(&mut on, wanted, periods, (ways, horizon)) else {
                return false;
            };
            raisable = range.high.max(0.0);
            passed += periods;
        }
        false
    }

    /// Goes on for some periods with the σ̈ nearest to `wanted`, and notes it; gives what the limits allow there. `None` where
    /// they allow none, the feed is not kept, the plan is not known, or enough has been tried.
    fn go(
        &mut self,
        (way, watch): &mut (&mut RateState<'_>, &mut Watch),
        wanted: f64,
        periods: u32,
        (ways, horizon): (&mut WaySearch, &Horizon),
    ) -> Option<Interval> {
        let step_s = f64::from(periods) * ways.period_s;
        self.steps_left = self.steps_left.checked_sub(1)?;
        let range = ways
            .range(way, step_s, horizon)
            .filter(|_| way.place.is_known())?;
        let change = range.nearest(wanted);
        if turns_beyond(way, change, step_s) {
            return None;
        }
        for _ in 0..periods {
            ways.tried.push(change);
        }
        let is_steady = change == -way.rate_per_s / step_s;
        let looks = periods.min(LOOKS);
        for _ in 0..looks {
            let look_s = step_s / f64::from(looks);
            way.pass(change, look_s);
            if !watch.is_kept(way, self.ratio, look_s) {
                return None;
            }
        }
        if is_steady {
            way.rate_per_s = 0.0;
        }
        Some(range)
    }
}

/// Whether σ turns round beyond an end of its range within a step with this σ̈.
fn turns_beyond(from: &RateState<'_>, change: f64, step_s: f64) -> bool {
    let rate = from.rate_per_s;
    let turns = rate * (rate + step_s * change) < 0.0;
    turns && !(0.0..=1.0).contains(&(from.sigma - rate * rate / (2.0 * change)))
}

/// Most periods of a way.
fn most_periods(period_s: f64, horizon: &Horizon) -> u32 {
    let [least, most] = FEED_WAY_PERIODS;
    let longest_s = FEED_WAY_RAMPS * horizon.reach_s + horizon.stop_s;
    (longest_s / period_s).clamp(least, most) as u32
}

/// How many periods the next step of a way lasts behind so many.
fn periods_of_step(passed: u32) -> u32 {
    (passed / FEED_WAY_SINGLE_PERIODS).max(1)
}

#[cfg(test)]
mod tests {
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
            assert!((0.9..1.3).contains(&took), "{took} of the shortest time");
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
}
