//! Axes to joints and back, and what happens where the kinematics know neither.

use tandem_sdk::{AxisVector, Kinematics, PluginError};

use super::FineLoop;
use crate::config::{FineConfig, Joints};
use crate::fault::FaultKind;

/// Relative rounding of a speed that a limit forgives.
const ROUNDING: f64 = 5e-7;

/// How far from joints their way through the axes and back may end, mm or rad.
const BACK: f64 = 1e-6;

/// What leads the joints where the kinematics are not linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lead {
    /// The axes, by the kinematics.
    Axes,
    /// Nothing, after a fault: each goes to rest on its own, and the kinematics are not asked.
    Nothing,
}

/// Number of joints. Kinematics that are not linear have been asked: theirs lie behind the axes. Host.
pub(super) fn count(config: &FineConfig, kinematics: Option<&dyn Kinematics>) -> usize {
    match config.joints {
        Joints::Curved { axes } => config.lane_count() - axes,
        _ => kinematics.map_or(config.axis_count(), |k| k.joint_count(config.axis_count())),
    }
}

/// Axes to joints and back, with what homing has found between the two.
pub(super) struct JointSpace {
    /// `None` where joints are axes.
    kinematics: Option<Box<dyn Kinematics>>,
    /// What the drives are sent beyond the axes' coordinates: homing has found it, mm or rad per joint.
    pub(super) offset: AxisVector,
    /// Where the axes are by the feedback, as far as the kinematics last knew.
    pub(super) axes: AxisVector,
    pub(super) lead: Lead,
}

impl JointSpace {
    /// With the axes where the machine stands. Host.
    pub(super) fn new(config: &FineConfig, kinematics: Option<Box<dyn Kinematics>>) -> Self {
        Self {
            kinematics,
            offset: AxisVector::ZERO,
            axes: config.axes_alone(&config.position),
            lead: Lead::Axes,
        }
    }

    /// Whether `other` makes joints of axes the same way.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        self.kinematics.is_some() == other.kinematics.is_some()
    }

    /// What homing has found for the loop before.
    pub(super) fn take_over(&mut self, last: &Self) {
        self.offset = last.offset;
        self.axes = last.axes;
    }

    /// Where the joints are to be in the sample `position`: where there are no kinematics, where the axes are.
    #[inline]
    fn joints_of(&self, config: &FineConfig, position: &AxisVector) -> AxisVector {
        match &self.kinematics {
            None => *position + self.offset,
            Some(kinematics) => self.joints_by(kinematics.as_ref(), config, position),
        }
    }

    /// Kinematics that are not linear have been asked by [`FineLoop::add_joints`], and the guard has seen what they
    /// answered: they are not asked again.
    #[inline(never)]
    fn joints_by(
        &self,
        kinematics: &dyn Kinematics,
        config: &FineConfig,
        position: &AxisVector,
    ) -> AxisVector {
        let joints = match config.joints {
            Joints::Curved { axes } => {
                AxisVector::from_slice(&position.0[axes..config.lane_count()])
            }
            _ => kinematics.to_joints(&config.axes_alone(position)),
        };
        joints + self.offset
    }

    /// Joints of the axes at `position`, where the kinematics alone know them and are still asked.
    fn ask(&self, position: &AxisVector) -> Option<AxisVector> {
        let kinematics = self.kinematics.as_ref()?;
        (self.lead == Lead::Axes).then(|| kinematics.to_joints(position))
    }

    /// Axis coordinates of `joints`, of `axes` axes, mm or rad; the first axis that the kinematics do not know, where that is one.
    #[inline(never)]
    fn axes_of(&mut self, axes: usize, joints: &AxisVector) -> Result<AxisVector, usize> {
        let joints = *joints - self.offset;
        let Some(kinematics) = &self.kinematics else {
            return Ok(joints);
        };
        let found = kinematics.to_axes(&joints);
        if let Some(axis) = (0..axes).find(|axis| !found[*axis].is_finite()) {
            return Err(axis);
        }
        self.axes = found;
        Ok(found)
    }

    /// The axes of `joints`, where kinematics that are asked for the joints there give the same ones.
    fn found_from(&self, config: &FineConfig, joints: &AxisVector) -> Option<AxisVector> {
        let kinematics = self.kinematics.as_ref()?;
        let found = config.axes_alone(&kinematics.to_axes(joints));
        let again = kinematics.to_joints(&found);
        let count = count(config, Some(kinematics.as_ref()));
        let leads_back = (0..count).all(|joint| (again[joint] - joints[joint]).abs() <= BACK);
        leads_back.then_some(found)
    }

    /// What the plugin says of itself.
    fn error(&self) -> Option<PluginError> {
        self.kinematics.as_ref()?.health().err()
    }
}

impl FineLoop {
    /// Where the joints are to be in the sample `position`.
    #[inline]
    pub(super) fn joints_of(&self, position: &AxisVector) -> AxisVector {
        self.space.joints_of(&self.config, position)
    }

