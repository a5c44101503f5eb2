//! Stand-in drives with inputs that nothing trips.

use tandem_sdk::{
    Attached, Driver, DriverContext, DriverDescription, Feedback, PluginError, Setpoint, Words,
};

/// Drives whose inputs in `levels` are 1 whatever they say.
pub struct AtRest {
    pub driver: Box<dyn Driver>,
    /// A bit per input, as the driver numbers them.
    pub levels: u64,
}

impl Driver for AtRest {
    fn describe(&self) -> DriverDescription {
        self.driver.describe()
    }

    fn check(&self, context: &DriverContext) -> Result<(), PluginError> {
        self.driver.check(context)
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        self.driver.open(context)
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        self.driver.start()
    }

    fn send(&mut self, setpoint: &Setpoint) -> bool {
        self.driver.send(setpoint)
    }

    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        let exchanged = self.driver.exchange(setpoint, feedback);
        feedback.inputs |= self.levels;
        exchanged
    }

    fn quick_stop(&mut self) {
        self.driver.quick_stop();
    }

    fn stop(&mut self) -> Result<(), PluginError> {
        self.driver.stop()
    }

    fn explain(&self, joint: u32, code: u32) -> Words {
        self.driver.explain(joint, code)
    }
}
