//! Drivers across the border.

use std::ffi::c_void;
use std::marker::PhantomData;

use super::Descriptor;
use super::entry::{self, Handle, Instance, ask, function};
use super::layout::table;
use super::watch::Method;
use crate::{
    Attached, Driver, DriverContext, DriverDescription, Feedback, Made, PluginError, PluginKind, PluginOptions,
    RawSlice, Setpoint, Words, size_of_contract,
};

type Errors = *mut PluginError;

table! {
    /// The functions of a driver. Each that answers writes its answer, or an error.
    pub struct Table {
        size: u32,
        open: unsafe extern "C" fn(RawSlice<u8>, RawSlice<u8>, *mut *mut c_void, Errors) -> u32,
        close: unsafe extern "C" fn(*mut c_void),
        describe: unsafe extern "C" fn(*const c_void, *mut DriverDescription, Errors) -> u32,
        check: unsafe extern "C" fn(*const c_void, *const DriverContext, *mut (), Errors) -> u32,
        claim: unsafe extern "C" fn(*mut c_void, *const DriverContext, *mut (), Errors) -> u32,
        start: unsafe extern "C" fn(*mut c_void, *mut Attached, Errors) -> u32,
        send: unsafe extern "C" fn(*mut c_void, *const Setpoint, *mut (), Errors) -> u32,
        exchange: unsafe extern "C" fn(*mut c_void, *const Setpoint, *mut Feedback, *mut (), Errors) -> u32,
        quick_stop: unsafe extern "C" fn(*mut c_void, *mut (), Errors) -> u32,
        stop: unsafe extern "C" fn(*mut c_void, *mut (), Errors) -> u32,
        explain: unsafe extern "C" fn(*const c_void, u32, u32, *mut Words, Errors) -> u32,
    }
}

/// The plugin `name` of the driver that `open` makes from its options.
pub const fn driver<T, O, F>(name: &'static str, version: &'static str, _open: F) -> Descriptor
where
    T: Driver + 'static,
    O: PluginOptions + 'static,
    F: Fn(&O) -> Result<T, PluginError> + Copy + 'static,
{
    Descriptor::new(PluginKind::Driver, (name, version), entry::describe::<O>, &Side::<T, O, F>::TABLE)
}

/// The plugin's side.
struct Side<T, O, F>(PhantomData<(T, O, F)>);

impl<T, O, F> Side<T, O, F>
where
    T: Driver + 'static,
    O: PluginOptions + 'static,
    F: Fn(&O) -> Result<T, PluginError> + Copy + 'static,
{
    const TABLE: Table = Table {
        size: size_of_contract::<Table>(),
        open: Self::open,
        close: entry::close::<T>,
        describe: describe::<T>,
        check: check::<T>,
        claim: claim::<T>,
        start: start::<T>,
        send: send::<T>,
        exchange: exchange::<T>,
        quick_stop: quick_stop::<T>,
        stop: stop::<T>,
        explain: explain::<T>,
    };

    unsafe extern "C" fn open(
        name: RawSlice<u8>,
        options: RawSlice<u8>,
        handle: *mut *mut c_void,
        error: Errors,
    ) -> u32 {
        // SAFETY: the host gives what lives for the call.
        unsafe { entry::open([name, options], handle, error, |options: &O| function::<F>()(options)) }
    }
}

// SAFETY of all of these: the host passes the handle that `open` gave, places that can be written to, and references that
// live for the call; it calls a driver from one thread at a time.

unsafe extern "C" fn describe<T: Driver>(this: *const c_void, answer: *mut DriverDescription, error: Errors) -> u32 {
    let this = unsafe { &*this.cast::<Instance<T>>() };
    unsafe { this.fault.guard("describe", answer, error, || Ok(this.plugin.describe())) }
}

unsafe extern "C" fn check<T: Driver>(
    this: *const c_void,
    context: *const DriverContext,
    answer: *mut (),
    error: Errors,
) -> u32 {
    let this = unsafe { &*this.cast::<Instance<T>>() };
    unsafe { this.fault.guard("check", answer, error, || this.plugin.check(&*context)) }
}

unsafe extern "C" fn claim<T: Driver>(
    this: *mut c_void,
    context: *const DriverContext,
    answer: *mut (),
    error: Errors,
) -> u32 {
    let Instance { plugin, fault } = unsafe { &mut *this.cast::<Instance<T>>() };
    unsafe { fault.guard("open", answer, error, || plugin.open(&*context)) }
}

unsafe extern "C" fn start<T: Driver>(this: *mut c_void, answer: *mut Attached, error: Errors) -> u32 {
    let Instance { plugin, fault } = unsafe { &mut *this.cast::<Instance<T>>() };
    unsafe { fault.guard("start", answer, error, || plugin.start()) }
}

