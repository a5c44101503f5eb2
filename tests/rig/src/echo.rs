//! Drives that follow exactly.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use tandem_sdk::{
    Attached, AxisVector, Driver, DriverContext, DriverDescription, Feedback, MAX_AXES,
    PluginError, Setpoint,
};

/// What a test does with an exchange after the drives have followed.
type Exchanged = dyn FnMut(&Setpoint, &mut Feedback) -> Result<(), PluginError> + Send;

/// Simulated drives that are enabled as soon as they are told, stand where the machine starts, and follow exactly.
pub struct Echo {
    joints: usize,
    stands: AxisVector,
    exchanged: Box<Exchanged>,
    quick_stops: Arc<AtomicU64>,
}

impl Echo {
    /// Drives in whose exchanges `exchanged` has the last word.
    pub fn new(
        exchanged: impl FnMut(&Setpoint, &mut Feedback) -> Result<(), PluginError> + Send + 'static,
    ) -> Self {
        Self {
            joints: MAX_AXES,
            stands: AxisVector::ZERO,
            exchanged: Box::new(exchanged),
            quick_stops: Arc::default(),
        }
    }

    /// How often they were told to stop quickly, also while somebody else owns them.
    pub fn quick_stops(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.quick_stops)
    }
}

impl Default for Echo {
    fn default() -> Self {
        Self::new(|_, _| Ok(()))
    }
}

impl Driver for Echo {
    fn describe(&self) -> DriverDescription {
        DriverDescription::simulated()
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        (self.joints, self.stands) = (context.joint_count as usize, context.start_position);
        Ok(())
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        Ok(Attached::at(self.stands))
    }

    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        feedback.follow(setpoint, self.joints);
        (self.exchanged)(setpoint, feedback)
    }

    fn quick_stop(&mut self) {
        self.quick_stops.fetch_add(1, Relaxed);
    }

    fn stop(&mut self) -> Result<(), PluginError> {
        Ok(())
    }
}
