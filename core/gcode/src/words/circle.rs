//! The circle of an arc from what the program says of it. Pure geometry in a plane, mm and rad.

use std::f64::consts::{PI, TAU};

use tandem_sdk::ArcGeometry;

use crate::line_error::show;

/// Start and end radius may differ by what rounding to 0.01 mm, or to 0.001 inch, makes of them: LinuxCNC's values.
const ROUNDED_MM: f64 = 0.02 * std::f64::consts::SQRT_2;
const ROUNDED_INCH: f64 = 0.002 * std::f64::consts::SQRT_2;
/// Where they differ by less than this of the radius they may differ by [`MOST`] times as much.
const RELATIVE: f64 = 1e-3;
const MOST: f64 = 100.0;
/// An arc may leave the ring between its radii by this much, mm, and an arc by radius (R) may be short by it; by
/// [`RELATIVE`] of the radius too.
const ABSOLUTE_MM: f64 = 0.005;
/// Largest change of the swept angle, rad, when the centre moves. More means that the ends lie radially apart, where the
/// circle through both is a tiny one, far from what the program means.
const SWEEP_CHANGE: f64 = 1.0;
/// Ends that lie closer are the same point: the arc is a full circle.
const SAME_POINT_MM: f64 = 1e-9;

/// A point of the plane, mm.
pub(crate) type Point = [f64; 2];

/// The ends of an arc, its sense and its turns.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ends {
    pub start: Point,
    pub end: Point,
    pub clockwise: bool,
    /// 1 for an arc of at most one turn.
    pub turns: u32,
    /// What [`tolerance_mm`] says of the units of the program.
    pub tolerance_mm: f64,
}

/// An arc with its ends.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Part {
    pub arc: ArcGeometry,
    pub start: Point,
    pub end: Point,
}

/// The one or two arcs of a line.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Parts {
    parts: [Part; 2],
    count: usize,
}

impl Parts {
    fn one(part: Part) -> Self {
        Self {
            parts: [part, Part::default()],
            count: 1,
        }
    }

    pub fn as_slice(&self) -> &[Part] {
        &self.parts[..self.count]
    }
}

