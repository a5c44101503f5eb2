//! Steps of velocity and acceleration where segments of order 3 meet, and what they take of the limits around them.
//!
//! A plan may pass a jump of its curvature or a turn too small to rest at. The differences of samples show such a step for
//! three samples, beside what the rate of program time does meanwhile: in the periods around it that has the less.

use tandem_sdk::{MAX_AXES, Segment, derivatives};

/// Share of its step by which acceleration is in the worst third difference of four samples, times the period.
const WORST: f64 = 0.75;
/// Periods after the one with the step whose samples show it, and as many before it in which what is begun lasts.
pub const AROUND: u8 = 2;

/// Steps per axis, summed up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steps {
    velocity: [f64; MAX_AXES],
    acceleration: [f64; MAX_AXES],
    /// The largest jerk of the plan beside one of them, mm/s³.
    jerk: [f64; MAX_AXES],
    /// How long the shortest of the segments beside them is, s: that far the plan has the jerk beside them.
    beside_s: f64,
}

impl Default for Steps {
    fn default() -> Self {
        Self {
            velocity: [0.0; MAX_AXES],
            acceleration: [0.0; MAX_AXES],
            jerk: [0.0; MAX_AXES],
            beside_s: f64::INFINITY,
        }
    }
}

/// Jerk of each axis in `segment` at the local time `t_s`, mm/s³.
fn jerk(segment: &Segment, t_s: f64) -> [f64; MAX_AXES] {
    std::array::from_fn(|axis| derivatives(&segment.coefficients[axis], t_s)[2].abs())
}

impl Steps {
    /// From the end of `before` to the start of `behind`.
    pub fn between(before: &Segment, behind: &Segment) -> Self {
        let velocity = behind.velocity(0.0) - before.velocity(before.duration_s);
        let acceleration = behind.acceleration(0.0) - before.acceleration(before.duration_s);
        let (jerk_before, jerk_behind) = (jerk(before, before.duration_s), jerk(behind, 0.0));
        Self {
            velocity: velocity.0.map(f64::abs),
            acceleration: acceleration.0.map(f64::abs),
            jerk: std::array::from_fn(|axis| jerk_before[axis].max(jerk_behind[axis])),
            beside_s: before.duration_s.min(behind.duration_s),
        }
    }

    /// From the end of `before` to a rest there.
    pub fn to_rest(before: &Segment) -> Self {
        let velocity = before.velocity(before.duration_s);
        let acceleration = before.acceleration(before.duration_s);
        Self {
            velocity: velocity.0.map(f64::abs),
            acceleration: acceleration.0.map(f64::abs),
            jerk: jerk(before, before.duration_s),
            beside_s: before.duration_s,
        }
    }

    /// Both, as if they came together.
    pub fn join(&mut self, other: &Self) {
        for axis in 0..MAX_AXES {
            self.velocity[axis] += other.velocity[axis];
            self.acceleration[axis] += other.acceleration[axis];
            self.jerk[axis] = self.jerk[axis].max(other.jerk[axis]);
        }
        self.beside_s = self.beside_s.min(other.beside_s);
    }

    /// Acceleration of `axis` that samples show for them at the rate `sigma`, mm/s².
    pub fn acceleration_mm_per_s2(&self, axis: usize, sigma: f64, period_s: f64) -> f64 {
        sigma * self.velocity[axis] / period_s
    }

    /// Jerk that may be driven of `axis` beside them at the rate `sigma`, mm/s³, where samples may show `most`. On top of a step samples show
    /// a mean of what is driven before it and behind it: what the plan itself uses on one side is not left on the other. Where a segment
    /// beside them is shorter than samples look, the one beyond it may use all of it.
    pub fn left_of_jerk_mm_per_s3(&self, axis: usize, sigma: f64, period_s: f64, most: f64) -> f64 {
        let step = self.jerk_mm_per_s3(axis, sigma, period_s);
        if step == 0.0 {
            return most;
        }
        let is_known = self.beside_s >= f64::from(AROUND) * sigma * period_s;
        let planned = if is_known {
            (sigma * sigma * sigma * self.jerk[axis]).min(most)
        } else {
            most
        };
        let left = most - step;
        left.min(2.0 * left - planned)
    }

    /// Jerk of `axis` that samples show for them at the rate `sigma`, mm/s³.
    fn jerk_mm_per_s3(&self, axis: usize, sigma: f64, period_s: f64) -> f64 {
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

    /// One motion in two segments: from 3 to 5 mm/s, and on with the same acceleration.
    #[test]
    fn a_motion_that_goes_on_as_it_is_has_no_step() {
        let segment = |velocity: f64| {
            let mut segment = Segment::rest(&AxisVector::ZERO, 0.5);
            segment.coefficients[1] = [0.0, velocity, 2.0, 0.0, 0.0, 0.0];
            segment
        };
        let steps = Steps::between(&segment(3.0), &segment(5.0));
        assert_eq!(steps.acceleration_mm_per_s2(1, 1.0, 0.001), 0.0);
        assert_eq!(steps.jerk_mm_per_s3(1, 1.0, 0.001), 0.0);
        // To a rest there the speed and the acceleration at its end are the step.
        let steps = Steps::to_rest(&segment(3.0));
        assert_eq!(steps.acceleration_mm_per_s2(1, 1.0, 0.5), 5.0 / 0.5);
        assert_eq!(
            steps.jerk_mm_per_s3(1, 1.0, 0.5),
            (5.0 / 0.5 + WORST * 4.0) / 0.5
        );
    }

    /// Segments of 0.5 s on both sides of a step of the acceleration by 8 mm/s² use 900 mm/s³ before it and 100 mm/s³ behind it.
    #[test]
    fn the_jerk_that_the_plan_uses_on_one_side_of_a_step_is_not_left_on_the_other() {
        let segment = |[velocity, acceleration, jerk]: [f64; 3], duration_s: f64| {
            let mut segment = Segment::rest(&AxisVector::ZERO, duration_s);
            segment.coefficients[0] = [0.0, velocity, acceleration / 2.0, jerk / 6.0, 0.0, 0.0];
            segment
        };
        let (sigma, period_s, most) = (0.9, 0.01, 1000.0);
        let step = WORST * sigma * sigma * 8.0 / period_s;
        let left = |before_s: f64, planned: f64| {
            let came = [
                planned * before_s * before_s / 2.0,
                -planned * before_s,
                planned,
            ];
            let before = segment(came, before_s);
            let steps = Steps::between(&before, &segment([0.0, 8.0, 100.0], 0.5));
            assert_eq!(
                steps.left_of_jerk_mm_per_s3(1, sigma, period_s, most),
                most,
                "an axis without a step has all of it"
            );
            steps.left_of_jerk_mm_per_s3(0, sigma, period_s, most)
        };
        // The mean of both sides is what the step leaves.
        let used = sigma.powi(3) * 900.0;
        assert!((f64::midpoint(left(0.5, 900.0), used) - (most - step)).abs() < 1e-9);
        assert!((left(0.5, 200.0) - (most - step)).abs() < 1e-9);
        // What comes before a segment that is shorter than samples look at this rate may use all of the limit.
        let seen_s = f64::from(AROUND) * sigma * period_s;
        assert!((left(seen_s + 1e-9, 200.0) - (most - step)).abs() < 1e-9);
        assert!((left(seen_s - 1e-9, 200.0) - (most - 2.0 * step)).abs() < 1e-9);
        assert!((left(0.01, 200.0) - (most - 2.0 * step)).abs() < 1e-9);
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
