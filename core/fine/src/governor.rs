//! The governor: how fast program time passes.
//!
//! Program time advances at the rate σ, 0 ≤ σ ≤ 1, which changes linearly within a period. With q the plan in program
//! time the axes move at σ·q′ and accelerate by σ²·q″ + σ̇·q′. Where the plan's velocity steps at junctions, q′ stands
//! for the continuous velocity that the segment declares; the steps themselves shrink with σ. A constant σ is always
//! admissible where the plan is, so the interval for σ̇ is never empty.
//!
//! # Velocity steps
//!
//! The look-ahead planner drives blocks one after the other, so at a corner the velocity of an axis steps. The machine
//! allows a step of V (`motion.allowable_speed_difference_mm_per_min`). A rule for single junctions is not enough: a
//! circle of 2 mm radius in chords of 0.02 mm would keep V at each junction and exceed the acceleration limit A several
//! times. What is asked instead holds over every window: **the velocity of an axis changes by at most A·Δt + V in any
//! time Δt, however many junctions lie in it.**
//!
//! The rule. At a junction the direction of an axis steps by Δu; at the feed v its velocity steps by v·Δu. Take the
//! velocity g that at every junction runs through the mean of the velocities before and after, and that in between
//! takes the step back at a constant rate. Just after a junction the axis is ahead of g by half the step there; just
//! before the next it is behind by half the step there. So inside a block of duration t
//!
//! ```text
//! dg/dt = acceleration of the axis + (v_s·Δu_s + v_e·Δu_e) / (2·t)
//! ```
//!
//! with `s` and `e` for the start and the end of the block. The planner asks for two things: |v·Δu| ≤ V at every
//! junction, and |dg/dt| ≤ A everywhere. Both are local. The sum in the second is signed: a zigzag pays for each of its
//! steps but not for their sum, a chain of chords pays exactly the centripetal acceleration of the curve it stands for.
//!
//! Why the window follows. The lead of the velocity over g is never more than half a step, so between any two instants
//! it changes by at most V. g changes by at most A·Δt. Together: A·Δt + V.
//!
//! Why it is a leaky bucket. Judge, guard and report keep, per axis and sign, `u ← max(0, u + Δv − A·T)` over the
//! sampled velocity and ask u ≤ V. By unrolling, u is the greatest value of (sum of Δv) − A·Δt over all windows that
//! end now. One number for each axis and sign therefore asks the question over all windows.
//!
//! Why sampled differences inherit the bound. The sampled velocity of a period is the mean of the true velocity over
//! the period. The difference of two of them, n periods apart, is the mean over 0 ≤ s ≤ T of the true velocity change
//! from t + s to t + s + n·T. Each of these changes is taken over a window of exactly n·T and is at most A·n·T + V; so
//! is their mean. In other words: a sampled velocity change is the acceleration (with impulses at the junctions)
//! weighted by a trapezoid, a triangle for n = 1, and that weight is a mixture of indicators of intervals of equal
//! length. No correction for the sampling is needed.
//!
//! What the segment carries. `Segment::step_velocity` is the lead at the start of the segment,
//! `Segment::step_acceleration` the rate at which it is taken back; at local time t the continuous velocity is
//! `velocity(t) − step_velocity + step_acceleration·t`. The governor limits σ²·(q″ + `step_acceleration`) + σ̇·(q′ −
//! lead), with q the plan: the rate of σ·g. The steps themselves shrink with σ. So the same argument holds while the
//! machine is held, slowed or starved. Planners of continuous velocity leave both fields zero.
//!
//! Under `junction = "tangent"` nothing of this holds: that form bounds the velocity along the block before, as
//! published. It runs with `guard.mode = "count"` on simulated drives only.
//!
//! # Order 2 and order 3
//!
//! **Order 2.** σ changes linearly within a period, so that the velocity of the axes is continuous under hold and
//! override. With σ₀ at the start and σ₀ + d·t at the end of a period T, an axis accelerates by σ₀²·q″ + (d·t/T)·q′ at
//! the start, which is linear in t, and by (σ₀ + d·t)²·q″ + (d·t/T)·q′ at its end, which is quadratic. Both crossings
//! of ±A have a closed form, and the smallest of them over all axes and over the ends (and, on curved segments, the
//! middles) of the segments in the period is how far σ may go. t = 0 is always admissible where the plan is. Where that
//! does not reach what is asked for, because the plan turns from getting faster to braking within the period, the
//! period is laid out segment by segment: σ is linear in each.
//!
//! **Order 3.** An axis jerks by q‴σ³ + 3q″σσ̇ + q′σ̈. σ̈ is constant within a period. The points of the period give an
//! interval for it, linear in σ̈. What is wanted of it comes from two time-optimal laws, one in σ (back to 1) and one
//! in the path speed (down to a cap, or to rest); to rest it is never less braking than the second law asks of a plan of
//! constant speed, for a plan that brakes for a corner gets faster again after it, nor than the axis needs that alone would come to
//! rest clearly later (`wanted_by_slowest`). The governor takes as much of that as
//! still lets it make the rate constant again: from the end of the period on σ̇ must come to zero, within the limits at the ends and in the middle of every stretch of a segment that a
//! period drives, within 0 ≤ σ ≤ 1, and within what is queued, tried out on the queued plan period by period. So σ
//! comes to 0 and to 1 with σ̇ = 0. A constant σ is always admissible, and the way that was found is kept: where the
//! next period finds no better one, it goes on that way to its end. At most five ways are tried in a period, each over
//! 3.2 times the longest a/J of an axis or 640 periods at most, and none while σ stands still. Where the plan uses all
//! of the jerk and eases off, a hold therefore begins by fractions of a percent and grows with the room that its own
//! slowness leaves. Where no way is known (a plan that is itself beyond its limits), velocity and acceleration are
//! kept, and samples beyond the jerk limit are counted in `jerk_relaxed_samples`; the guard does not hold them against
//! the planner.
//!
//! A plan of order 3 may let velocity or acceleration step where segments meet: a line that runs into an arc, with a
//! little turn, passed at a speed at which samples keep the jerk limit. The rough loop flags segments that begin so
//! (`SegmentFlags::STEPS`). With Δv and Δa those steps, samples show up to σ·Δv/T as acceleration and σ·Δv/T² +
//! 0.75·σ²·Δa/T as jerk, which no single point has, in the differences of three samples. In the periods around such a
//! place, two before it and two behind, the governor leaves that out of what it uses, and with it what the plan uses of the
//! jerk on the other side: one sample shows both.
//!
//! Asked for is a path speed, ratio × programmed feed, not a scale: a corner that is slower than that anyway runs as
//! planned. Behind it the plan, which is made at `max_feed_ratio`, may be too fast; so with a jerk limit σ is taken only to
//! where it can be lowered from in time (`governor/way_below.rs`).
//!
//! # Places ahead
//!
//! Speed is linear within periods, so braking for a place is laid out in whole ones: the end speed is met and not gone
//! below, rest is met at the place. From rest the rate of the first period is one that is kept over it. At a ratio
//! below 1 the plan does not slow down for a lower feed by itself: it reaches that feed at its own deceleration, but
//! not ratio × feed. The fine loop looks at each queued segment once, at most 64 in a period, and remembers where the
//! feed falls; the speed from which every such place can be met with the declared deceleration is a cap. The end of a
//! line in single-block operation is such a place with speed zero; with a jerk limit `governor/rest_at.rs` meets it. A line
//! whose end can no longer be met is passed.