/// Why there is no such arc: a stable code and words.
pub(crate) type Impossible = (&'static str, String);

fn distance(a: Point, b: Point) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn rounding(radius: f64) -> f64 {
    ABSOLUTE_MM.max(RELATIVE * radius)
}

/// How far an arc may leave the ring between its radii, mm.
fn stray(radii: [f64; 2]) -> f64 {
    rounding(radii[0].max(radii[1])).max((radii[0] - radii[1]).abs())
}

/// How much the radii of any arc may differ, mm, in a program whose unit is `unit_mm`.
pub(crate) fn tolerance_mm(unit_mm: f64) -> f64 {
    if unit_mm == 1.0 {
        ROUNDED_MM
    } else {
        ROUNDED_INCH * unit_mm
    }
}

impl Ends {
    /// The arc about `center`. Where the radii at both ends differ within the tolerance, the centre moves to the nearest
    /// point with the same distance from both. Where the arc would then leave the programmed circle by more than the
    /// tolerance (it is nearly closed, so that a small difference moves the centre far), its last half turn becomes an
    /// arc of its own.
    pub fn about(&self, center: Point) -> Result<Parts, Impossible> {
        let radii = self.radii(center)?;
        let chord = distance(self.start, self.end);
        if chord < SAME_POINT_MM {
            return Ok(Parts::one(self.part(center)));
        }
        if let Some(part) = self.near(center, chord, radii) {
            return Ok(Parts::one(part));
        }
        self.halves(center, radii).ok_or_else(|| {
            let off = show(stray(radii));
            let why = format!(
                "{}; no circle through both ends stays within {off} mm of it",
                unequal(radii)
            );
            ("arc-radius", why)
        })
    }

    fn radii(&self, center: Point) -> Result<[f64; 2], Impossible> {
        let radii = [distance(self.start, center), distance(self.end, center)];
        let largest = radii[0].max(radii[1]);
        if largest < SAME_POINT_MM {
            return Err((
                "arc-radius",
                "the radius of the arc is zero: its centre lies on its start".into(),
            ));
        }
        let unlike = (radii[0] - radii[1]).abs();
        let most = if unlike > RELATIVE * largest {
            self.tolerance_mm
        } else {
            MOST * self.tolerance_mm
        };
        if unlike > most {
            return Err(("arc-radius", unequal(radii)));
        }
        Ok(radii)
    }

    /// The arc about the point nearest to `center` that is as far from both ends, if it stays near the programmed one.
    fn near(&self, center: Point, chord: f64, radii: [f64; 2]) -> Option<Part> {
        let part = self.part(self.onto_bisector(center, chord));
        let turned = (part.arc.sweep_rad - self.part(center).arc.sweep_rad).abs();
        let near = deviation(&part.arc, center, radii) <= stray(radii) && turned <= SWEEP_CHANGE;
        near.then_some(part)
    }

    /// The arc in two parts, the second one half a turn about `center`.
    fn halves(&self, center: Point, radii: [f64; 2]) -> Option<Parts> {
        let whole = self.part(center).arc.sweep_rad;
        let before = whole - PI.copysign(whole);
        if before * whole <= 0.0 {
            return None;
        }
        let from_end = [0, 1].map(|axis| (self.end[axis] - center[axis]) / radii[1]);
        let radius = f64::midpoint(radii[0], radii[1]);
        let middle = [0, 1].map(|axis| center[axis] - from_end[axis] * radius);
        let turns = (before.abs() / TAU).floor() as u32 + 1;
        let ends = [
            Self {
                end: middle,
                turns,
                ..*self
            },
            Self {
                start: middle,
                turns: 1,
                ..*self
            },
        ];
        let [first, last] = ends.map(|ends| {
            let chord = distance(ends.start, ends.end);
            if chord < SAME_POINT_MM {
                None
            } else {
                ends.near(center, chord, ends.radii(center).ok()?)
            }
        });
        Some(Parts {
            parts: [first?, last?],
            count: 2,
        })
    }

    fn onto_bisector(&self, center: Point, chord: f64) -> Point {
        let (middle, normal) = self.bisector(chord);
        let height = (center[0] - middle[0]) * normal[0] + (center[1] - middle[1]) * normal[1];
        [
            middle[0] + height * normal[0],
            middle[1] + height * normal[1],
        ]
    }

    /// Middle of the chord, and the unit normal to its left.
    fn bisector(&self, chord: f64) -> (Point, Point) {
        let (s, e) = (self.start, self.end);
        (
            [f64::midpoint(s[0], e[0]), f64::midpoint(s[1], e[1])],
            [(s[1] - e[1]) / chord, (e[0] - s[0]) / chord],
        )
    }

    /// The arc of `radius`: the short one, or for a negative radius the long one.
    pub fn of_radius(&self, radius: f64) -> Result<Parts, Impossible> {
        let chord = distance(self.start, self.end);
        if chord < SAME_POINT_MM {
            let why = "an arc by radius (R) cannot end where it starts: a full circle needs I J K";
            return Err(("arc-ends", why.into()));
        }
        let half = chord / 2.0;
        if half - radius.abs() > rounding(radius.abs()) {
            let (r, d) = (show(radius.abs()), show(chord));
            let why =
                format!("the radius {r} mm is too small: the ends of the arc are {d} mm apart");
            return Err(("arc-radius", why));
        }
        let height = (radius * radius - half * half).max(0.0).sqrt();
        let height = if self.clockwise == (radius > 0.0) {
            -height
        } else {
            height
        };
        let (middle, normal) = self.bisector(chord);
        let center = [
            middle[0] + height * normal[0],
            middle[1] + height * normal[1],
        ];
        Ok(Parts::one(self.part(center)))
    }

    fn part(&self, center: Point) -> Part {
        let angle = |p: Point| (p[1] - center[1]).atan2(p[0] - center[0]);
        let start_angle = angle(self.start);
        let turn = if self.clockwise {
            start_angle - angle(self.end)
        } else {
            angle(self.end) - start_angle
        };
        let same = distance(self.start, self.end) < SAME_POINT_MM;
        let turn = if same || turn == 0.0 {
            TAU
        } else {
            turn.rem_euclid(TAU)
        };
        let sweep = turn + TAU * f64::from(self.turns - 1);
        let arc = ArcGeometry {
            plane: [0, 1],
            center_mm: center,
            radius_mm: distance(self.start, center),
            start_angle_rad: start_angle,
            sweep_rad: if self.clockwise { -sweep } else { sweep },
        };
        Part {
            arc,
            start: self.start,
            end: self.end,
        }
    }
}

fn unequal(radii: [f64; 2]) -> String {
    let [start, end] = radii.map(|r| format!("{r:.4}"));
    format!("the arc does not fit: its radius is {start} mm at the start and {end} mm at the end")
}

/// How far the arc leaves the ring between the two radii about the programmed centre.
fn deviation(arc: &ArcGeometry, center: Point, radii: [f64; 2]) -> f64 {
    let shift = distance(arc.center_mm, center);
    let towards = (arc.center_mm[1] - center[1]).atan2(arc.center_mm[0] - center[0]);
    let farthest = if contains(arc, towards) {
        arc.radius_mm + shift - radii[0].max(radii[1])
    } else {
        0.0
    };
    let nearest = (arc.radius_mm - shift).abs();
    let nearest = if contains(arc, towards + PI) {
        radii[0].min(radii[1]) - nearest
    } else {
        0.0
    };
    farthest.max(nearest)
}

/// Whether the arc passes the angle.
pub(crate) fn contains(arc: &ArcGeometry, angle: f64) -> bool {
    let from_start = (angle - arc.start_angle_rad) * arc.sweep_rad.signum();
    from_start.rem_euclid(TAU) <= arc.sweep_rad.abs()
}

/// The box of the arc: lowest and highest coordinate of each axis of the plane.
pub(crate) fn extent(part: &Part) -> [(f64, f64); 2] {
    let arc = &part.arc;
    std::array::from_fn(|axis| {
        let high_angle = axis as f64 * PI / 2.0;
        let (a, b) = (part.start[axis], part.end[axis]);
        let reach = |angle, sign: f64, end| {
            if contains(arc, angle) {
                arc.center_mm[axis] + sign * arc.radius_mm
            } else {
                end
            }
        };
        (
            reach(high_angle + PI, -1.0, a.min(b)),
            reach(high_angle, 1.0, a.max(b)),
        )
    })
}

#[cfg(test)]
mod tests;
