//! The motion by rough periods, as the two-step motion control loop hands it from its rough loop to its fine one.

use std::f64::consts::TAU;
use std::io::Write;
use std::path::Path;

use tandem_machine::Machine;
use tandem_rings::Sample;
use tandem_sdk::{Axes, AxisVector};

use super::output::{Output, RecordError};
use super::trace_csv::TraceCsv;

/// Writes a row for each rough period: the displacement of every axis in it, and the path feed at both of its ends.
pub struct RoughCsv {
    out: Output,
    axes: Axes,
    period_s: f64,
    per_rough: u64,
    /// Where the rough period began, at which feed, mm/s, and in which tick; none before the first sample.
    from: Option<(AxisVector, f64, u64)>,
    last: Sample,
    /// It has been told that no further row can be written.
    failed: bool,
}

impl RoughCsv {
    /// Starts the file with its head line.
    ///
    /// # Errors
    /// The path with the system's words.
    pub fn create(path: &Path, machine: &Machine) -> Result<Self, String> {
        let mut out = Output::create(path)?;
        let mut head = vec!["t_s".to_string()];
        for axis in 0..machine.axes.count() {
            let unit = if machine.axes.is_rotary(axis) {
                "deg"
            } else {
                "mm"
            };
            let letter = machine.axes.letter(axis).to_ascii_lowercase();
            head.push(format!("{letter}_displacement_{unit}"));
        }
        head.push("start_feed_mm_s,end_feed_mm_s".to_string());
        writeln!(out, "{}", head.join(",")).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(Self {
            out,
            axes: machine.axes,
            period_s: machine.fine_period_s,
            per_rough: u64::from(machine.fine_periods_per_rough),
            from: None,
            last: Sample::default(),
            failed: false,
        })
    }

    /// A sample was sent. After an error all further ones are left out.
    ///
    /// # Errors
    /// Once: no further row can be written.
    pub fn sample(&mut self, sample: &Sample) -> Result<(), RecordError> {
        let (_, _, from) =
            *self
                .from
                .get_or_insert((sample.command, sample.end_feed_mm_per_s, sample.tick));
        self.last = *sample;
        if sample.tick - from >= self.per_rough {
            self.row()?;
        }
        Ok(())
    }

    /// Ends the file, with the rough period in which the run ended.
    ///
    /// # Errors
    /// The last row cannot be written, or the file cannot take its name. What [`RoughCsv::sample`] has told is not told again.
    pub fn finish(mut self) -> Result<(), RecordError> {
        if self.from.is_some_and(|(_, _, from)| self.last.tick > from) {
            self.row()?;
        }
        if self.failed {
            return Ok(());
        }
        self.out.finish_record("rough")
    }

    /// The row of what lies between where the rough period began and the last sample.
    fn row(&mut self) -> Result<(), RecordError> {
        let command = self.last.command;
        let end_feed = self.last.end_feed_mm_per_s;
        let tick = self.last.tick;
        let Some((from, start_feed, since)) = self.from.replace((command, end_feed, tick)) else {
            return Ok(());
        };
        if self.failed {
            return Ok(());
        }
        let way = command - from;
        let mut row = vec![TraceCsv::t_s(since, self.period_s).to_string()];
        row.extend((0..self.axes.count()).map(|axis| {
            let turns = if self.axes.is_rotary(axis) {
                360.0 / TAU
            } else {
                1.0
            };
            format!("{:.12}", way[axis] * turns)
        }));
        row.push(format!("{start_feed:.12},{end_feed:.12}"));
        let written = writeln!(self.out, "{}", row.join(","));
        written.map_err(|error| {
            self.failed = true;
            RecordError::of("rough", &mut self.out, error).at(&self.last)
        })
    }
}
