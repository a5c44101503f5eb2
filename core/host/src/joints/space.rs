//! The joints of a machine, and how they follow from its axes.

use std::sync::Arc;

use tandem_machine::Machine;
use tandem_recorder::{JointWatch, WatchedJoint};
use tandem_sdk::abi::{Method, calling};
use tandem_sdk::{
    AxisVector, JointLanes, Kinematics, Limits, MAX_AXES, PlannerDescription, PluginError,
};

use super::joint::{Joint, beyond};
use super::linear::{Linear, positions};
use super::{fold, linear, stated};
use crate::error::{HostError, refusal};
use crate::plugins::registry::Registry;

/// How joints follow from axes.
pub enum Map {
    /// Each axis is its joint.
    Axes,
    /// Weights and offsets; joints that are sums of axes have lanes.
    Linear(Linear, Option<&'static JointLanes>),
    /// Only the plugin knows.
    Curved(Box<dyn Kinematics>),
}

/// The joints of a machine.
pub struct JointSpace {
    pub joints: Vec<Joint>,
    pub(super) map: Map,
    axes: usize,
    /// There are no kinematics but those of axes with several joints.
    are_own: bool,
    /// Limits of the axes with the joints folded in, then of the lanes.
    pub limits: Limits,
    /// What each lane behind the axes is: index of a joint.
    lanes: Vec<usize>,
}

impl JointSpace {
    /// The joints of `machine`. Host; allocates.
    ///
    /// # Errors
    /// Kinematics that are not there, refuse their options or do not lead back; joints that do not fit them; a travel that
    /// leaves an axis none.
    pub fn of(machine: &Machine, registry: &Registry) -> Result<Self, HostError> {
        calling(Method::KinematicsConvert, || Self::found(machine, registry))
    }

    fn found(machine: &Machine, registry: &Registry) -> Result<Self, HostError> {
        let axes = machine.axes.count();
        let are_own = machine.kinematics.plugin == "identity";
        let (joints, kinematics) = stated::joints(machine, registry)?;
        let Some(kinematics) = kinematics else {
            let mut limits = machine.limits;
            for (axis, joint) in joints.iter().enumerate() {
                fold::narrow(machine, &mut limits, axis, joint, (1.0, 0.0))?;
            }
            let this = Self {
                joints,
                map: Map::Axes,
                axes,
                are_own,
                limits,
                lanes: vec![],
            };
            this.check_health(machine)?;
            return Ok(this);
        };
        let positions = positions(&machine.limits);
        let sound = linear::check(kinematics.as_ref(), joints.len(), axes, &positions);
        sound.map_err(|e| {
            refusal(
                machine,
                "kinematics.plugin",
                format!("{}: {e}", machine.kinematics.plugin),
            )
        })?;
        let linear = Linear::of(kinematics.as_ref(), joints.len(), axes, &positions);
        let this = if let Some((weights, offsets)) = linear {
            let folded = fold::fold(machine, &joints, &weights, &offsets)?;
            let map = Map::Linear(Linear::new(weights, offsets, kinematics), folded.coupled);
            Self {
                joints,
                map,
                axes,
                are_own,
                limits: folded.limits,
                lanes: folded.lanes,
            }
        } else {
            let limits = fold::behind(machine, &joints)?;
            let lanes = (0..joints.len()).collect();
            Self {
                joints,
                map: Map::Curved(kinematics),
                axes,
                are_own,
                limits,
                lanes,
            }
        };
        this.check_health(machine)?;
        Ok(this)
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.joints.len()
    }

    /// Whether each axis is its joint.
    pub fn are_axes(&self) -> bool {
        matches!(self.map, Map::Axes)
    }

    /// Whether each joint is an axis, some of which may have more than one: no kinematics of their own.
    pub fn are_stated_by_axes(&self) -> bool {
        self.are_own
    }

    /// Whether joints are no linear function of the axes.
    pub fn are_curved(&self) -> bool {
        matches!(self.map, Map::Curved(_))
    }

    /// The limits as planners see them.
    pub fn planned(&self) -> Limits {
        if self.are_curved() {
            self.of_axes()
        } else {
            self.limits
        }
    }

    /// The limits of the axes alone, as narrow as joints make them.
    pub fn of_axes(&self) -> Limits {
        Limits {
            count: self.axes as u32,
            ..self.limits
        }
    }

    /// What the fine loop needs to know of the joints.
    pub fn fine(&self) -> tandem_fine::Joints {
        match &self.map {
            Map::Axes | Map::Linear(_, None) => tandem_fine::Joints::Axes,
            Map::Linear(_, Some(lanes)) => tandem_fine::Joints::Sums(lanes),
            Map::Curved(_) => tandem_fine::Joints::Curved { axes: self.axes },
        }
    }

    /// Joint positions at the axis positions `axes`, mm or rad.
    pub fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        match &self.map {
            Map::Axes => *axes,
            Map::Linear(linear, _) => linear.to_joints(axes),
            Map::Curved(kinematics) => {
                calling(Method::KinematicsConvert, || kinematics.to_joints(axes))
            }
        }
    }

