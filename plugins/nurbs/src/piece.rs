//! What a feed profile gives: the path coordinate over time, and how it becomes segments.

use tandem_motion::nurbs::Place;
use tandem_sdk::{AxisVector, MAX_AXES, Segment};

use crate::course::Course;

/// Most that a segment may stand off its path, mm.
const OFF_MM: f64 = 5e-9;
/// Halvings of a piece until a segment follows the path.
const MAX_HALVINGS: u32 = 40;

/// The path coordinate over a piece of time: a cubic, so that the jerk along the path is constant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Piece {
    /// Path coordinate in the stretch at the start, mm.
    pub start_mm: f64,
    /// Speed at the start, mm/s.
    pub speed_mm_per_s: f64,
    /// Acceleration at the start, mm/s².
    pub acceleration_mm_per_s2: f64,
    /// Jerk, mm/s³.
    pub jerk_mm_per_s3: f64,
    /// Duration, s.
    pub duration_s: f64,
}

impl Piece {
    /// The piece from `t_s` on, `duration_s` long.
    #[must_use]
    pub fn part(&self, t_s: f64, duration_s: f64) -> Self {
        let a = self.acceleration_mm_per_s2;
        let j = self.jerk_mm_per_s3;
        Self {
            start_mm: self.start_mm + t_s * (self.speed_mm_per_s + t_s * (a / 2.0 + t_s * j / 6.0)),
            speed_mm_per_s: self.speed_mm_per_s + t_s * (a + t_s * j / 2.0),
            acceleration_mm_per_s2: a + t_s * j,
            jerk_mm_per_s3: j,
            duration_s,
        }
    }

    /// Draws the longest segment at the start of the piece that follows stretch `index` of `course` within 5e-9 mm: the
    /// quintics with position, velocity and acceleration of both ends, compared with the path in the middle and at the
    /// quarters, halved until they fit. Gives what is left. Does not allocate.
    pub fn draw(
        &self,
        course: &Course,
        index: usize,
        place: &mut Place,
        segment: &mut Segment,
    ) -> Option<Self> {
        let mut part = *self;
        let start = state(course, index, &part.part(0.0, 0.0), place);
        for _ in 0..MAX_HALVINGS {
            let end = state(course, index, &part.part(part.duration_s, 0.0), place);
            fill(segment, &start, &end, part.duration_s);
            let follows = [0.25, 0.5, 0.75].iter().all(|share| {
                let t_s = share * part.duration_s;
                let on = course
                    .at(index, part.part(t_s, 0.0).start_mm, place)
                    .position
                    - segment.position(t_s);
                on.0.iter().all(|off| off.abs() <= OFF_MM)
            });
            if follows {
                break;
            }
            part.duration_s /= 2.0;
        }
        segment.duration_s = part.duration_s;
        let a = self.acceleration_mm_per_s2 / 2.0;
        let j = self.jerk_mm_per_s3 / 6.0;
        segment.path = [self.start_mm, self.speed_mm_per_s, a, j, 0.0, 0.0];
        let left_s = self.duration_s - part.duration_s;
        (left_s > 0.0).then(|| self.part(part.duration_s, left_s))
    }
}

/// Position, velocity and acceleration at the start of `piece`.
fn state(course: &Course, index: usize, piece: &Piece, place: &mut Place) -> [AxisVector; 3] {
    let at = course.at(index, piece.start_mm, place);
    let speed = piece.speed_mm_per_s;
    let acceleration = at.direction * piece.acceleration_mm_per_s2 + at.curvature * (speed * speed);
    [at.position, at.direction * speed, acceleration]
}

fn fill(segment: &mut Segment, from: &[AxisVector; 3], to: &[AxisVector; 3], duration_s: f64) {
    for axis in 0..MAX_AXES {
        segment.coefficients[axis] =
            tandem_motion::hermite(from.map(|v| v[axis]), to.map(|v| v[axis]), duration_s);
    }
}
