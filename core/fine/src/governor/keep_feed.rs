//! The governor where jerk is limited and the path speed is to stay below a feed that the plan goes beyond.
//!
//! What the plan does is looked at where the period ends, and not where it begins: its own jerk may turn round within. There
//! the speed may rise by no more than leaves time to bring that to nothing. And where the plan turns it may use all the jerk
//! or acceleration of an axis, so that σ cannot be lowered while it gets faster: that is tried out on the way ahead.
//!
//! A plan is made at `max_feed_ratio`, so at a lower ratio it runs through what is asked for with all its acceleration
//! and jerk. Three things keep the samples below. σ̈ is sought with which speed
//! and its rise *at the end* of the period lie on a curve that comes to the feed with no rise, and the mean of the
//! period below it. On 48 places ahead, the first a period away and each 12 % farther than the one before, it is tried out
//! whether lowering σ from the next period on with what the limits leave there keeps the feed: a plan that leaves a
//! corner may use all of an axis for so long that σ has to be low before. And from rest σ begins with a rate that lasts
//! for six periods. Speed is that of the linear axes where they move more than the path coordinate, which is a
//! polynomial of its own and may run behind.
//!
//! The trial counts on less than the limits leave, so it may find that lowering σ does not suffice where a constant σ
//! does, and would lower it to rest. A constant σ is admissible wherever the plan is: below half of the least rate that
//! all places allow σ rises, whatever the trial finds, and program time gets on.

use super::Governor;
use super::interval::Interval;
use super::keep_limits::RateState;
use super::order3::Aim;
use super::tuning::{
    FEED_POINT_LIMIT_SHARE, FEED_POINT_MIN_RATE, FEED_POINT_SPACING, FEED_SHARE, MAX_LOWERING,
    RISE_JERK_SHARE, RISE_PERIODS, TRIAL_RATE_SHARE,
};
use crate::horizon::Horizon;
use crate::period_points::larger;
use crate::plan_ahead::{Motion, PlanCursor};

/// Rounds in which σ̈ is sought: what is wrong is squared by each.
const ROUNDS: u32 = 5;
/// To which change of σ in a period it is sought.
const PRECISION: f64 = 1e-9;
/// Places ahead at which the rate is tried out.
const PLACES: usize = 48;
/// Tries in which σ̈ is sought for these places.
const TRIES: u32 = 6;

/// A place ahead.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FeedPoint {
    /// Program time from the place before, s.
    step_s: f64,
    /// Rate at which the path speed there is the highest that is allowed.
    most: f64,
    motion: Motion,
}

impl FeedPoint {
    /// Room for the places of a period. Host; allocates.
    pub(super) fn room() -> Box<[Self]> {
        vec![Self::default(); PLACES].into_boxed_slice()
    }
}

/// The places ahead of a period, nearest first. Each is looked at when it is first asked for: a rate that falls is at rest long
/// before the last.
#[derive(Debug)]
struct FeedPoints<'a> {
    seen: Box<[FeedPoint]>,
    count: usize,
    place: PlanCursor<'a>,
    /// From the last one seen to the next, s.
    step_s: f64,
    ratio: f64,
}

impl FeedPoints<'_> {
    /// The place of this number; `None` after the last, and where nothing moves there.
    fn get(&mut self, number: usize) -> Option<&FeedPoint> {
        if number == self.count
            && let Some(next) = self.seen.get_mut(number)
        {
            self.place.go(self.step_s);
            let speed = self.place.look_at_motion(&mut next.motion)?;
            (next.step_s, next.most) =
                (self.step_s, self.ratio * self.place.feed_mm_per_s() / speed);
            self.step_s *= FEED_POINT_SPACING;
            self.count += 1;
        }
        self.seen[..self.count].get(number)
    }

    /// The highest rate at which no place ahead is too fast; `None` where that is not above `least`, which is mostly said by
    /// the first place.
    fn rate_above(&mut self, least: f64) -> Option<f64> {
        let mut most = f64::INFINITY;
        for number in 0.. {
            let Some(place) = self.get(number) else { break };
            most = most.min(place.most);
            if most <= least {
                return None;
            }
        }
        Some(most)
    }
}

