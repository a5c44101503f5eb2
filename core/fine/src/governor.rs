//! The governor: how fast program time passes.
//!
//! Program time advances at the rate σ, 0 ≤ σ ≤ 1, which changes linearly within a period. With q the plan in program
//! time the axes move at σ·q′ and accelerate by σ²·q″ + σ̇·q′. Where the plan's velocity steps at junctions, q′ stands
//! for the continuous velocity that the segment declares; the steps themselves shrink with σ. A constant σ is always
//! admissible where the plan is, so the interval for σ̇ is never empty.

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
    period_s: f64,
    acceleration: [f64; MAX_AXES],
    axes: usize,
}

impl Governor {
    /// A governor at σ = 1: where nothing moves, program time passes at its own rate.
    pub fn new(limits: &[AxisLimits; MAX_AXES], axes: usize, period_s: f64) -> Self {
        Self { sigma: 1.0, period_s, acceleration: limits.map(|l| l.acceleration_mm_per_s2), axes }
    }

    /// The rate at the end of the last period.
    pub fn sigma(&self) -> f64 {
        self.sigma
    }

    /// Sets the rate where nothing moves and any rate is as good.
    pub fn jump(&mut self, sigma: f64) {
        self.sigma = sigma;
    }

    /// The highest rate at which the plan itself keeps the limits: 1 unless the planner is defective.
    pub fn plan_limit(points: &Points) -> f64 {
        let excess = points.speed_ratio.max(points.acceleration_ratio.sqrt());
        if excess <= 1.0 + TOLERANCE { 1.0 } else { 1.0 / excess }
    }

    /// The rate at the end of this period, as near to `target` as the limits let it come.
    pub fn choose(&self, target: f64, points: &Points) -> f64 {
        let first = self.admissible(target, self.sigma, points);
        // The bounds depend on σ, monotonically: what holds at both ends of the period holds in between.
        let second = self.admissible(target, first, points);
        if (second - self.sigma).abs() < (first - self.sigma).abs() { second } else { first }
    }

    /// Takes `sigma` as the rate at the end of this period; gives the program time that passes meanwhile, s.
    pub fn take(&mut self, sigma: f64) -> f64 {
        let mean = f64::midpoint(self.sigma, sigma);
        self.sigma = sigma;
        mean * self.period_s
    }

    /// Program time that would pass if the period ended at `sigma`, s.
    pub fn program_time_s(&self, sigma: f64) -> f64 {
        f64::midpoint(self.sigma, sigma) * self.period_s
    }

    /// `target`, cut to what the acceleration limits allow when the bounds are taken at `sigma`.
    fn admissible(&self, target: f64, sigma: f64, points: &Points) -> f64 {
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for point in points.iter() {
            for axis in 0..self.axes {
                let velocity = point.velocity[axis];
                if velocity == 0.0 {
                    continue;
                }
                let planned = sigma * sigma * point.acceleration[axis];
                let most = (MARGIN * self.acceleration[axis]).max(planned.abs());
                let (a, b) = ((-most - planned) / velocity, (most - planned) / velocity);
                low = low.max(a.min(b));
                high = high.min(a.max(b));
            }
        }
        (self.sigma + ((target - self.sigma) / self.period_s).clamp(low, high.max(low)) * self.period_s).clamp(0.0, 1.0)
    }
}
