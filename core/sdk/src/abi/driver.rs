//! Drivers across the border.

use super::contract::contract;
use crate::{
    Attached, Driver, DriverContext, DriverDescription, Feedback, PluginError, PluginResult,
    Setpoint, Words,
};

contract! {
    /// The functions of a driver. Each writes its answer, or an error.
    driver: Driver, Driver(), DriverNew, DriverDrop;
    ref describe(plugin) -> DriverDescription = DriverDescribe { Ok(plugin.describe()) }
    ref check(plugin, context: *const DriverContext) -> () = DriverCheck { plugin.check(&*context) }
    mut open(plugin, context: *const DriverContext) -> () = DriverOpen { plugin.open(&*context) }
    mut start(plugin) -> Attached = DriverStart { plugin.start() }
    mut send(plugin, setpoint: *const Setpoint) -> u32 = DriverSend { Ok(u32::from(plugin.send(&*setpoint))) }
    mut exchange(plugin, setpoint: *const Setpoint, feedback: *mut Feedback) -> () = DriverExchange {
        plugin.exchange(&*setpoint, &mut *feedback)
    }
    mut quick_stop(plugin) -> () = DriverQuickStop {
        plugin.quick_stop();
        Ok(())
    }
    mut stop(plugin) -> () = DriverStop { plugin.stop() }
    ref explain(plugin, joint: u32, code: u32) -> Words = DriverExplain { Ok(plugin.explain(joint, code)) }
}

/// The host's side: a driver behind its table.
struct Linked(Calls);

/// Drops an error that is told elsewhere, away from the calls that go well.
#[cold]
#[inline(never)]
fn forget(error: PluginError) {
    drop(error);
}

/// Makes a driver behind its table.
pub fn open(table: &'static Table, name: &'static str, options: &str) -> PluginResult<dyn Driver> {
    Ok(Box::new(Linked(Calls::make(table, name, options)?)))
}

impl Driver for Linked {
    fn describe(&self) -> DriverDescription {
        // One that has panicked says so when it is opened.
        self.0
            .describe()
            .unwrap_or_else(|_| DriverDescription::real())
    }

    fn check(&self, context: &DriverContext) -> Result<(), PluginError> {
        self.0.check(context)
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        self.0.open(context)
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        self.0.start()
    }

    fn send(&mut self, setpoint: &Setpoint) -> bool {
        match self.0.send(setpoint) {
            Ok(sends) => sends != 0,
            // A panic is told by the exchange that follows.
            Err(error) => {
                forget(error);
                false
            }
        }
    }

    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        self.0.exchange(setpoint, feedback)
    }

    fn quick_stop(&mut self) {
        // Nothing may be asked of it any more that could tell. The log is one for the fine loop.
        if let Err(error) = self.0.quick_stop() {
            crate::log!(Error, "no quick stop: {error}");
        }
    }

    fn stop(&mut self) -> Result<(), PluginError> {
        self.0.stop()
    }

    fn explain(&self, joint: u32, code: u32) -> Words {
        self.0.explain(joint, code).unwrap_or_default()
    }
}
