//! Kinematics across the border.

use std::ffi::c_void;
use std::mem::MaybeUninit;

use super::contract::contract;
use super::entry::{CallGuard, Instance};
use super::watch::converting;
use crate::{AxisVector, Kinematics, KinematicsContext, PluginError, PluginResult};

/// A conversion of one vector. One that fails gives numbers that are none, and `health` has the error.
type Convert = unsafe extern "C" fn(*mut c_void, *const AxisVector) -> AxisVector;

contract! {
    /// The functions of a kinematics. The conversions return what they answer; others write it, or an error.
    kinematics: Kinematics, Kinematics(KinematicsContext), KinematicsNew, KinematicsDrop;
    ref joint_count(plugin, axis_count: u32) -> u32 = KinematicsJointCount {
        Ok(plugin.joint_count(axis_count as usize) as u32)
    }
    ref health(plugin) -> () = KinematicsHealth { plugin.health() }
    [to_joints: Convert = to_joints::<T>, to_axes: Convert = to_axes::<T>]
}

// SAFETY of both: the host passes the handle that `make` gave, and a vector that lives for the call.

unsafe extern "C" fn to_joints<T: Kinematics>(
    this: *mut c_void,
    axes: *const AxisVector,
) -> AxisVector {
    let Instance { plugin, guard } = unsafe { &*this.cast::<Instance<T>>() };
    convert(guard, "to_joints", || plugin.to_joints(unsafe { &*axes }))
}

unsafe extern "C" fn to_axes<T: Kinematics>(
    this: *mut c_void,
    joints: *const AxisVector,
) -> AxisVector {
    let Instance { plugin, guard } = unsafe { &*this.cast::<Instance<T>>() };
    convert(guard, "to_axes", || plugin.to_axes(unsafe { &*joints }))
}

/// No position at all.
const NOWHERE: AxisVector = AxisVector([f64::NAN; crate::MAX_AXES]);

/// Makes a conversion. One that has panicked answers no position: its caller sees that, and asks for its health. The answer
/// is written where the host wants it: to copy it takes as long as the call.
#[inline]
fn convert(guard: &CallGuard, method: &str, work: impl FnOnce() -> AxisVector) -> AxisVector {
    let mut answer = MaybeUninit::uninit();
    let write = || {
        answer.write(work());
    };
    match guard.run(method, write) {
        // SAFETY: it was written.
        Ok(()) => unsafe { answer.assume_init() },
        Err(_) => NOWHERE,
    }
}

/// The host's side: a kinematics behind its table.
struct Linked(Calls);

/// Opens a kinematics behind its table.
pub fn open(
    table: &'static Table,
    name: &'static str,
    options: &str,
    context: &KinematicsContext,
) -> PluginResult<dyn Kinematics> {
    Ok(Box::new(Linked(Calls::make(
        table, name, options, context,
    )?)))
}

// SAFETY of the conversions: the handle is open, and references live for the call.
impl Kinematics for Linked {
    fn joint_count(&self, axis_count: usize) -> usize {
        self.0
            .joint_count(axis_count as u32)
            .map_or(0, |joints| joints as usize)
    }

    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        converting(|| unsafe { (self.0.table.to_joints)(self.0.handle.instance, axes) })
    }

    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        converting(|| unsafe { (self.0.table.to_axes)(self.0.handle.instance, joints) })
    }

    fn health(&self) -> Result<(), PluginError> {
        self.0.health()
    }
}
