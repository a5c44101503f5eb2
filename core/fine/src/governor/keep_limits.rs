//! Whether the rate of program time can be made constant again. A change of the rate is begun only where it can: that keeps the jerk
//! limit to its end.
//!
//! A constant σ is admissible wherever the plan is. So σ̈ of a period is good if from its end on σ̇ can be brought to zero
//! within the limits and within 0 ≤ σ ≤ 1, tried out period by period on the plan ahead. The way that was found is kept:
//! where the next period finds no better one, it follows that way to its end.
//!
//! [`WaySearch`] is that search, for all that asks for a way: `order3.rs` asks it what may be taken of the σ̈ that is wanted, and
//! `way_below.rs` has it try ways that keep a feed as well. What is wanted it does not know.

use super::interval::{Interval, RateAt};
use super::tuning::{
    ACCELERATION_SHARE, FEED_WAY_LIMIT_SHARE, FEED_WAY_PERIODS, JERK_SHARE, RECOVERY_PERIODS,
    RECOVERY_RAMPS,
};
use crate::horizon::Horizon;
use crate::plan_ahead::{Motion, PlanCursor};
use crate::steps::{AROUND, Recent, Steps};

/// Program time that is none, s.
const NONE_S: f64 = 1e-9;
/// Tries between the σ̈ wanted and the one that makes σ constant.
const HALVINGS: u32 = 4;
/// Share of what the limits leave of σ̈ by which a way that was tried out differs from it by rounding.
const ROUNDED_SHARE: f64 = 1e-3;

/// σ̈ of the periods of a way at whose end σ is constant, 1/s².
#[derive(Debug)]
pub(super) struct Recovery {
    changes_per_s2: Box<[f64]>,
    count: usize,
    passed: usize,
    /// It keeps a feed to its end, and may begin where σ is constant.
    pub keeps_feed: bool,
}

impl Recovery {
    /// A way without periods, with room for the longest.
    pub(super) fn new() -> Self {
        Self {
            changes_per_s2: vec![0.0; RECOVERY_PERIODS[1].max(FEED_WAY_PERIODS[1]) as usize]
                .into_boxed_slice(),
            count: 0,
            passed: 0,
            keeps_feed: false,
        }
    }

    /// Forgets the way: σ is constant.
    pub(super) fn clear(&mut self) {
        self.count = 0;
        self.passed = 0;
        self.keeps_feed = false;
    }

    /// Goes on with this σ̈. What is beyond the room for it is not noted.
    pub(super) fn push(&mut self, change_per_s2: f64) {
        if let Some(next) = self.changes_per_s2.get_mut(self.count) {
            *next = change_per_s2;
            self.count += 1;
        }
    }

    /// σ̈ of its next period.
    pub(super) fn peek(&self) -> Option<f64> {
        self.changes_per_s2[..self.count].get(self.passed).copied()
    }

    /// The next period of the way, and whether it is the last.
    pub(super) fn next(&mut self) -> Option<(f64, bool)> {
        let change_per_s2 = *self.changes_per_s2[..self.count].get(self.passed)?;
        self.passed += 1;
        Some((change_per_s2, self.passed == self.count))
    }
}

/// The rate of program time, and where it is on the plan.
#[derive(Clone, Copy, Debug)]
pub(super) struct RateState<'a> {
    pub sigma: f64,
    pub rate_per_s: f64,
    pub place: PlanCursor<'a>,
    /// Steps of the plan that the next samples show.
    pub recent: Recent,
}

impl RateState<'_> {
    /// Goes on for a period.
    pub(super) fn pass(&mut self, change_per_s2: f64, h: f64) {
        let (sigma, rate) = (self.sigma, self.rate_per_s);
        let mut left_s = h * (sigma + h * (rate / 2.0 + h * change_per_s2 / 6.0));
        let mut crossed: Option<Steps> = None;
        while left_s > NONE_S {
            left_s = self.place.advance(left_s);
            if left_s > NONE_S
                && let Some(steps) = self.place.step()
            {
                crossed.get_or_insert_default().join(&steps);
            }
        }
        self.recent.pass(crossed.as_ref());
        self.sigma = sigma + h * (rate + h * change_per_s2 / 2.0);
        self.rate_per_s = rate + h * change_per_s2;
    }
}