    /// A sample on its way to the guard gets the joints behind the axes, where only the kinematics know them. Kinematics
    /// that do not know either fault the machine, and each joint goes to rest by its own limit.
    #[inline]
    pub(super) fn add_joints(&mut self, position: &mut AxisVector) {
        if let Joints::Curved { axes } = self.config.joints {
            self.add_curved(axes, position);
        }
    }

    #[inline(never)]
    fn add_curved(&mut self, axes: usize, position: &mut AxisVector) {
        *position = self.config.axes_alone(position);
        let joints = match self.space.ask(position) {
            Some(joints) if self.accepts(axes, position, &joints) => joints,
            _ => self.slower(axes),
        };
        position.0[axes..self.config.lane_count()].copy_from_slice(&joints.0[..self.drives.joints]);
    }

    /// Whether the joints go where the kinematics want them. Before a fault the guard decides that; on the way to rest,
    /// where every sample is sent, they do as long as each can follow.
    fn accepts(&mut self, axes: usize, position: &AxisVector, joints: &AxisVector) -> bool {
        if position.0[..axes].iter().any(|axis| !axis.is_finite()) {
            // The plan is to blame, and the guard says so.
            return true;
        }
        if let Some(joint) = (0..self.drives.joints).find(|joint| !joints[*joint].is_finite()) {
            self.space.lead = Lead::Nothing;
            self.lose_way(FaultKind::Kinematics { joint });
        } else if self.fault.is_some()
            && !(0..self.drives.joints).all(|j| self.can_follow(axes + j, joints[j]))
        {
            self.space.lead = Lead::Nothing;
        }
        self.space.lead == Lead::Axes
    }

    /// Whether the joint at `entry` reaches `next` within its limits of velocity and acceleration.
    fn can_follow(&self, entry: usize, next: f64) -> bool {
        let (limits, period_s) = (&self.config.limits.axes[entry], self.config.period_s);
        let before = self.guard.velocity()[entry];
        let velocity = (next - self.guard.position()[entry]) / period_s;
        let fastest = limits
            .feed_mm_per_s
            .max(limits.rapid_mm_per_s)
            .max(before.abs());
        let rounding = 4.0 * f64::EPSILON * next.abs().max(1.0) / period_s;
        let within = |value: f64, most: f64| value.abs() <= most * (1.0 + ROUNDING) + rounding;
        within(velocity, fastest)
            && within(velocity - before, limits.acceleration_mm_per_s2 * period_s)
    }

    /// The joints a period later, each with less speed by its limit.
    fn slower(&self, axes: usize) -> AxisVector {
        let (period_s, mut joints) = (self.config.period_s, AxisVector::ZERO);
        for joint in 0..self.drives.joints {
            let (entry, most) = (
                axes + joint,
                self.config.limits.axes[axes + joint].acceleration_mm_per_s2,
            );
            let speed = self.guard.velocity()[entry];
            let slower = speed.signum() * (speed.abs() - most * period_s).max(0.0);
            joints[joint] = self.guard.position()[entry] + slower * period_s;
        }
        joints
    }

    /// Whether the joints rest when the axes do: they may have been slowing down on their own.
    pub(super) fn joints_rest(&self) -> bool {
        let first = self.config.axis_count();
        self.space.lead == Lead::Axes
            || self.guard.velocity().0[first..]
                .iter()
                .all(|speed| *speed == 0.0)
    }

    /// Whether the joints came to rest each on its own, away from where the axes were to be. Host.
    pub fn joints_went_alone(&self) -> bool {
        self.space.lead == Lead::Nothing
    }

    /// Axis coordinates of what the drives report, mm or rad. Where the kinematics do not know, the last ones, and a fault.
    #[inline]
    pub(super) fn axes_of(&mut self, joints: &AxisVector) -> AxisVector {
        if self.space.kinematics.is_none() {
            return *joints - self.space.offset;
        }
        match self.space.axes_of(self.config.axis_count(), joints) {
            Ok(axes) => axes,
            Err(axis) => {
                self.lose_way(FaultKind::WayBack { axis });
                self.space.axes
            }
        }
    }

    /// The position sent last, in the coordinates of the drives, which homing does not change, mm or rad. Where the joints
    /// came to rest on their own, it is what the kinematics make of them, if that leads back. Host.
    pub fn sent(&self) -> AxisVector {
        let axes = self.config.axes_alone(self.guard.position());
        if !self.joints_went_alone() {
            return axes + self.space.offset;
        }
        let joints = self.joints_of(self.guard.position());
        self.space.found_from(&self.config, &joints).unwrap_or(axes)
    }

    /// Where the joints were told to be last, mm or rad. Host.
    pub fn told_to_joints(&self) -> AxisVector {
        self.drives.setpoint.position
    }

    /// Faults the machine; the plugin's own words about it are kept for the host.
    #[cold]
    fn lose_way(&mut self, kind: FaultKind) {
        if self.fault.is_none()
            && let Some(error) = self.space.error()
        {
            self.plugin_error.get_or_insert(error);
        }
        self.fail(kind);
    }
}
