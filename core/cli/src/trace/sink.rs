//! The trace that a run writes, in the format that its name asks for.

use std::path::Path;

use tandem_host::{Output, Run, Timed, TraceCsv};
use tandem_machine::Machine;
use tandem_rings::Sample;
use tandem_trace::{Header, Writer};

/// A trace in the making.
pub enum TraceSink {
    /// One row of text a sample.
    Csv(TraceCsv),
    /// The binary format.
    Binary {
        /// Writes it.
        writer: Box<Writer<Output>>,
        /// The first record that could not be written, in words.
        failed: Option<String>,
    },
}

impl TraceSink {
    /// Starts the file: binary where it is called `.ttr`, else CSV.
    ///
    /// # Errors
    /// The path with the system's words.
    pub fn create(path: &Path, machine: &Machine, program: &str, run: &Run, dry_run: bool) -> Result<Self, String> {
        let signals = run.signals();
        if !is_binary_name(path) {
            return TraceCsv::create(path, machine, &signals).map(Self::Csv);
        }
        let header = Header {
            fine_period_s: machine.fine_period_s,
            axes: machine.axes,
            machine: machine.name.clone(),
            program: program.to_string(),
            planner: machine.planner.plugin.clone(),
            dry_run,
            signals: signals.iter().map(ToString::to_string).collect(),
        };
        let writer = Writer::new(Output::create(path)?, &header).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(Self::Binary { writer: Box::new(writer), failed: None })
    }

    /// Adds a sample.
    pub fn sample(&mut self, sample: &Sample, signals: &[f64]) {
        match self {
            Self::Csv(csv) => csv.sample(sample, signals),
            Self::Binary { failed: Some(_), .. } => {}
            Self::Binary { writer, failed } => *failed = writer.sample(sample, signals).err().map(|e| e.to_string()),
        }
    }

    /// Adds a command of the operator; a CSV has no place for it.
    pub fn command(&mut self, command: &Timed) {
        if let Self::Binary { writer, failed: failed @ None } = self {
            *failed = writer.command(&command.to_string()).err().map(|e| e.to_string());
        }
    }

    /// Ends the file.
    ///
    /// # Errors
    /// The first sample that could not be written, or the file cannot take its name.
    pub fn finish(self) -> Result<(), String> {
        match self {
            Self::Csv(csv) => csv.finish(),
            Self::Binary { failed: Some(error), .. } => Err(format!("trace: {error}")),
            Self::Binary { writer, .. } => writer.finish().map_err(|e| format!("trace: {e}"))?.finish(),
        }
    }
}

/// Whether a file's name is that of a binary trace.
pub fn is_binary_name(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("ttr"))
}
