//! Whether the samples of a plan keep the limits.
//!
//! The samples are taken as the fine loop takes them: one a fine period, one exactly at each rest. Velocity and
//! acceleration are their differences; the allowable speed difference V is judged by a leaky bucket per axis and sign,
//! `u ← max(0, u + Δv − A·T)`, `u ≤ V` (`core/fine/src/governor.rs`, "Velocity steps").

use tandem_sdk::{AxisVector, Limits, PlannerDescription, Segment, SegmentFlags};

use crate::machine::FINE_PERIOD_S;

/// Relative tolerances, as the host's guard has them.
const TOLERANCE: f64 = 1e-6;
const JERK_TOLERANCE: f64 = 1e-2;
/// Rounding of a position, mm: its differences lose as much over the period.
const ROUNDING_MM: f64 = 2e-13;

/// A sample: the position, the segment it is on, and whether that is a rest.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    pub position: AxisVector,
    pub segment: usize,
}

/// The plan, sampled.
pub fn samples(segments: &[Segment]) -> Vec<Sample> {
    let mut samples = vec![];
    // Time from the start of the segment to the next sample, s.
    let mut next_s = 0.0;
    for (index, segment) in segments.iter().enumerate() {
        while next_s < segment.duration_s {
            samples.push(Sample {
                position: segment.position(next_s),
                segment: index,
            });
            next_s += FINE_PERIOD_S;
        }
        next_s -= segment.duration_s;
        if segment.flags.contains(SegmentFlags::ENDS_AT_REST) {
            samples.push(Sample {
                position: segment.position(segment.duration_s),
                segment: index,
            });
            next_s = FINE_PERIOD_S;
        }
    }
    samples
}

/// What is wrong with the samples, if anything.
pub fn judge(
    segments: &[Segment],
    samples: &[Sample],
    limits: &Limits,
    description: &PlannerDescription,
) -> Option<String> {
    (0..limits.axes().len()).find_map(|axis| {
        let mut judge = AxisJudge::new(limits, description, axis);
        samples.windows(2).find_map(|pair| {
            let segment = &segments[pair[1].segment];
            let rapid = segment.flags.contains(SegmentFlags::RAPID);
            let wrong = judge.step(pair[0].position[axis], pair[1].position[axis], rapid)?;
            Some(format!("block {}, axis {axis}: {wrong}", segment.block))
        })
    })
}

/// One axis.
struct AxisJudge {
    limits: tandem_sdk::AxisLimits,
    step_mm_per_s: f64,
    jerk: bool,
    velocity: f64,
    acceleration: f64,
    buckets: [f64; 2],
}

impl AxisJudge {
    fn new(limits: &Limits, description: &PlannerDescription, axis: usize) -> Self {
        Self {
            limits: limits.axes()[axis],
            step_mm_per_s: description.speed_difference_mm_per_s[axis],
            jerk: description.order >= 3,
            velocity: 0.0,
            acceleration: 0.0,
            buckets: [0.0; 2],
        }
    }

    fn step(&mut self, from: f64, to: f64, rapid: bool) -> Option<String> {
        let limits = &self.limits;
        if to < limits.min_mm || to > limits.max_mm || !to.is_finite() {
            return Some(format!("position {to} mm is outside the travel"));
        }
        let velocity = (to - from) / FINE_PERIOD_S;
        let most = if rapid {
            limits.rapid_mm_per_s
        } else {
            limits.feed_mm_per_s
        };
        if velocity.abs() > most * (1.0 + TOLERANCE) + 2.0 * ROUNDING_MM / FINE_PERIOD_S {
            return Some(format!("velocity {velocity:.6} mm/s, limit {most}"));
        }
        let change = velocity - self.velocity;
        let acceleration = change / FINE_PERIOD_S;
        let rounding = 4.0 * ROUNDING_MM / FINE_PERIOD_S;
        let allowed = limits.acceleration_mm_per_s2 * (1.0 + TOLERANCE) * FINE_PERIOD_S + rounding;
        for (bucket, sign) in self.buckets.iter_mut().zip([1.0, -1.0]) {
            *bucket = (*bucket + sign * change - allowed).max(0.0);
            if *bucket > self.step_mm_per_s * (1.0 + TOLERANCE) + rounding {
                let most = limits.acceleration_mm_per_s2;
                return Some(format!(
                    "acceleration {acceleration:.3} mm/s² in a window already full, limit {most}"
                ));
            }
        }
        let jerk = (acceleration - self.acceleration) / FINE_PERIOD_S;
        let most = limits.jerk_mm_per_s3 * (1.0 + JERK_TOLERANCE)
            + 8.0 * ROUNDING_MM / FINE_PERIOD_S.powi(3);
        (self.velocity, self.acceleration) = (velocity, acceleration);
        (self.jerk && jerk.abs() > most)
            .then(|| format!("jerk {jerk:.1} mm/s³, limit {}", limits.jerk_mm_per_s3))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::context;

    /// 1 s of constant acceleration in X, then the same back to rest.
    fn ramp(acceleration: f64) -> Vec<Segment> {
        let (half, end) = (
            acceleration / 2.0,
            AxisVector::from_slice(&[acceleration * 0.01]),
        );
        let mut up = Segment::rest(&AxisVector::ZERO, 0.1);
        up.flags = SegmentFlags::BLOCK_BEGINS;
        up.coefficients[0][2] = half;
        let mut down = up;
        down.coefficients[0] = [half * 0.01, acceleration * 0.1, -half, 0.0, 0.0, 0.0];
        vec![up, down, Segment::rest(&end, 0.0)]
    }

    #[test]
    fn one_percent_too_much_is_found() {
        let limits = context(AxisVector::ZERO).limits;
        let description = PlannerDescription::order_2();
        let verdict =
            |segments: &[Segment]| judge(segments, &samples(segments), &limits, &description);
        assert_eq!(verdict(&ramp(1000.0)), None);
        let words = verdict(&ramp(1010.0)).unwrap();
        assert!(
            words.contains("acceleration") && words.contains("axis 0"),
            "{words}"
        );
        let jerky = PlannerDescription {
            order: 3,
            ..description
        };
        let segments = ramp(900.0);
        assert!(
            judge(&segments, &samples(&segments), &limits, &jerky)
                .unwrap()
                .contains("jerk")
        );
    }
}
