//! A driver.

use tandem_sdk::{
    Attached, AxisVector, Driver, DriverContext, DriverDescription, Feedback, JointState, PluginError, Setpoint,
};

use crate::mischief::{Misbehave, Mischief, Options};

pub struct Hostile(Mischief, usize, AxisVector);

impl Hostile {
    pub fn open(options: &Options) -> Result<Self, PluginError> {
        Ok(Self(Mischief::new(options)?, 0, AxisVector::ZERO))
    }
}

impl Drop for Hostile {
    fn drop(&mut self) {
        self.0.quietly("drop");
    }
}

impl Driver for Hostile {
    fn describe(&self) -> DriverDescription {
        self.0.quietly("describe");
        DriverDescription::simulated()
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        (self.1, self.2) = (context.joint_count as usize, context.start_position);
        self.0.of("open")?;
        // A thread of its own that goes wrong, where it is told so.
        let _ = std::thread::scope(|scope| scope.spawn(|| self.0.quietly("thread")).join());
        Ok(())
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        self.0.of("start").map(|_| Attached::at(self.2))
    }

    fn exchange(&mut self, setpoint: &Setpoint, feedback: &mut Feedback) -> Result<(), PluginError> {
        let what = self.0.of("exchange")?;
        (feedback.position, feedback.speed) = (setpoint.position, setpoint.velocity);
        feedback.position[0] = Mischief::number(what, feedback.position[0]);
        let state = if setpoint.enable != 0 { JointState::Enabled } else { JointState::Disabled };
        feedback.state[..self.1].fill(state);
        if what == Misbehave::Foreign {
            feedback.state[self.1 - 1] = JointState(250);
        }
        Ok(())
    }

    fn quick_stop(&mut self) {
        self.0.quietly("quick_stop");
    }

    fn stop(&mut self) -> Result<(), PluginError> {
        self.0.of("stop").map(|_| ())
    }
}
