//! Where segments of order 3 meet: whether velocity or acceleration step there.

use tandem_sdk::{MAX_AXES, Segment, SegmentFlags, derivatives};

/// Steps below these are rounding on any machine: of velocity, mm/s, and of acceleration, mm/s².
pub const ROUNDING: [f64; 2] = [1e-4, 0.1];

/// How the last segment ended.
#[derive(Clone, Copy, Debug)]
pub struct JunctionSteps {
    /// Axes that are looked at: the first ones of a segment.
    lanes: usize,
    /// Velocity and acceleration of each at the end.
    ends: [[f64; 2]; MAX_AXES],
    /// They count: not behind a rest, and of plans that keep no jerk.
    counts: bool,
    /// Steps up to these do not count: of velocity, mm/s, and of acceleration, mm/s².
    rounding: [f64; 2],
}

impl JunctionSteps {
    /// Behind a rest of a machine with so many axes and joints that are planned.
    pub fn new(lanes: usize, rounding: [f64; 2]) -> Self {
        Self {
            lanes,
            ends: [[0.0; 2]; MAX_AXES],
            counts: false,
            rounding,
        }
    }

    /// Behind a rest again.
    pub fn restart(&mut self) {
        self.counts = false;
    }

    /// Whether velocity or acceleration step where `segment` begins, which follows the last one.
    pub fn is_step_at(&mut self, segment: &Segment) -> bool {
        let counted = std::mem::take(&mut self.counts);
        if segment.order < 3 || segment.duration_s == 0.0 {
            return false;
        }
        self.counts = !segment.flags.contains(SegmentFlags::ENDS_AT_REST);
        let [of_velocity, of_acceleration] = self.rounding;
        let mut steps = false;
        let ends = self.ends[..self.lanes].iter_mut();
        for (end, c) in ends.zip(&segment.coefficients) {
            // At the start they are coefficients.
            steps |= (c[1] - end[0]).abs() > of_velocity;
            steps |= (2.0 * c[2] - end[1]).abs() > of_acceleration;
            let [velocity, acceleration, _] = derivatives(c, segment.duration_s);
            *end = [velocity, acceleration];
        }
        counted && steps
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::AxisVector;

    fn segment(coefficients: [f64; 6]) -> Segment {
        let mut segment = Segment::rest(&AxisVector::ZERO, 0.5);
        (segment.order, segment.flags) = (3, SegmentFlags::default());
        segment.coefficients[1] = coefficients;
        segment
    }

    /// Velocity and acceleration at its end.
    fn at_end(segment: &Segment) -> [f64; 2] {
        let end_s = segment.duration_s;
        [segment.velocity(end_s)[1], segment.acceleration(end_s)[1]]
    }

    #[test]
    fn steps_are_found_where_segments_meet() {
        let mut junction_steps = JunctionSteps::new(2, ROUNDING);
        // At its end the velocity is 4, the acceleration 8.
        assert!(
            !junction_steps.is_step_at(&segment([0.0, 0.0, 4.0, 0.0, 0.0, 0.0])),
            "after a rest nothing steps"
        );
        assert!(
            !junction_steps.is_step_at(&segment([1.0, 4.0, 4.0, -1.0, 0.0, 0.0])),
            "it goes on"
        );
        let end = at_end(&segment([1.0, 4.0, 4.0, -1.0, 0.0, 0.0]));
        assert!(
            junction_steps.is_step_at(&segment([0.0, end[0], end[1] / 2.0 + 0.2, 0.0, 0.0, 0.0])),
            "acceleration steps"
        );
        let end = at_end(&segment([0.0, end[0], end[1] / 2.0 + 0.2, 0.0, 0.0, 0.0]));
        assert!(
            junction_steps.is_step_at(&segment([0.0, end[0] + 1e-3, end[1] / 2.0, 0.0, 0.0, 0.0])),
            "velocity steps"
        );
        assert!(!junction_steps.is_step_at(&Segment::rest(&AxisVector::ZERO, 0.0)));
        assert!(
            !junction_steps.is_step_at(&segment([0.0, 0.0, 4.0, 0.0, 0.0, 0.0])),
            "nor behind a rest"
        );
        // What is rounding on fast machines is a part of what a slow one may.
        for (rounding, counts) in [(ROUNDING, false), ([1e-6, 3e-4], true)] {
            let mut junction_steps = JunctionSteps::new(2, rounding);
            assert!(!junction_steps.is_step_at(&segment([0.0, 0.0, 4.0, 0.0, 0.0, 0.0])));
            assert_eq!(
                junction_steps.is_step_at(&segment([1.0, 4.0 + 5e-5, 4.0, 0.0, 0.0, 0.0])),
                counts
            );
        }
    }
}
