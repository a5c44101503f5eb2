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
//! in the path speed (down to a cap, or to rest). Taken of it is as much as leaves a way back: from the end of the
//! period on σ̇ must come to zero, within the limits at the ends and in the middle of every stretch of a segment that a
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
//! place, two before it and two behind, the governor leaves that out of what it uses.
//!
//! Asked for is a path speed, ratio × programmed feed, not a scale: a corner that is slower than that anyway runs as
//! planned.
//!
//! # Places ahead
//!
//! Speed is linear within periods, so braking for a place is laid out in whole ones: the end speed is met and not gone
//! below, rest is met at the place. From rest the rate of the first period is one that is kept over it. At a ratio
//! below 1 the plan does not slow down for a lower feed by itself: it reaches that feed at its own deceleration, but
//! not ratio × feed. The fine loop looks at each queued segment once, at most 64 in a period, and remembers where the
//! feed falls; the speed from which every such place can be met with the declared deceleration is a cap. The end of a
//! line in single-block operation is such a place with speed zero. A line whose end can no longer be met is passed.
//! With a jerk limit the machine may pass an end that it brakes for by a few hundredths of a mm, where a turn behind it
//! takes of the jerk: it is held there.

mod below;
mod early;
mod smooth;
mod steady;

use below::Ahead;
use early::Early;
pub use smooth::Aim;
use steady::Steadying;

use tandem_sdk::{AxisLimits, MAX_AXES};

use crate::points::Points;

/// The governor aims this far inside the acceleration limit: what it leaves covers the curvature within a period.
const MARGIN: f64 = 0.999;

/// Relative tolerance within which a plan is at its limit, not beyond it.
const TOLERANCE: f64 = 1e-6;

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
    early: Early,
    /// Where jerk is limited: the way that was begun last, and one that is being tried.
    begun: Steadying,
    tried: Steadying,
    /// Room for the places ahead at which a feed is to be kept.
    ahead: Box<[Ahead]>,
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
            early: Early::new(Points::new(limits, axes)),
            begun: Steadying::new(),
            tried: Steadying::new(),
            ahead: Ahead::room(),
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
        self.begun.clear();
    }

    /// The highest rate at which the plan itself keeps the limits: 1 unless the planner is defective.
    pub fn plan_limit(points: &Points) -> f64 {
        let excess = points.speed_ratio.max(points.acceleration_ratio.sqrt());
        if excess <= 1.0 + TOLERANCE {
            1.0
        } else {
            1.0 / excess
        }
    }

    /// The rate at the end of this period, as near to `target` as the limits let it come.
    pub fn choose(&self, target: f64, points: &Points) -> f64 {
        self.choose_within(self.sigma, target, points, self.period_s)
    }

    /// The same from the rate `sigma`, within `time_s`.
    pub fn choose_within(&self, sigma: f64, target: f64, points: &Points, time_s: f64) -> f64 {
        let direction = if target > sigma { 1.0 } else { -1.0 };
        let mut most = (target - sigma).abs();
        for point in points.iter() {
            for axis in 0..self.axes {
                let planned = (point.velocity[axis] / time_s, point.acceleration[axis]);
                most = most.min(reach(sigma, planned, self.acceleration[axis], direction));
            }
        }
        (sigma + direction * most).clamp(0.0, 1.0)
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

/// How far σ may go from `sigma` in `direction` within a time T before an axis with the planned velocity, divided by T, and
/// acceleration meets its `limit`.
///
/// With σ going from σ₀ to σ₀ + d·t the axis accelerates by `σ²·q″ + d·t/T·q′`: at the start of the time linear in t, at its
/// end quadratic. Where it is within the limit at both ends, it is so in between.
fn reach(
    sigma: f64,
    (velocity_per_s, acceleration): (f64, f64),
    limit: f64,
    direction: f64,
) -> f64 {
    let planned = sigma * sigma * acceleration;
    let most = (MARGIN * limit).max(planned.abs());
    let turned = direction * velocity_per_s;
    let slope = turned + 2.0 * direction * sigma * acceleration;
    let up =
        crossing(most - planned, turned, 0.0).min(crossing(most - planned, slope, acceleration));
    let down =
        crossing(most + planned, -turned, 0.0).min(crossing(most + planned, -slope, -acceleration));
    up.min(down)
}

/// The first t ≥ 0 at which `slope·t + curve·t²` rises through `gap ≥ 0`; infinite where it never does.
fn crossing(gap: f64, slope: f64, curve: f64) -> f64 {
    let discriminant = slope * slope + 4.0 * curve * gap;
    if discriminant < 0.0 {
        return f64::INFINITY;
    }
    let root = discriminant.sqrt();
    // In each case the form that does not cancel.
    if slope > 0.0 {
        2.0 * gap / (slope + root)
    } else if curve > 0.0 {
        (root - slope) / (2.0 * curve)
    } else {
        f64::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_axis_bounds_the_rate_and_not_only_the_first_and_the_last() {
        let axis = AxisLimits {
            min_mm: -1.0,
            max_mm: 1.0,
            feed_mm_per_s: 100.0,
            rapid_mm_per_s: 100.0,
            acceleration_mm_per_s2: 1000.0,
            jerk_mm_per_s3: f64::INFINITY,
            speed_difference_mm_per_s: 0.0,
        };
        let limits = [axis; MAX_AXES];
        for moving in 0..3 {
            let mut segment = tandem_sdk::Segment::rest(&tandem_sdk::AxisVector::ZERO, 1.0);
            segment.coefficients[moving][1] = 50.0;
            let mut points = Points::new(&limits, 3);
            points.add(&segment, 0.0, 0.001);
            // 1000 mm/s² take 1 mm/s of 50 in a period.
            let sigma = Governor::new(&limits, 3, 0.001).choose(0.0, &points);
            assert!(
                (sigma - (1.0 - MARGIN / 50.0)).abs() < 1e-9,
                "axis {moving}: {sigma}"
            );
        }
    }

    proptest! {
        #[test]
        fn the_crossing_is_the_first(gap in 0.0..10.0f64, slope in -5.0..5.0f64, curve in -5.0..5.0f64) {
            let at = |t: f64| slope * t + curve * t * t;
            let t = crossing(gap, slope, curve);
            let until = if t.is_finite() { t } else { 1e3 };
            for step in 0..100 {
                let earlier = until * f64::from(step) / 100.0;
                prop_assert!(at(earlier) <= gap + 1e-6 * (1.0 + gap), "{t}: {} at {earlier}", at(earlier));
            }
            prop_assert!(t.is_infinite() || (at(t) - gap).abs() <= 1e-6 * (1.0 + gap));
        }
    }
}
