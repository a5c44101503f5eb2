//! Driver: drives that follow exactly, and a CSV file of what they were told.

use tandem_sdk::{Attached, Driver, DriverContext, DriverDescription, Feedback, PluginError, Setpoint};

tandem_sdk::options! {
    pub struct Options {
        /// The file, written when the run is over.
        pub file: String = "setpoints.csv".to_string(),
    }
}

pub struct Recorder {
    file: String,
    context: DriverContext,
    sent: Vec<Setpoint>,
}

tandem_sdk::plugin!(driver "csv-recorder" = |options: &Options| Ok(Recorder {
    file: options.file.clone(), context: DriverContext::new(0, 0.0), sent: Vec::with_capacity(100_000),
}));

impl Driver for Recorder {
    fn describe(&self) -> DriverDescription {
        DriverDescription::simulated()
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        self.context = *context;
        std::fs::write(&self.file, "").map_err(|e| PluginError::of_option("file", e.to_string()))
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        Ok(Attached::at(self.context.start_position))
    }

    fn exchange(&mut self, setpoint: &Setpoint, feedback: &mut Feedback) -> Result<(), PluginError> {
        feedback.follow(setpoint, self.context.joint_count as usize);
        self.sent.extend(Some(*setpoint).filter(|_| self.sent.len() < self.sent.capacity())); // allocates nothing
        Ok(())
    }

    fn quick_stop(&mut self) {}

    fn stop(&mut self) -> Result<(), PluginError> {
        let row = |s: &Setpoint| format!("{},{:?}\n", s.tick, &s.position.0[..self.context.joint_count as usize]);
        let written = std::fs::write(&self.file, self.sent.iter().map(row).collect::<String>());
        written.map_err(|error| PluginError::new(format!("{}: {error}", self.file)))
    }
}
