//! Segments from a path and a piece of constant path acceleration.

use tandem_sdk::{AxisVector, MAX_AXES, Segment};

use crate::Path;

/// A stretch of constant acceleration in the middle of which a segment lies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpeedPiece {
    /// Path coordinate in the block at the start, mm.
    pub start_mm: f64,
    /// Speed at the start, mm/s.
    pub speed_mm_per_s: f64,
    /// Acceleration along the path, mm/s².
    pub acceleration_mm_per_s2: f64,
    /// Duration, s.
    pub duration_s: f64,
}

impl SpeedPiece {
    /// Path coordinate at local time `t_s`, mm.
    pub fn path_mm(&self, t_s: f64) -> f64 {
        self.start_mm + t_s * (self.speed_mm_per_s + t_s * self.acceleration_mm_per_s2 / 2.0)
    }

    /// Speed at local time `t_s`, mm/s.
    pub fn speed(&self, t_s: f64) -> f64 {
        self.speed_mm_per_s + t_s * self.acceleration_mm_per_s2
    }
}

/// Share of the 1e-6 mm that a segment may stand off its path.
const FIT_MM: f64 = 1e-8;

/// Most that a segment on an arc may turn, and by how much of that its speeding up may be, rad: the quintic of a longer one
/// accelerates by more than a thousandth harder than the arc does, however near it lies to a small one.
const MAX_TURN_RAD: f64 = 0.35;
const MAX_TURN_FASTER_RAD: f64 = 0.15;

/// Below this turn, rad, a segment on an arc is drawn from its start alone, where that stands off by less than 1e-9 mm. The times
/// of a profile end beside those of a period, and over a fraction of a nanosecond the difference of two positions is rounding:
/// a polynomial that meets both has an acceleration of its own.
const SHORT_TURN_RAD: f64 = 1e-3;
const SHORT_FIT_MM: f64 = 1e-8;

/// Draws the segments of one block: how they lie on the path, and how long they may be.
#[derive(Clone, Copy, Debug, Default)]
pub struct Builder {
    path_start_mm: f64,
    /// Most that a segment at constant speed may turn for its fit, rad, to the sixth power.
    max_turn_6: f64,
    /// Turn below which it is drawn from its start alone, rad.
    short_turn_rad: f64,
}

impl Builder {
    /// Segments of the block whose `path` starts `path_start_mm` after the start of the run.
    pub fn new(path: &Path, path_start_mm: f64) -> Self {
        // The quintic through position, velocity and acceleration at both ends of an arc of angle θ stands off by at
        // most R·θ⁶/(6!·2⁶): the Hermite remainder of a sine.
        Self {
            path_start_mm,
            max_turn_6: 46_080.0 * FIT_MM / path.radius_mm(),
            short_turn_rad: (SHORT_FIT_MM / path.radius_mm()).sqrt().min(SHORT_TURN_RAD),
        }
    }

    /// Where the block starts on the path of the run, mm.
    pub fn path_start_mm(&self) -> f64 {
        self.path_start_mm
    }

    /// The longest duration, s, that one segment from `piece` may have and stay within its fit.
    pub fn longest_s(&self, path: &Path, piece: &SpeedPiece) -> f64 {
        if path.is_straight() {
            return f64::INFINITY;
        }
        let fastest = piece.speed_mm_per_s.max(piece.speed(piece.duration_s));
        let rad_per_mm = path.rad_per_mm();
        // The sixth derivative of a point on a circle of radius 1 that turns at ω and gets faster by α is at most
        // ω⁶ + 15·ω⁴α + 45·ω²α² + 15·α³: what ω⁶ alone is at a constant speed.
        let turns = (rad_per_mm * fastest).powi(2);
        let faster = rad_per_mm * piece.acceleration_mm_per_s2.abs();
        let sixth = turns.powi(3)
            + 15.0 * faster * (turns * turns + 3.0 * turns * faster + faster * faster);
        let by_fit_s = (self.max_turn_6 / sixth).cbrt().sqrt();
        let by_turn_s = MAX_TURN_RAD / turns.sqrt();
        by_fit_s
            .min(by_turn_s)
            .min((MAX_TURN_FASTER_RAD / faster).sqrt())
    }

