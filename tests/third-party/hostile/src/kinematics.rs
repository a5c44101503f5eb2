//! A kinematics: the identity, or joint 0 = x + y²/1000, until it is not.

use tandem_sdk::{AxisVector, Kinematics, KinematicsContext, PluginError};

use crate::mischief::{Mischief, Options};

pub struct Hostile {
    mischief: Mischief,
    bend: f64,
}

impl Hostile {
    pub fn open(options: &Options, _context: &KinematicsContext) -> Result<Self, PluginError> {
        Ok(Self { mischief: Mischief::new(options)?, bend: if options.curved { 1e-3 } else { 0.0 } })
    }

    fn with_first(&self, method: &str, vector: &AxisVector, more: f64) -> AxisVector {
        let what = self.mischief.quietly(method);
        let mut vector = *vector;
        vector[0] = Mischief::number(what, vector[0] + more);
        vector
    }
}

impl Drop for Hostile {
    fn drop(&mut self) {
        self.mischief.quietly("drop");
    }
}

impl Kinematics for Hostile {
    fn joint_count(&self, axis_count: usize) -> usize {
        self.mischief.quietly("joint_count");
        axis_count
    }

    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        self.with_first("to_joints", axes, self.bend * axes[1] * axes[1])
    }

    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        self.with_first("to_axes", joints, -self.bend * joints[1] * joints[1])
    }

    fn health(&self) -> Result<(), PluginError> {
        self.mischief.of("health").map(|_| ())
    }
}
