//! The governor where jerk is limited: the rate of program time is smooth itself.
//!
//! With q the plan in program time an axis jerks by `q‴σ³ + 3q″σσ̇ + q′σ̈`. What is chosen for a period is σ̈: as near to
//! what two laws ask for as leaves a way on which σ̇ comes to zero within the limits (`keep_limits.rs`).

use super::interval::{Interval, RateAt};
use super::keep_limits::RateState;
use super::tuning::{
    APPROACH_END_FACTOR, CLEARLY_LONGER, EXCESSES, ORDER3_LIMIT_SHARE, SNAP_SHARE,
};
use super::way_below::Below;
use super::{Aim, Goal, Governor};
use crate::horizon::Horizon;
use crate::law::{stop_s, to_rest};
use crate::plan_ahead::{Pace, PlanCursor};
use crate::steps::{Recent, Steps};

/// What was chosen for the period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chosen {
    /// Program time that passes, s.
    pub delta_s: f64,
    /// No σ̈ keeps the jerk limit: velocity and acceleration are kept.
    pub relaxed: bool,
}

impl Governor {
    /// Chooses the rate for this period where jerk is limited, and takes it. `place` is where the plan is, `recent` what of
    /// its steps the next samples show.
    pub fn smooth(
        &mut self,
        aim: &Aim,
        horizon: &Horizon,
        place: PlanCursor<'_>,
        recent: Recent,
    ) -> Chosen {
        let here = RateState {
            sigma: self.sigma,
            rate_per_s: self.rate_per_s,
            place,
            recent,
        };
        let mut below = aim
            .keeps_feed()
            .then(|| Below::new(aim, &here, self.period_s));
        let wanted = match &aim.goal {
            Goal::Rest { .. } => self.wanted_freely(aim, horizon, &place),
            Goal::Run { sigma, rest_at, .. } => {
                let wanted = if below.is_some() {
                    self.wanted_below(aim, horizon, &here)
                } else {
                    self.wanted_freely(aim, horizon, &place)
                };
                rest_at.map_or(wanted, |rest| {
                    let goal = Goal::Rest { sigma: *sigma };
                    let slowest = self.wanted_freely(&Aim { goal, ..*aim }, horizon, &place);
                    self.wanted_to_rest_at(&rest, (slowest, wanted), &here)
                })
            }
        };
        let chosen = self.choose_change(wanted, here, below.as_mut(), &aim.goal, horizon);
        self.end_approach(aim, horizon, place, chosen.delta_s);
        chosen
    }

    /// The σ̈ nearest to `wanted` that leaves a way on, taken. Where the goal is rest, that comes before the feed: it is not put off for
    /// a way on which the feed is kept.
    fn choose_change(
        &mut self,
        mut wanted: f64,
        mut here: RateState<'_>,
        below: Option<&mut Below<'_>>,
        goal: &Goal,
        horizon: &Horizon,
    ) -> Chosen {
        let is_constant = wanted == 0.0 && self.rate_per_s == 0.0;
        let below = below.filter(|below| !is_constant || self.sigma > below.kept_rate);
        if is_constant && below.is_none() {
            self.ways.found.clear();
            return Chosen {
                delta_s: self.sigma * self.period_s,
                relaxed: false,
            };
        }
        let mut change = None;
        if let Some(below) = below {
            if is_constant && here.place.begin_after_rest() {
                match below.rate_to_begin_with(here, &mut self.ways, horizon) {
                    Some(sigma) => self.sigma = sigma,
                    None => self.jump(below.kept_rate),
                }
                return Chosen {
                    delta_s: self.sigma * self.period_s,
                    relaxed: false,
                };
            }
            change = below.recoverable(wanted, &here, &mut self.ways, horizon);
            if change.is_none() && goal.is_rest() && self.ways.found.keeps_feed {
                self.ways.found.keeps_feed = false;
                wanted = wanted.min(self.ways.found.peek().unwrap_or(wanted));
            }
        } else {
            self.ways.found.keeps_feed = false;
        }
        if change.is_none() && !self.ways.found.keeps_feed {
            change = self.ways.recoverable(wanted, &here, horizon);
        } else if change.is_none() && !self.ways.keeps_limits_on(&here, horizon) {
            // The limits come before the feed.
            self.ways.found.keeps_feed = false;
            let wanted = self.ways.found.peek().unwrap_or(wanted);
            change = self.ways.recoverable(wanted, &here, horizon);
        }
        match change {
            Some(change) => Chosen {
                delta_s: self.pass(change),
                relaxed: false,
            },
            None => self.go_on(horizon, &self.ways.reserve(&here)),
        }
    }

