//! The governor: how fast program time passes.
//!
//! Program time advances at the rate σ, 0 ≤ σ ≤ 1, which changes linearly within a period. With q the plan in program
//! time the axes move at σ·q′ and accelerate by σ²·q″ + σ̇·q′. Where the plan's velocity steps at junctions, q′ stands
//! for the continuous velocity that the segment declares; the steps themselves shrink with σ. A constant σ is always
//! admissible where the plan is, so the interval for σ̇ is never empty.

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
        if excess <= 1.0 + TOLERANCE { 1.0 } else { 1.0 / excess }
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
fn reach(sigma: f64, (velocity_per_s, acceleration): (f64, f64), limit: f64, direction: f64) -> f64 {
    let planned = sigma * sigma * acceleration;
    let most = (MARGIN * limit).max(planned.abs());
    let turned = direction * velocity_per_s;
    let slope = turned + 2.0 * direction * sigma * acceleration;
    let up = crossing(most - planned, turned, 0.0).min(crossing(most - planned, slope, acceleration));
    let down = crossing(most + planned, -turned, 0.0).min(crossing(most + planned, -slope, -acceleration));
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
            assert!((sigma - (1.0 - MARGIN / 50.0)).abs() < 1e-9, "axis {moving}: {sigma}");
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
