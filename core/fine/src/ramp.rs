//! Ramping out: every axis to rest from the last samples sent, at its own limit. Leaves the path; asks no plugin.

use tandem_sdk::{AxisVector, MAX_AXES};

use crate::config::FineConfig;

/// A ramp to rest.
#[derive(Clone, Copy, Debug)]
pub struct Ramp {
    position: AxisVector,
    velocity: AxisVector,
    step: [f64; MAX_AXES],
    period_s: f64,
}

impl Ramp {
    /// From the last position and velocity sent.
    pub fn new(config: &FineConfig, position: &AxisVector, velocity: &AxisVector) -> Self {
        let step = config.limits.axes.map(|l| l.acceleration_mm_per_s2 * config.period_s);
        Self { position: *position, velocity: *velocity, step, period_s: config.period_s }
    }

    /// The next sample. Each axis slows by its acceleration limit, whatever lies ahead: the travel too.
    pub fn next(&mut self) -> AxisVector {
        for axis in 0..MAX_AXES {
            let v = self.velocity[axis];
            self.velocity[axis] = v.signum() * (v.abs() - self.step[axis]).max(0.0);
        }
        self.position += self.velocity * self.period_s;
        self.position
    }

    /// Whether every axis rests.
    pub fn is_over(&self) -> bool {
        self.velocity.0.iter().all(|v| *v == 0.0)
    }
}
