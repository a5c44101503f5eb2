//! Axes to joints and back, and what happens where the kinematics know neither.

use tandem_sdk::{AxisVector, Kinematics, Setpoint};

use super::FineLoop;
use crate::config::{FineConfig, Joints};
use crate::fault::{Fault, FaultKind};

/// Number of joints. Kinematics that are not linear have been asked: theirs lie behind the axes. Host.
pub(super) fn count(config: &FineConfig, kinematics: Option<&dyn Kinematics>) -> usize {
    match config.joints {
        Joints::Curved { axes } => config.lane_count() - axes,
        _ => kinematics.map_or(config.axis_count(), |k| k.joint_count(config.axis_count())),
    }
}

/// What is repeated to the drives where the kinematics fail in the first period. Host.
pub(super) fn first_setpoint(config: &FineConfig) -> Setpoint {
    let mut setpoint = Setpoint::default();
    if let Joints::Curved { axes } = config.joints {
        setpoint.position = AxisVector::from_slice(&config.position.0[axes..config.lane_count()]);
    }
    setpoint
}

/// Whether the joints rest when the axes do: where the kinematics have failed, they slow down on their own.
pub(super) fn rest(fault: Option<&Fault>, setpoint: &Setpoint) -> bool {
    let alone = fault.is_some_and(|f| matches!(f.kind, FaultKind::Kinematics { .. } | FaultKind::WayBack { .. }));
    !alone || setpoint.velocity == AxisVector::ZERO
}

impl FineLoop {
    /// Where the joints are to be. Kinematics that do not know fault the machine, and each joint slows down by its own limit.
    pub(super) fn joints_of(&mut self, axes: &AxisVector) -> AxisVector {
        let Some(kinematics) = &self.kinematics else { return *axes + self.offset };
        let joints = kinematics.to_joints(&self.config.axes_alone(axes));
        let Some(joint) = self.unknown_joint(&joints) else { return joints + self.offset };
        self.lose_way(FaultKind::Kinematics { joint });
        self.slower()
    }

    /// A sample on its way to the guard: with the joints behind the axes, where only the kinematics know them.
    #[inline]
    pub(super) fn with_joints(&mut self, mut position: AxisVector) -> AxisVector {
        if let (Joints::Curved { axes }, Some(kinematics)) = (self.config.joints, &self.kinematics) {
            position = self.config.axes_alone(&position);
            let joints = kinematics.to_joints(&position);
            position.0[axes..self.config.lane_count()].copy_from_slice(&joints.0[..self.joints]);
            if let Some(joint) =
                self.unknown_joint(&joints).filter(|_| position.0[..axes].iter().all(|axis| axis.is_finite()))
            {
                self.lose_way(FaultKind::Kinematics { joint });
            }
        }
        position
    }

    /// Axis coordinates of what the drives report, mm or rad. Where the kinematics do not know, the last ones, and a fault.
    pub(super) fn axes_of(&mut self, joints: &AxisVector) -> AxisVector {
        let joints = *joints - self.offset;
        let Some(kinematics) = &self.kinematics else { return joints };
        let axes = kinematics.to_axes(&joints);
        if let Some(axis) = (0..self.config.axis_count()).find(|axis| !axes[*axis].is_finite()) {
            self.lose_way(FaultKind::WayBack { axis });
        } else {
            self.axes = axes;
        }
        self.axes
    }

    fn unknown_joint(&self, joints: &AxisVector) -> Option<usize> {
        (0..self.joints).find(|joint| !joints[*joint].is_finite())
    }

    /// Faults the machine; the plugin's own words about it are kept for the host.
    #[cold]
    fn lose_way(&mut self, kind: FaultKind) {
        if let Some(Err(error)) = self.kinematics.as_ref().filter(|_| self.fault.is_none()).map(|k| k.health()) {
            self.plugin_error.get_or_insert(error);
        }
        self.fail(kind);
    }

    /// The joints a period later, each with less speed by its limit.
    fn slower(&self) -> AxisVector {
        let (period_s, first) = (self.config.period_s, self.config.axis_count());
        let mut position = self.setpoint.position;
        for joint in 0..self.joints {
            let most = self.config.limits.axes.get(first + joint).map_or(0.0, |limits| limits.acceleration_mm_per_s2);
            let speed = self.setpoint.velocity[joint];
            position[joint] += speed.signum() * (speed.abs() - most * period_s).max(0.0) * period_s;
        }
        position
    }
}