unsafe extern "C" fn send<T: Driver>(
    this: *mut c_void,
    setpoint: *const Setpoint,
    answer: *mut (),
    error: Errors,
) -> u32 {
    let Instance { plugin, fault } = unsafe { &mut *this.cast::<Instance<T>>() };
    let work = || {
        plugin.send(unsafe { &*setpoint });
        Ok(())
    };
    unsafe { fault.guard("send", answer, error, work) }
}

unsafe extern "C" fn exchange<T: Driver>(
    this: *mut c_void,
    setpoint: *const Setpoint,
    feedback: *mut Feedback,
    answer: *mut (),
    error: Errors,
) -> u32 {
    let Instance { plugin, fault } = unsafe { &mut *this.cast::<Instance<T>>() };
    unsafe { fault.guard("exchange", answer, error, || plugin.exchange(&*setpoint, &mut *feedback)) }
}

unsafe extern "C" fn quick_stop<T: Driver>(this: *mut c_void, answer: *mut (), error: Errors) -> u32 {
    let Instance { plugin, fault } = unsafe { &mut *this.cast::<Instance<T>>() };
    let work = || {
        plugin.quick_stop();
        Ok(())
    };
    unsafe { fault.guard("quick_stop", answer, error, work) }
}

unsafe extern "C" fn stop<T: Driver>(this: *mut c_void, answer: *mut (), error: Errors) -> u32 {
    let Instance { plugin, fault } = unsafe { &mut *this.cast::<Instance<T>>() };
    unsafe { fault.guard("stop", answer, error, || plugin.stop()) }
}

unsafe extern "C" fn explain<T: Driver>(
    this: *const c_void,
    joint: u32,
    code: u32,
    answer: *mut Words,
    error: Errors,
) -> u32 {
    let this = unsafe { &*this.cast::<Instance<T>>() };
    unsafe { this.fault.guard("explain", answer, error, || Ok(this.plugin.explain(joint, code))) }
}

/// The host's side: a driver behind its table.
struct Linked {
    table: &'static Table,
    handle: Handle,
}

/// Opens a driver behind its table.
pub fn open(table: &'static Table, name: &'static str, options: &str) -> Made<dyn Driver> {
    let (name, options) = (RawSlice::new(name.as_bytes()), RawSlice::new(options.as_bytes()));
    // SAFETY: everything lives for the call.
    let handle = Handle::open([Method::DriverNew, Method::DriverDrop], table.close, |handle, error| unsafe {
        (table.open)(name, options, handle, error)
    })?;
    Ok(Box::new(Linked { table, handle }))
}

/// Drops an error that is told elsewhere, away from the calls that go well.
#[cold]
#[inline(never)]
fn forget(error: PluginError) {
    drop(error);
}

// SAFETY of the calls: the handle is open, `ask` gives places to write to, references live for the call.
impl Driver for Linked {
    fn describe(&self) -> DriverDescription {
        let asked = ask(Method::DriverDescribe, |answer, error| unsafe {
            (self.table.describe)(self.handle.instance, answer, error)
        });
        // It has panicked, and says so when it is opened.
        asked.unwrap_or_else(|_| DriverDescription::real())
    }

    fn check(&self, context: &DriverContext) -> Result<(), PluginError> {
        ask(Method::DriverCheck, |answer, error| unsafe {
            (self.table.check)(self.handle.instance, context, answer, error)
        })
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        ask(Method::DriverOpen, |answer, error| unsafe {
            (self.table.claim)(self.handle.instance, context, answer, error)
        })
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        ask(Method::DriverStart, |answer, error| unsafe { (self.table.start)(self.handle.instance, answer, error) })
    }

    fn send(&mut self, setpoint: &Setpoint) {
        // A panic is told by the exchange that follows.
        if let Err(error) = ask(Method::DriverSend, |answer, error| unsafe {
            (self.table.send)(self.handle.instance, setpoint, answer, error)
        }) {
            forget(error);
        }
    }

    fn exchange(&mut self, setpoint: &Setpoint, feedback: &mut Feedback) -> Result<(), PluginError> {
        ask(Method::DriverExchange, |answer, error| unsafe {
            (self.table.exchange)(self.handle.instance, setpoint, feedback, answer, error)
        })
    }

    fn quick_stop(&mut self) {
        // Nothing may be asked of it any more that could tell. The log is one for the fine loop.
        if let Err(error) = ask(Method::DriverQuickStop, |answer, error| unsafe {
            (self.table.quick_stop)(self.handle.instance, answer, error)
        }) {
            crate::log!(Error, "no quick stop: {error}");
        }
    }

    fn stop(&mut self) -> Result<(), PluginError> {
        ask(Method::DriverStop, |answer, error| unsafe { (self.table.stop)(self.handle.instance, answer, error) })
    }

    fn explain(&self, joint: u32, code: u32) -> Words {
        let asked = ask(Method::DriverExplain, |answer, error| unsafe {
            (self.table.explain)(self.handle.instance, joint, code, answer, error)
        });
        asked.unwrap_or_default()
    }
}
