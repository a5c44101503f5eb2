//! The circle of an arc from what the program says of it. Pure geometry in a plane, mm and rad.

use std::f64::consts::{PI, TAU};

use tandem_sdk::ArcGeometry;

use crate::fault::show;

/// Start and end radius may differ by this much, mm, or by [`RELATIVE`] of the radius: programs are rounded.
const ABSOLUTE_MM: f64 = 0.005;
const RELATIVE: f64 = 1e-3;
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
}

/// Why there is no such arc: a stable code and words.
pub(crate) type Impossible = (&'static str, String);

fn distance(a: Point, b: Point) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn tolerance(radius: f64) -> f64 {
    ABSOLUTE_MM.max(RELATIVE * radius)
}

impl Ends {
    /// The arc about `center`. Where the radii at both ends differ within the tolerance, the centre moves to the nearest
    /// point with the same distance from both, and the arc may leave the programmed circles by no more than that.
    pub fn about(&self, center: Point) -> Result<ArcGeometry, Impossible> {
        let radii = [distance(self.start, center), distance(self.end, center)];
        let largest = radii[0].max(radii[1]);
        if largest < SAME_POINT_MM {
            return Err(("arc-radius", "the radius of the arc is zero: its centre lies on its start".into()));
        }
        if (radii[0] - radii[1]).abs() > tolerance(largest) {
            return Err(("arc-radius", unequal(radii)));
        }
        let chord = distance(self.start, self.end);
        if chord < SAME_POINT_MM {
            return Ok(self.circle(center, radii[0]));
        }
        let moved = self.onto_bisector(center, chord);
        let arc = self.circle(moved, distance(self.start, moved));
        let turned = (arc.sweep_rad - self.circle(center, radii[0]).sweep_rad).abs();
        if deviation(&arc, center, radii) > tolerance(largest) || turned > SWEEP_CHANGE {
            let why = format!("; no circle through both ends stays within {} mm of it", show(tolerance(largest)));
            return Err(("arc-radius", unequal(radii) + &why));
        }
        Ok(arc)
    }

    fn onto_bisector(&self, center: Point, chord: f64) -> Point {
        let (middle, normal) = self.bisector(chord);
        let height = (center[0] - middle[0]) * normal[0] + (center[1] - middle[1]) * normal[1];
        [middle[0] + height * normal[0], middle[1] + height * normal[1]]
    }

    /// Middle of the chord, and the unit normal to its left.
    fn bisector(&self, chord: f64) -> (Point, Point) {
        let (s, e) = (self.start, self.end);
        ([f64::midpoint(s[0], e[0]), f64::midpoint(s[1], e[1])], [(s[1] - e[1]) / chord, (e[0] - s[0]) / chord])
    }

    /// The arc of `radius`: the short one, or for a negative radius the long one.
    pub fn of_radius(&self, radius: f64) -> Result<ArcGeometry, Impossible> {
        let chord = distance(self.start, self.end);
        if chord < SAME_POINT_MM {
            let why = "an arc by radius (R) cannot end where it starts: a full circle needs I J K";
            return Err(("arc-ends", why.into()));
        }
        let half = chord / 2.0;
        if half - radius.abs() > tolerance(radius.abs()) {
            let (r, d) = (show(radius.abs()), show(chord));
            let why = format!("the radius {r} mm is too small: the ends of the arc are {d} mm apart");
            return Err(("arc-radius", why));
        }
        let height = (radius * radius - half * half).max(0.0).sqrt();
        let height = if self.clockwise == (radius > 0.0) { -height } else { height };
        let (middle, normal) = self.bisector(chord);
        let center = [middle[0] + height * normal[0], middle[1] + height * normal[1]];
        Ok(self.circle(center, distance(self.start, center)))
    }

    fn circle(&self, center: Point, radius: f64) -> ArcGeometry {
        let angle = |p: Point| (p[1] - center[1]).atan2(p[0] - center[0]);
        let start_angle = angle(self.start);
        let turn = if self.clockwise { start_angle - angle(self.end) } else { angle(self.end) - start_angle };
        let same = distance(self.start, self.end) < SAME_POINT_MM;
        let turn = if same || turn == 0.0 { TAU } else { turn.rem_euclid(TAU) };
        let sweep = turn + TAU * f64::from(self.turns - 1);
        ArcGeometry {
            plane: [0, 1],
            center_mm: center,
            radius_mm: radius,
            start_angle_rad: start_angle,
            sweep_rad: if self.clockwise { -sweep } else { sweep },
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
    let farthest = if contains(arc, towards) { arc.radius_mm + shift - radii[0].max(radii[1]) } else { 0.0 };
    let nearest = (arc.radius_mm - shift).abs();
    let nearest = if contains(arc, towards + PI) { radii[0].min(radii[1]) - nearest } else { 0.0 };
    farthest.max(nearest)
}

/// Whether the arc passes the angle.
pub(crate) fn contains(arc: &ArcGeometry, angle: f64) -> bool {
    let from_start = (angle - arc.start_angle_rad) * arc.sweep_rad.signum();
    from_start.rem_euclid(TAU) <= arc.sweep_rad.abs()
}

/// The box of the arc beyond its ends: lowest and highest coordinate of each axis of the plane, `ends` included.
pub(crate) fn extent(arc: &ArcGeometry, ends: [Point; 2]) -> [(f64, f64); 2] {
    std::array::from_fn(|axis| {
        let high_angle = axis as f64 * PI / 2.0;
        let (a, b) = (ends[0][axis], ends[1][axis]);
        let reach =
            |angle, sign: f64, end| if contains(arc, angle) { arc.center_mm[axis] + sign * arc.radius_mm } else { end };
        (reach(high_angle + PI, -1.0, a.min(b)), reach(high_angle, 1.0, a.max(b)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ends(start: Point, end: Point, clockwise: bool) -> Ends {
        Ends { start, end, clockwise, turns: 1 }
    }

    #[test]
    fn quarter_and_full_circles() {
        let quarter = ends([10.0, 0.0], [0.0, 10.0], false).about([0.0, 0.0]).unwrap();
        assert!((quarter.sweep_rad - PI / 2.0).abs() < 1e-15);
        let rest = ends([10.0, 0.0], [0.0, 10.0], true).about([0.0, 0.0]).unwrap();
        assert!((rest.sweep_rad + 1.5 * PI).abs() < 1e-15);
        let full = ends([10.0, 0.0], [10.0, 0.0], true).about([0.0, 0.0]).unwrap();
        assert_eq!(full.sweep_rad, -TAU);
        let three = Ends { turns: 3, ..ends([10.0, 0.0], [10.0, 0.0], false) }.about([0.0, 0.0]).unwrap();
        assert_eq!(three.sweep_rad, 3.0 * TAU);
    }

    #[test]
    fn radius_arcs_take_the_short_or_the_long_way() {
        let short = ends([10.0, 0.0], [0.0, 10.0], false).of_radius(10.0).unwrap();
        assert!(distance(short.center_mm, [0.0, 0.0]) < 1e-12 && (short.sweep_rad - PI / 2.0).abs() < 1e-12);
        let long = ends([10.0, 0.0], [0.0, 10.0], false).of_radius(-10.0).unwrap();
        assert!(distance(long.center_mm, [10.0, 10.0]) < 1e-12 && (long.sweep_rad - 1.5 * PI).abs() < 1e-12);
        let half = ends([10.0, 0.0], [-10.0, 0.0], true).of_radius(9.9999).unwrap();
        assert!((half.radius_mm - 10.0).abs() < 1e-12 && (half.sweep_rad + PI).abs() < 1e-12);
        assert_eq!(ends([0.0, 0.0], [20.0, 0.0], true).of_radius(9.0).unwrap_err().0, "arc-radius");
        assert_eq!(ends([0.0, 0.0], [0.0, 0.0], true).of_radius(9.0).unwrap_err().0, "arc-ends");
    }

    #[test]
    fn radii_that_differ_too_much_are_refused_with_both() {
        let (code, why) = ends([10.0, 0.0], [0.0, 10.02], false).about([0.0, 0.0]).unwrap_err();
        assert_eq!(code, "arc-radius");
        assert_eq!(why, "the arc does not fit: its radius is 10.0000 mm at the start and 10.0200 mm at the end");
        // Radially apart, at the same angle: the circle through both ends would be tiny.
        assert!(ends([10.0, 0.0], [10.004, 0.0], false).about([0.0, 0.0]).unwrap_err().1.contains("no circle"));
    }

    #[test]
    fn extents_know_the_quadrants() {
        let arc = ends([10.0, 0.0], [0.0, -10.0], false).about([0.0, 0.0]).unwrap();
        let [x, y] = extent(&arc, [[10.0, 0.0], [0.0, -10.0]]);
        assert_eq!((x, y), ((-10.0, 10.0), (-10.0, 10.0)));
        let arc = ends([10.0, 0.0], [0.0, 10.0], false).about([0.0, 0.0]).unwrap();
        assert_eq!(extent(&arc, [[10.0, 0.0], [0.0, 10.0]]), [(0.0, 10.0), (0.0, 10.0)]);
    }

    proptest! {
        /// Ends rounded to 0.001 mm: both lie on the circle of the arc, and sweeping it from the start meets the end.
        #[test]
        fn rounded_arcs_hold_together(
            r in 0.5..200.0f64, a in 0.0..TAU, sweep in 0.2..6.0f64, cx in -50.0..50.0f64, clockwise: bool,
        ) {
            let round = |v: f64| (v * 1000.0).round() / 1000.0;
            let at = |angle: f64| [round(cx + r * angle.cos()), round(r * angle.sin())];
            let b = if clockwise { a - sweep } else { a + sweep };
            let ends = ends(at(a), at(b), clockwise);
            let arc = ends.about([round(cx), 0.0]).unwrap();
            for end in [ends.start, ends.end] {
                prop_assert!((distance(end, arc.center_mm) - arc.radius_mm).abs() < 1e-9);
            }
            let last = arc.start_angle_rad + arc.sweep_rad;
            let reached = [arc.center_mm[0] + arc.radius_mm * last.cos(), arc.center_mm[1] + arc.radius_mm * last.sin()];
            prop_assert!(distance(reached, ends.end) < 1e-9);
            prop_assert!((arc.sweep_rad.abs() - sweep).abs() < 0.02);
        }
    }
}
