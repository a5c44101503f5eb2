//! Axis space to joint space and back.

use crate::AxisVector;

/// The map between axes (what the program speaks of) and joints (what the drives move).
///
/// Called on the fine loop: no method allocates, blocks or panics.
pub trait Kinematics: Send + Sync {
    /// Number of joints. Two joints may serve one axis (a gantry).
    fn joint_count(&self, axis_count: usize) -> usize {
        axis_count
    }

    /// Joint positions for axis positions, mm or rad.
    fn to_joints(&self, axes: &AxisVector) -> AxisVector;

    /// Axis positions for joint positions, mm or rad.
    fn to_axes(&self, joints: &AxisVector) -> AxisVector;

    /// Change of the joints for a small change `direction` of the axes at `position`. The default takes a difference
    /// of [`Kinematics::to_joints`], exact for linear maps.
    fn joint_direction(&self, position: &AxisVector, direction: &AxisVector) -> AxisVector {
        self.to_joints(&(*position + *direction)) - self.to_joints(position)
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

    fn joint_direction(&self, _position: &AxisVector, direction: &AxisVector) -> AxisVector {
        *direction
    }
}
