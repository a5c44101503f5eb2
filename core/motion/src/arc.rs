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
    pub(crate) fn new(block: &Block) -> Self {
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
            lanes: block.joint_lanes,
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
        let at = [self.center_mm[0] + self.radius_mm * cos, self.center_mm[1] + self.radius_mm * sin];
        self.with_plane(*start + self.rise * s_mm, at)
    }

    pub(crate) fn direction(&self, s_mm: f64) -> AxisVector {
        self.direction_at(self.angle(s_mm))
    }

    pub(crate) fn direction_at(&self, angle: f64) -> AxisVector {
        let (sin, cos) = angle.sin_cos();
        let at = [-self.radius_mm * self.rad_per_mm * sin, self.radius_mm * self.rad_per_mm * cos];
        self.with_plane(self.rise, at)
    }

    pub(crate) fn curvature(&self, s_mm: f64) -> AxisVector {
        self.curvature_at(self.angle(s_mm))
    }

    pub(crate) fn curvature_at(&self, angle: f64) -> AxisVector {
        let (sin, cos) = angle.sin_cos();
        let at = [-self.radius_mm * self.rad_per_mm.powi(2) * cos, -self.radius_mm * self.rad_per_mm.powi(2) * sin];
        self.with_plane(AxisVector::ZERO, at)
    }

    /// On a circle the direction turns evenly, and its axes do so alone.
    pub(crate) fn third(&self, s_mm: f64) -> AxisVector {
        let (direction, squared) = (self.direction(s_mm), self.rad_per_mm * self.rad_per_mm);
        self.with_plane(AxisVector::ZERO, self.plane.map(|axis| -squared * direction[usize::from(axis)]))
    }

    /// Per axis the largest |value| of a function whose plane components go as the sine and cosine of the angle: they
    /// peak at the ends of the arc or at a multiple of π/2 inside it, and those of a joint lane where its sine and cosine
    /// are in phase.
    pub(crate) fn largest(&self, value: impl Fn(f64) -> AxisVector) -> AxisVector {
        let (from, to) = (self.start_angle_rad, self.start_angle_rad + self.sweep_rad);
        let (low, high) = (from.min(to), from.max(to));
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
                let (q, r) = (0.5 * (east[lane] - west[lane]), 0.5 * (east[lane] + west[lane]));
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

    /// Angle from the start, rad, of the point of the arc nearest to `point`; of several turns the one whose rise fits.
    pub(crate) fn nearest(&self, start: &AxisVector, point: &AxisVector) -> f64 {
        let [x, y] = [0, 1].map(|i| point[usize::from(self.plane[i])] - self.center_mm[i]);
        let swept = self.sweep_rad.abs();
        let turn = ((y.atan2(x) - self.start_angle_rad) * self.sweep_rad.signum()).rem_euclid(TAU);
        // A point just before the start belongs to the start, not to the end of the turn.
        let beyond = (turn - swept).max(0.0);
        let angle = if beyond > 0.0 && TAU - turn < beyond { 0.0 } else { turn };
        let risen = self.rise.0.iter().enumerate().find(|(_, rise)| **rise != 0.0);
        let turns = risen.map_or(0.0, |(axis, rise)| {
            let wanted = (point[axis] - start[axis]) / rise * self.rad_per_mm.abs();
            ((wanted - turn) / TAU).round().max(0.0)
        });
        if turns > 0.0 { (turn + turns * TAU).min(swept) } else { angle.min(swept) }
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
        let mut block = Block::at(AxisVector::from_slice(&[radius * start.cos(), radius * start.sin(), 1.0]));
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
            let (s, h) = (at * path.length_mm(), 1e-4 * path.length_mm().min(radius));
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
        fn joint_lanes_are_sums_of_the_axes_and_bounded(
            radius in 0.1..50.0f64, start in -3.0..3.0f64, sweep in -12.0..12.0f64, rise in -5.0..5.0f64,
            weights in proptest::array::uniform3(-2.0..2.0f64), at in 0.0..1.0f64,
        ) {
            let mut block = helix_block(radius, start, sweep, rise);
            let lanes = JointLanes::new(3, &[AxisVector::from_slice(&weights)]).unwrap();
            block.joint_lanes = Some(Box::leak(Box::new(lanes)));
            let path = Path::new(&block).unwrap();
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