/// How fast a speed may rise that is to end at a limit.
#[derive(Clone, Copy, Debug)]
struct Curve {
    jerk_mm_per_s3: f64,
    reserve_s: f64,
}

impl Curve {
    /// The rise `below_mm_per_s` below the limit, mm/s², and how fast it changes with that, 1/s. Above it is negative.
    fn rise(&self, below_mm_per_s: f64) -> (f64, f64) {
        let (reserve, way) = (self.reserve_s, below_mm_per_s.abs());
        let rise =
            2.0 * way / (reserve + (reserve * reserve + 2.0 * way / self.jerk_mm_per_s3).sqrt());
        (
            rise.copysign(below_mm_per_s),
            1.0 / (reserve + rise / self.jerk_mm_per_s3),
        )
    }
}

impl Governor {
    /// σ̈ that brings the rate to the one aimed at, as far as the path speed stays below the feed here and ahead.
    pub(super) fn wanted_below(
        &mut self,
        aim: &Aim,
        horizon: &Horizon,
        here: &RateState<'_>,
    ) -> f64 {
        let h = self.period_s;
        if aim.path[0] <= 0.0 {
            let mut soon = here.place;
            soon.go(h);
            let goal = aim.sigma.min(aim.ratio);
            if self.sigma < goal && soon.pace().is_some_and(|pace| pace.speed <= 0.0) {
                // A hold in a dwell has taken the rate to nothing, and a dwell has no speed that says how fast it is to pass.
                return self.small(self.freely(goal, horizon), horizon);
            }
            // From rest the rate was chosen for what follows.
            return -self.rate_per_s / h;
        }
        let free = self.small(self.freely(aim.sigma, horizon), horizon);
        let below = if aim.speed_mm_per_s.is_finite() {
            self.below(aim, free, here, horizon)
        } else {
            free
        };
        self.in_time(aim, below, here, horizon)
            .max(-MAX_LOWERING / (h * h))
    }

    /// The greatest σ̈ up to `most` with which the speed at the end of the period is on the curve or below it, and its mean
    /// below the limit.
    fn below(&self, aim: &Aim, most: f64, here: &RateState<'_>, horizon: &Horizon) -> f64 {
        let (h, limit) = (self.period_s, FEED_SHARE * aim.speed_mm_per_s);
        let Some(from) = here.place.pace() else {
            return most;
        };
        let jerk = horizon
            .path_jerk_mm_per_s3
            .min(limit * MAX_LOWERING / (h * h));
        let curve = Curve {
            jerk_mm_per_s3: RISE_JERK_SHARE * horizon.approach_jerk_share * jerk,
            reserve_s: RISE_PERIODS * h,
        };
        let is_below = here.sigma * from.speed <= aim.speed_mm_per_s / FEED_SHARE;
        let mut change = most;
        for _ in 0..ROUNDS {
            let mut way = *here;
            way.pass(change, h);
            let Some(to) = way.place.pace().filter(|to| to.speed > 0.0) else {
                break;
            };
            let speed = way.sigma * to.speed;
            let rise = way.sigma * way.sigma * to.rise + to.speed * way.rate_per_s;
            let (allowed, per_s) = curve.rise(limit - speed);
            let mut over = (rise - allowed) / (to.speed * h * (1.0 + per_s * h / 2.0));
            if is_below {
                let mean_over =
                    (from.way_to_mm(&to) / h - aim.speed_mm_per_s) * 6.0 / (to.speed * h * h);
                let end_over = (speed - limit) * 2.0 / (to.speed * h * h);
                over = over.max(mean_over).max(end_over);
            }
            if (change == most && over <= 0.0) || over.abs() * h * h < PRECISION {
                break;
            }
            change = (change - over).min(most);
        }
        change
    }

