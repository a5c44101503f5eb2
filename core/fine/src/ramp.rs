//! Ramping out: to rest from the last samples sent, at the limits. Leaves the path; asks no plugin.
//!
//! Every axis goes by its own limits. Where joints are sums of axes they go together instead: one law for the whole vector
//! of velocities, so that every sum of axes goes by it too, and lasts as long as the joint or axis that needs most.

use tandem_sdk::{AxisVector, MAX_AXES};

use crate::config::{FineConfig, Joints};
use crate::guard::Guard;
use crate::law::to_rest;

/// Share of the jerk with which an axis comes to rest: a plan that brakes towards the end of its travel may use all of it, and a
/// ramp with less would go beyond.
const SHARE: f64 = 1.0;

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
    together: Option<Together>,
    /// Entries that move.
    axes: usize,
}

impl Ramp {
    /// From the last samples sent.
    pub fn new(config: &FineConfig, sent: &Guard) -> Self {
        let smooth = config.order >= 3;
        let mut ramp = Self {
            position: *sent.position(),
            velocity: *sent.velocity(),
            acceleration: *sent.acceleration(),
            most: config.limits.axes.map(|l| l.acceleration_mm_per_s2),
            jerk: config.limits.axes.map(|l| {
                if smooth {
                    l.jerk_mm_per_s3
                } else {
                    f64::INFINITY
                }
            }),
            period_s: config.period_s,
            together: None,
            axes: if matches!(config.joints, Joints::Curved { .. }) {
                config.axis_count()
            } else {
                MAX_AXES
            },
        };
        if matches!(config.joints, Joints::Sums(_)) {
            ramp.together = Some(Together::new(&ramp, config.lane_count()));
        }
        ramp
    }

    /// The next sample. Each axis slows by its limits, whatever lies ahead: the travel too.
    pub fn next(&mut self) -> AxisVector {
        if let Some(together) = &mut self.together {
            self.velocity = together.next(self.period_s);
        } else {
            (0..self.axes).for_each(|axis| self.slow(axis));
        }
        self.position += self.velocity * self.period_s;
        self.position
    }

    /// Whether every axis rests.
    pub fn is_over(&self) -> bool {
        self.velocity.0[..self.axes].iter().all(|v| *v == 0.0)
    }

    fn slow(&mut self, axis: usize) {
        if self.jerk[axis].is_finite() {
            self.slow_smoothly(axis);
        } else {
            let v = self.velocity[axis];
            self.velocity[axis] = v.signum() * (v.abs() - self.most[axis] * self.period_s).max(0.0);
        }
    }

    /// The change of acceleration that leads to rest soonest. In samples `v ← v + T·a` follows `a ← a + T·j`: the law's
    /// form in `v − T·a`.
    fn slow_smoothly(&mut self, axis: usize) {
        let (period_s, limit, most) = (self.period_s, self.jerk[axis], self.most[axis]);
        let (velocity, acceleration) = (self.velocity[axis], self.acceleration[axis]);
        let jerk = to_rest(
            velocity - period_s * acceleration,
            acceleration,
            SHARE * limit,
            limit,
            period_s,
        );
        let kept = acceleration.abs().max(most);
        let next = (acceleration + period_s * jerk).clamp(-kept, kept);
        let step = limit * period_s;
        let arrives =
            (velocity + period_s * next).abs() < 1e-3 * step * period_s && next.abs() < step;
        (self.velocity[axis], self.acceleration[axis]) = if arrives {
            (0.0, 0.0)
        } else {
            (velocity + period_s * next, next)
        };
    }
}

/// All entries to rest by one law: first the acceleration runs out, then the velocity falls.
#[derive(Clone, Copy, Debug)]
struct Together {
    velocity: AxisVector,
    acceleration: AxisVector,
    /// What is left of the velocity when the acceleration has run out.
    steady: AxisVector,
    /// How long it takes to run out at the jerk limit, in periods.
    runs_out: f64,
    /// Whole periods until then, and from then until rest.
    periods: [f64; 2],
    /// The velocity falls with `1 − 3τ² + 2τ³` where there is a jerk limit, else with `1 − τ`.
    smooth: bool,
    passed: f64,
}

