//! Circular arcs and helices by path coordinate.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use tandem_sdk::{AxisVector, Block, JointLanes};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Arc {
    plane: [u8; 2],
    center_mm: [f64; 2],
    pub(crate) radius_mm: f64,
    start_angle_rad: f64,
    sweep_rad: f64,
    pub(crate) rad_per_mm: f64,
    /// Change of the axes outside the plane per mm; zero in the plane.
    rise: AxisVector,
    lanes: Option<&'static JointLanes>,
}

impl Arc {
    pub(crate) fn new(block: &Block, lanes: Option<&'static JointLanes>) -> Self {
        let plane = block.arc.plane.map(|axis| axis as usize);
        let mut rise = (block.end - block.start) * (1.0 / block.length_mm);
        rise[plane[0]] = 0.0;
        rise[plane[1]] = 0.0;
        Self {
            plane: plane.map(|axis| axis as u8),
            center_mm: block.arc.center_mm,
            radius_mm: block.arc.radius_mm,
            start_angle_rad: block.arc.start_angle_rad,
            sweep_rad: block.arc.sweep_rad,
            rad_per_mm: block.arc.sweep_rad / block.length_mm,
            rise,
            lanes,
        }
    }

    /// Writes the components in the plane, and what the joint lanes make of them.
    #[inline]
    fn with_plane(&self, mut vector: AxisVector, components: [f64; 2]) -> AxisVector {
        vector[usize::from(self.plane[0])] = components[0];
        vector[usize::from(self.plane[1])] = components[1];
        if let Some(lanes) = self.lanes {
            lanes.fill(&mut vector);
        }
        vector
    }

    fn angle(&self, s_mm: f64) -> f64 {
        self.start_angle_rad + self.rad_per_mm * s_mm
    }

    pub(crate) fn position(&self, start: &AxisVector, s_mm: f64) -> AxisVector {
        let (sin, cos) = self.angle(s_mm).sin_cos();
        let at = [
            self.center_mm[0] + self.radius_mm * cos,
            self.center_mm[1] + self.radius_mm * sin,
        ];
        self.with_plane(*start + self.rise * s_mm, at)
    }

    pub(crate) fn direction(&self, s_mm: f64) -> AxisVector {
        self.direction_at(self.angle(s_mm))
    }

    pub(crate) fn direction_at(&self, angle: f64) -> AxisVector {
        let (sin, cos) = angle.sin_cos();
        let at = [
            -self.radius_mm * self.rad_per_mm * sin,
            self.radius_mm * self.rad_per_mm * cos,
        ];
        self.with_plane(self.rise, at)
    }

    pub(crate) fn curvature(&self, s_mm: f64) -> AxisVector {
        self.curvature_at(self.angle(s_mm))
    }

    pub(crate) fn curvature_at(&self, angle: f64) -> AxisVector {
        let (sin, cos) = angle.sin_cos();
        let at = [
            -self.radius_mm * self.rad_per_mm.powi(2) * cos,
            -self.radius_mm * self.rad_per_mm.powi(2) * sin,
        ];
        self.with_plane(AxisVector::ZERO, at)
    }

    /// On a circle the direction turns evenly, and its axes do so alone.
    pub(crate) fn third(&self, s_mm: f64) -> AxisVector {
        let direction = self.direction(s_mm);
        let squared = self.rad_per_mm * self.rad_per_mm;
        self.with_plane(
            AxisVector::ZERO,
            self.plane
                .map(|axis| -squared * direction[usize::from(axis)]),
        )
    }

