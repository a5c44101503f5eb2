//! Pieces of arcs and helices, exact.

use std::f64::consts::{PI, TAU};

use crate::{
    Position,
    geometry::{distance, dot, minus, plus_scaled},
};

/// Newton steps towards the nearest point of a helix; from the chord three are enough.
const NEWTON_STEPS: usize = 8;
/// Halvings towards the first point within reach: a slightly later one is within reach too.
const HALVINGS: usize = 12;

/// A circle in a plane of two axes, while the other axes move in proportion to the angle.
#[derive(Clone, Debug)]
pub struct Arc {
    /// Start, of which the two axes of the plane are not used.
    pub from: Position,
    /// What the other axes move; 0 in the plane.
    pub along: Position,
    /// The two axes; the turn from the first to the second is positive.
    pub plane: [usize; 2],
    pub center_mm: [f64; 2],
    pub radius_mm: f64,
    pub start_rad: f64,
    pub sweep_rad: f64,
}

impl Arc {
    pub fn at(&self, fraction: f64) -> Position {
        let (sine, cosine) = (self.start_rad + fraction * self.sweep_rad).sin_cos();
        let mut point = plus_scaled(&self.from, fraction, &self.along);
        point[self.plane[0]] = self.center_mm[0] + self.radius_mm * cosine;
        point[self.plane[1]] = self.center_mm[1] + self.radius_mm * sine;
        point
    }

    pub fn length_mm(&self) -> f64 {
        (self.radius_mm * self.sweep_rad).hypot(dot(&self.along, &self.along).sqrt())
    }

    pub fn reversed(&self) -> Self {
        self.part(1.0, 0.0)
    }

    /// The piece between two fractions.
    pub fn part(&self, from: f64, to: f64) -> Self {
        Self {
            from: plus_scaled(&self.from, from, &self.along),
            along: std::array::from_fn(|axis| (to - from) * self.along[axis]),
            start_rad: self.start_rad + from * self.sweep_rad,
            sweep_rad: (to - from) * self.sweep_rad,
            ..self.clone()
        }
    }

    /// Fraction of the nearest point, beyond the ends by less than half a turn.
    pub fn foot(&self, point: &Position) -> f64 {
        if dot(&self.along, &self.along) == 0.0 {
            self.foot_in_plane(point)
        } else {
            self.foot_on_helix(point)
        }
    }

    /// A fraction within reach of the point, soon after the first one; `low` is out of reach and `nearest` within.
    pub fn entry(&self, point: &Position, reach_mm: f64, low: f64, nearest: f64) -> f64 {
        let (mut outside, mut inside) = (low, nearest);
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(outside, inside);
            if distance(&self.at(middle), point) <= reach_mm {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        inside
    }

    fn foot_in_plane(&self, point: &Position) -> f64 {
        let [first, second] = self.plane;
        let angle = (point[second] - self.center_mm[1]).atan2(point[first] - self.center_mm[0]);
        // Counted from the middle of the piece, so that the end nearer to the point is met where it lies beyond.
        let from_middle = angle - self.start_rad - self.sweep_rad / 2.0;
        let wrapped = (from_middle + PI).rem_euclid(TAU) - PI;
        0.5 + wrapped / self.sweep_rad
    }

    fn foot_on_helix(&self, point: &Position) -> f64 {
        let start = self.at(0.0);
        let chord = minus(&self.at(1.0), &start);
        let mut fraction =
            (dot(&minus(point, &start), &chord) / dot(&chord, &chord)).clamp(0.0, 1.0);
        for _ in 0..NEWTON_STEPS {
            let step = self.newton_step(point, fraction);
            fraction -= step;
            if step.abs() < 1e-15 || !(-1.0..=2.0).contains(&fraction) {
                break;
            }
        }
        fraction.clamp(-1.0, 2.0)
    }

    /// Newton's step towards the place where the line to the point is square to the path.
    fn newton_step(&self, point: &Position, fraction: f64) -> f64 {
        let [first, second] = self.plane;
        let here = self.at(fraction);
        let from_center = [
            here[first] - self.center_mm[0],
            here[second] - self.center_mm[1],
        ];
        let mut velocity = self.along;
        velocity[first] = -self.sweep_rad * from_center[1];
        velocity[second] = self.sweep_rad * from_center[0];
        let off = minus(&here, point);
        let bend =
            -self.sweep_rad.powi(2) * (off[first] * from_center[0] + off[second] * from_center[1]);
        let speed_squared = dot(&velocity, &velocity);
        let slope = speed_squared + bend;
        // Near the axis of the helix the distance is not convex; a step of steepest descent is safe there.
        dot(&off, &velocity)
            / if slope > 0.1 * speed_squared {
                slope
            } else {
                speed_squared
            }
    }
}
