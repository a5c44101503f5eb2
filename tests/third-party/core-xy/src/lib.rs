//! Kinematics: CoreXY. Two motors move X and Y together through one belt.

use tandem_sdk::{AxisVector, Kinematics, KinematicsContext, PluginError};

tandem_sdk::options! {
    pub struct Options {
        /// Whether the second belt runs the other way round.
        pub reversed: bool = false,
    }
}

pub struct CoreXy {
    x: usize,
    y: usize,
    sign: f64,
}

tandem_sdk::plugin!(kinematics "core-xy" = CoreXy::open);

impl CoreXy {
    pub fn open(options: &Options, context: &KinematicsContext) -> Result<Self, PluginError> {
        let axis = |letter| context.axes.index(letter).ok_or(PluginError::fixed("it needs an X and a Y axis"));
        Ok(Self { x: axis('X')?, y: axis('Y')?, sign: if options.reversed { -1.0 } else { 1.0 } })
    }
}

impl Kinematics for CoreXy {
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        let mut joints = *axes;
        joints[self.x] = axes[self.x] + axes[self.y];
        joints[self.y] = self.sign * (axes[self.x] - axes[self.y]);
        joints
    }

    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        let (a, b) = (joints[self.x], self.sign * joints[self.y]);
        let mut axes = *joints;
        (axes[self.x], axes[self.y]) = ((a + b) / 2.0, (a - b) / 2.0);
        axes
    }
}
