//! Whether the joints stay within their travel along a block.

use std::f64::consts::TAU;
use std::sync::Arc;

use tandem_motion::Path;
use tandem_motion::nurbs::Nurbs;
use tandem_sdk::{Axes, AxisVector, Block, BlockKind, Curve, PluginError};

use super::joint::beyond;
use super::space::{JointSpace, Map};

/// Places tried on a knot span of a curve, and on a path where the joints are no linear function of the axes.
const TRIED: u32 = 64;

/// The travel of all joints.
pub struct Travel {
    space: Arc<JointSpace>,
    axes: Axes,
}

impl Travel {
    pub fn new(space: Arc<JointSpace>, axes: Axes) -> Self {
        Self { space, axes }
    }

    /// Whether all joints stay within their travel along `block`.
    ///
    /// # Errors
    /// Which does not, in words.
    pub fn check(&self, block: &Block, curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        match block.kind {
            BlockKind::Dwell => Ok(()),
            BlockKind::Nurbs => curve.map_or(Ok(()), |curve| self.curve(curve)),
            _ if matches!(self.space.map, Map::Curved(_)) => self.tried(block),
            BlockKind::Arc => self.arc(block),
            BlockKind::Rapid | BlockKind::Line => self.at(&block.end),
        }
    }

    fn at(&self, position: &AxisVector) -> Result<(), PluginError> {
        let joints = self.space.to_joints(position);
        self.space.health(&joints)?;
        let words = self
            .space
            .joints
            .iter()
            .enumerate()
            .find_map(|(i, joint)| beyond(joint, joints[i]));
        words.map_or(Ok(()), |words| Err(PluginError::new(words)))
    }

    fn tried(&self, block: &Block) -> Result<(), PluginError> {
        let Some(path) = Path::new(block) else {
            return Ok(());
        };
        (0..=TRIED).try_for_each(|i| {
            self.at(&path.position(path.length_mm() * f64::from(i) / f64::from(TRIED)))
        })
    }

    /// At the end of an arc, and wherever a joint turns on it.
    fn arc(&self, block: &Block) -> Result<(), PluginError> {
        self.at(&block.end)?;
        let (Map::Linear(linear, _), Some(path)) = (&self.space.map, Path::new(block)) else {
            return Ok(());
        };
        let mm_per_rad = path.length_mm() / block.arc.sweep_rad.abs();
        let turns = (0..self.space.count()).flat_map(|joint| turns(block, linear.weights(joint)));
        turns
            .into_iter()
            .try_for_each(|angle| self.at(&path.position(angle * mm_per_rad)))
    }

    fn curve(&self, curve: Curve<'_>) -> Result<(), PluginError> {
        let curve = Nurbs::new(&curve.to_data(), &self.axes)
            .map_err(|e| PluginError::new(e.to_string()))?;
        for span in curve.knots()[curve.degree()..=curve.points()]
            .windows(2)
            .filter(|span| span[1] > span[0])
        {
            let place = |i: u32| span[0] + (span[1] - span[0]) * f64::from(i) / f64::from(TRIED);
            (0..=TRIED).try_for_each(|i| self.at(&curve.position(place(i))))?;
        }
        Ok(())
    }
}

/// Swept angles, rad, at which `Σ weight · axis` turns on an arc or helix: in its first turn and in its last.
///
/// With the angle φ the sum is `q·cos φ + p·sin φ` and a rise r per radian: it turns where `A·cos(φ + δ) = −r`.
fn turns(block: &Block, weights: &AxisVector) -> Vec<f64> {
    let arc = &block.arc;
    let sign = block.arc.sweep_rad.signum();
    let plane = arc.plane.map(|axis| axis as usize);
    let [q, p] = plane.map(|axis| arc.radius_mm * weights[axis]);
    let outside = (0..weights.0.len()).filter(|axis| !plane.contains(axis));
    let rise: f64 = outside
        .map(|axis| weights[axis] * (block.end[axis] - block.start[axis]))
        .sum();
    let level = -sign * rise / (arc.sweep_rad.abs() * p.hypot(q));
    if !(-1.0..=1.0).contains(&level) {
        return vec![];
    }
    let phase = q.atan2(p);
    let swept = arc.sweep_rad.abs();
    let both = [level.acos(), -level.acos()]
        .map(|angle| (sign * (angle - phase - arc.start_angle_rad)).rem_euclid(TAU));
    let inside = both.into_iter().filter(|angle| *angle <= swept);
    inside
        .flat_map(|angle| [angle, angle + TAU * ((swept - angle) / TAU).floor()])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tandem_sdk::ArcGeometry;

    proptest! {
        #[test]
        fn between_its_turns_a_sum_of_axes_is_monotonic(
            radius in 0.1..50.0f64, start in -3.0..3.0f64, sweep in -20.0..20.0f64, rise in -50.0..50.0f64,
            weights in proptest::array::uniform3(-2.0..2.0f64),
        ) {
            let at = |angle: f64, z: f64| AxisVector::from_slice(&[radius * angle.cos(), radius * angle.sin(), z]);
            let block = Block {
                kind: BlockKind::Arc,
                end: at(start + sweep, rise),
                length_mm: (radius * sweep).hypot(rise),
                arc: ArcGeometry {
                    plane: [0, 1],
                    center_mm: [0.0; 2],
                    radius_mm: radius,
                    start_angle_rad: start,
                    sweep_rad: sweep,
                },
                ..Block::at(at(start, 0.0))
            };
            let (path, weights) = (Path::new(&block).unwrap(), AxisVector::from_slice(&weights));
            let value = |s_mm: f64| weights.0.iter().zip(path.position(s_mm).0).map(|(w, v)| w * v).sum::<f64>();
            let mm_per_rad = path.length_mm() / sweep.abs();
            let candidates = turns(&block, &weights).into_iter().map(|angle| value(angle * mm_per_rad));
            let most = candidates.chain([value(0.0), value(path.length_mm())]).fold(f64::NEG_INFINITY, f64::max);
            let places = (0..=5000).map(|i| path.length_mm() * f64::from(i) / 5000.0);
            let seen = places.map(value).fold(f64::NEG_INFINITY, f64::max);
            prop_assert!(seen <= most + 1e-9, "{seen} > {most}");
            prop_assert!(most <= seen + 1e-3 * radius, "{most} is never reached, {seen} is");
        }
    }
}