/// The search for a way: of which σ̈ the period leaves one, as near as may be to the σ̈ that is wanted. Whether it has to keep the
/// limits ([`WaySearch::recoverable`]) or a feed as well ([`Below::recoverable`](super::way_below::Below::recoverable)), it is sought
/// in the same manner, and what the limits leave in each period of it is [`WaySearch::range`].
#[derive(Debug)]
pub(super) struct WaySearch {
    pub period_s: f64,
    /// The way that was found last, which is followed where no better one is found.
    pub found: Recovery,
    /// One that is being tried.
    pub tried: Recovery,
}

impl WaySearch {
    /// No way is known. Allocates.
    pub(super) fn new(period_s: f64) -> Self {
        Self {
            period_s,
            found: Recovery::new(),
            tried: Recovery::new(),
        }
    }

    /// Keeps the way that has been tried.
    pub(super) fn keep_tried(&mut self) {
        std::mem::swap(&mut self.found, &mut self.tried);
    }

    /// The σ̈ nearest to `wanted` from which σ can be made constant within the limits, with the way that does it in
    /// [`WaySearch::found`]; `None` where none is found.
    pub(super) fn recoverable(
        &mut self,
        wanted: f64,
        here: &RateState<'_>,
        horizon: &Horizon,
    ) -> Option<f64> {
        let h = self.period_s;
        let range = self.range(here, h, horizon)?;
        let steady = range.nearest(-here.rate_per_s / h);
        nearest_with_way(range.nearest(wanted), steady, HALVINGS, |change| {
            let mut way = *here;
            way.pass(change, h);
            let found = self.recovers(way, horizon);
            if found {
                self.keep_tried();
            }
            found
        })
    }

    /// Whether σ becomes constant; the way that does it is noted in [`WaySearch::tried`].
    fn recovers(&mut self, mut way: RateState<'_>, horizon: &Horizon) -> bool {
        let h = self.period_s;
        let [least, most] = RECOVERY_PERIODS;
        let periods = (RECOVERY_RAMPS * horizon.reach_s / h).clamp(least, most) as u32;
        self.tried.clear();
        for _ in 0..periods {
            if !(0.0..=1.0).contains(&way.sigma) {
                return false;
            }
            if way.rate_per_s == 0.0 {
                return true;
            }
            // What is not queued yet could be anything.
            let Some(range) = self
                .range(&way, self.period_s, horizon)
                .filter(|_| way.place.is_known())
            else {
                return false;
            };
            let steady = -way.rate_per_s / h;
            let change = range.nearest(steady);
            self.tried.push(change);
            way.pass(change, h);
            if change == steady {
                way.rate_per_s = 0.0;
            }
        }
        false
    }

    /// Whether the next period of the way that was found last keeps the limits: where it was tried out some periods at a time, it
    /// may go beyond them.
    pub(super) fn keeps_limits_on(&self, here: &RateState<'_>, horizon: &Horizon) -> bool {
        let range = self.range(here, self.period_s, horizon);
        range.is_some_and(|range| {
            let next = self.found.peek();
            next.is_none_or(|next| {
                (range.nearest(next) - next).abs() <= ROUNDED_SHARE * (range.high - range.low)
            })
        })
    }

    /// σ̈ that the limits allow in the `h` seconds that begin here: a period, or some of them.
    pub(super) fn range(&self, way: &RateState<'_>, h: f64, horizon: &Horizon) -> Option<Interval> {
        let mut interval = Interval::ALL;
        let whole_s = h * (way.sigma + h * way.rate_per_s / 2.0).clamp(0.0, 1.0);
        let (mut place, mut left_s) = (way.place, whole_s);
        let bounds = (horizon, &self.reserve(way));
        self.keep_at(way, (0.0, h), &place.motion(), bounds, &mut interval);
        while left_s > NONE_S {
            // With the middle, what samples show of a quadratic course is a mean of what is kept here (Simpson's rule).
            let stretch_s = place.stretch_s(left_s);
            for end_s in [left_s - stretch_s / 2.0, left_s - stretch_s] {
                place.advance(stretch_s / 2.0);
                self.keep_at(
                    way,
                    (1.0 - end_s / whole_s, h),
                    &place.motion(),
                    bounds,
                    &mut interval,
                );
            }
            left_s -= stretch_s;
            if left_s > NONE_S {
                place.step();
                self.keep_at(
                    way,
                    (1.0 - left_s / whole_s, h),
                    &place.motion(),
                    bounds,
                    &mut interval,
                );
            }
        }
        if whole_s <= NONE_S {
            // From rest next to no program time passes in the period, but σ̇ grows in it, and the velocity of the axes.
            self.keep_at(way, (1.0, h), &place.motion(), bounds, &mut interval);
        }
        (!interval.is_empty()).then_some(interval)
    }