    /// Writes duration and polynomials of the segment that drives `piece`; the rest of it is the planner's.
    /// `piece.duration_s` is at most [`Builder::longest_s`].
    pub fn draw(&self, path: &Path, piece: &SpeedPiece, segment: &mut Segment) {
        let speed = piece.speed_mm_per_s;
        let half_acceleration = piece.acceleration_mm_per_s2 / 2.0;
        segment.duration_s = piece.duration_s;
        segment.path = [
            self.path_start_mm + piece.start_mm,
            speed,
            half_acceleration,
            0.0,
            0.0,
            0.0,
        ];
        if path.is_straight() {
            parabola(path, piece, &mut segment.coefficients);
        } else {
            let turn_rad = path.rad_per_mm() * (piece.path_mm(piece.duration_s) - piece.start_mm);
            if turn_rad < self.short_turn_rad {
                cubic(path, piece, &mut segment.coefficients);
            } else {
                quintic(path, piece, &mut segment.coefficients);
            }
        }
    }
}

fn parabola(path: &Path, piece: &SpeedPiece, coefficients: &mut [[f64; 6]; MAX_AXES]) {
    let at = path.position(piece.start_mm);
    let direction = path.direction(piece.start_mm);
    let velocity = direction * piece.speed_mm_per_s;
    let half_acceleration = direction * (piece.acceleration_mm_per_s2 / 2.0);
    for (axis, c) in coefficients.iter_mut().enumerate() {
        *c = [
            at[axis],
            velocity[axis],
            half_acceleration[axis],
            0.0,
            0.0,
            0.0,
        ];
    }
}

/// From the state at the start, with the acceleration at the end.
fn cubic(path: &Path, piece: &SpeedPiece, coefficients: &mut [[f64; 6]; MAX_AXES]) {
    let [position, velocity, from] = state(path, piece, 0.0);
    let [_, _, to] = state(path, piece, piece.duration_s);
    for (axis, c) in coefficients.iter_mut().enumerate() {
        let sixth_of_jerk = (to[axis] - from[axis]) / (6.0 * piece.duration_s);
        *c = [
            position[axis],
            velocity[axis],
            from[axis] / 2.0,
            sixth_of_jerk,
            0.0,
            0.0,
        ];
    }
}

fn quintic(path: &Path, piece: &SpeedPiece, coefficients: &mut [[f64; 6]; MAX_AXES]) {
    let start = state(path, piece, 0.0);
    let end = state(path, piece, piece.duration_s);
    for (axis, c) in coefficients.iter_mut().enumerate() {
        *c = hermite(
            start.map(|v| v[axis]),
            end.map(|v| v[axis]),
            piece.duration_s,
        );
    }
}

/// Position, velocity and acceleration per axis at local time `t_s` of `piece`. Rough loop; does not allocate.
pub fn state(path: &Path, piece: &SpeedPiece, t_s: f64) -> [AxisVector; 3] {
    let s_mm = piece.path_mm(t_s);
    let speed = piece.speed(t_s);
    let direction = path.direction(s_mm);
    let acceleration =
        direction * piece.acceleration_mm_per_s2 + path.curvature(s_mm) * (speed * speed);
    [path.position(s_mm), direction * speed, acceleration]
}