    /// Follows the way that was found last, at whose end σ is constant.
    fn go_on(&mut self, horizon: &Horizon, reserve: &Steps) -> Chosen {
        if self.rate_per_s == 0.0 && !self.ways.found.keeps_feed {
            return Chosen {
                delta_s: self.pass(0.0),
                relaxed: false,
            };
        }
        let Some((change, last)) = self.ways.found.next() else {
            self.ways.found.keeps_feed = false;
            return if self.rate_per_s == 0.0 {
                Chosen {
                    delta_s: self.pass(0.0),
                    relaxed: false,
                }
            } else {
                self.relaxed(horizon, reserve)
            };
        };
        let delta_s = self.pass(change);
        if last {
            self.rate_per_s = 0.0;
        }
        Chosen {
            delta_s,
            relaxed: false,
        }
    }

    /// Makes σ constant as soon as velocity and acceleration allow it, with no more jerk than that takes.
    fn relaxed(&mut self, horizon: &Horizon, reserve: &Steps) -> Chosen {
        let mut accelerations = Interval::ALL;
        self.accelerations(horizon, reserve, &mut accelerations);
        let mut all = accelerations;
        self.jerks(horizon, reserve, 0.0, &mut all);
        let mut least = all;
        for excess in EXCESSES {
            if !least.is_empty() {
                break;
            }
            least = accelerations;
            self.jerks(horizon, reserve, excess, &mut least);
        }
        let steady = -self.rate_per_s / self.period_s;
        let chosen = if least.is_empty() {
            accelerations.nearest(steady)
        } else {
            least.nearest(steady)
        };
        let chosen = accelerations.nearest(self.landing(chosen));
        let before = self.rate_per_s;
        let delta_s = self.pass(chosen);
        // Where σ has met an end of its range, σ̇ ended there and not as chosen.
        let change = (self.rate_per_s - before) / self.period_s;
        Chosen {
            delta_s,
            relaxed: all.is_empty() || !all.contains(change),
        }
    }

    /// `chosen`, or the σ̈ that is needed to come to the end of the range with σ constant, evenly from here on.
    fn landing(&self, chosen: f64) -> f64 {
        let (h, rate) = (self.period_s, self.rate_per_s);
        let room = if rate > 0.0 {
            1.0 - self.sigma
        } else {
            self.sigma
        };
        let periods = (2.0 * room / (h * rate.abs())).floor().max(1.0);
        let even = -rate / (periods * h);
        if rate > 0.0 {
            chosen.min(even)
        } else {
            chosen.max(even)
        }
    }

    /// Ends an approach: what rounding leaves of it is far below what a period may change. The feed is not, where the plan at the end of
    /// the period, `delta_s` behind its `place`, would be beyond it: there σ stays as it was chosen.
    fn end_approach(
        &mut self,
        aim: &Aim,
        horizon: &Horizon,
        mut place: PlanCursor<'_>,
        delta_s: f64,
    ) {
        let h = self.period_s;
        let most = SNAP_SHARE * horizon.rate_change_per_s2.min(1.0 / (h * h)) * h;
        let target = match aim.goal {
            Goal::Rest { .. } => 0.0,
            Goal::Run { sigma, .. } => sigma,
        };
        if (self.sigma - target).abs() >= most * h || self.rate_per_s.abs() >= most {
            return;
        }
        place.go(delta_s);
        let is_kept = |pace: Pace| target * pace.speed <= aim.goal.speed_mm_per_s();
        if target <= self.sigma || place.pace().is_none_or(is_kept) {
            (self.sigma, self.rate_per_s) = (target, 0.0);
        }
    }

    /// σ̈ that reaches the aim soonest, in small steps.
    fn wanted_freely(&self, aim: &Aim, horizon: &Horizon, place: &PlanCursor<'_>) -> f64 {
        let wanted = self
            .wanted(aim, horizon)
            .min(self.wanted_by_slowest(aim, horizon, place));
        self.small(wanted, horizon)
    }

