//! A kinematics: the identity, until it is not.

use tandem_sdk::{AxisVector, Kinematics, KinematicsContext, PluginError};

use crate::mischief::{Mischief, Options};

pub struct Hostile(Mischief);

impl Hostile {
    pub fn open(options: &Options, _context: &KinematicsContext) -> Result<Self, PluginError> {
        Mischief::new(options).map(Self)
    }

    fn same(&self, method: &str, vector: &AxisVector) -> AxisVector {
        let what = self.0.quietly(method);
        let mut vector = *vector;
        vector[0] = Mischief::number(what, vector[0]);
        vector
    }
}

impl Kinematics for Hostile {
    fn joint_count(&self, axis_count: usize) -> usize {
        self.0.quietly("joint_count");
        axis_count
    }

    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        self.same("to_joints", axes)
    }

    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        self.same("to_axes", joints)
    }

    fn joint_direction(&self, _position: &AxisVector, direction: &AxisVector) -> AxisVector {
        self.same("joint_direction", direction)
    }
}
