//! One piece of the filtered motion as a segment's polynomials.

use tandem_sdk::{AxisVector, MAX_AXES, Segment};

use crate::filter::Knot;

/// Below this a piece is a parabola that fits the velocities, s: in a higher power the rounding of the knots would stand
/// for motion, and the positions fit to h³/12 times the jerk. With half and with twice as much no test of this crate had another
/// result.
const SHORT_S: f64 = 2e-6;

/// Below this even the difference of the velocities is rounding, and the parabola takes the acceleration at its start. With twice as much
/// a piece outlasts the time asked for (`advance_is_cut_at_the_time_asked_for`); with half no test of this crate had another result.
pub(crate) const RESOLUTION_S: f64 = 1e-9;

/// A piece of motion without kinks inside, with the accelerations on its side of its ends.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    pub duration_s: f64,
    pub from: Knot,
    pub to: Knot,
    pub from_acceleration: AxisVector,
    pub to_acceleration: AxisVector,
}

impl Piece {
    /// The polynomials of all axes: exact for lines under a moving average, else within 1e-8 mm by the piece's length.
    pub fn coefficients(&self) -> [[f64; 6]; MAX_AXES] {
        std::array::from_fn(|axis| {
            let from = [
                self.from.position[axis],
                self.from.velocity[axis],
                self.from_acceleration[axis],
            ];
            let to = [
                self.to.position[axis],
                self.to.velocity[axis],
                self.to_acceleration[axis],
            ];
            through(from, to, self.duration_s)
        })
    }

    /// The path coordinate of `segment`, which has this piece's coefficients: the length of the path driven, `start_mm`
    /// at the start. `counted` gives the part of a vector that path speed counts.
    pub fn path(
        &self,
        segment: &Segment,
        start_mm: f64,
        counted: impl Fn(&AxisVector) -> AxisVector,
    ) -> [f64; 6] {
        let speed = |t_s: f64| norm(&counted(&segment.velocity(t_s)));
        let half_s = self.duration_s / 2.0;
        let length_mm: f64 = NODES
            .iter()
            .map(|(node, share)| share * half_s * speed(half_s * (1.0 + node)))
            .sum();
        let [from, to] = [
            (&self.from, &self.from_acceleration, 1.0),
            (&self.to, &self.to_acceleration, -1.0),
        ]
        .map(|(knot, acceleration, away)| {
            let velocity = counted(&knot.velocity);
            let speed = norm(&velocity);
            // From rest speed can only rise, to rest only fall.
            let rise = away * norm(&counted(acceleration));
            (
                speed,
                if speed > 0.0 {
                    dot(&velocity, acceleration) / speed
                } else {
                    rise
                },
            )
        });
        through(
            [start_mm, from.0, from.1],
            [start_mm + length_mm, to.0, to.1],
            self.duration_s,
        )
    }
}

/// Gauss-Legendre nodes and weights on −1…1.
const NODES: [(f64, f64); 3] = [
    (-0.774_596_669_241_483_4, 5.0 / 9.0),
    (0.0, 8.0 / 9.0),
    (0.774_596_669_241_483_4, 5.0 / 9.0),
];

fn dot(a: &AxisVector, b: &AxisVector) -> f64 {
    a.0.iter().zip(&b.0).map(|(x, y)| x * y).sum()
}

fn norm(a: &AxisVector) -> f64 {
    dot(a, a).sqrt()
}

/// The quintic with value, first and second derivative `from` at 0 and `to` at `h`, in the powers of t.
fn through(from: [f64; 3], to: [f64; 3], h: f64) -> [f64; 6] {
    let c1 = from[1];
    let c2 = from[2] / 2.0;
    if h < SHORT_S {
        let c2 = if h > RESOLUTION_S {
            (to[1] - from[1]) / (2.0 * h)
        } else {
            c2
        };
        return [from[0], c1, c2, 0.0, 0.0, 0.0];
    }
    // What is missing at the end of the parabola, each times the power of h that makes it a length.
    let position = to[0] - from[0] - h * (c1 + h * c2);
    let velocity = (to[1] - c1 - 2.0 * c2 * h) * h;
    let acceleration = (to[2] - from[2]) * h * h / 2.0;
    let c3 = 10.0 * position - 4.0 * velocity + acceleration;
    let c4 = -15.0 * position + 7.0 * velocity - 2.0 * acceleration;
    let c5 = 6.0 * position - 3.0 * velocity + acceleration;
    let cube = h * h * h;
    [
        from[0],
        c1,
        c2,
        c3 / cube,
        c4 / (cube * h),
        c5 / (cube * h * h),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quarter turn of radius 2 within 1 s in steps of 10 ms.
    fn turn(step: u32) -> Piece {
        let knot = |t: f64| {
            let (sin, cos) = t.sin_cos();
            let position = AxisVector::from_slice(&[2.0 * cos, 2.0 * sin]);
            (
                Knot {
                    position,
                    velocity: AxisVector::from_slice(&[-2.0 * sin, 2.0 * cos]),
                },
                position * -1.0,
            )
        };
        let t = f64::from(step) * 0.01;
        let ((from, from_acceleration), (to, to_acceleration)) = (knot(t), knot(t + 0.01));
        Piece {
            duration_s: 0.01,
            from,
            to,
            from_acceleration,
            to_acceleration,
        }
    }

    #[test]
    fn polynomials_follow_the_motion_and_its_length() {
        let mut start_mm = 0.0;
        for step in 0..100 {
            let piece = turn(step);
            let mut segment = Segment::rest(&AxisVector::ZERO, piece.duration_s);
            segment.coefficients = piece.coefficients();
            let at = segment.position(0.004);
            assert!((at[0].hypot(at[1]) - 2.0).abs() < 1e-12);
            segment.path = piece.path(&segment, start_mm, |v| *v);
            assert!((segment.path_speed_mm_per_s(0.006) - 2.0).abs() < 1e-9);
            start_mm = segment.path_mm(piece.duration_s);
        }
        assert!((start_mm - 2.0).abs() < 1e-11);
    }

    #[test]
    fn length_from_rest_and_to_rest() {
        let knot = |x: f64, v: f64| Knot {
            position: AxisVector([x; 8]),
            velocity: AxisVector([v; 8]),
        };
        let acceleration = AxisVector([10.0; 8]);
        let piece = Piece {
            duration_s: 0.01,
            from: knot(0.0, 0.0),
            to: knot(0.0005, 0.1),
            from_acceleration: acceleration,
            to_acceleration: acceleration,
        };
        let mut segment = Segment::rest(&AxisVector::ZERO, piece.duration_s);
        segment.coefficients = piece.coefficients();
        let path = piece.path(&segment, 7.0, |v| *v);
        assert!(
            (path[2] - 5.0 * 8.0_f64.sqrt()).abs() < 1e-9 && path[3].abs() < 1e-6,
            "{path:?}"
        );
    }
}