    /// Axis positions at the joint positions `joints`, mm or rad.
    pub fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        let axes = match &self.map {
            Map::Axes => *joints,
            Map::Linear(linear, _) => linear.to_axes(joints),
            Map::Curved(kinematics) => {
                calling(Method::KinematicsConvert, || kinematics.to_axes(joints))
            }
        };
        AxisVector::from_slice(&axes.0[..self.axes])
    }

    /// The name of joint `index`.
    pub fn name(&self, index: usize) -> &str {
        self.joints.get(index).map_or("?", |joint| &joint.name)
    }

    /// Why `joints` are not known, where they are not: the plugin's own words, if it has any.
    ///
    /// # Errors
    /// The reason, where one of them is no finite number.
    pub fn health(&self, joints: &AxisVector) -> Result<(), PluginError> {
        match &self.map {
            Map::Curved(kinematics)
                if joints.0[..self.count()]
                    .iter()
                    .any(|joint| !joint.is_finite()) =>
            {
                kinematics.health()
            }
            _ => Ok(()),
        }
    }

    /// `axes` with what lies behind them in the fine loop.
    pub fn with_lanes(&self, axes: &AxisVector) -> AxisVector {
        let mut all = *axes;
        match &self.map {
            Map::Linear(_, Some(lanes)) => lanes.fill(&mut all),
            Map::Curved(kinematics) => {
                let joints = calling(Method::KinematicsConvert, || kinematics.to_joints(axes));
                all.0[self.axes..self.axes + self.count()]
                    .copy_from_slice(&joints.0[..self.count()]);
            }
            _ => {}
        }
        all
    }

    /// Largest following error of each joint.
    pub fn max_following_error_mm(&self) -> AxisVector {
        let each = |i: usize| {
            self.joints
                .get(i)
                .map_or(f64::INFINITY, |joint| joint.max_following_error_mm)
        };
        AxisVector(std::array::from_fn(each))
    }

    /// Velocity steps that `planner` makes use of: where it does on the axes, also in joints that only the guard sees.
    pub fn speed_difference_mm_per_s(&self, planner: &PlannerDescription) -> [f64; MAX_AXES] {
        let mut steps = planner.speed_difference_mm_per_s;
        if self.are_curved() && steps.iter().any(|step| *step > 0.0) {
            for (step, joint) in steps[self.axes..].iter_mut().zip(&self.joints) {
                *step = joint.limits.speed_difference_mm_per_s;
            }
        }
        steps
    }

    /// The joint that lies behind the axes at entry `entry` of the fine loop's vectors, if one does, and what its position
    /// there lacks.
    pub fn behind(&self, entry: usize) -> Option<(&Joint, f64)> {
        let joint = *self.lanes.get(entry.checked_sub(self.axes)?)?;
        let offset = if let Map::Linear(linear, _) = &self.map {
            linear.offset(joint)
        } else {
            0.0
        };
        Some((&self.joints[joint], offset))
    }

    /// Which joints turn.
    pub fn rotary(&self) -> [bool; MAX_AXES] {
        std::array::from_fn(|i| self.joints.get(i).is_some_and(|joint| joint.rotary))
    }

    /// What watches them in a run; none where the joints are the axes. Host; allocates.
    pub fn watch(self: &Arc<Self>, fine_period_s: f64) -> Option<JointWatch> {
        if self.are_axes() {
            return None;
        }
        let watched = |joint: &Joint| WatchedJoint {
            name: joint.name.clone(),
            rotary: joint.rotary,
        };
        let space = Arc::clone(self);
        let to_joints = move |axes: &AxisVector| space.to_joints(axes);
        Some(JointWatch::new(
            self.joints.iter().map(watched).collect(),
            to_joints,
            fine_period_s,
        ))
    }

    /// The map for the fine loop; none where the joints are the axes.
    pub fn into_kinematics(self) -> Option<Box<dyn Kinematics>> {
        match self.map {
            Map::Axes => None,
            Map::Linear(linear, _) => Some(Box::new(linear)),
            Map::Curved(kinematics) => Some(kinematics),
        }
    }

    /// The joints that are sums of axes, as planners carry them.
    pub fn lanes(&self) -> Option<&'static JointLanes> {
        match &self.map {
            Map::Linear(_, lanes) => *lanes,
            _ => None,
        }
    }

    /// Axes, a bit each, that are moved by any of `joints`, a bit each: all of them where only a plugin knows.
    pub fn axes_moved_by(&self, joints: u32) -> u32 {
        let all = (1 << self.axes) - 1;
        let of = |joint: &Joint| joint.axis.map_or(all, |axis| 1 << axis);
        let moved = self
            .joints
            .iter()
            .enumerate()
            .filter(|(i, _)| joints >> i & 1 == 1);
        moved.fold(0, |axes, (_, joint)| axes | of(joint))
    }

    /// Whether the kinematics know the joints where the machine starts.
    ///
    /// # Errors
    /// Why they do not.
    pub fn check_health(&self, machine: &Machine) -> Result<(), HostError> {
        let at = self.to_joints(&machine.start);
        self.health(&at)
            .map_err(|e| refusal(machine, "kinematics.plugin", e.to_string()))
    }

    /// Whether the machine starts within the travel of its joints: programs do.
    ///
    /// # Errors
    /// Which joint does not.
    pub fn check_start(&self, machine: &Machine) -> Result<(), HostError> {
        let at = self.to_joints(&machine.start);
        for (i, joint) in self.joints.iter().enumerate() {
            if let Some(words) = beyond(joint, at[i]) {
                let key = format!("joints.{}", joint.name);
                return Err(refusal(
                    machine,
                    &key,
                    format!("where the machine starts, {words}"),
                ));
            }
        }
        Ok(())
    }
}