mod feeds_ahead;
mod interval;
mod keep_feed;
mod keep_limits;
mod order2;
mod order3;
mod rest_at;
pub mod tuning;
mod way_below;

use feeds_ahead::FeedsAhead;
use keep_limits::WaySearch;
pub use rest_at::RestAt;

use tandem_sdk::{AxisLimits, MAX_AXES};

use crate::period_points::PeriodPoints;

/// Relative tolerance within which a plan is at its limit, not beyond it.
pub const TOLERANCE: f64 = 1e-6;

/// Where the rate is to go in the coming period.
#[derive(Clone, Copy, Debug)]
pub enum Goal {
    /// Rest along the path: a hold, a stop, or a feed of nothing.
    Rest {
        /// Rate that counts where the plan stands still, so that no speed says how to stop: 0 stays there, 1 lets its time pass to where it
        /// moves.
        sigma: f64,
    },
    /// A rate at which the plan is followed.
    Run {
        /// Rate of program time to reach.
        sigma: f64,
        /// Path speed not to exceed, mm/s; infinite where none is asked for.
        speed_mm_per_s: f64,
        /// Where to rest all the same.
        rest_at: Option<RestAt>,
    },
}

impl Goal {
    /// To run at `sigma` with no more than `speed_mm_per_s` along the path; at a speed of nothing that is rest.
    pub fn run(sigma: f64, speed_mm_per_s: f64, rest_at: Option<RestAt>) -> Self {
        if speed_mm_per_s == 0.0 {
            Self::Rest { sigma }
        } else {
            Self::Run {
                sigma,
                speed_mm_per_s,
                rest_at,
            }
        }
    }

