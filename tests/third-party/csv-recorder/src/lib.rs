//! Driver: drives that follow exactly, and a CSV file of what they were told.

use tandem_sdk::{Attached, Driver, DriverContext, DriverDescription, Feedback, PluginError, Setpoint};

tandem_sdk::options! {
    pub struct Options {
        /// The file, written when the run is over.
        pub file: String = "setpoints.csv".to_string(),
    }
}

pub struct Recorder(Options, DriverContext, Vec<Setpoint>);

tandem_sdk::plugin!(driver "csv-recorder" = |options: &Options| {
    Ok(Recorder(options.clone(), DriverContext::new(0, 0.0), Vec::with_capacity(100_000)))
});

impl Driver for Recorder {
    fn describe(&self) -> DriverDescription {
        DriverDescription::simulated()
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        self.1 = *context;
        std::fs::write(&self.0.file, "").map_err(|e| PluginError::of_option("file", e.to_string()))
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        Ok(Attached::at(self.1.start_position))
    }

    fn exchange(&mut self, setpoint: &Setpoint, feedback: &mut Feedback) -> Result<(), PluginError> {
        feedback.follow(setpoint, self.1.joint_count as usize);
        if self.2.len() < self.2.capacity() {
            self.2.push(*setpoint); // within what is allocated: this runs on the fine loop
        }
        Ok(())
    }

    fn quick_stop(&mut self) {}

    fn stop(&mut self) -> Result<(), PluginError> {
        let row = |s: &Setpoint| format!("{},{:?}\n", s.tick, &s.position.0[..self.1.joint_count as usize]);
        let written = std::fs::write(&self.0.file, self.2.iter().map(row).collect::<String>());
        written.map_err(|error| PluginError::new(format!("{}: {error}", self.0.file)))
    }
}
