//! Axis space to joint space and back.

use crate::abi::layout::layout;
use crate::{Axes, AxisVector, PluginError};

/// What a kinematics is told when it is made.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct KinematicsContext {
    /// The machine's axes.
    pub axes: Axes,
}

layout!(KinematicsContext { axes });

impl KinematicsContext {
    /// The context of a machine with these axes.
    pub fn new(axes: Axes) -> Self {
        Self { axes }
    }

    /// The places of the linear axes whose letters the option `key` states. Host; allocates where it refuses.
    ///
    /// # Errors
    /// A letter that the machine does not have, that is one of an axis that turns, or that is named twice.
    pub fn linear_axes<const N: usize>(
        &self,
        key: &str,
        letters: [char; N],
    ) -> Result<[usize; N], PluginError> {
        let mut found = [0; N];
        for (place, letter) in letters.into_iter().enumerate() {
            if letters[..place].contains(&letter) {
                return Err(PluginError::of_option(
                    key,
                    format!("{letter} is named twice"),
                ));
            }
            let axis = self
                .axes
                .index(letter.to_ascii_uppercase())
                .filter(|axis| !self.axes.is_rotary(*axis));
            found[place] = axis.ok_or_else(|| {
                PluginError::of_option(key, format!("the machine has no linear axis {letter}"))
            })?;
        }
        Ok(found)
    }
}

/// The map between axes (what the program speaks of) and joints (what the drives move).
///
/// Called on the fine loop: no method allocates, blocks or panics. The host tries the map before a run. One that is linear
/// in the axes (weights and an offset for each joint) has the limits of its joints kept by planning; of any other the axes'
/// limits are planned and the joints' guarded.
pub trait Kinematics: Send + Sync {
    /// Number of joints. Two joints may serve one axis (a gantry).
    fn joint_count(&self, axis_count: usize) -> usize {
        axis_count
    }

    /// Joint positions for axis positions, mm or rad.
    fn to_joints(&self, axes: &AxisVector) -> AxisVector;

    /// Axis positions for joint positions, mm or rad.
    fn to_axes(&self, joints: &AxisVector) -> AxisVector;

    /// Why there is no joint position for a place that was asked for: asked before a run, and where an answer is not
    /// finite, on the fine loop too. A plugin that has panicked says so here.
    ///
    /// # Errors
    /// The reason. Use [`PluginError::fixed`], which does not allocate.
    fn health(&self) -> Result<(), PluginError> {
        Ok(())
    }
}

/// Joints are the axes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Identity;

impl Kinematics for Identity {
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        *axes
    }

    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        *joints
    }
}