    /// Whether it is rest.
    pub fn is_rest(&self) -> bool {
        matches!(self, Self::Rest { .. })
    }

    /// Rate of program time to reach.
    fn sigma(&self) -> f64 {
        let (Self::Rest { sigma } | Self::Run { sigma, .. }) = self;
        *sigma
    }

    /// Path speed not to exceed, mm/s.
    fn speed_mm_per_s(&self) -> f64 {
        match self {
            Self::Rest { .. } => 0.0,
            Self::Run { speed_mm_per_s, .. } => *speed_mm_per_s,
        }
    }
}

/// What is asked of the coming period.
#[derive(Clone, Copy, Debug)]
pub struct Aim {
    /// Where the rate is to go.
    pub goal: Goal,
    /// Share of the programmed feeds ahead that is not to be exceeded there; infinite where the plan keeps what is asked.
    pub ratio: f64,
    /// Rate at which the plan keeps that share wherever it is.
    pub kept_rate: f64,
    /// Derivatives of the plan's path coordinate here by program time.
    pub path: [f64; 3],
}

impl Aim {
    /// Whether a feed is to be kept that the plan may go beyond: on the way to rest those ahead, else the speed asked for too.
    fn keeps_feed(&self) -> bool {
        match self.goal {
            Goal::Rest { .. } => self.ratio.is_finite(),
            Goal::Run { speed_mm_per_s, .. } => speed_mm_per_s.min(self.ratio).is_finite(),
        }
    }
}

/// The rate of program time.
#[derive(Debug)]
pub struct Governor {
    sigma: f64,
    /// Its rate of change at the end of the last period, 1/s.
    rate_per_s: f64,
    period_s: f64,
    acceleration: [f64; MAX_AXES],
    axes: usize,
    /// Where jerk is not limited: the rates from which the feeds ahead can be met.
    feeds_ahead: FeedsAhead,
    /// Where jerk is limited: the way on.
    ways: WaySearch,
}

impl Governor {
    /// A governor at σ = 1: where nothing moves, program time passes at its own rate. Host; allocates.
    pub fn new(limits: &[AxisLimits; MAX_AXES], axes: usize, period_s: f64) -> Self {
        Self {
            sigma: 1.0,
            rate_per_s: 0.0,
            period_s,
            acceleration: limits.map(|l| l.acceleration_mm_per_s2),
            axes,
            feeds_ahead: FeedsAhead::new(PeriodPoints::new(limits, axes)),
            ways: WaySearch::new(period_s),
        }
    }

    /// The rate at the end of the last period.
    pub fn sigma(&self) -> f64 {
        self.sigma
    }