    /// Per axis the largest |value| of a function whose plane components go as the sine and cosine of the angle: they
    /// peak at the ends of the arc or at a multiple of π/2 inside it, and those of a joint lane where its sine and cosine
    /// are in phase.
    pub(crate) fn largest(&self, value: impl Fn(f64) -> AxisVector) -> AxisVector {
        let from = self.start_angle_rad;
        let to = self.start_angle_rad + self.sweep_rad;
        let low = from.min(to);
        let high = from.max(to);
        let mut largest = value(low).map(f64::abs);
        let mut consider = |angle: f64| {
            let at = value(angle);
            for (most, v) in largest.0.iter_mut().zip(at.0) {
                *most = most.max(v.abs());
            }
        };
        consider(high);
        let first = (low / FRAC_PI_2).ceil();
        for quarter in 0..4 {
            let angle = (first + f64::from(quarter)) * FRAC_PI_2;
            if angle <= high {
                consider(angle);
            }
        }
        if let Some(lanes) = self.lanes {
            // A lane is p·sin φ + q·cos φ + r: it peaks where tan φ = p/q, half a turn apart.
            let [east, north, west] = [0.0, FRAC_PI_2, PI].map(&value);
            for lane in lanes.first()..lanes.first() + lanes.weights().len() {
                let q = 0.5 * (east[lane] - west[lane]);
                let r = 0.5 * (east[lane] + west[lane]);
                let peak = (north[lane] - r).atan2(q);
                let first = ((low - peak) / PI).ceil();
                [first, first + 1.0]
                    .map(|n| peak + n * PI)
                    .into_iter()
                    .filter(|angle| *angle <= high)
                    .for_each(&mut consider);
            }
        }
        largest
    }

    /// Angle from the start, rad, of the point of the arc or helix nearest to `point`.
    pub(crate) fn nearest(&self, start: &AxisVector, point: &AxisVector) -> f64 {
        let [x, y] = [0, 1].map(|i| point[usize::from(self.plane[i])] - self.center_mm[i]);
        let swept = self.sweep_rad.abs();
        // Where in the plane the point lies, as an angle from the start in the direction of the sweep.
        let turn = ((y.atan2(x) - self.start_angle_rad) * self.sweep_rad.signum()).rem_euclid(TAU);
        let axes = self.lanes.map_or(self.rise.0.len(), JointLanes::first);
        let per_rad = self.rise.0[..axes]
            .iter()
            .map(|rise| rise / self.rad_per_mm.abs());
        let mut square = 0.0;
        let mut along = 0.0;
        for (axis, rise) in per_rad.enumerate() {
            square += rise * rise;
            along += rise * (point[axis] - start[axis]);
        }
        if square == 0.0 {
            // A point just before the start belongs to the start, not to the end of the turn.
            let beyond = (turn - swept).max(0.0);
            let angle = if beyond > 0.0 && TAU - turn < beyond {
                0.0
            } else {
                turn
            };
            return angle.min(swept);
        }
        let way = Helix {
            pull: self.radius_mm * x.hypot(y),
            square,
            risen: along / square,
        };
        way.nearest(turn, swept)
    }
}

/// The distance of a point from a helix, as a function of the angle from the start: the square of it is, but for a constant,
/// `square·(angle − risen)² − 2·pull·cos(angle − turn)`.
struct Helix {
    /// Radius of the helix times that of the point, mm².
    pull: f64,
    /// Square of the rise per rad, mm².
    square: f64,
    /// The angle at which the rise is that of the point, rad.
    risen: f64,
}

/// Steps of Newton's method, or halvings where it would leave its bracket: to the rounding of an angle.
const STEPS: u32 = 60;

impl Helix {
    /// The angle of the nearest point between 0 and `swept`, rad.
    ///
    /// In the plane the distance is least at `turn` and at whole turns from it, along the rise at `risen`. Without ends the
    /// nearest point lies between `risen` and the one of these angles that is nearest to it; where an end cuts that off, it
    /// is the end, or lies in one of the neighbouring turns.
    fn nearest(&self, turn: f64, swept: f64) -> f64 {
        let middle = turn + ((self.risen.clamp(0.0, swept) - turn) / TAU).round() * TAU;
        let inside = [middle - TAU, middle, middle + TAU]
            .map(|turn| self.least_beside(turn).clamp(0.0, swept));
        let cost = |angle: f64| {
            let off = angle - self.risen;
            self.square * off * off - 2.0 * self.pull * (angle - turn).cos()
        };
        let nearer = |best: f64, angle: f64| {
            if cost(angle) < cost(best) {
                angle
            } else {
                best
            }
        };
        inside.into_iter().chain([swept]).fold(0.0, nearer)
    }