    /// The greatest σ̈ up to `most` after which there is time to lower σ before the plan is too fast. A rate far below what
    /// every place ahead allows rises: it need not fall for any of them.
    fn in_time(&mut self, aim: &Aim, most: f64, here: &RateState<'_>, horizon: &Horizon) -> f64 {
        let (h, sigma) = (self.period_s, here.sigma);
        let (seen, step_s) = (
            std::mem::take(&mut self.feed_points),
            h * sigma.max(FEED_POINT_MIN_RATE),
        );
        let mut ahead = FeedPoints {
            seen,
            count: 0,
            place: here.place,
            step_s,
            ratio: aim.ratio,
        };
        ahead.place.go(h * sigma);
        let mut change = most;
        for _ in 0..TRIES {
            let over = self.over(change, here, &mut ahead, horizon);
            if over <= 0.0 {
                break;
            }
            change -= over;
        }
        if change < most
            && let Some(allowed) = ahead.rate_above(sigma / TRIAL_RATE_SHARE)
        {
            let rising = self.freely((TRIAL_RATE_SHARE * allowed).min(aim.sigma), horizon);
            change = change.max(rising.min(horizon.max_change_per_s2)).min(most);
        }
        self.feed_points = ahead.seen;
        change
    }

    /// By how much σ̈ has to be lower than `change`, so that lowering σ as far as the limits allow from the next period on
    /// keeps the speed below at the places ahead; not more than 0 where it does.
    fn over(
        &self,
        change: f64,
        here: &RateState<'_>,
        ahead: &mut FeedPoints<'_>,
        horizon: &Horizon,
    ) -> f64 {
        let h = self.period_s;
        let mut sigma = here.sigma + h * (here.rate_per_s + h * change / 2.0);
        let mut rate = here.rate_per_s + h * change;
        let (mut time_s, mut most, mut was_below) = (0.0, f64::NEG_INFINITY, false);
        let mut before = [(f64::NEG_INFINITY, f64::NEG_INFINITY); 2];
        for number in 0.. {
            if sigma <= 0.0 {
                break;
            }
            let Some(place) = ahead.get(number) else {
                break;
            };
            let real_s = place.step_s / sigma;
            let least = self.least(sigma, rate, &place.motion, horizon);
            // What the limits leave at either end of the way, or at its start before, counts on all of it: the jerk of a plan may
            // turn round within.
            let change = larger(least.0, larger(before[0].0, before[1].0));
            let lowest = larger(least.1, larger(before[0].1, before[1].1));
            let slower = larger(rate + real_s * change, lowest.min(0.0));
            sigma += real_s * f64::midpoint(rate, slower);
            time_s += real_s;
            (rate, before) = (slower, [least, before[0]]);
            was_below |= sigma <= place.most;
            if was_below {
                most = most.max((sigma - place.most) / (h * (h / 2.0 + time_s)));
            }
        }
        most
    }

