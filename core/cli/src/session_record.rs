//! What jogging and manual input keep of the runs of one session.

use std::path::Path;

use tandem_host::{Run, Timed};
use tandem_machine::Machine;
use tandem_recorder::Summary;
use tandem_rings::Sample;

use crate::broken::Broken;
use crate::operator::Operator;
use crate::trace::TraceSink;

/// A trace that goes on after a reset, the operator of the run, and what has been said.
#[derive(Default)]
pub struct SessionRecord {
    trace: Option<TraceSink>,
    pub operator: Option<Operator>,
    /// Tick of the session at which the run began.
    first_tick: u64,
    next_tick: u64,
    /// What the computer does not grant is said once, not in every run.
    noted: Vec<String>,
    /// The trace, where it could not be written to its end.
    broken: Broken,
}

impl SessionRecord {
    /// Begins the trace with the first run, where one is asked for; `what` stands in it as the program.
    ///
    /// # Errors
    /// It cannot be created.
    pub fn begin_trace(
        &mut self,
        path: Option<&Path>,
        machine: &Machine,
        what: &str,
        run: &Run,
    ) -> Result<(), String> {
        if let (None, Some(path)) = (&self.trace, path) {
            self.trace = Some(TraceSink::create(path, machine, what, run, false)?);
        }
        Ok(())
    }

    /// A run begins with this operator.
    pub fn begin(&mut self, operator: Operator) {
        self.operator = Some(operator);
        self.first_tick = self.next_tick;
    }

    /// After a run: clients may take its fault back, where it has one.
    pub fn begin_fault(&mut self, summary: &Summary) {
        if let (Some(operator), Some(fault)) = (&mut self.operator, &summary.fault) {
            operator.begin_fault(fault);
        }
    }

    /// The run is over for its operator.
    pub fn end(&mut self, summary: &Summary) {
        if let Some(mut operator) = self.operator.take() {
            operator.end(summary);
        }
    }

    /// Ends the session. Gives whether the trace could not be written to its end, which is told.
    pub fn finish(mut self) -> bool {
        self.broken
            .note(self.trace.take().map_or(Ok(()), TraceSink::finish));
        self.broken.tell();
        self.broken.is_any()
    }

    /// What [`tandem_host::RunObserver::broken_record`] answers.
    pub fn broken_record(&mut self) -> Option<String> {
        self.broken.tell()
    }

    /// Whether `note` has not been said in this session.
    pub fn is_new(&mut self, note: &str) -> bool {
        let is_new = !self.noted.iter().any(|said| said == note);
        if is_new {
            self.noted.push(note.to_string());
        }
        is_new
    }

    pub fn is_attended(&self) -> bool {
        self.operator.as_ref().is_some_and(Operator::is_attended)
    }

    pub fn command(&mut self, command: &Timed) {
        if let Some(trace) = &mut self.trace {
            self.broken.note(trace.command(&Timed {
                tick: self.first_tick + command.tick,
                ..*command
            }));
        }
    }

    /// Takes a sample of the run; gives it with its tick of the session.
    pub fn sample(&mut self, sample: &Sample, signals: &[f64]) -> Sample {
        let sample = Sample {
            tick: self.first_tick + sample.tick,
            ..*sample
        };
        self.next_tick = sample.tick + 1;
        if let Some(operator) = &self.operator {
            operator.sample(&sample, 1.0);
        }
        if let Some(trace) = &mut self.trace {
            self.broken.note(trace.sample(&sample, signals));
        }
        sample
    }
}