    /// σ̈ that reaches the aim soonest, were there no limits but those of the approach.
    fn wanted(&self, aim: &Aim, horizon: &Horizon) -> f64 {
        let h = self.period_s;
        let [speed, acceleration, jerk] = aim.path;
        let most = ORDER3_LIMIT_SHARE * horizon.rate_change_per_s2;
        let free = if most.is_finite() {
            self.approach(
                self.sigma - aim.goal.sigma(),
                horizon.approach_jerk_share * most,
                most,
            )
        } else {
            0.0
        };
        let (sigma, rate) = (self.sigma, self.rate_per_s);
        let along = sigma * sigma * acceleration + speed * rate;
        let path_jerk = horizon.path_jerk_to_rest(sigma, sigma * speed, along);
        let path_jerk = ORDER3_LIMIT_SHARE * path_jerk.min(speed * horizon.small_change_per_s2());
        let most_mm_per_s = aim.goal.speed_mm_per_s();
        if most_mm_per_s.is_infinite() || speed <= 0.0 || !path_jerk.is_finite() {
            return free;
        }
        let over = sigma * speed - most_mm_per_s;
        if over == 0.0 && along == 0.0 {
            return free.min(0.0);
        }
        let coming_in = horizon.approach_jerk_share * path_jerk;
        let towards = |along: f64| {
            let last = APPROACH_END_FACTOR * path_jerk;
            to_rest(over - h * along / 2.0, along, coming_in, last, h)
        };
        let planned = sigma * (sigma * sigma * jerk + 3.0 * acceleration * rate);
        let mut capped = (towards(along) - planned) / speed;
        if aim.goal.is_rest() {
            // A plan that brakes by itself, for a corner or a turn, gets faster again behind it: that is no stop, and no reason to ease.
            capped = capped.min(towards(speed * rate) / speed);
        }
        // At its bound the law of the rate only says that its aim is far.
        if free < most {
            free.min(capped)
        } else {
            capped
        }
    }

    /// The same to rest soonest, by the axis that alone would need longest, where that is clearly longer than what the path
    /// takes by its speed: an axis that is slow to turn round decides, though the path hardly has its direction yet.
    fn wanted_by_slowest(&self, aim: &Aim, horizon: &Horizon, place: &PlanCursor<'_>) -> f64 {
        let (h, sigma, rate) = (self.period_s, self.sigma, self.rate_per_s);
        let [speed, acceleration, _] = aim.path;
        if !aim.goal.is_rest() || sigma == 0.0 || speed <= 0.0 {
            return f64::INFINITY;
        }
        let along = sigma * sigma * acceleration + speed * rate;
        let path_jerk = ORDER3_LIMIT_SHARE * horizon.path_jerk_to_rest(sigma, sigma * speed, along);
        let path_s = stop_s(sigma * speed, along, f64::INFINITY, path_jerk);
        let (mut longest_s, mut wanted) = (CLEARLY_LONGER * path_s + 2.0 * h, f64::INFINITY);
        let motion = place.motion();
        for (axis, (most, jerk)) in horizon.limits() {
            let velocity = motion.velocity[axis];
            let turning = sigma * motion.acceleration[axis];
            let (fast, changing) = (sigma * velocity, sigma * turning + velocity * rate);
            let axis_s = stop_s(fast, changing, most, ORDER3_LIMIT_SHARE * jerk);
            if axis_s > longest_s && velocity != 0.0 {
                let planned = sigma * sigma * sigma * motion.jerk[axis] + 3.0 * turning * rate;
                let asked = to_rest(
                    fast - h * changing / 2.0,
                    changing,
                    horizon.approach_jerk_share * ORDER3_LIMIT_SHARE * jerk,
                    APPROACH_END_FACTOR * ORDER3_LIMIT_SHARE * jerk,
                    h,
                );
                (longest_s, wanted) = (axis_s, (asked - planned) / velocity);
            }
        }
        wanted
    }