impl Together {
    /// From the state of `ramp`, within the limits of its first `count` entries.
    fn new(ramp: &Ramp, count: usize) -> Self {
        let (period_s, velocity, acceleration) = (ramp.period_s, ramp.velocity, ramp.acceleration);
        let longest = |of: &dyn Fn(usize) -> f64| (0..count).map(of).fold(0.0, f64::max);
        let smooth = ramp.jerk[..count].iter().any(|jerk| jerk.is_finite());
        let runs_out = longest(&|i| acceleration[i].abs() / ramp.jerk[i]) / period_s;
        let out = runs_out.ceil();
        let steady = velocity + acceleration * (gained(out, runs_out) * period_s);
        // The falling law has its greatest slope 1.5 in the middle, its greatest bend 6 at the ends.
        let fall_s = longest(&|i| {
            let v = steady[i].abs();
            if smooth {
                (1.5 * v / ramp.most[i]).max((6.0 * v / ramp.jerk[i]).sqrt())
            } else {
                v / ramp.most[i]
            }
        });
        let fall = (fall_s / period_s).ceil().max(1.0);
        Self {
            velocity,
            acceleration,
            steady,
            runs_out,
            periods: [out, fall],
            smooth,
            passed: 0.0,
        }
    }

    /// The velocity in the next period.
    fn next(&mut self, period_s: f64) -> AxisVector {
        self.passed += 1.0;
        let [out, fall] = self.periods;
        if self.passed <= out {
            return self.velocity
                + self.acceleration * (gained(self.passed, self.runs_out) * period_s);
        }
        let share = ((self.passed - out) / fall).min(1.0);
        if share >= 1.0 {
            return AxisVector::ZERO;
        }
        self.steady
            * if self.smooth {
                1.0 - share * share * (3.0 - 2.0 * share)
            } else {
                1.0 - share
            }
    }
}

