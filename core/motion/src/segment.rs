//! Segments from a path and a piece of constant path acceleration.

use tandem_sdk::{AxisVector, MAX_AXES, Segment, SegmentFlags};

use crate::Path;

/// A stretch of constant acceleration in the middle of which a segment lies.
#[derive(Clone, Copy, Debug, PartialEq)]
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

/// Makes the segments of one block.
#[derive(Clone, Copy, Debug)]
pub struct Builder {
    blank: Segment,
    path: Path,
    path_start_mm: f64,
    max_angle_rad: f64,
}

/// Share of the 1e-6 mm that a segment may stand off its path.
const FIT_MM: f64 = 1e-8;

impl Builder {
    /// Segments of the block whose `path` starts `path_start_mm` after the start of the run. Block, line, feed and flags
    /// are the planner's to set in [`Builder::blank`].
    pub fn new(path: &Path, path_start_mm: f64) -> Self {
        let mut blank = Segment::rest(path.start(), 0.0);
        blank.flags = SegmentFlags::default();
        // The quintic through position, velocity and acceleration at both ends of an arc of angle θ stands off by at
        // most R·θ⁶/(6!·2⁶): the Hermite remainder of a sine.
        let max_angle_rad = (46_080.0 * FIT_MM / path.radius_mm()).powf(1.0 / 6.0);
        Self { blank, path: *path, path_start_mm, max_angle_rad }
    }

    /// The blank that every segment of the block starts from: flags and the like may be set on it.
    pub fn blank(&mut self) -> &mut Segment {
        &mut self.blank
    }

    /// Where the block starts on the path of the run, mm.
    pub fn path_start_mm(&self) -> f64 {
        self.path_start_mm
    }

    /// The longest duration, s, that one segment from `piece` may have and stay within its fit.
    pub fn longest_s(&self, piece: &SpeedPiece) -> f64 {
        if self.path.is_straight() {
            return f64::INFINITY;
        }
        let fastest = piece.speed_mm_per_s.max(piece.speed(piece.duration_s));
        self.max_angle_rad / (self.path.rad_per_mm() * fastest)
    }

    /// The segment that drives `piece`. `piece.duration_s` is at most [`Builder::longest_s`].
    pub fn segment(&self, piece: &SpeedPiece) -> Segment {
        let mut segment = self.blank;
        segment.duration_s = piece.duration_s;
        segment.path[0] = self.path_start_mm + piece.start_mm;
        segment.path[1] = piece.speed_mm_per_s;
        segment.path[2] = piece.acceleration_mm_per_s2 / 2.0;
        segment.coefficients = if self.path.is_straight() { self.parabola(piece) } else { self.quintic(piece) };
        segment
    }

    fn parabola(&self, piece: &SpeedPiece) -> [[f64; 6]; MAX_AXES] {
        let at = self.path.position(piece.start_mm);
        let direction = self.path.direction(piece.start_mm);
        std::array::from_fn(|axis| {
            let u = direction[axis];
            [at[axis], piece.speed_mm_per_s * u, piece.acceleration_mm_per_s2 / 2.0 * u, 0.0, 0.0, 0.0]
        })
    }

    fn quintic(&self, piece: &SpeedPiece) -> [[f64; 6]; MAX_AXES] {
        let start = self.state(piece, 0.0);
        let end = self.state(piece, piece.duration_s);
        std::array::from_fn(|axis| hermite(start.map(|v| v[axis]), end.map(|v| v[axis]), piece.duration_s))
    }

    /// Position, velocity and acceleration at local time `t_s`.
    fn state(&self, piece: &SpeedPiece, t_s: f64) -> [AxisVector; 3] {
        let (s_mm, speed) = (piece.path_mm(t_s), piece.speed(t_s));
        let direction = self.path.direction(s_mm);
        let acceleration = direction * piece.acceleration_mm_per_s2 + self.path.curvature(s_mm) * (speed * speed);
        [self.path.position(s_mm), direction * speed, acceleration]
    }
}

/// The quintic with value, first and second derivative `from` at 0 and `to` at `h`, in the powers of t.
fn hermite(from: [f64; 3], to: [f64; 3], h: f64) -> [f64; 6] {
    let (c1, c2) = (from[1], from[2] / 2.0);
    let position = to[0] - from[0] - h * (c1 + h * c2);
    let velocity = (to[1] - c1 - 2.0 * c2 * h) * h;
    let acceleration = (to[2] - from[2]) * h * h;
    let c3 = 10.0 * position - 4.0 * velocity + acceleration / 2.0;
    let c4 = -15.0 * position + 7.0 * velocity - acceleration;
    let c5 = 6.0 * position - 3.0 * velocity + acceleration / 2.0;
    let (h3, h4) = (h * h * h, h * h * h * h);
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
            piece.duration_s = builder.longest_s(&piece).min(0.008).min(0.9 * speed / a.abs());
            let segment = builder.segment(&piece);
            let t = at * piece.duration_s;
            let off = segment.position(t) - path.position(piece.path_mm(t));
            prop_assert!(off.0.iter().all(|d| d.abs() < 1e-7), "{off:?}");
            prop_assert!((segment.path_mm(t) - piece.path_mm(t)).abs() < 1e-12 * (1.0 + radius));
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
