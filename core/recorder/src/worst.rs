//! The largest shares of the limits that samples use, whatever the guard makes of them.

use tandem_machine::Machine;
use tandem_rings::Sample;
use tandem_sdk::{AxisLimits, MAX_AXES};

use crate::summary::{OfLimit, OfLimits};

/// Per axis the worst sample for velocity, acceleration and jerk.
#[derive(Debug)]
pub struct Worst {
    axes: [WorstOfAxis; MAX_AXES],
    period_s: f64,
}

/// The same of one axis.
#[derive(Clone, Copy, Debug)]
struct WorstOfAxis {
    limits: AxisLimits,
    /// Change of the velocity that the acceleration limit explains in a period, mm/s.
    explained_mm_per_s: f64,
    /// Per sign: by how much the velocity has changed more than that, mm/s.
    beyond: [f64; 2],
    /// Largest |velocity|, |change of velocity| and |jerk| of which the share of the limit is known: what is no larger has no larger
    /// share, and most samples need no division.
    largest: [f64; 3],
    of_limits: OfLimits,
}

impl Worst {
    /// Nothing seen.
    pub fn new(machine: &Machine) -> Self {
        let period_s = machine.fine_period_s;
        let of_axis = |limits: AxisLimits| WorstOfAxis {
            limits,
            explained_mm_per_s: limits.acceleration_mm_per_s2 * period_s,
            beyond: [0.0; 2],
            largest: [-1.0; 3],
            of_limits: OfLimits::default(),
        };
        Self {
            axes: machine.limits.axes.map(of_axis),
            period_s,
        }
    }

    /// The planner makes use of these steps of the velocity and no others, per axis, mm/s.
    pub fn allow_steps(&mut self, speed_difference_mm_per_s: &[f64; MAX_AXES]) {
        for (axis, step) in self.axes.iter_mut().zip(speed_difference_mm_per_s) {
            axis.limits.speed_difference_mm_per_s = *step;
        }
    }

    /// Velocity, acceleration and jerk of `axis` up to a sample, as finite differences.
    #[inline]
    pub fn sample(&mut self, axis: usize, motion: [f64; 3], sample: &Sample) {
        self.axes[axis].sample(motion, self.period_s, sample);
    }

    /// Whether no earlier change of the velocity of `axis` counts any more.
    #[inline]
    pub fn is_settled(&self, axis: usize) -> bool {
        self.axes[axis].beyond == [0.0; 2]
    }

    /// What was worst of the limits of `axis`.
    pub fn of_axis(&self, axis: usize) -> OfLimits {
        self.axes[axis].of_limits
    }
}

impl WorstOfAxis {
    #[inline]
    fn sample(&mut self, [velocity, acceleration, jerk]: [f64; 3], period_s: f64, sample: &Sample) {
        let change = acceleration * period_s;
        if self.is_beyond_steps(change) || is_larger(&mut self.largest[1], change) {
            let share = self.of_acceleration(change);
            raise(&mut self.of_limits.acceleration, share, sample);
        }
        let limits = &self.limits;
        if is_larger(&mut self.largest[0], velocity) {
            let fastest = limits.feed_mm_per_s.max(limits.rapid_mm_per_s);
            raise(
                &mut self.of_limits.velocity,
                velocity.abs() / fastest,
                sample,
            );
        }
        if is_larger(&mut self.largest[2], jerk) {
            let share = jerk.abs() / limits.jerk_mm_per_s3;
            raise(&mut self.of_limits.jerk, share, sample);
        }
    }

    /// Whether `change` of the velocity in one period is more than the limit explains, or one before it was.
    fn is_beyond_steps(&self, change: f64) -> bool {
        change.abs() > self.explained_mm_per_s || self.beyond != [0.0; 2]
    }

    /// Share of the acceleration limit that `change` of the velocity, in one period, uses. Where steps are allowed, no single change
    /// says it: as for the guard, it is beyond by what it adds to more than such a step.
    fn of_acceleration(&mut self, change: f64) -> f64 {
        let most = self.explained_mm_per_s;
        let mut share = (change.abs() / most).min(1.0);
        for (sign, beyond) in [1.0, -1.0].into_iter().zip(&mut self.beyond) {
            let added = sign * change - most;
            *beyond = (*beyond + added).max(0.0);
            let excess = (*beyond - self.limits.speed_difference_mm_per_s).min(added);
            if excess > 0.0 {
                share = share.max(1.0 + excess / most);
            }
        }
        share
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