    /// Steps of the plan that the samples of this period and the next ones show together.
    pub(super) fn reserve(&self, way: &RateState<'_>) -> Steps {
        let mut steps = way.recent.steps();
        let (h, periods) = (self.period_s, f64::from(AROUND) + 1.0);
        let soon = (way.sigma + periods * h * way.rate_per_s.max(0.0)).clamp(0.0, 1.0);
        steps.join(&way.place.steps_within(periods * h * soon));
        steps
    }

    /// Jerk and acceleration at a point of the time that is looked at, the share `part` of its program time from its start.
    fn keep_at(
        &self,
        way: &RateState<'_>,
        (part, time_s): (f64, f64),
        motion: &Motion,
        (horizon, reserve): (&Horizon, &Steps),
        keep: &mut Interval,
    ) {
        let h = self.period_s;
        let sigma = (way.sigma + part * time_s * way.rate_per_s).max(0.0);
        let at = RateAt {
            sigma: sigma.min(1.0),
            rate_per_s: way.rate_per_s,
            part,
            period_s: time_s,
        };
        let unturned = RateAt { sigma, ..at };
        // Between the points of some periods more may be used than at them.
        let share = if time_s > h {
            FEED_WAY_LIMIT_SHARE
        } else {
            1.0
        };
        for (axis, (acceleration_limit, jerk_limit)) in horizon.limits() {
            let velocity = motion.velocity[axis];
            let acceleration = motion.acceleration[axis];
            let most = share * JERK_SHARE * jerk_limit;
            let left = reserve.left_of_jerk_mm_per_s3(axis, at.sigma, h, most);
            let planned = [velocity, acceleration, motion.jerk[axis]];
            keep.keep_jerk(planned, &at, (left, jerk_limit), 0.0);
            let left = share * ACCELERATION_SHARE * acceleration_limit
                - reserve.acceleration_mm_per_s2(axis, at.sigma, h);
            keep.keep_acceleration([velocity, acceleration], &unturned, left);
        }
    }
}

