//! Which joints there are: what the machine file states, beside what the kinematics have.

use tandem_machine::Machine;
use tandem_sdk::{AxisVector, Kinematics, KinematicsContext, MAX_AXES};

use super::joint::Joint;
use crate::error::{HostError, refusal};
use crate::plugins::registry::Registry;

/// Joints, and the map to them; no map where each axis is its joint.
type Stated = (Vec<Joint>, Option<Box<dyn Kinematics>>);

/// The joints in the order of the drives, and the map to them; no map where each axis is its joint.
pub fn joints(machine: &Machine, registry: &Registry) -> Result<Stated, HostError> {
    if machine.kinematics.plugin == "identity" {
        of_axes(machine)
    } else {
        of_plugin(machine, registry)
    }
}

/// Without kinematics of their own: every axis has the joints that are stated for it, or itself.
fn of_axes(machine: &Machine) -> Result<Stated, HostError> {
    if let Some(own) = machine.joints.iter().find(|joint| joint.axis.is_none()) {
        let cause = "states no axis, and without a kinematics plugin every joint moves one";
        return Err(refusal(machine, &format!("joints.{}", own.name), cause));
    }
    let mut joints = vec![];
    for axis in 0..machine.axes.count() {
        let before = joints.len();
        joints.extend(
            machine
                .joints
                .iter()
                .filter(|joint| joint.axis == Some(axis))
                .map(stated),
        );
        if joints.len() == before {
            joints.push(axis_itself(machine, axis));
        }
    }
    if joints.len() > MAX_AXES {
        let cause = format!("{} joints: a machine has at most {MAX_AXES}", joints.len());
        return Err(refusal(machine, "joints", cause));
    }
    if joints.len() == machine.axes.count() {
        return Ok((joints, None));
    }
    let map = Gantry {
        axes: joints.iter().map(|joint| joint.axis.unwrap_or(0)).collect(),
    };
    Ok((joints, Some(Box::new(map))))
}

/// The joints of a plugin are stated, all of them, in its order.
fn of_plugin(machine: &Machine, registry: &Registry) -> Result<Stated, HostError> {
    let made = plugin(machine, registry)?;
    let name = &machine.kinematics.plugin;
    let count = made.joint_count(machine.axes.count());
    let stands = machine.joints.len();
    if !(1..=MAX_AXES).contains(&count) {
        let words = format!("{name} has {count} joints: a machine has 1 to {MAX_AXES}");
        let cause = made
            .health()
            .map_or_else(|error| format!("{name}: {error}"), |()| words);
        return Err(refusal(machine, "kinematics.plugin", cause));
    }
    made.health()
        .map_err(|e| refusal(machine, "kinematics.plugin", format!("{name}: {e}")))?;
    if stands != count {
        let cause = format!(
            "{name} has {count} joints on these axes, and {stands} are stated: every joint needs its limits, as \
             [joints.<name>] tables in the order of the drives"
        );
        return Err(refusal(
            machine,
            if stands == 0 {
                "kinematics.plugin"
            } else {
                "joints"
            },
            cause,
        ));
    }
    let joints: Vec<Joint> = machine.joints.iter().map(stated).collect();
    let watched = |axis: usize| joints.iter().any(|joint| joint.axis == Some(axis));
    let mut followed =
        (0..machine.axes.count()).filter(|axis| machine.max_following_error_mm[*axis].is_finite());
    if let Some(axis) = followed.find(|axis| !watched(*axis)) {
        let unit = if machine.axes.is_rotary(axis) {
            "deg"
        } else {
            "mm"
        };
        let key = format!(
            "axes.{}.max_following_error_{unit}",
            machine.axes.letter(axis).to_ascii_lowercase()
        );
        let cause = format!(
            "following errors are those of joints, and no joint states this axis: state it in [joints.*] of {name}"
        );
        return Err(refusal(machine, &key, cause));
    }
    Ok((joints, Some(made)))
}

fn stated(joint: &tandem_machine::Joint) -> Joint {
    Joint {
        name: joint.name.clone(),
        rotary: joint.rotary,
        axis: joint.axis,
        limits: joint.limits,
        max_following_error_mm: joint.max_following_error_mm,
    }
}

fn axis_itself(machine: &Machine, axis: usize) -> Joint {
    Joint {
        name: machine.axes.letter(axis).to_ascii_lowercase().to_string(),
        rotary: machine.axes.is_rotary(axis),
        axis: Some(axis),
        limits: machine.limits.axes()[axis],
        max_following_error_mm: machine.max_following_error_mm[axis],
    }
}

/// Joints that are axes, some of which have more than one.
struct Gantry {
    /// The axis of each joint.
    axes: Vec<usize>,
}

impl Kinematics for Gantry {
    fn joint_count(&self, _axis_count: usize) -> usize {
        self.axes.len()
    }

    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        let mut joints = AxisVector::ZERO;
        for (joint, axis) in joints.0.iter_mut().zip(&self.axes) {
            *joint = axes[*axis];
        }
        joints
    }

    /// Where the joints of an axis differ, it stands in their middle.
    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        let mut axes = AxisVector::ZERO;
        let mut counts = [0.0; MAX_AXES];
        for (joint, axis) in self.axes.iter().enumerate() {
            axes[*axis] += joints[joint];
            counts[*axis] += 1.0;
        }
        AxisVector(std::array::from_fn(|axis| {
            if counts[axis] > 1.0 {
                axes[axis] / counts[axis]
            } else {
                axes[axis]
            }
        }))
    }
}

/// The machine's kinematics, as its plugin makes it.
fn plugin(machine: &Machine, registry: &Registry) -> Result<Box<dyn Kinematics>, HostError> {
    let made = registry.kinematics(&machine.kinematics, &KinematicsContext::new(machine.axes));
    made.map_err(|e| e.at(machine, "kinematics"))
}
