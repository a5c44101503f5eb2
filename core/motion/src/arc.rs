//! Circular arcs and helices by path coordinate.

use std::f64::consts::{FRAC_PI_2, TAU};

use tandem_sdk::{AxisVector, Block};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Arc {
    plane: [usize; 2],
    center_mm: [f64; 2],
    pub(crate) radius_mm: f64,
    start_angle_rad: f64,
    sweep_rad: f64,
    pub(crate) rad_per_mm: f64,
    /// Change of the axes outside the plane per mm; zero in the plane.
    rise: AxisVector,
}

impl Arc {
    pub(crate) fn new(block: &Block) -> Self {
        let plane = block.arc.plane.map(|axis| axis as usize);
        let mut rise = (block.end - block.start) * (1.0 / block.length_mm);
        rise[plane[0]] = 0.0;
        rise[plane[1]] = 0.0;
        Self {
            plane,
            center_mm: block.arc.center_mm,
            radius_mm: block.arc.radius_mm,
            start_angle_rad: block.arc.start_angle_rad,
            sweep_rad: block.arc.sweep_rad,
            rad_per_mm: block.arc.sweep_rad / block.length_mm,
            rise,
        }
    }

    fn angle(&self, s_mm: f64) -> f64 {
        self.start_angle_rad + self.rad_per_mm * s_mm
    }

    pub(crate) fn position(&self, start: &AxisVector, s_mm: f64) -> AxisVector {
        let (sin, cos) = self.angle(s_mm).sin_cos();
        let mut at = *start + self.rise * s_mm;
        at[self.plane[0]] = self.center_mm[0] + self.radius_mm * cos;
        at[self.plane[1]] = self.center_mm[1] + self.radius_mm * sin;
        at
    }

    pub(crate) fn direction(&self, s_mm: f64) -> AxisVector {
        self.direction_at(self.angle(s_mm))
    }

    pub(crate) fn direction_at(&self, angle: f64) -> AxisVector {
        let (sin, cos) = angle.sin_cos();
        let mut at = self.rise;
        at[self.plane[0]] = -self.radius_mm * self.rad_per_mm * sin;
        at[self.plane[1]] = self.radius_mm * self.rad_per_mm * cos;
        at
    }

    pub(crate) fn curvature(&self, s_mm: f64) -> AxisVector {
        self.curvature_at(self.angle(s_mm))
    }

    pub(crate) fn curvature_at(&self, angle: f64) -> AxisVector {
        let (sin, cos) = angle.sin_cos();
        let mut at = AxisVector::ZERO;
        at[self.plane[0]] = -self.radius_mm * self.rad_per_mm.powi(2) * cos;
        at[self.plane[1]] = -self.radius_mm * self.rad_per_mm.powi(2) * sin;
        at
    }

    /// Per axis the largest |value| of a function whose plane components go as the sine and cosine of the angle: they
    /// peak at the ends of the arc or at a multiple of π/2 inside it.
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
        largest
    }

    /// Angle from the start, rad, of the point of the arc nearest to `point`; of several turns the one whose rise fits.
    pub(crate) fn nearest(&self, start: &AxisVector, point: &AxisVector) -> f64 {
        let (x, y) = (point[self.plane[0]] - self.center_mm[0], point[self.plane[1]] - self.center_mm[1]);
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
        Path::new(&block).unwrap()
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
            for axis in 0..3 {
                prop_assert!((numeric[axis] - path.direction(s)[axis]).abs() < 1e-6);
                prop_assert!((bend[axis] - path.curvature(s)[axis]).abs() < 1e-5 / radius);
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

    #[test]
    fn a_point_before_the_start_is_near_the_start() {
        let path = helix(10.0, 0.0, FRAC_PI_2, 0.0);
        let mut before = *path.start();
        before[1] = -0.1;
        assert!((path.distance_mm(&before) - 0.1).abs() < 1e-12);
    }
}