/// The σ̈ nearest to `wanted` that `leaves_way`, by halvings of what lies between it and `good`, which is taken to leave one; `None`
/// where none of those that were tried does.
pub(super) fn nearest_with_way(
    wanted: f64,
    mut good: f64,
    halvings: u32,
    mut leaves_way: impl FnMut(f64) -> bool,
) -> Option<f64> {
    if leaves_way(wanted) {
        return Some(wanted);
    }
    let (mut bad, mut found) = (wanted, None);
    for _ in 0..halvings {
        let between = f64::midpoint(good, bad);
        if leaves_way(between) {
            (good, found) = (between, Some(between));
        } else {
            bad = between;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::order3;
    use super::*;
    use crate::plan_ahead::{PlanAhead, TWO_LINEAR};
    use proptest::prelude::*;
    use tandem_rings::{MIN_JERK_SHARE, Queued};
    use tandem_sdk::{AxisLimits, AxisVector, MAX_AXES, Segment, SegmentFlags, derivatives};

    const PERIOD_S: f64 = 0.001;
    const ACCELERATION: f64 = 1000.0;
    const JERK: f64 = 20_000.0;

    fn limits() -> [AxisLimits; MAX_AXES] {
        order3::tests::limits(ACCELERATION, JERK)
    }

    /// A segment that goes on from `before` with this jerk per axis.
    fn next(before: &Segment, jerk: [f64; 2], duration_s: f64) -> Segment {
        let mut segment = Segment::rest(&AxisVector::ZERO, duration_s);
        for (axis, jerk) in jerk.into_iter().enumerate() {
            let [velocity, acceleration, _] =
                derivatives(&before.coefficients[axis], before.duration_s);
            let place = before.position(before.duration_s)[axis];
            segment.coefficients[axis] =
                [place, velocity, acceleration / 2.0, jerk / 6.0, 0.0, 0.0];
        }
        segment.flags = SegmentFlags::default();
        segment
    }

    #[test]
    fn halving_comes_near_the_last_change_that_leaves_a_way() {
        let nearest = |wanted: f64, good: f64, highest: f64| {
            nearest_with_way(wanted, good, HALVINGS, |change| change <= highest)
        };
        assert_eq!(nearest(1.0, 0.0, 1.0), Some(1.0));
        assert_eq!(nearest(1.0, 0.0, 0.3), Some(0.25));
        assert_eq!(nearest(1.0, 0.0, 0.8), Some(0.75));
        assert_eq!(nearest(1.0, 0.0, 0.99), Some(0.9375));
        assert_eq!(nearest(1.0, -1.0, 0.3), Some(0.25));
        assert_eq!(nearest(1.0, 0.0, 0.01), None);
    }

    /// Program time of a period is that of its mean rate: from 0.5 up by 400 1/s it reaches over the end of a segment, down by as much
    /// it does not.
    #[test]
    fn the_range_looks_as_far_as_the_period_goes() {
        let mut first = Segment::rest(&AxisVector::ZERO, 0.004);
        first.coefficients[0] = [0.0, 20.0, 0.0, 0.0, 0.0, 0.0];
        first.flags = SegmentFlags::default();
        let second = next(&first, [0.9 * JERK, 0.0], 0.1);
        let queued = [Queued::Segment {
            start_s: first.duration_s,
            segment: second,
        }];
        let limits = limits();
        let horizon = Horizon::new(&limits, 2, PERIOD_S);
        let range = |rate_per_s: f64, left: f64| {
            let way = RateState {
                sigma: 0.5,
                rate_per_s,
                place: PlanAhead::new(&first, [&queued, &[]], TWO_LINEAR)
                    .begin(first.duration_s - left * PERIOD_S),
                recent: Recent::default(),
            };
            let ways = WaySearch::new(PERIOD_S);
            let range = ways.range(&way, PERIOD_S, &horizon);
            range.map(|range| [range.low, range.high])
        };
        // Ends of the segment that the period reaches change what is left of the jerk, others do not.
        assert_ne!(range(40.0, 0.51), range(40.0, 0.6));
        assert_eq!(range(-40.0, 0.51), range(-40.0, 0.6));
        assert_ne!(range(-40.0, 0.47), range(-40.0, 0.6));
        assert_eq!(range(40.0, 0.53), range(40.0, 0.6));
    }

    /// The acceleration of the plan rises to 900 mm/s² in the middle of the period and falls again: there half of the σ̈ of the period
    /// has come together.
    #[test]
    fn the_middle_of_a_period_counts_as_far_as_the_rate_has_come_there() {
        let (sigma, peak, speed) = (0.9, 900.0, 100.0);
        let whole_s = sigma * PERIOD_S;
        let mut hump = Segment::rest(&AxisVector::ZERO, 1.0);
        let third = 4.0 * peak / whole_s / 6.0;
        let fourth = -4.0 * peak / whole_s / whole_s / 12.0;
        hump.coefficients[0] = [0.0, speed, 0.0, third, fourth, 0.0];
        hump.flags = SegmentFlags::default();
        let mut limits = limits();
        limits[0].jerk_mm_per_s3 = 1e9;
        let way = RateState {
            sigma,
            rate_per_s: 0.0,
            place: PlanAhead::new(&hump, [&[], &[]], TWO_LINEAR).begin(0.0),
            recent: Recent::default(),
        };
        let horizon = Horizon::new(&limits, 2, PERIOD_S);
        let range = WaySearch::new(PERIOD_S).range(&way, PERIOD_S, &horizon);
        let left = ACCELERATION_SHARE * ACCELERATION - sigma * sigma * peak;
        let expected = left / (speed * 0.5 * PERIOD_S);
        let high = range.unwrap().high;
        assert!((high / expected - 1.0).abs() < 0.05, "{high}, {expected}");
    }

    /// A step of the plan counts as soon as a rate that rises may come to it while samples show this period; one that falls may not.
    #[test]
    fn a_step_is_looked_for_as_far_as_a_rising_rate_comes() {
        let mut first = Segment::rest(&AxisVector::ZERO, 0.01);
        first.coefficients[0][1] = 5.0;
        first.flags = SegmentFlags::default();
        let mut second = first;
        second.coefficients[0][1] = 7.0;
        second.flags = SegmentFlags::STEPS;
        let start_s = first.duration_s;
        let step = Steps::between(&first, &second);
        let queued = [Queued::Segment {
            start_s,
            segment: second,
        }];
        let ways = WaySearch::new(PERIOD_S);
        // At half the rate half a period passes in each; up to nearly the whole rate, nearly a whole one.
        for (rate_per_s, periods_ahead, is_seen) in [
            (0.0, 1.4, true),
            (0.0, 1.6, false),
            (100.0, 2.3, true),
            (100.0, 2.5, false),
            (-100.0, 1.4, true),
            (-100.0, 1.6, false),
        ] {
            let from_s = first.duration_s - periods_ahead * PERIOD_S;
            let reserve = ways.reserve(&RateState {
                sigma: 0.5,
                rate_per_s,
                place: PlanAhead::new(&first, [&queued, &[]], TWO_LINEAR).begin(from_s),
                recent: Recent::default(),
            });
            let expected = if is_seen { step } else { Steps::default() };
            assert_eq!(reserve, expected, "{rate_per_s} {periods_ahead}");
        }
    }

    /// What samples show of a step takes its part of the acceleration, and the change of the rate has the rest.
    #[test]
    fn a_step_leaves_less_of_the_acceleration() {
        let mut line = Segment::rest(&AxisVector::ZERO, 1.0);
        line.coefficients[0][1] = 5.0;
        line.flags = SegmentFlags::default();
        let mut limits = limits();
        limits[0].jerk_mm_per_s3 = 1e9;
        let horizon = Horizon::new(&limits, 2, PERIOD_S);
        let ways = WaySearch::new(PERIOD_S);
        let changes = |step_mm_per_s: f64| {
            let mut faster = line;
            faster.coefficients[0][1] += step_mm_per_s;
            faster.flags = SegmentFlags::STEPS;
            let mut recent = Recent::default();
            recent.pass(Some(&Steps::between(&line, &faster)));
            let way = RateState {
                sigma: 0.5,
                rate_per_s: 0.0,
                place: PlanAhead::new(&line, [&[], &[]], TWO_LINEAR).begin(0.0),
                recent,
            };
            let range = ways.range(&way, PERIOD_S, &horizon).unwrap();
            [range.low, range.high]
        };
        let left = ACCELERATION_SHARE * ACCELERATION - 0.5 * 0.4 / PERIOD_S;
        let share = left / (ACCELERATION_SHARE * ACCELERATION);
        for (with, without) in changes(0.4).into_iter().zip(changes(0.0)) {
            assert!(
                (with / without / share - 1.0).abs() < 0.01,
                "{with} of {without}"
            );
        }
    }

    /// A rate that is turned round before the end of its range only with nearly all of the jerk is turned round, whatever is wanted.
    #[test]
    fn a_way_is_found_where_only_one_near_the_limits_is_left() {
        const SPEED: f64 = 20.0;
        let mut line = Segment::rest(&AxisVector::ZERO, 1.0);
        line.coefficients[0][1] = SPEED;
        line.flags = SegmentFlags::default();
        let horizon = Horizon::new(&limits(), 2, PERIOD_S);
        for (rate_per_s, end) in [(10.0_f64, 1.0), (-10.0, 0.0)] {
            let shortest = rate_per_s * rate_per_s.abs() / (2.0 * JERK / SPEED);
            let here = RateState {
                sigma: end - 1.2 * shortest,
                rate_per_s,
                place: PlanAhead::new(&line, [&[], &[]], TWO_LINEAR).begin(0.1),
                recent: Recent::default(),
            };
            let mut ways = WaySearch::new(PERIOD_S);
            let found = ways.recoverable(1000.0 * rate_per_s, &here, &horizon);
            assert!(
                found.is_some_and(|change| change * rate_per_s < 0.0),
                "{found:?} from {rate_per_s}"
            );
        }
    }

    /// What comes next of a way is known before it is driven, to its end.
    #[test]
    fn a_way_says_what_it_does_next() {
        let mut way = Recovery::new();
        assert_eq!(way.peek(), None);
        way.push(5.0);
        way.push(-3.0);
        for (change, is_last) in [(5.0, false), (-3.0, true)] {
            assert_eq!(way.peek(), Some(change));
            assert_eq!(way.next(), Some((change, is_last)));
        }
        assert_eq!((way.peek(), way.next()), (None, None));
    }

    proptest! {
        /// σ̈ at either end of the range keeps jerk and acceleration of both axes at every instant of the period, up to what the
        /// plan itself takes of them; and one of them is used up, so that no more could be taken.
        #[test]
        fn the_range_of_a_period_keeps_the_limits_in_all_of_it_and_leaves_nothing_unused(
            velocity in proptest::array::uniform2(5.0..100.0f64),
            acceleration in proptest::array::uniform2(-500.0..500.0f64),
            jerks in proptest::array::uniform4(-0.95..0.95f64),
            sigma in 0.3..0.9f64, rate in -2.0..2.0f64, at in 0.0..1.0f64, cut in 0.0..1.2f64,
        ) {
            let mut first = Segment::rest(&AxisVector::ZERO, 0.004);
            for axis in 0..2 {
                first.coefficients[axis] =
                    [0.0, velocity[axis], acceleration[axis] / 2.0, JERK * jerks[axis] / 6.0, 0.0, 0.0];
            }
            first.flags = SegmentFlags::default();
            let second = next(&first, [JERK * jerks[2], JERK * jerks[3]], 0.1);
            // The period begins somewhere in the first segment, and mostly ends in the second.
            let from_s = first.duration_s - (cut * at * PERIOD_S).min(first.duration_s);
            let queued = [Queued::Segment { start_s: first.duration_s, segment: second }];
            let way = RateState {
                sigma,
                rate_per_s: rate,
                place: PlanAhead::new(&first, [&queued, &[]], TWO_LINEAR).begin(from_s),
                recent: Recent::default(),
            };
            let limits = limits();
            let ways = WaySearch::new(PERIOD_S);
            let Some(range) = ways.range(&way, PERIOD_S, &Horizon::new(&limits, 2, PERIOD_S)) else {
                return Ok(());
            };
            for change in [range.low, range.high] {
                prop_assert!(change.is_finite());
                let mut most: f64 = 0.0;
                for step in 0..=200 {
                    let t = PERIOD_S * f64::from(step) / 200.0;
                    let (now, turned) = (sigma + t * (rate + t * change / 2.0), rate + t * change);
                    let local_s = from_s + t * (sigma + t * (rate / 2.0 + t * change / 6.0));
                    // σ̈ moves the end of the period by a thousandth of it: of a segment that it comes to only so no sample shows anything.
                    let looked_s = from_s + t * (sigma + t * rate / 2.0);
                    let (segment, local_s) = if looked_s < first.duration_s + NONE_S {
                        (&first, local_s)
                    } else {
                        (&second, local_s - first.duration_s)
                    };
                    for axis in 0..2 {
                        let [v, a, j] = derivatives(&segment.coefficients[axis], local_s);
                        let jerk = now.powi(3) * j + 3.0 * now * turned * a + v * change;
                        let of_plan = (now.powi(3) * j).abs() / JERK;
                        let used = jerk.abs() / JERK / f64::max(1.0, of_plan + MIN_JERK_SHARE);
                        let driven = now * now * a + turned * v;
                        most = most.max(used).max(driven.abs() / ACCELERATION);
                    }
                }
                prop_assert!(most < 1.02, "{most} of a limit is used");
                prop_assert!(most > 0.95, "only {most} of a limit is used");
            }
        }
    }
}