/// The quintic with value, first and second derivative `from` at 0 and `to` at `h`, in the powers of t. Any loop; does not
/// allocate.
pub fn hermite(from: [f64; 3], to: [f64; 3], h: f64) -> [f64; 6] {
    let c1 = from[1];
    let c2 = from[2] / 2.0;
    let position = to[0] - from[0] - h * (c1 + h * c2);
    let velocity = (to[1] - c1 - 2.0 * c2 * h) * h;
    let acceleration = (to[2] - from[2]) * h * h;
    let c3 = 10.0 * position - 4.0 * velocity + acceleration / 2.0;
    let c4 = -15.0 * position + 7.0 * velocity - acceleration;
    let c5 = 6.0 * position - 3.0 * velocity + acceleration / 2.0;
    let h3 = h * h * h;
    let h4 = h * h * h * h;
    [from[0], c1, c2, c3 / h3, c4 / h4, c5 / (h4 * h)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tandem_sdk::{ArcGeometry, Block, BlockKind};

    fn circle(radius: f64) -> Block {
        let mut block = Block::at(AxisVector::from_slice(&[radius, 0.0]));
        block.kind = BlockKind::Arc;
        block.length_mm = std::f64::consts::TAU * radius;
        block.arc = ArcGeometry {
            plane: [0, 1],
            center_mm: [0.0; 2],
            radius_mm: radius,
            start_angle_rad: 0.0,
            sweep_rad: std::f64::consts::TAU,
        };
        block
    }

    proptest! {
        #[test]
        fn segments_of_an_arc_stay_on_it(radius in 0.05..300.0f64, speed in 0.5..250.0f64, a in -500.0..500.0f64, at in 0.0..1.0f64) {
            let block = circle(radius);
            let path = Path::new(&block).unwrap();
            let builder = Builder::new(&path, 0.0);
            let mut piece = SpeedPiece { start_mm: 0.01 * radius, speed_mm_per_s: speed, acceleration_mm_per_s2: a, duration_s: 0.001 };
            piece.duration_s = builder.longest_s(&path, &piece).min(0.008).min(0.9 * speed / a.abs());
            let mut segment = Segment::rest(path.start(), 0.0);
            builder.draw(&path, &piece, &mut segment);
            let t = at * piece.duration_s;
            let off = segment.position(t) - path.position(piece.path_mm(t));
            prop_assert!(off.0.iter().all(|d| d.abs() < 1e-7), "{off:?}");
            prop_assert!((segment.path_mm(t) - piece.path_mm(t)).abs() < 1e-12 * (1.0 + radius));
        }
    }

    proptest! {
        /// From rest, at speed and in between, on arcs of a micrometre and of a third of a metre, near the origin and far off it,
        /// however short they are.
        #[test]
        fn segments_of_an_arc_accelerate_as_the_arc_does_and_stay_on_it(
            radius in -3.0..2.5f64, turns in 0.0..1.0f64, a in 1.0..4.0f64, braking in proptest::bool::ANY,
            short in prop_oneof![Just(0.0), -9.0..0.0f64], far in prop_oneof![Just(0.0), 0.0..100.0f64],
        ) {
            let (radius, a) = (10f64.powf(radius), 10f64.powf(a));
            let mut block = circle(radius);
            block.arc.center_mm[0] += far;
            block.start[0] += far;
            block.end[0] += far;
            let path = Path::new(&block).unwrap();
            let builder = Builder::new(&path, 0.0);
            // Turning takes up to twice of what speeding up does.
            let speed = (2.0 * turns * a * radius).sqrt();
            let mut piece = SpeedPiece { start_mm: 0.01 * radius, speed_mm_per_s: speed, acceleration_mm_per_s2: if braking { -a } else { a }, duration_s: 0.0 };
            // What it is at the end says how long it may be.
            for _ in 0..40 {
                piece.duration_s = builder.longest_s(&path, &piece).min(if braking { speed / a } else { f64::INFINITY });
            }
            piece.duration_s *= 10f64.powf(short);
            prop_assume!(piece.duration_s > 0.0);
            let mut segment = Segment::rest(path.start(), 0.0);
            builder.draw(&path, &piece, &mut segment);
            for n in 0..=16 {
                let t = f64::from(n) / 16.0 * piece.duration_s;
                let exact = state(&path, &piece, t)[2];
                let fastest = piece.speed(0.0).max(piece.speed(piece.duration_s));
                let size = a.hypot(fastest * fastest / radius);
                let off = segment.acceleration(t) - exact;
                prop_assert!(off.0.iter().all(|off| off.abs() < 1e-3 * size), "{:?} of {size} at {n}", off.0);
                let off = segment.position(t) - path.position(piece.path_mm(t));
                prop_assert!(off.0.iter().all(|off| off.abs() < 1.1 * FIT_MM), "{:?} of {radius} at {n}", off.0);
            }
        }
    }

    #[test]
    fn hermite_meets_both_ends() {
        let c = hermite([1.0, 2.0, 3.0], [4.0, -5.0, 6.0], 0.5);
        let mut segment = Segment::rest(&AxisVector::ZERO, 0.5);
        segment.coefficients[0] = c;
        assert!((segment.position(0.5)[0] - 4.0).abs() < 1e-12);
        assert!((segment.velocity(0.5)[0] + 5.0).abs() < 1e-12);
        assert!((segment.acceleration(0.5)[0] - 6.0).abs() < 1e-10);
    }
}
