//! The driver of a loop that has no drives yet.

use tandem_sdk::{
    Attached, Driver, DriverContext, DriverDescription, Feedback, PluginError, Setpoint,
};

/// Stands in a loop until it takes over the drives.
pub(crate) struct NoDriver;

impl Driver for NoDriver {
    fn describe(&self) -> DriverDescription {
        DriverDescription::simulated()
    }

    fn open(&mut self, _context: &DriverContext) -> Result<(), PluginError> {
        Ok(())
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        Ok(Attached::default())
    }

    fn exchange(
        &mut self,
        _setpoint: &Setpoint,
        _feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        Ok(())
    }

    fn quick_stop(&mut self) {}

    fn stop(&mut self) -> Result<(), PluginError> {
        Ok(())
    }
}
