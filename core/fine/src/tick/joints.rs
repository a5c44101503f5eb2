//! Axes to joints and back, and what happens where the kinematics know neither.

use tandem_sdk::{AxisVector, Kinematics, PluginError};

use crate::config::{FineConfig, Joints};
use crate::fault::FaultKind;
use crate::guard::Guard;

/// Relative rounding of a speed that a limit forgives.
const ROUNDING: f64 = 5e-7;

/// How far from joints their way through the axes and back may end, mm or rad.
const BACK: f64 = 1e-6;

/// What leads the joints where the kinematics are not linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lead {
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
    offset: AxisVector,
    /// Where the axes are by the feedback, as far as the kinematics last knew.
    axes: AxisVector,
    lead: Lead,
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

    /// What the drives are sent beyond the axes' coordinates, mm or rad per joint.
    pub(super) fn offset(&self) -> &AxisVector {
        &self.offset
    }

    /// The same, for homing to change.
    pub(super) fn offset_mut(&mut self) -> &mut AxisVector {
        &mut self.offset
    }

    /// Where the axes are by the feedback, as far as the kinematics last knew.
    pub(super) fn last_axes(&self) -> &AxisVector {
        &self.axes
    }

    /// The axes lead the joints again, after a fault.
    pub(super) fn lead_again(&mut self) {
        self.lead = Lead::Axes;
    }

    /// Whether the axes lead the joints; after a fault they may not.
    pub(super) fn axes_lead(&self) -> bool {
        self.lead == Lead::Axes
    }

    /// Where the joints are to be in the sample `position`: where there are no kinematics, where the axes are.
    #[inline]
    pub(super) fn joints_of(&self, config: &FineConfig, position: &AxisVector) -> AxisVector {
        match &self.kinematics {
            None => *position + self.offset,
            Some(kinematics) => self.joints_by(kinematics.as_ref(), config, position),
        }
    }

    /// Kinematics that are not linear have been asked by [`Self::add_joints`], and the guard has seen what they
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

    /// Axis coordinates of `joints`, mm or rad, where joints are axes.
    #[inline]
    pub(super) fn axes_alone(&self, joints: &AxisVector) -> Option<AxisVector> {
        self.kinematics.is_none().then(|| *joints - self.offset)
    }

    /// The same by the kinematics; the fault where they do not know them.
    #[inline(never)]
    pub(super) fn axes_by_kinematics(
        &mut self,
        config: &FineConfig,
        joints: &AxisVector,
    ) -> Result<AxisVector, FaultKind> {
        let joints = *joints - self.offset;
        let Some(kinematics) = &self.kinematics else {
            return Ok(joints);
        };
        let found = kinematics.to_axes(&joints);
        let mut axes = 0..config.axis_count();
        if let Some(axis) = axes.find(|axis| !found[*axis].is_finite()) {
            return Err(FaultKind::WayBack { axis });
        }
        self.axes = found;
        Ok(found)
    }

    /// The axes of `joints`, where kinematics that are asked for the joints there give the same ones.
    pub(super) fn found_from(
        &self,
        config: &FineConfig,
        joints: &AxisVector,
    ) -> Option<AxisVector> {
        let kinematics = self.kinematics.as_ref()?;
        let found = config.axes_alone(&kinematics.to_axes(joints));
        let again = kinematics.to_joints(&found);
        let count = count(config, Some(kinematics.as_ref()));
        let leads_back = (0..count).all(|joint| (again[joint] - joints[joint]).abs() <= BACK);
        leads_back.then_some(found)
    }

    /// What the plugin says of itself.
    pub(super) fn error(&self) -> Option<PluginError> {
        self.kinematics.as_ref()?.health().err()
    }

    /// A sample on its way to the guard gets the joints behind its `axes` axes, which only the kinematics know. Where those do not
    /// know either, that is the fault given, and each joint goes to rest by its own limit, as it does `after_fault` where a joint
    /// cannot follow.
    #[inline(never)]
    pub(super) fn add_joints(
        &mut self,
        config: &FineConfig,
        guard: &Guard,
        after_fault: bool,
        axes: usize,
        position: &mut AxisVector,
    ) -> Option<FaultKind> {
        *position = config.axes_alone(position);
        let lanes = axes..config.lane_count();
        let mut fault = None;
        let joints = self.ask(position).filter(|joints| {
            fault = self.look_at_joints(config, guard, after_fault, position, joints);
            self.lead == Lead::Axes
        });
        let joints = joints.unwrap_or_else(|| slower(config, guard, axes));
        position.0[lanes.clone()].copy_from_slice(&joints.0[..lanes.len()]);
        fault
    }

    /// Whether the joints go on where the kinematics want them. Before a fault the guard decides that; on the way to rest,
    /// where every sample is sent, they do as long as each can follow.
    fn look_at_joints(
        &mut self,
        config: &FineConfig,
        guard: &Guard,
        after_fault: bool,
        position: &AxisVector,
        joints: &AxisVector,
    ) -> Option<FaultKind> {
        let lanes = config.axis_count()..config.lane_count();
        if position.0[..lanes.start]
            .iter()
            .any(|axis| !axis.is_finite())
        {
            // The plan is to blame, and the guard says so.
            return None;
        }
        if let Some(joint) = (0..lanes.len()).find(|joint| !joints[*joint].is_finite()) {
            self.lead = Lead::Nothing;
            return Some(FaultKind::Kinematics { joint });
        }
        let follows = |entry: usize| can_follow(config, guard, entry, joints[entry - lanes.start]);
        if after_fault && !lanes.clone().all(follows) {
            self.lead = Lead::Nothing;
        }
        None
    }
}

