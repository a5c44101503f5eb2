//! Where segments of order 3 meet: whether velocity or acceleration step there.

use tandem_sdk::{AxisVector, MAX_AXES, Segment, SegmentFlags};

/// Steps below these are rounding on any machine: of velocity, mm/s, and of acceleration, mm/s².
pub const ROUNDING: [f64; 2] = [1e-4, 0.1];

/// How the last segment ended.
#[derive(Clone, Copy, Debug)]
pub struct JunctionSteps {
    /// Velocity and acceleration; none at a rest, and of plans that keep no jerk.
    end: Option<[AxisVector; 2]>,
    /// Steps up to these do not count: of velocity, mm/s, and of acceleration, mm/s².
    rounding: [f64; 2],
}

impl JunctionSteps {
    /// Behind a rest.
    pub fn new(rounding: [f64; 2]) -> Self {
        Self {
            end: None,
            rounding,
        }
    }

    /// Behind a rest again.
    pub fn restart(&mut self) {
        self.end = None;
    }

    /// Whether velocity or acceleration step where `segment` begins, which follows the last one.
    pub fn is_step_at(&mut self, segment: &Segment) -> bool {
        let before = self.end.take();
        if segment.order < 3 || segment.duration_s == 0.0 {
            return false;
        }
        if !segment.flags.contains(SegmentFlags::ENDS_AT_REST) {
            self.end = Some(derivatives(segment, segment.duration_s));
        }
        let start = derivatives_at_start(segment);
        before.is_some_and(|end| {
            let off = |n: usize| {
                (0..MAX_AXES).any(|axis| (start[n][axis] - end[n][axis]).abs() > self.rounding[n])
            };
            off(0) || off(1)
        })
    }
}

fn derivatives(segment: &Segment, t_s: f64) -> [AxisVector; 2] {
    [segment.velocity(t_s), segment.acceleration(t_s)]
}

/// The same at the start, where they are coefficients.
fn derivatives_at_start(segment: &Segment) -> [AxisVector; 2] {
    let of = |f: fn(&[f64; 6]) -> f64| {
        AxisVector(std::array::from_fn(|axis| f(&segment.coefficients[axis])))
    };
    [of(|c| c[1]), of(|c| 2.0 * c[2])]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(coefficients: [f64; 6]) -> Segment {
        let mut segment = Segment::rest(&AxisVector::ZERO, 0.5);
        (segment.order, segment.flags) = (3, SegmentFlags::default());
        segment.coefficients[1] = coefficients;
        segment
    }

    #[test]
    fn steps_are_found_where_segments_meet() {
        let mut junction_steps = JunctionSteps::new(ROUNDING);
        // At its end the velocity is 4, the acceleration 8.
        assert!(
            !junction_steps.is_step_at(&segment([0.0, 0.0, 4.0, 0.0, 0.0, 0.0])),
            "after a rest nothing steps"
        );
        assert!(
            !junction_steps.is_step_at(&segment([1.0, 4.0, 4.0, -1.0, 0.0, 0.0])),
            "it goes on"
        );
        let end = derivatives(&segment([1.0, 4.0, 4.0, -1.0, 0.0, 0.0]), 0.5).map(|v| v[1]);
        assert!(
            junction_steps.is_step_at(&segment([0.0, end[0], end[1] / 2.0 + 0.2, 0.0, 0.0, 0.0])),
            "acceleration steps"
        );
        let end = derivatives(
            &segment([0.0, end[0], end[1] / 2.0 + 0.2, 0.0, 0.0, 0.0]),
            0.5,
        )
        .map(|v| v[1]);
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
            let mut junction_steps = JunctionSteps::new(rounding);
            assert!(!junction_steps.is_step_at(&segment([0.0, 0.0, 4.0, 0.0, 0.0, 0.0])));
            assert_eq!(
                junction_steps.is_step_at(&segment([1.0, 4.0 + 5e-5, 4.0, 0.0, 0.0, 0.0])),
                counts
            );
        }
    }
}
