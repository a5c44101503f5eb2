//! Two belts that both motors pull move one carriage: the kinematics `corexy`.
//!
//! Motor A turns by x + y, motor B by x − y, in mm of belt; every further axis is its own joint. So along an axis both
//! motors share the work, and on a diagonal one of them does it alone: there the limits of the motors bind.
//!
//! ```toml
//! [kinematics]
//! plugin = "corexy"
//! [kinematics.options]
//! axes = ["x", "y"]        # the default
//!
//! [joints.a]               # x + y
//! max_feed_mm_per_min = 12000
//! max_acceleration_mm_per_s2 = 1500
//! [joints.b]               # x - y
//! max_feed_mm_per_min = 12000
//! max_acceleration_mm_per_s2 = 1500
//! [joints.z]
//! axis = "z"
//! ```

use tandem_sdk::{AxisVector, Kinematics, KinematicsContext, PluginError};

tandem_sdk::plugin!(kinematics "corexy" = CoreXy::new);

tandem_sdk::options! {
    /// The keys of `[kinematics.options]`.
    pub struct Options {
        /// The two axes that the belts move; their joints take their places.
        pub axes: [char; 2] = ['x', 'y'],
    }
}

/// The map: `a = x + y`, `b = x − y`.
#[derive(Clone, Copy, Debug)]
pub struct CoreXy {
    axes: [usize; 2],
}

impl CoreXy {
    /// The map on a machine with the axes of `context`. Host.
    ///
    /// # Errors
    /// An axis that the machine does not have, that turns, or is named twice.
    pub fn new(options: &Options, context: &KinematicsContext) -> Result<Self, PluginError> {
        let axes = context.linear_axes("axes", options.axes)?;
        Ok(Self { axes })
    }
}

impl Kinematics for CoreXy {
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        let ([x, y], mut joints) = (self.axes, *axes);
        (joints[x], joints[y]) = (axes[x] + axes[y], axes[x] - axes[y]);
        joints
    }

    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        let ([a, b], mut axes) = (self.axes, *joints);
        (axes[a], axes[b]) = (0.5 * (joints[a] + joints[b]), 0.5 * (joints[a] - joints[b]));
        axes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::Axes;

    fn made(options: &str) -> Result<Box<dyn Kinematics>, PluginError> {
        let axes = Axes::new(&[('X', false), ('Z', false), ('Y', false), ('A', true)]).unwrap();
        PLUGIN.kinematics(options, &KinematicsContext::new(axes))
    }

    #[test]
    fn both_motors_pull() {
        let map = made("").unwrap();
        let axes = AxisVector::from_slice(&[10.0, 7.0, 4.0, 1.0]);
        assert_eq!(
            map.to_joints(&axes),
            AxisVector::from_slice(&[14.0, 7.0, 6.0, 1.0])
        );
        assert_eq!(map.to_axes(&map.to_joints(&axes)), axes);
        assert_eq!(map.joint_count(4), 4);
    }

    #[test]
    fn axes_are_checked() {
        assert!(made("axes = [\"x\", \"z\"]").is_ok());
        for (options, word) in [
            ("axes = [\"x\", \"a\"]", "linear axis a"),
            ("axes = [\"x\", \"x\"]", "twice"),
            ("axis = 1", "axis"),
        ] {
            let words = made(options).err().expect(options).to_string();
            assert!(words.contains(word), "{words}");
        }
    }
}
