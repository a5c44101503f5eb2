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
#[path = "order3_tests.rs"]
pub(super) mod tests;
