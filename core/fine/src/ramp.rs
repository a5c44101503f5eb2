//! Ramping out: every axis to rest from the last samples sent, at its own limits. Leaves the path; asks no plugin.

use tandem_sdk::{AxisVector, MAX_AXES};

use crate::config::FineConfig;
use crate::guard::Guard;
use crate::law::to_rest;

/// Share of the jerk with which an axis comes to rest; the rest of it is for getting there.
const SHARE: f64 = 0.95;

/// A ramp to rest.
#[derive(Clone, Copy, Debug)]
pub struct Ramp {
    position: AxisVector,
    velocity: AxisVector,
    acceleration: AxisVector,
    most: [f64; MAX_AXES],
    /// Infinite where the planner keeps no jerk limit.
    jerk: [f64; MAX_AXES],
    period_s: f64,
}

impl Ramp {
    /// From the last samples sent.
    pub fn new(config: &FineConfig, sent: &Guard) -> Self {
        let smooth = config.order >= 3;
        Self {
            position: *sent.position(),
            velocity: *sent.velocity(),
            acceleration: *sent.acceleration(),
            most: config.limits.axes.map(|l| l.acceleration_mm_per_s2),
            jerk: config.limits.axes.map(|l| if smooth { l.jerk_mm_per_s3 } else { f64::INFINITY }),
            period_s: config.period_s,
        }
    }

    /// The next sample. Each axis slows by its limits, whatever lies ahead: the travel too.
    pub fn next(&mut self) -> AxisVector {
        for axis in 0..MAX_AXES {
            if self.jerk[axis].is_finite() {
                self.slow_smoothly(axis);
            } else {
                let v = self.velocity[axis];
                self.velocity[axis] = v.signum() * (v.abs() - self.most[axis] * self.period_s).max(0.0);
            }
        }
        self.position += self.velocity * self.period_s;
        self.position
    }

    /// Whether every axis rests.
    pub fn is_over(&self) -> bool {
        self.velocity.0.iter().all(|v| *v == 0.0)
    }

    /// The change of acceleration that leads to rest soonest. In samples `v ← v + T·a` follows `a ← a + T·j`: the law's
    /// form in `v − T·a`.
    fn slow_smoothly(&mut self, axis: usize) {
        let (period_s, limit, most) = (self.period_s, self.jerk[axis], self.most[axis]);
        let (velocity, acceleration) = (self.velocity[axis], self.acceleration[axis]);
        let jerk = to_rest(velocity - period_s * acceleration, acceleration, SHARE * limit, limit, period_s);
        let kept = acceleration.abs().max(most);
        let next = (acceleration + period_s * jerk).clamp(-kept, kept);
        let step = limit * period_s;
        let arrives = (velocity + period_s * next).abs() < 1e-3 * step * period_s && next.abs() < step;
        (self.velocity[axis], self.acceleration[axis]) =
            if arrives { (0.0, 0.0) } else { (velocity + period_s * next, next) };
    }
}
