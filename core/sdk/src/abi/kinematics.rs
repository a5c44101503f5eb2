//! Kinematics across the border.

use std::ffi::c_void;
use std::marker::PhantomData;
use std::mem::MaybeUninit;

use super::Descriptor;
use super::entry::{self, Fault, Handle, Instance, ask, function};
use super::layout::table;
use super::watch::{Method, converting};
use crate::{
    AxisVector, Kinematics, KinematicsContext, Made, PluginError, PluginKind, PluginOptions, RawSlice, size_of_contract,
};

type Errors = *mut PluginError;
/// A conversion of one vector. One that fails gives numbers that are none, and `health` has the error.
type Convert = unsafe extern "C" fn(*const c_void, *const AxisVector) -> AxisVector;

table! {
    /// The functions of a kinematics. The conversions return what they answer; others write it, or an error.
    pub struct Table {
        size: u32,
        open: unsafe extern "C" fn(RawSlice<u8>, RawSlice<u8>, *const KinematicsContext, *mut *mut c_void, Errors) -> u32,
        close: unsafe extern "C" fn(*mut c_void),
        joint_count: unsafe extern "C" fn(*const c_void, u32, *mut u32, Errors) -> u32,
        to_joints: Convert,
        to_axes: Convert,
        joint_direction: unsafe extern "C" fn(*const c_void, *const AxisVector, *const AxisVector) -> AxisVector,
        health: unsafe extern "C" fn(*const c_void, *mut (), Errors) -> u32,
    }
}

/// The plugin `name` of the kinematics that `open` makes from its options.
pub const fn kinematics<T, O, F>(name: &'static str, version: &'static str, _open: F) -> Descriptor
where
    T: Kinematics + 'static,
    O: PluginOptions + 'static,
    F: Fn(&O, &KinematicsContext) -> Result<T, PluginError> + Copy + 'static,
{
    Descriptor::new(PluginKind::Kinematics, (name, version), entry::describe::<O>, &Side::<T, O, F>::TABLE)
}

/// The plugin's side.
struct Side<T, O, F>(PhantomData<(T, O, F)>);

impl<T, O, F> Side<T, O, F>
where
    T: Kinematics + 'static,
    O: PluginOptions + 'static,
    F: Fn(&O, &KinematicsContext) -> Result<T, PluginError> + Copy + 'static,
{
    const TABLE: Table = Table {
        size: size_of_contract::<Table>(),
        open: Self::open,
        close: entry::close::<T>,
        joint_count: joint_count::<T>,
        to_joints: to_joints::<T>,
        to_axes: to_axes::<T>,
        joint_direction: joint_direction::<T>,
        health: health::<T>,
    };

    unsafe extern "C" fn open(
        name: RawSlice<u8>,
        options: RawSlice<u8>,
        context: *const KinematicsContext,
        handle: *mut *mut c_void,
        error: Errors,
    ) -> u32 {
        // SAFETY: the host gives what lives for the call.
        unsafe { entry::open([name, options], handle, error, |options: &O| function::<F>()(options, &*context)) }
    }
}

// SAFETY of all of these: the host passes the handle that `open` gave, places that can be written to, and references that
// live for the call.

unsafe extern "C" fn joint_count<T: Kinematics>(
    this: *const c_void,
    axis_count: u32,
    answer: *mut u32,
    error: Errors,
) -> u32 {
    let this = unsafe { &*this.cast::<Instance<T>>() };
    let work = || Ok(this.plugin.joint_count(axis_count as usize) as u32);
    unsafe { this.fault.guard("joint_count", answer, error, work) }
}

unsafe extern "C" fn to_joints<T: Kinematics>(this: *const c_void, axes: *const AxisVector) -> AxisVector {
    let Instance { plugin, fault } = unsafe { &*this.cast::<Instance<T>>() };
    convert(fault, "to_joints", || plugin.to_joints(unsafe { &*axes }))
}

unsafe extern "C" fn to_axes<T: Kinematics>(this: *const c_void, joints: *const AxisVector) -> AxisVector {
    let Instance { plugin, fault } = unsafe { &*this.cast::<Instance<T>>() };
    convert(fault, "to_axes", || plugin.to_axes(unsafe { &*joints }))
}

unsafe extern "C" fn joint_direction<T: Kinematics>(
    this: *const c_void,
    position: *const AxisVector,
    direction: *const AxisVector,
) -> AxisVector {
    let Instance { plugin, fault } = unsafe { &*this.cast::<Instance<T>>() };
    convert(fault, "joint_direction", || unsafe { plugin.joint_direction(&*position, &*direction) })
}

/// No position at all.
const NOWHERE: AxisVector = AxisVector([f64::NAN; crate::MAX_AXES]);

/// Makes a conversion. One that has panicked answers no position: its caller sees that, and asks for its health. The answer
/// is written where the host wants it: to copy it takes as long as the call.
#[inline]
fn convert(fault: &Fault, method: &str, work: impl FnOnce() -> AxisVector) -> AxisVector {
    let mut answer = MaybeUninit::uninit();
    let write = || {
        answer.write(work());
    };
    match fault.run(method, write) {
        // SAFETY: it was written.
        Ok(()) => unsafe { answer.assume_init() },
        Err(_) => NOWHERE,
    }
}

unsafe extern "C" fn health<T: Kinematics>(this: *const c_void, answer: *mut (), error: Errors) -> u32 {
    let this = unsafe { &*this.cast::<Instance<T>>() };
    unsafe { this.fault.guard("health", answer, error, || this.plugin.health()) }
}

/// The host's side: a kinematics behind its table.
struct Linked {
    table: &'static Table,
    handle: Handle,
}

/// Opens a kinematics behind its table.
pub fn open(
    table: &'static Table,
    name: &'static str,
    options: &str,
    context: &KinematicsContext,
) -> Made<dyn Kinematics> {
    let (name, options) = (RawSlice::new(name.as_bytes()), RawSlice::new(options.as_bytes()));
    // SAFETY: everything lives for the call.
    let handle = Handle::open([Method::KinematicsNew, Method::KinematicsDrop], table.close, |handle, error| unsafe {
        (table.open)(name, options, context, handle, error)
    })?;
    Ok(Box::new(Linked { table, handle }))
}

// SAFETY of the calls: the handle is open, `ask` gives places to write to, references live for the call.
impl Kinematics for Linked {
    fn joint_count(&self, axis_count: usize) -> usize {
        let count = axis_count as u32;
        let asked = ask(Method::KinematicsJointCount, |answer, error| unsafe {
            (self.table.joint_count)(self.handle.instance, count, answer, error)
        });
        asked.map_or(0, |joints| joints as usize)
    }

    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        converting(|| unsafe { (self.table.to_joints)(self.handle.instance, axes) })
    }

    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        converting(|| unsafe { (self.table.to_axes)(self.handle.instance, joints) })
    }

    fn joint_direction(&self, position: &AxisVector, direction: &AxisVector) -> AxisVector {
        converting(|| unsafe { (self.table.joint_direction)(self.handle.instance, position, direction) })
    }

    fn health(&self) -> Result<(), PluginError> {
        ask(Method::KinematicsHealth, |answer, error| unsafe {
            (self.table.health)(self.handle.instance, answer, error)
        })
    }
}