    /// σ̈ of `wanted` in small steps, which the limits do not ask for where next to nothing moves; larger ones to end an approach.
    ///
    /// A constant rate counts as a rising one. So the first step of a hold may be one of the larger ones, though it ends nothing:
    /// the limits bound it all the same, and with the small bound there no test of this crate had another result.
    pub(super) fn small(&self, wanted: f64, horizon: &Horizon) -> f64 {
        let small = horizon.small_change_per_s2();
        let (down, up) = if self.rate_per_s < 0.0 {
            (small, APPROACH_END_FACTOR * small)
        } else {
            (APPROACH_END_FACTOR * small, small)
        };
        wanted.clamp(-down, up)
    }

    /// σ̈ that brings the rate to `sigma` soonest; infinite where that is too far for the law to say more.
    pub(super) fn freely(&self, sigma: f64, horizon: &Horizon) -> f64 {
        let most = ORDER3_LIMIT_SHARE * horizon.rate_change_per_s2;
        if !most.is_finite() {
            return f64::INFINITY;
        }
        let free = self.approach(self.sigma - sigma, horizon.approach_jerk_share * most, most);
        if free < most { free } else { f64::INFINITY }
    }

    fn approach(&self, off: f64, coming_in: f64, most: f64) -> f64 {
        if off == 0.0 && self.rate_per_s == 0.0 {
            return 0.0;
        }
        to_rest(
            off - self.period_s * self.rate_per_s / 2.0,
            self.rate_per_s,
            coming_in,
            most,
            self.period_s,
        )
    }

    /// Acceleration at the points of the period, at the rate with which it ends.
    fn accelerations(&self, horizon: &Horizon, reserve: &Steps, interval: &mut Interval) {
        let h = self.period_s;
        let end = RateAt {
            sigma: (self.sigma + h * self.rate_per_s).clamp(0.0, 1.0),
            rate_per_s: self.rate_per_s,
            part: 1.0,
            period_s: h,
        };
        for point in horizon.iter().take_while(|p| p.offset_s <= h) {
            let motion = &point.motion;
            for (axis, (limit, _)) in horizon.limits() {
                let reserved = reserve.acceleration_mm_per_s2(axis, end.sigma, h);
                let planned = [motion.velocity[axis], motion.acceleration[axis]];
                interval.keep_acceleration(planned, &end, ORDER3_LIMIT_SHARE * limit - reserved);
            }
        }
    }

    /// Jerk at the points of the period, up to `excess` of the limit beyond it.
    fn jerks(&self, horizon: &Horizon, reserve: &Steps, excess: f64, interval: &mut Interval) {
        let (h, rate) = (self.period_s, self.rate_per_s);
        for point in horizon.iter().take_while(|p| p.offset_s <= h) {
            let part = (point.offset_s / (h * self.sigma).max(f64::MIN_POSITIVE)).min(1.0);
            let at = RateAt {
                sigma: (self.sigma + part * h * rate).clamp(0.0, 1.0),
                rate_per_s: rate,
                part,
                period_s: h,
            };
            let motion = &point.motion;
            for (axis, (_, limit)) in horizon.limits() {
                let most = ORDER3_LIMIT_SHARE * limit;
                let left = reserve.left_of_jerk_mm_per_s3(axis, at.sigma, h, most);
                let planned = [
                    motion.velocity[axis],
                    motion.acceleration[axis],
                    motion.jerk[axis],
                ];
                interval.keep_jerk(planned, &at, (left, limit), excess * limit);
            }
        }
    }

    /// Takes σ̈ for this period; gives the program time that passes, s.
    fn pass(&mut self, change_per_s2: f64) -> f64 {
        let (h, sigma, rate) = (self.period_s, self.sigma, self.rate_per_s);
        self.sigma = sigma + h * (rate + h * change_per_s2 / 2.0);
        self.rate_per_s = rate + h * change_per_s2;
        let mut delta_s = h * (sigma + h * (rate / 2.0 + h * change_per_s2 / 6.0));
        if self.sigma <= 0.0 || self.sigma >= 1.0 {
            // There it stays: what the last step would have gone beyond is the law's rounding.
            self.sigma = self.sigma.clamp(0.0, 1.0);
            self.rate_per_s = 0.0;
            delta_s = delta_s.clamp(0.0, h);
        }
        delta_s
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::plan_ahead::{Ahead, TWO_LINEAR};
    use proptest::prelude::*;
    use tandem_sdk::{AxisLimits, AxisVector, MAX_AXES, Segment, SegmentFlags};

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
    }
}