/// How many periods of an acceleration are gained in the first `periods` periods of its running out, a period's share of
/// `1/runs_out` after the other: never more than the plan would gain, so that no speed gets beyond what was planned.
fn gained(periods: f64, runs_out: f64) -> f64 {
    let periods = periods.min(runs_out.floor());
    if periods > 0.0 {
        periods - periods * (periods + 1.0) / (2.0 * runs_out)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ramp(velocity: [f64; 2], acceleration: [f64; 2], jerk: f64) -> Ramp {
        let lanes = |[x, y]: [f64; 2]| AxisVector::from_slice(&[x, y, x + y, x - y]);
        let mut ramp = Ramp {
            position: AxisVector::ZERO,
            velocity: lanes(velocity),
            acceleration: lanes(acceleration),
            most: [1000.0, 800.0, 900.0, 900.0, 0.0, 0.0, 0.0, 0.0],
            jerk: [jerk; MAX_AXES],
            period_s: 0.001,
            together: None,
            axes: MAX_AXES,
        };
        ramp.together = Some(Together::new(&ramp, 4));
        ramp
    }

    proptest! {
        /// From any state within the limits, every entry keeps them, and a sum of axes stays their sum.
        #[test]
        fn together_within_all_limits(
            v in proptest::array::uniform2(-150.0..150.0f64), a in proptest::array::uniform2(-440.0..440.0f64),
            jerk in prop_oneof![Just(f64::INFINITY), 5_000.0..50_000.0f64],
        ) {
            let mut ramp = ramp(v, if jerk.is_finite() { a } else { [0.0; 2] }, jerk);
            let start = ramp;
            let (mut velocity, mut acceleration) = (ramp.velocity, ramp.acceleration);
            for _ in 0..20_000 {
                if ramp.is_over() { break; }
                let at = ramp.next();
                prop_assert!((at[2] - at[0] - at[1]).abs() < 1e-9 && (at[3] - at[0] + at[1]).abs() < 1e-9);
                let next = (ramp.velocity - velocity) * 1e3;
                let change = (next - acceleration) * 1e3;
                // What the entry that needs longest gains while its acceleration runs out at its jerk limit.
                let longest_s = (0..4).fold(0.0, |most: f64, i| most.max(start.acceleration[i].abs() / jerk));
                for i in 0..4 {
                    let gain = 0.5 * start.acceleration[i].abs() * longest_s;
                    prop_assert!(ramp.velocity[i].abs() <= start.velocity[i].abs() + gain + 1e-9, "{i}");
                    prop_assert!(next[i].abs() <= ramp.most[i] * (1.0 + 1e-6), "{i}: {}", next[i]);
                    prop_assert!(change[i].abs() <= jerk * 1.01, "{i}: {}", change[i]);
                }
                (velocity, acceleration) = (ramp.velocity, next);
            }
            prop_assert!(ramp.is_over());
        }

        /// A plan brakes to rest with all that the axis has, as towards the end of its travel, and is given up on the way.
        #[test]
        fn goes_no_farther_than_a_plan_that_brakes_already(
            speed in 1.0..200.0f64, most in 100.0..5000.0f64, building_s in 0.003..0.1f64, period_s in 1e-4..1e-3f64,
            phase in 0.0..1.0f64, at in 0.0..1.0f64,
        ) {
            let jerk = most / building_s;
            let ramp_s = building_s.min((speed / jerk).sqrt());
            let held_s = speed / (jerk * ramp_s) - ramp_s;
            let pieces = [(-jerk, ramp_s), (0.0, held_s), (jerk, ramp_s)];
            let plan = |time_s: f64| {
                let (mut left_s, mut x, mut v, mut a) = (time_s, 0.0, speed, 0.0);
                for (j, piece_s) in pieces {
                    let t = f64::min(left_s, piece_s).max(0.0);
                    x += t * (v + t * (a / 2.0 + t * j / 6.0));
                    (v, a) = (v + t * (a + t * j / 2.0), a + t * j);
                    left_s -= piece_s;
                }
                x
            };
            // Before the plan brakes it goes straight on.
            let plan = |time_s: f64| if time_s < 0.0 { speed * time_s } else { plan(time_s) };
            let time_s = 2.0 * ramp_s + held_s;
            let samples = (time_s / period_s).floor();
            let sample = |k: f64| plan((k + phase) * period_s);
            let k = (at * samples).floor();
            let velocity = (sample(k) - sample(k - 1.0)) / period_s;
            let before = (sample(k - 1.0) - sample(k - 2.0)) / period_s;
            let one = |x: f64| AxisVector::from_slice(&[x]);
            let mut ramp = Ramp {
                position: one(sample(k)),
                velocity: one(velocity),
                acceleration: one((velocity - before) / period_s),
                most: [most; MAX_AXES],
                jerk: [jerk; MAX_AXES],
                period_s,
                together: None,
                axes: 1,
            };
            let (mut velocity, mut acceleration, mut last) = (ramp.velocity, ramp.acceleration, ramp.position);
            for _ in 0..100_000 {
                if ramp.is_over() { break; }
                last = ramp.next();
                let next = (ramp.velocity - velocity) * (1.0 / period_s);
                let change = (next - acceleration)[0] / period_s;
                prop_assert!(next[0].abs() <= most * (1.0 + 1e-6), "{} of {most}", next[0]);
                prop_assert!(change.abs() <= jerk * 1.01, "{change} of {jerk}");
                (velocity, acceleration) = (ramp.velocity, next);
            }
            prop_assert!(ramp.is_over());
            let (end, grain) = (plan(time_s), jerk * period_s.powi(3));
            prop_assert!(last[0] <= end + grain, "{} grains beyond", (last[0] - end) / grain);
        }
    }
}
