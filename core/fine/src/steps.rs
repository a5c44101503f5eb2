//! Steps of velocity and acceleration where segments of order 3 meet, and what they take of the limits around them.
//!
//! A plan may pass a jump of its curvature or a turn too small to rest at. The differences of samples show such a step for
//! three samples, beside what the rate of program time does meanwhile: in the periods around it that has the less.

use tandem_sdk::{MAX_AXES, Segment};

/// Share of its step by which acceleration is in the worst third difference of four samples, times the period.
const WORST: f64 = 0.75;
/// Periods after the one with the step whose samples show it, and as many before it in which what is begun lasts.
pub const AROUND: u8 = 2;

/// Steps per axis, summed up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Steps {
    velocity: [f64; MAX_AXES],
    acceleration: [f64; MAX_AXES],
}

impl Steps {
    /// From the end of `before` to the start of `behind`.
    pub fn between(before: &Segment, behind: &Segment) -> Self {
        let velocity = behind.velocity(0.0) - before.velocity(before.duration_s);
        let acceleration = behind.acceleration(0.0) - before.acceleration(before.duration_s);
        Self {
            velocity: velocity.0.map(f64::abs),
            acceleration: acceleration.0.map(f64::abs),
        }
    }

    /// From the end of `before` to a rest there.
    pub fn to_rest(before: &Segment) -> Self {
        let (velocity, acceleration) = (
            before.velocity(before.duration_s),
            before.acceleration(before.duration_s),
        );
        Self {
            velocity: velocity.0.map(f64::abs),
            acceleration: acceleration.0.map(f64::abs),
        }
    }

    /// Both, as if they came together.
    pub fn join(&mut self, other: &Self) {
        for axis in 0..MAX_AXES {
            self.velocity[axis] += other.velocity[axis];
            self.acceleration[axis] += other.acceleration[axis];
        }
    }

    /// Acceleration of `axis` that samples show for them at the rate `sigma`, mm/s².
    pub fn acceleration_mm_per_s2(&self, axis: usize, sigma: f64, period_s: f64) -> f64 {
        sigma * self.velocity[axis] / period_s
    }

    /// Jerk of `axis` that samples show for them at the rate `sigma`, mm/s³.
    pub fn jerk_mm_per_s3(&self, axis: usize, sigma: f64, period_s: f64) -> f64 {
        sigma * (self.velocity[axis] / period_s + WORST * sigma * self.acceleration[axis])
            / period_s
    }
}

/// Steps that the next samples still show.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Recent {
    steps: Steps,
    periods: u8,
}

impl Recent {
    /// The steps; none after some periods without.
    pub fn steps(&self) -> Steps {
        self.steps
    }

    /// A period with these steps has passed.
    pub fn pass(&mut self, crossed: Option<&Steps>) {
        if let Some(steps) = crossed {
            self.steps.join(steps);
            self.periods = AROUND;
        } else if self.periods > 0 {
            self.periods -= 1;
            if self.periods == 0 {
                self.steps = Steps::default();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::AxisVector;

    /// From 5 mm/s to 7 mm/s, and from an acceleration of nothing to 40 mm/s².
    fn steps() -> Steps {
        let segment = |velocity: f64, acceleration: f64| {
            let mut segment = Segment::rest(&AxisVector::ZERO, 0.5);
            segment.coefficients[1] = [0.0, velocity, acceleration / 2.0, 0.0, 0.0, 0.0];
            segment
        };
        Steps::between(&segment(5.0, 0.0), &segment(7.0, 40.0))
    }

    #[test]
    fn a_step_takes_of_the_limits_what_samples_show_of_it() {
        let steps = steps();
        assert!((steps.acceleration_mm_per_s2(1, 0.5, 0.001) - 0.5 * 2.0 / 0.001).abs() < 1e-9);
        let jerk = 0.5 * (2.0 / 0.001 + 0.75 * 0.5 * 40.0) / 0.001;
        assert!((steps.jerk_mm_per_s3(1, 0.5, 0.001) - jerk).abs() < 1e-6);
        assert_eq!(steps.jerk_mm_per_s3(0, 0.5, 0.001), 0.0);
        let mut twice = steps;
        twice.join(&steps);
        assert!((twice.jerk_mm_per_s3(1, 0.5, 0.001) - 2.0 * jerk).abs() < 1e-6);
    }

    #[test]
    fn a_step_counts_in_the_periods_around_it_and_no_longer() {
        let mut recent = Recent::default();
        recent.pass(Some(&steps()));
        for _ in 1..AROUND {
            recent.pass(None);
            assert_eq!(recent.steps(), steps());
        }
        recent.pass(None);
        assert_eq!(recent.steps(), Steps::default());
    }
}