    /// Its rate of change at the end of the last period, 1/s.
    pub fn rate_per_s(&self) -> f64 {
        self.rate_per_s
    }

    /// Sets the rate where nothing moves and any rate is as good.
    pub fn jump(&mut self, sigma: f64) {
        (self.sigma, self.rate_per_s) = (sigma, 0.0);
        self.ways.found.clear();
    }

    /// Forgets the way that was found last: the rate has stayed as it is since, and the way was for another place of the plan.
    #[inline]
    pub fn forget_way(&mut self) {
        self.ways.found.clear();
    }

    /// The highest rate at which the plan itself keeps the limits: 1 unless the planner is defective.
    pub fn plan_limit(points: &PeriodPoints) -> f64 {
        let excess = points.speed_ratio.max(points.acceleration_ratio.sqrt());
        if excess <= 1.0 + TOLERANCE {
            1.0
        } else {
            1.0 / excess
        }
    }

    /// Takes `sigma` as the rate at the end of this period; gives the program time that passes meanwhile, s.
    pub fn take(&mut self, sigma: f64) -> f64 {
        let mean = f64::midpoint(self.sigma, sigma);
        self.rate_per_s = (sigma - self.sigma) / self.period_s;
        self.sigma = sigma;
        mean * self.period_s
    }

    /// Program time that would pass if the period ended at `sigma`, s.
    pub fn program_time_s(&self, sigma: f64) -> f64 {
        f64::midpoint(self.sigma, sigma) * self.period_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_program_time_of_a_rate_is_what_passes_when_it_is_taken() {
        let mut governor = Governor::new(&[AxisLimits::unlimited(); MAX_AXES], 1, 0.002);
        governor.jump(0.5);
        assert_eq!((governor.sigma(), governor.rate_per_s()), (0.5, 0.0));
        let passes_s = governor.program_time_s(0.9);
        assert!((passes_s - 0.7 * 0.002).abs() < 1e-15);
        assert_eq!(governor.take(0.9), passes_s);
        assert_eq!(governor.sigma(), 0.9);
        assert!((governor.rate_per_s() - 0.4 / 0.002).abs() < 1e-9);
    }

    #[test]
    fn a_plan_beyond_its_limits_is_slowed_as_far_as_they_ask() {
        let mut points = PeriodPoints::new(&[AxisLimits::unlimited(); MAX_AXES], 1);
        for (speed, acceleration, limit) in [
            (1.0, 1.0, 1.0),
            (1.0 + 0.5 * TOLERANCE, 0.0, 1.0),
            (1.25, 1.0, 0.8),
            (1.25, 4.0, 0.5),
        ] {
            (points.speed_ratio, points.acceleration_ratio) = (speed, acceleration);
            assert_eq!(
                Governor::plan_limit(&points),
                limit,
                "{speed} {acceleration}"
            );
        }
    }

    #[test]
    fn a_speed_of_nothing_is_rest_and_a_feed_is_kept_where_one_is_asked_for() {
        let aim = |goal, ratio| Aim {
            goal,
            ratio,
            kept_rate: ratio,
            path: [0.0; 3],
        };
        let rest = Goal::run(0.7, 0.0, None);
        assert!(rest.is_rest() && rest.sigma() == 0.7 && rest.speed_mm_per_s() == 0.0);
        let run = Goal::run(0.7, 5.0, None);
        assert!(!run.is_rest() && run.sigma() == 0.7 && run.speed_mm_per_s() == 5.0);
        let free = Goal::run(1.0, f64::INFINITY, None);
        for (goal, ratio, keeps) in [
            (rest, f64::INFINITY, false),
            (rest, 0.5, true),
            (run, f64::INFINITY, true),
            (free, 0.5, true),
            (free, f64::INFINITY, false),
        ] {
            assert_eq!(aim(goal, ratio).keeps_feed(), keeps, "{goal:?} {ratio}");
        }
    }
}