    /// The least σ̈ and the least rate of σ that the limits leave where the plan has this motion.
    ///
    /// An axis that brakes has the more jerk to its end the faster σ falls, and the slower it is the less σ̈ changes that: a rate
    /// which does not keep the limit by staying as it is would have to fall ever faster.
    fn least(&self, sigma: f64, rate_per_s: f64, motion: &Motion, horizon: &Horizon) -> (f64, f64) {
        let (mut changes, mut rate) = (Interval::ALL, f64::NEG_INFINITY);
        for (axis, (acceleration_limit, jerk_limit)) in horizon.limits() {
            let speed = motion.velocity[axis].abs();
            if speed < f64::MIN_POSITIVE {
                continue;
            }
            // All of it along the way of the axis.
            let per_speed = 1.0 / speed;
            let turned = sigma * motion.acceleration[axis] * motion.velocity[axis].signum();
            let jerk = motion.jerk[axis] * motion.velocity[axis].signum();
            let planned = sigma * sigma * sigma * jerk;
            let most = larger(FEED_POINT_LIMIT_SHARE * jerk_limit, planned.abs());
            let constant = planned + 3.0 * turned * rate_per_s;
            changes.narrow(
                (-most - constant) * per_speed,
                (most - constant) * per_speed,
            );
            if turned < 0.0 {
                rate = larger(rate, (most - planned) / (3.0 * turned));
            }
            let planned = sigma * turned;
            let most = larger(FEED_POINT_LIMIT_SHARE * acceleration_limit, planned.abs());
            rate = larger(rate, (-most - planned) * per_speed);
        }
        (
            changes.nearest(-MAX_LOWERING / (self.period_s * self.period_s)),
            rate,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan_ahead::PlanAhead;
    use crate::steps::Recent;
    use proptest::prelude::*;
    use tandem_sdk::{AxisLimits, AxisVector, MAX_AXES, Segment};

    /// X is slower than Y.
    fn limits(
        acceleration_mm_per_s2: f64,
        slower: f64,
        jerk_mm_per_s3: f64,
    ) -> [AxisLimits; MAX_AXES] {
        let axis = AxisLimits {
            min_mm: -1000.0,
            max_mm: 1000.0,
            feed_mm_per_s: 1000.0,
            rapid_mm_per_s: 1000.0,
            acceleration_mm_per_s2,
            jerk_mm_per_s3,
            speed_difference_mm_per_s: 0.0,
        };
        let mut limits = [axis; MAX_AXES];
        limits[0].acceleration_mm_per_s2 *= slower;
        limits[0].jerk_mm_per_s3 *= slower;
        limits
    }

    proptest! {
        /// X turns with all that it has while Y gets fast, and σ falls below half of what keeps every feed ahead: it rises.
        #[test]
        fn far_below_what_all_places_ahead_allow_the_rate_rises(
            acceleration in 10.0..1000.0f64, building_s in 0.002..0.1f64, slower in 0.05..1.0f64, period_s in 1e-4..2e-3f64,
            used in 0.3..1.0f64, gain in 0.5..4.0f64, long in 0.3..3.0f64, ratio in 0.1..1.0f64,
            part in 0.05..1.0f64, falling in 0.0..0.02f64,
        ) {
            let jerk = acceleration / building_s;
            let (turning, time_s) = (used * slower * jerk, long * building_s);
            let from = turning * time_s * time_s / 4.0;
            let mut segment = Segment::rest(&AxisVector::ZERO, time_s);
            segment.coefficients[0] = [0.0, from, 0.0, -turning / 6.0, 0.0, 0.0];
            segment.coefficients[1] = [0.0, 0.0, gain * from / time_s / 2.0, 0.0, 0.0, 0.0];
            segment.feed_mm_per_s = from;
            let plan = PlanAhead::new(&segment, [&[], &[]], (2, 0b11));
            let fastest = (0..=1000)
                .filter_map(|step| plan.begin(time_s * f64::from(step) / 1000.0).pace())
                .fold(0.0, |most: f64, pace| most.max(pace.speed));
            let sigma = 0.499 * part * (ratio * from / fastest).min(1.0);
            let here = RateState { sigma, rate_per_s: -falling / period_s, place: plan.begin(0.0), recent: Recent::default() };
            let aim = Aim { sigma: 1.0, speed_mm_per_s: ratio * from, ratio, path: [from, 0.0, 0.0], rest_at: None };
            let limits = limits(acceleration, slower, jerk);
            let mut governor = Governor::new(&limits, 2, period_s);
            let most = 0.01 / (period_s * period_s);
            let change = governor.in_time(&aim, most, &here, &Horizon::new(&limits, 2, period_s));
            prop_assert!(change > 0.0, "{change} at the rate {sigma}, all places allow {}", ratio * from / fastest);
        }
    }
}