    /// The least distance between `turn`, where it is least in the plane, and the rise, at most half a turn away; `turn`
    /// where there is none.
    fn least_beside(&self, turn: f64) -> f64 {
        let off = self.risen - turn;
        let way = off.abs();
        // Half of the derivative at `x` from the turn towards the rise: below zero at 0, and concave up to half a turn.
        let slope = |x: f64| self.pull * x.sin() + self.square * (x - way);
        let steepest = if self.square < self.pull {
            (-self.square / self.pull).acos()
        } else {
            PI
        };
        let mut low = 0.0;
        let mut high = if way <= PI { way } else { steepest };
        if slope(high) < 0.0 {
            return turn;
        }
        let mut x = high.min(self.square * way / (self.square + self.pull));
        for _ in 0..STEPS {
            let at = slope(x);
            *(if at < 0.0 { &mut low } else { &mut high }) = x;
            let next = x - at / (self.pull * x.cos() + self.square);
            let next = if next > low && next < high {
                next
            } else {
                f64::midpoint(low, high)
            };
            if next == x || (next - x).abs() <= f64::EPSILON * x.abs() {
                break;
            }
            x = next;
        }
        turn + off.signum() * x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Path;
    use proptest::prelude::*;
    use tandem_sdk::{ArcGeometry, BlockKind};

    fn helix(radius: f64, start: f64, sweep: f64, rise: f64) -> Path {
        Path::new(&helix_block(radius, start, sweep, rise)).unwrap()
    }

    fn helix_block(radius: f64, start: f64, sweep: f64, rise: f64) -> Block {
        let mut block = Block::at(AxisVector::from_slice(&[
            radius * start.cos(),
            radius * start.sin(),
            1.0,
        ]));
        let to = start + sweep;
        block.kind = BlockKind::Arc;
        block.end = AxisVector::from_slice(&[radius * to.cos(), radius * to.sin(), 1.0 + rise]);
        block.length_mm = (radius * sweep).hypot(rise);
        block.arc = ArcGeometry {
            plane: [0, 1],
            center_mm: [0.0, 0.0],
            radius_mm: radius,
            start_angle_rad: start,
            sweep_rad: sweep,
        };
        block
    }

    proptest! {
        #[test]
        fn derivatives_match_differences(
            radius in 0.1..50.0f64, start in -3.0..3.0f64, sweep in 0.1..12.0f64, sign in proptest::bool::ANY,
            rise in -5.0..5.0f64, at in 0.05..0.95f64,
        ) {
            let path = helix(radius, start, if sign { sweep } else { -sweep }, rise);
            let s = at * path.length_mm();
            let h = 1e-4 * path.length_mm().min(radius);
            let numeric = (path.position(s + h) - path.position(s - h)) * (0.5 / h);
            let bend = (path.direction(s + h) - path.direction(s - h)) * (0.5 / h);
            let twist = (path.curvature(s + h) - path.curvature(s - h)) * (0.5 / h);
            for axis in 0..3 {
                prop_assert!((numeric[axis] - path.direction(s)[axis]).abs() < 1e-6);
                prop_assert!((bend[axis] - path.curvature(s)[axis]).abs() < 1e-5 / radius);
                prop_assert!((twist[axis] - path.third(s)[axis]).abs() < 1e-4 / (radius * radius));
                prop_assert!(path.direction(s)[axis].abs() <= path.max_direction()[axis] + 1e-12);
                prop_assert!(path.curvature(s)[axis].abs() <= path.max_curvature()[axis] + 1e-12);
            }
        }

        #[test]
        fn a_point_on_the_path_is_at_no_distance(
            radius in 0.1..50.0f64, start in -3.0..3.0f64, sweep in 0.1..12.0f64, rise in 1.0..5.0f64, at in 0.0..1.0f64,
        ) {
            let path = helix(radius, start, sweep, rise);
            prop_assert!(path.distance_mm(&path.position(at * path.length_mm())) < 1e-9);
        }
    }

    proptest! {
        #[test]
        fn the_nearest_point_of_an_arc_or_helix_is_that_of_a_dense_search(
            radius in 0.1..50.0f64, start in -3.0..3.0f64, sweep in 0.1..20.0f64, sign in proptest::bool::ANY,
            pitch in prop_oneof![Just(0.0), -0.5..0.5f64, -500.0..500.0f64], at in -0.2..1.2f64,
            off in proptest::array::uniform3(-1.0..1.0f64), far in prop_oneof![Just(1e-3), Just(1.0), Just(60.0)],
        ) {
            let path = helix(radius, start, if sign { sweep } else { -sweep }, pitch * sweep);
            let mut point = path.position(at.clamp(0.0, 1.0) * path.length_mm());
            for (axis, off) in off.iter().enumerate() {
                point[axis] += far * off;
            }
            point[2] += (at - at.clamp(0.0, 1.0)) * pitch * sweep;
            let steps = 4000;
            let distance = |i: f64| {
                let off = point - path.position(i / f64::from(steps) * path.length_mm());
                off.0.iter().map(|d| d * d).sum::<f64>().sqrt()
            };
            let searched = (0..=steps).map(|i| distance(f64::from(i))).fold(f64::INFINITY, f64::min);
            let found = path.distance_mm(&point);
            let step_mm = path.length_mm() / f64::from(steps);
            prop_assert!(found <= searched + 1e-9, "{found} for {searched}");
            prop_assert!(found >= searched - step_mm, "{found} for {searched}, steps of {step_mm}");
        }
    }

    #[test]
    fn a_sample_beside_a_steep_helix_is_as_far_away_as_it_is() {
        let path = helix(2.0, 0.0, 3.0, 60.0);
        // The binormal of a helix is at right angles to it: 10 µm along it are 10 µm from the path.
        let at = 1.0f64;
        let rise = 20.0;
        let mut point = path.position(path.length_mm() / 3.0);
        let length = 2.0f64.hypot(rise);
        for (axis, part) in [rise * at.sin(), -rise * at.cos(), 2.0]
            .into_iter()
            .enumerate()
        {
            point[axis] += 0.01 * part / length;
        }
        assert!(
            (path.distance_mm(&point) - 0.01).abs() < 1e-6,
            "{}",
            path.distance_mm(&point)
        );
    }

    proptest! {
        #[test]
        fn joint_lanes_are_sums_of_the_axes_and_bounded(
            radius in 0.1..50.0f64, start in -3.0..3.0f64, sweep in -12.0..12.0f64, rise in -5.0..5.0f64,
            weights in proptest::array::uniform3(-2.0..2.0f64), at in 0.0..1.0f64,
        ) {
            let block = helix_block(radius, start, sweep, rise);
            let lanes = JointLanes::new(3, &[AxisVector::from_slice(&weights)]).unwrap();
            let path = Path::with_lanes(&block, Some(Box::leak(Box::new(lanes)))).unwrap();
            let s_mm = at * path.length_mm();
            for (vector, most) in [(path.direction(s_mm), path.max_direction()), (path.curvature(s_mm), path.max_curvature())] {
                let mut filled = vector;
                lanes.fill(&mut filled);
                prop_assert_eq!(filled, vector);
                prop_assert!(vector[3].abs() <= most[3] * (1.0 + 1e-12) + 1e-12, "{} > {}", vector[3], most[3]);
            }
            let seen = (0..=2000).map(|i| path.direction(f64::from(i) / 2000.0 * path.length_mm())[3].abs());
            prop_assert!(path.max_direction()[3] <= seen.fold(0.0, f64::max) + 1e-3, "not more than it needs");
        }
    }

    #[test]
    fn a_point_before_the_start_is_near_the_start() {
        let path = helix(10.0, 0.0, FRAC_PI_2, 0.0);
        let mut before = *path.start();
        before[1] = -0.1;
        assert!((path.distance_mm(&before) - 0.1).abs() < 1e-12);
    }
}
