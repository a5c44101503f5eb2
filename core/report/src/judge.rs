//! Which samples of an axis exceed its limits.

use crate::differences::{peak, rate};
use crate::model::Axis;

/// Bits of [`AxisMotion::marks`].
pub(crate) const VELOCITY: u8 = 1;
/// See [`VELOCITY`].
pub(crate) const ACCELERATION: u8 = 2;
/// See [`VELOCITY`].
pub(crate) const JERK: u8 = 4;

/// Relative tolerance of velocity and acceleration limits.
const TOLERANCE: f64 = 1e-6;
/// Relative tolerance of jerk limits.
const JERK_TOLERANCE: f64 = 1e-2;

/// How an axis moved, and where that was too much.
pub(crate) struct AxisMotion {
    /// In unit/s.
    pub velocity: Vec<f64>,
    /// In unit/s².
    pub acceleration: Vec<f64>,
    /// In unit/s³.
    pub jerk: Vec<f64>,
    /// Per sample the limits it exceeds: [`VELOCITY`], [`ACCELERATION`], [`JERK`].
    pub marks: Vec<u8>,
    /// Largest velocity change beyond what the acceleration limit allows, in unit/s.
    pub max_step: f64,
}

impl AxisMotion {
    /// Differentiates the commanded positions and holds them against the limits.
    pub(crate) fn of(axis: &Axis, position: &[f64], steps_s: &[f64], period_s: f64) -> Self {
        let velocity = rate(position, steps_s);
        let acceleration = rate(&velocity, steps_s);
        let jerk = rate(&acceleration, steps_s);
        // What the rounding of the positions alone can make of a velocity.
        let noise = 4.0 * f64::EPSILON * peak(position) / period_s;
        let mut motion = Self {
            marks: vec![0; position.len()],
            max_step: 0.0,
            velocity,
            acceleration,
            jerk,
        };
        motion.mark_above(VELOCITY, axis.max_velocity * (1.0 + TOLERANCE) + noise);
        motion.mark_steps(axis, steps_s, noise);
        if let Some(max) = axis.max_jerk {
            motion.mark_above(
                JERK,
                max * (1.0 + JERK_TOLERANCE) + 4.0 * noise / (period_s * period_s),
            );
        }
        motion
    }

    fn mark_above(&mut self, mark: u8, limit: f64) {
        let values = if mark == VELOCITY {
            &self.velocity
        } else {
            &self.jerk
        };
        for (bits, value) in self.marks.iter_mut().zip(values) {
            if value.abs() > limit {
                *bits |= mark;
            }
        }
    }

    /// A leaky bucket for either direction: speed changes fill it, the acceleration limit empties it, and what is left
    /// must not exceed the allowed step. Single differences could not tell one allowed step from a row of them.
    fn mark_steps(&mut self, axis: &Axis, steps_s: &[f64], noise: f64) {
        let full = axis.speed_difference * (1.0 + TOLERANCE) + noise;
        let leak = axis.max_acceleration * (1.0 + TOLERANCE);
        let mut bucket = [0.0_f64; 2];
        for (i, step_s) in steps_s.iter().enumerate().skip(2) {
            let change = self.velocity[i] - self.velocity[i - 1];
            for (level, rise) in bucket.iter_mut().zip([change, -change]) {
                let gain = rise - leak * step_s;
                *level = (*level + gain).max(0.0);
                self.max_step = self.max_step.max(*level);
                // While a full bucket empties, the samples are innocent: only what adds to it is marked.
                if *level > full && gain > 0.0 {
                    self.marks[i] |= ACCELERATION;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::differences::steps_s;

    const PERIOD_S: f64 = 0.001;

    fn axis(speed_difference: f64) -> Axis {
        Axis {
            letter: 'X',
            max_velocity: 100.0,
            max_acceleration: 1000.0,
            speed_difference,
            ..Axis::default()
        }
    }

    /// Marks of the motion that has the given velocities.
    fn marks(axis: &Axis, velocities: &[f64]) -> Vec<u8> {
        let mut x = 0.0;
        let position: Vec<f64> = velocities
            .iter()
            .map(|v| {
                x += v * PERIOD_S;
                x
            })
            .collect();
        let t_s: Vec<f64> = (0..position.len()).map(|i| i as f64 * PERIOD_S).collect();
        AxisMotion::of(axis, &position, &steps_s(&t_s, PERIOD_S), PERIOD_S).marks
    }

    #[test]
    fn motion_at_its_limits_is_not_marked() {
        let ramp: Vec<f64> = (0..=100).chain([100; 20]).map(f64::from).collect();
        assert!(marks(&axis(0.0), &ramp).iter().all(|&m| m == 0));
    }

    #[test]
    fn one_percent_too_much_is_marked() {
        let fast: Vec<f64> = (0..=100).map(|i| f64::from(i) * 1.01).collect();
        let marks = marks(&axis(0.0), &fast);
        assert!(marks[2..].iter().all(|m| m & ACCELERATION != 0));
        assert_eq!(marks[100] & VELOCITY, VELOCITY);
        assert_eq!(marks[98] & VELOCITY, 0);
    }

    #[test]
    fn one_step_is_allowed_but_not_a_row_of_them() {
        let one = [0.0, 0.0, 2.5, 2.5, 2.5, 2.5];
        assert!(marks(&axis(2.0), &one).iter().all(|&m| m == 0));
        let row = [0.0, 0.0, 2.5, 5.0, 7.5];
        assert_eq!(
            marks(&axis(2.0), &row),
            [0, 0, 0, ACCELERATION, ACCELERATION]
        );
    }

    #[test]
    fn jerk_is_marked_where_it_has_a_limit() {
        let kick = [0.0, 0.0, 0.0, 1.0, 2.0, 3.0];
        let limited = Axis {
            max_jerk: Some(500_000.0),
            ..axis(0.0)
        };
        assert_eq!(marks(&limited, &kick), [0, 0, 0, JERK, 0, 0]);
        assert!(marks(&axis(0.0), &kick).iter().all(|&m| m == 0));
    }
}