/// Whether the joint at `entry` reaches `next` within its limits of velocity and acceleration.
fn can_follow(config: &FineConfig, guard: &Guard, entry: usize, next: f64) -> bool {
    let (limits, period_s) = (&config.limits.axes[entry], config.period_s);
    let before = guard.velocity()[entry];
    let velocity = (next - guard.position()[entry]) / period_s;
    let fastest = limits
        .feed_mm_per_s
        .max(limits.rapid_mm_per_s)
        .max(before.abs());
    let rounding = 4.0 * f64::EPSILON * next.abs().max(1.0) / period_s;
    let within = |value: f64, most: f64| value.abs() <= most * (1.0 + ROUNDING) + rounding;
    within(velocity, fastest) && within(velocity - before, limits.acceleration_mm_per_s2 * period_s)
}

/// The joints behind `axes` axes a period later, each with less speed by its limit.
fn slower(config: &FineConfig, guard: &Guard, axes: usize) -> AxisVector {
    let (period_s, mut joints) = (config.period_s, AxisVector::ZERO);
    for entry in axes..config.lane_count() {
        let most = config.limits.axes[entry].acceleration_mm_per_s2;
        let speed = guard.velocity()[entry];
        let slower = speed.signum() * (speed.abs() - most * period_s).max(0.0);
        joints[entry - axes] = guard.position()[entry] + slower * period_s;
    }
    joints
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::{AxisLimits, Limits};

    /// Joints are twice the axes.
    struct Doubled;

    impl Kinematics for Doubled {
        fn to_joints(&self, axes: &AxisVector) -> AxisVector {
            *axes + *axes
        }

        fn to_axes(&self, joints: &AxisVector) -> AxisVector {
            AxisVector(joints.0.map(|joint| joint / 2.0))
        }
    }

    fn config() -> FineConfig {
        FineConfig::new(0.001, Limits::new(&[AxisLimits::unlimited(); 2]).unwrap())
    }

    fn plain() -> JointSpace {
        JointSpace::new(&config(), None)
    }

    fn doubled() -> JointSpace {
        JointSpace::new(&config(), Some(Box::new(Doubled)))
    }

    #[test]
    fn what_homing_has_found_is_between_axes_and_joints_in_both_directions() {
        let axes = AxisVector::from_slice(&[10.0, -4.0]);
        let found = AxisVector::from_slice(&[0.5, 3.0]);
        let mut space = plain();
        *space.offset_mut() = found;
        let joints = space.joints_of(&config(), &axes);
        assert_eq!(joints, AxisVector::from_slice(&[10.5, -1.0]));
        assert_eq!(space.axes_alone(&joints), Some(axes));
        let mut space = doubled();
        *space.offset_mut() = found;
        let joints = space.joints_of(&config(), &axes);
        assert_eq!(joints, AxisVector::from_slice(&[20.5, -5.0]));
        assert_eq!(space.axes_alone(&joints), None, "the kinematics are asked");
        assert_eq!(
            space.axes_by_kinematics(&config(), &joints).ok(),
            Some(axes)
        );
        assert_eq!(*space.last_axes(), axes);
    }

    /// Kinematics off by a little: what they find does not lead back.
    struct Skewed;

    impl Kinematics for Skewed {
        fn to_joints(&self, axes: &AxisVector) -> AxisVector {
            Doubled.to_joints(axes)
        }

        fn to_axes(&self, joints: &AxisVector) -> AxisVector {
            AxisVector(joints.0.map(|joint| joint / 2.0 + 0.01))
        }
    }

    #[test]
    fn axes_are_found_from_joints_to_which_they_lead_back() {
        let joints = AxisVector::from_slice(&[20.0, -6.0]);
        let found = doubled().found_from(&config(), &joints);
        assert_eq!(found, Some(AxisVector::from_slice(&[10.0, -3.0])));
        let skewed = JointSpace::new(&config(), Some(Box::new(Skewed)));
        assert_eq!(skewed.found_from(&config(), &joints), None);
        assert_eq!(plain().found_from(&config(), &joints), None);
    }

    #[test]
    fn the_loop_after_knows_what_homing_has_found_and_where_the_axes_were() {
        let mut last = doubled();
        *last.offset_mut() = AxisVector::from_slice(&[0.5, 3.0]);
        let joints = AxisVector::from_slice(&[20.5, -5.0]);
        let axes = last.axes_by_kinematics(&config(), &joints).unwrap();
        let mut next = doubled();
        next.take_over(&last);
        assert_eq!((next.offset(), next.last_axes()), (last.offset(), &axes));
    }

    #[test]
    fn joints_that_are_axes_are_not_like_those_of_kinematics() {
        assert!(plain().is_like(&plain()) && doubled().is_like(&doubled()));
        assert!(!plain().is_like(&doubled()) && !doubled().is_like(&plain()));
    }

    /// On the way to rest after a fault the kinematics lead as long as every joint can follow; where one cannot, each goes by itself. Before
    /// a fault the guard is who says so.
    #[test]
    fn after_a_fault_each_joint_has_to_be_able_to_follow() {
        let axis = AxisLimits {
            acceleration_mm_per_s2: 1000.0,
            ..AxisLimits::unlimited()
        };
        let config = FineConfig {
            joints: Joints::Curved { axes: 2 },
            ..FineConfig::new(0.001, Limits::new(&[axis; 4]).unwrap())
        };
        // From a standstill a joint gets a µm far in a period.
        let guard = Guard::new(&config);
        for (axes, after_fault, leads) in [
            ([0.0004, 0.0004], true, true),
            // With all that it has.
            ([0.0005, 0.0005], true, true),
            ([10.0, 0.0], true, false),
            ([0.0, 10.0], true, false),
            ([10.0, 0.0], false, true),
        ] {
            let mut space = JointSpace::new(&config, Some(Box::new(Doubled)));
            let mut position = AxisVector::from_slice(&axes);
            let fault = space.add_joints(&config, &guard, after_fault, 2, &mut position);
            assert_eq!(fault, None);
            let joints = if leads {
                axes.map(|axis| 2.0 * axis)
            } else {
                [0.0; 2]
            };
            assert_eq!(position.0[2..4], joints, "{axes:?}");
            // Once each goes by itself the kinematics are not asked before the machine begins anew.
            let next_joint = |space: &mut JointSpace| {
                let mut position = AxisVector::from_slice(&[0.0004, 0.0004]);
                space.add_joints(&config, &guard, true, 2, &mut position);
                position[2]
            };
            assert_eq!(next_joint(&mut space), if leads { 0.0008 } else { 0.0 });
            space.lead_again();
            assert_eq!(next_joint(&mut space), 0.0008);
        }
    }
}
