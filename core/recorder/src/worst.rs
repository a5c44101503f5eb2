//! The largest shares of the limits that samples use, whatever the guard makes of them.

use tandem_machine::Machine;
use tandem_rings::Sample;
use tandem_sdk::{AxisLimits, AxisVector, MAX_AXES};

use crate::summary::{OfLimit, OfLimits};

/// Per axis the worst sample for velocity, acceleration and jerk.
#[derive(Debug)]
pub struct Worst {
    limits: [AxisLimits; MAX_AXES],
    axes: usize,
    period_s: f64,
    /// Per axis and sign: by how much the velocity has changed more than the acceleration limit explains, mm/s.
    beyond: [[f64; 2]; MAX_AXES],
    /// Largest |velocity|, |change of velocity| and |jerk| of which the share of the limit is known: what is no larger has no larger
    /// share, and most samples need no division.
    largest: [[f64; 3]; MAX_AXES],
    of_limits: [OfLimits; MAX_AXES],
}

impl Worst {
    /// Nothing seen.
    pub fn new(machine: &Machine) -> Self {
        let limits = machine.limits.axes;
        let axes = machine.axes.count();
        let period_s = machine.fine_period_s;
        let (beyond, of_limits) = ([[0.0; 2]; MAX_AXES], [OfLimits::default(); MAX_AXES]);
        Self {
            limits,
            axes,
            period_s,
            beyond,
            largest: [[-1.0; 3]; MAX_AXES],
            of_limits,
        }
    }

    /// The planner makes use of these steps of the velocity and no others, per axis, mm/s.
    pub fn allow_steps(&mut self, speed_difference_mm_per_s: &[f64; MAX_AXES]) {
        for (limits, step) in self.limits.iter_mut().zip(speed_difference_mm_per_s) {
            limits.speed_difference_mm_per_s = *step;
        }
    }

    /// Share of the acceleration limit that `change` of the velocity of `axis`, in one period, uses. Where steps are
    /// allowed, no single change says it: as for the guard, it is beyond by what it adds to more than such a step.
    fn of_acceleration(&mut self, axis: usize, change: f64) -> f64 {
        let limits = &self.limits[axis];
        let most = limits.acceleration_mm_per_s2 * self.period_s;
        let mut share = (change.abs() / most).min(1.0);
        for (sign, beyond) in [1.0, -1.0].into_iter().zip(&mut self.beyond[axis]) {
            let added = sign * change - most;
            *beyond = (*beyond + added).max(0.0);
            let excess = (*beyond - limits.speed_difference_mm_per_s).min(added);
            if excess > 0.0 {
                share = share.max(1.0 + excess / most);
            }
        }
        share
    }

    /// A sample with these finite differences: velocity, acceleration and jerk.
    pub fn sample(&mut self, sample: &Sample, [velocity, acceleration, jerk]: [&AxisVector; 3]) {
        for axis in 0..self.axes {
            let change = acceleration[axis] * self.period_s;
            if self.is_beyond_steps(axis, change) || is_larger(&mut self.largest[axis][1], change) {
                let share = self.of_acceleration(axis, change);
                raise(&mut self.of_limits[axis].acceleration, share, sample);
            }
            let (limits, of) = (&self.limits[axis], &mut self.of_limits[axis]);
            let [fastest_seen, _, most_jerk] = &mut self.largest[axis];
            if is_larger(fastest_seen, velocity[axis]) {
                let fastest = limits.feed_mm_per_s.max(limits.rapid_mm_per_s);
                raise(&mut of.velocity, velocity[axis].abs() / fastest, sample);
            }
            if is_larger(most_jerk, jerk[axis]) {
                raise(
                    &mut of.jerk,
                    jerk[axis].abs() / limits.jerk_mm_per_s3,
                    sample,
                );
            }
        }
    }

    /// Whether `change` of the velocity of `axis` in one period is more than the limit explains, or one before it was.
    fn is_beyond_steps(&self, axis: usize, change: f64) -> bool {
        let most = self.limits[axis].acceleration_mm_per_s2 * self.period_s;
        change.abs() > most || self.beyond[axis] != [0.0; 2]
    }

    /// What was worst of the limits of `axis`.
    pub fn of_axis(&self, axis: usize) -> OfLimits {
        self.of_limits[axis]
    }
}

/// Whether `value` is of a larger magnitude than any before it, of which `largest` is the largest.
fn is_larger(largest: &mut f64, value: f64) -> bool {
    let larger = value.abs() > *largest;
    if larger {
        *largest = value.abs();
    }
    larger
}

fn raise(worst: &mut OfLimit, share: f64, sample: &Sample) {
    // Most samples are not the worst: one comparison each.
    if share > worst.share {
        *worst = OfLimit {
            share,
            tick: sample.tick,
            line: sample.line,
            state: sample.state.name(),
        };
    }
}
