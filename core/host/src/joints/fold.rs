//! The limits of joints as limits of axes and lanes.

use std::sync::{Mutex, PoisonError};

use tandem_machine::Machine;
use tandem_sdk::{AxisLimits, AxisVector, JointLanes, Limits, MAX_AXES};

use super::joint::Joint;
use crate::error::{HostError, refusal};

/// Weights below this share of a joint's largest are rounding.
const ROUNDING: f64 = 1e-12;

/// Limits of axes and lanes, the lanes, and which joint each is.
pub struct Folded {
    pub limits: Limits,
    pub coupled: Option<&'static JointLanes>,
    pub lanes: Vec<usize>,
}

/// Folds joints with these weights and offsets into the limits of the machine's axes.
pub fn fold(
    machine: &Machine,
    joints: &[Joint],
    weights: &[AxisVector],
    offsets: &[f64],
) -> Result<Folded, HostError> {
    let axes = machine.axes.count();
    let mut limits = machine.limits;
    let mut rows = vec![];
    let mut lanes = vec![];
    let mut behind = vec![];
    for (index, joint) in joints.iter().enumerate() {
        let (row, offset) = (&weights[index], offsets[index]);
        let most = row
            .0
            .iter()
            .fold(0.0f64, |most, weight| most.max(weight.abs()));
        let moving: Vec<usize> = (0..axes)
            .filter(|axis| row[*axis].abs() > ROUNDING * most)
            .collect();
        if let Some(axis) = joint.axis.filter(|axis| !moving.contains(axis)) {
            let letter = machine.axes.letter(axis);
            let name = &machine.kinematics.plugin;
            let cause = format!("{name} does not move this joint with {letter}");
            return Err(refusal(
                machine,
                &format!("joints.{}.axis", joint.name),
                cause,
            ));
        }
        match moving.as_slice() {
            [] => {}
            [axis] => narrow(machine, &mut limits, *axis, joint, (row[*axis], offset))?,
            _ => {
                rows.push(*row);
                lanes.push(index);
                behind.push(shifted(&joint.limits, offset));
            }
        }
    }
    let all: Vec<AxisLimits> = limits.axes().iter().copied().chain(behind).collect();
    let coupled = if rows.is_empty() {
        None
    } else {
        Some(lasting(JointLanes::new(axes, &rows)).map_err(|e| refusal(machine, "joints", e))?)
    };
    let limits = Limits::new(&all).map_err(|e| refusal(machine, "joints", e))?;
    Ok(Folded {
        limits,
        coupled,
        lanes,
    })
}

/// The machine's limits with those of all joints behind them, for the guard.
pub fn behind(machine: &Machine, joints: &[Joint]) -> Result<Limits, HostError> {
    let all: Vec<AxisLimits> = machine
        .limits
        .axes()
        .iter()
        .copied()
        .chain(joints.iter().map(|j| j.limits))
        .collect();
    if all.len() > MAX_AXES {
        let cause = format!(
            "{} is not linear in the axes, so that the guard judges its {} joints beside the {} axes: together at most \
             {MAX_AXES}",
            machine.kinematics.plugin,
            joints.len(),
            machine.axes.count()
        );
        return Err(refusal(machine, "kinematics.plugin", cause));
    }
    Limits::new(&all).map_err(|e| refusal(machine, "joints", e))
}

/// Makes the limits of `axis` as narrow as `joint`, which is `scale · axis + offset`, asks for.
pub fn narrow(
    machine: &Machine,
    limits: &mut Limits,
    axis: usize,
    joint: &Joint,
    (scale, offset): (f64, f64),
) -> Result<(), HostError> {
    let of = &mut limits.axes[axis];
    let joint_limits = &joint.limits;
    let size = scale.abs();
    let mut ends = [joint_limits.min_mm, joint_limits.max_mm].map(|end| (end - offset) / scale);
    ends.sort_by(f64::total_cmp);
    (of.min_mm, of.max_mm) = (of.min_mm.max(ends[0]), of.max_mm.min(ends[1]));
    let least = |of: &mut f64, joint: f64| *of = of.min(joint / size);
    least(&mut of.feed_mm_per_s, joint_limits.feed_mm_per_s);
    least(&mut of.rapid_mm_per_s, joint_limits.rapid_mm_per_s);
    least(
        &mut of.acceleration_mm_per_s2,
        joint_limits.acceleration_mm_per_s2,
    );
    least(&mut of.jerk_mm_per_s3, joint_limits.jerk_mm_per_s3);
    least(
        &mut of.speed_difference_mm_per_s,
        joint_limits.speed_difference_mm_per_s,
    );
    if of.min_mm < of.max_mm {
        return Ok(());
    }
    let letter = machine.axes.letter(axis);
    let name = &joint.name;
    Err(refusal(
        machine,
        &format!("joints.{name}"),
        format!("its travel and that of axis {letter} have nothing in common"),
    ))
}

fn shifted(limits: &AxisLimits, offset: f64) -> AxisLimits {
    AxisLimits {
        min_mm: limits.min_mm - offset,
        max_mm: limits.max_mm - offset,
        ..*limits
    }
}

/// The lanes, kept for as long as the process lives: the same ones once.
fn lasting(lanes: Result<JointLanes, String>) -> Result<&'static JointLanes, String> {
    static KEPT: Mutex<Vec<&'static JointLanes>> = Mutex::new(Vec::new());
    let lanes = lanes?;
    let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = kept.iter().find(|known| ***known == lanes) {
        return Ok(known);
    }
    let lasting: &'static JointLanes = Box::leak(Box::new(lanes));
    kept.push(lasting);
    Ok(lasting)
}
