//! The trace that a run writes, in the format that its name asks for.

use std::path::Path;

use tandem_host::{Run, Timed};
use tandem_machine::Machine;
use tandem_recorder::{Output, RecordError, TraceCsv};
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
        /// It has been told that no further record can be written.
        failed: bool,
    },
}

impl TraceSink {
    /// Starts the file: binary where it is called `.ttr`, else CSV.
    ///
    /// # Errors
    /// The path with the system's words.
    pub fn create(
        path: &Path,
        machine: &Machine,
        program: &str,
        run: &Run,
        dry_run: bool,
    ) -> Result<Self, String> {
        let signals = run.signals();
        let signals: Vec<&str> = signals.iter().map(String::as_str).collect();
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
        let writer = Writer::new(Output::create(path)?, &header)
            .map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(Self::Binary {
            writer: Box::new(writer),
            failed: false,
        })
    }

    /// Adds a sample. After an error all further ones are left out.
    ///
    /// # Errors
    /// Once: no further sample can be written.
    pub fn sample(&mut self, sample: &Sample, signals: &[f64]) -> Result<(), RecordError> {
        match self {
            Self::Csv(csv) => csv.sample(sample, signals),
            Self::Binary { failed: true, .. } => Ok(()),
            Self::Binary { writer, failed } => writer.sample(sample, signals).map_err(|error| {
                *failed = true;
                RecordError::of("trace", writer.out(), error).at(sample)
            }),
        }
    }

    /// Adds a command of the operator; a CSV has no place for it.
    ///
    /// # Errors
    /// As [`TraceSink::sample`].
    pub fn command(&mut self, command: &Timed) -> Result<(), RecordError> {
        match self {
            Self::Csv(_) | Self::Binary { failed: true, .. } => Ok(()),
            Self::Binary { writer, failed } => {
                writer.command(&command.to_string()).map_err(|error| {
                    *failed = true;
                    RecordError {
                        tick: Some(command.tick),
                        ..RecordError::of("trace", writer.out(), error)
                    }
                })
            }
        }
    }

    /// Ends the file.
    ///
    /// # Errors
    /// The last samples cannot be written, or the file cannot take its name. What has been told is not told again.
    pub fn finish(self) -> Result<(), RecordError> {
        match self {
            Self::Csv(csv) => csv.finish(),
            Self::Binary { failed: true, .. } => Ok(()),
            Self::Binary { mut writer, .. } => match writer.end() {
                Ok(()) => writer.into_inner().finish_record("trace"),
                Err(error) => Err(RecordError::of("trace", writer.out(), error)),
            },
        }
    }
}

/// Whether a file's name is that of a binary trace.
pub fn is_binary_name(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("ttr"))
}
