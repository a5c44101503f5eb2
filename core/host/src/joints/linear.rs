//! Whether kinematics are linear, found out by asking them, and the linear map itself.

use tandem_sdk::{AxisVector, Kinematics, Limits, PluginError};

/// How far a map may be off from what it should be and still be it, relative to the numbers.
const ROUNDING: f64 = 1e-9;

/// Positions inside the travel at which a map is tried, beside the corners.
const INSIDE: usize = 64;

/// A linear map to the joints: weights of the axes and an offset for each. The way back is the plugin's.
pub struct Linear {
    weights: Vec<AxisVector>,
    offsets: Vec<f64>,
    back: Box<dyn Kinematics>,
}

impl Linear {
    pub fn new(weights: Vec<AxisVector>, offsets: Vec<f64>, back: Box<dyn Kinematics>) -> Self {
        Self {
            weights,
            offsets,
            back,
        }
    }

    /// The weights of the axes in `joint`.
    pub fn weights(&self, joint: usize) -> &AxisVector {
        &self.weights[joint]
    }

    /// The offset of `joint`.
    pub fn offset(&self, joint: usize) -> f64 {
        self.offsets[joint]
    }

    /// Weights and offsets of `map`, where it is linear in the axes at all of `positions`. Host; allocates.
    pub fn of(
        map: &dyn Kinematics,
        joints: usize,
        axes: usize,
        positions: &[AxisVector],
    ) -> Option<(Vec<AxisVector>, Vec<f64>)> {
        let zero = map.to_joints(&AxisVector::ZERO);
        let mut weights = vec![AxisVector::ZERO; joints];
        for axis in 0..axes {
            let mut unit = AxisVector::ZERO;
            unit[axis] = 1.0;
            let at = map.to_joints(&unit);
            weights
                .iter_mut()
                .enumerate()
                .for_each(|(joint, weights)| weights[axis] = at[joint] - zero[joint]);
        }
        let offsets: Vec<f64> = (0..joints).map(|joint| zero[joint]).collect();
        let fits = |position: &AxisVector| {
            let at = map.to_joints(position);
            (0..joints)
                .all(|joint| is_near(at[joint], sum(&weights[joint], position) + offsets[joint]))
        };
        positions.iter().all(fits).then_some((weights, offsets))
    }
}

impl Kinematics for Linear {
    fn joint_count(&self, _axis_count: usize) -> usize {
        self.weights.len()
    }

    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        let mut joints = AxisVector::ZERO;
        for (joint, (weights, offset)) in joints
            .0
            .iter_mut()
            .zip(self.weights.iter().zip(&self.offsets))
        {
            *joint = sum(weights, axes) + offset;
        }
        joints
    }

    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        self.back.to_axes(joints)
    }

    fn health(&self) -> Result<(), PluginError> {
        self.back.health()
    }
}

/// Whether `map` gives finite numbers at `positions` and leads back to them. Host.
///
/// # Errors
/// Where it does not, in words.
pub fn check(
    map: &dyn Kinematics,
    joints: usize,
    axes: usize,
    positions: &[AxisVector],
) -> Result<(), String> {
    for position in positions {
        let at = map.to_joints(position);
        let place = &position.0[..axes];
        if let Some(joint) = (0..joints).find(|joint| !at[*joint].is_finite()) {
            map.health().map_err(|e| e.to_string())?;
            return Err(format!(
                "joint {joint} is no finite number where the axes are at {place:?} (mm, rad)"
            ));
        }
        let back = map.to_axes(&at);
        if let Some(axis) = (0..axes).find(|axis| !is_near(back[*axis], position[*axis])) {
            map.health().map_err(|e| e.to_string())?;
            return Err(format!(
                "axes at {place:?} (mm, rad) lead to joints that lead back to {} for axis {axis}",
                back[axis]
            ));
        }
    }
    Ok(())
}

/// Zero, the corners of the travel and places inside it, always the same.
pub fn positions(limits: &Limits) -> Vec<AxisVector> {
    let axes = limits.axes();
    let at = |share: &mut dyn FnMut(usize) -> f64| {
        let each =
            |(i, a): (usize, &tandem_sdk::AxisLimits)| a.min_mm + share(i) * (a.max_mm - a.min_mm);
        AxisVector::from_slice(&axes.iter().enumerate().map(each).collect::<Vec<_>>())
    };
    let corners = (0..1usize << axes.len()).map(|corner| at(&mut |i| (corner >> i & 1) as f64));
    // Multiples of irrational numbers fill the unit cube evenly.
    let share = |n: usize, i: usize| {
        (n as f64 * [2.0f64, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0][i % 8].sqrt()).fract()
    };
    let inside = (1..=INSIDE).map(|n| at(&mut |i| share(n, i)));
    corners.chain(inside).collect()
}

/// `Σ weight · axis`.
pub fn sum(weights: &AxisVector, axes: &AxisVector) -> f64 {
    weights
        .0
        .iter()
        .zip(&axes.0)
        .map(|(weight, axis)| weight * axis)
        .sum()
}

fn is_near(a: f64, b: f64) -> bool {
    (a - b).abs() <= ROUNDING * (1.0 + a.abs().max(b.abs()))
}
