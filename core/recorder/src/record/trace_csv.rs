//! The trace: one row a fine period, 17 significant digits.

use std::f64::consts::TAU;
use std::io::Write;
use std::path::Path;

use tandem_machine::Machine;
use tandem_rings::{Sample, Switched};
use tandem_sdk::{Axes, MAX_AXES};

use super::output::{Output, RecordError};

/// Writes a trace CSV.
pub struct TraceCsv {
    out: Output,
    axes: Axes,
    period_s: f64,
    /// How many of [`SWITCHED_COLUMNS`] there are.
    switched: usize,
    /// It has been told that no further row can be written.
    failed: bool,
}

impl TraceCsv {
    /// Starts the file with its head line.
    ///
    /// # Errors
    /// The path with the system's words.
    pub fn create(path: &Path, machine: &Machine, signals: &[&str]) -> Result<Self, String> {
        let switched = SWITCHED_COLUMNS.len();
        Self::of_axes(path, machine.axes, machine.fine_period_s, signals, switched)
    }

    /// Starts the file with its head line, for a machine of which only axes and fine period are known. `switched` is how many
    /// of the first [`SWITCHED_COLUMNS`] are known: none, what is switched and the phase, or the age of feedback too.
    ///
    /// # Errors
    /// The path with the system's words.
    pub fn of_axes(
        path: &Path,
        axes: Axes,
        fine_period_s: f64,
        signals: &[&str],
        switched: usize,
    ) -> Result<Self, String> {
        let mut out = Output::create(path)?;
        let head = head(&axes, signals, switched);
        writeln!(out, "{head}").map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(Self {
            out,
            axes,
            period_s: fine_period_s,
            switched,
            failed: false,
        })
    }

    /// Adds a row. After an error all further ones are left out.
    ///
    /// # Errors
    /// Once: no further row can be written.
    pub fn sample(&mut self, sample: &Sample, signals: &[f64]) -> Result<(), RecordError> {
        if self.failed {
            return Ok(());
        }
        self.row(sample, signals).map_err(|error| {
            self.failed = true;
            RecordError::of("trace", &mut self.out, error).at(sample)
        })
    }

    /// Ends the file.
    ///
    /// # Errors
    /// The last rows cannot be written, or the file cannot take its name. What [`TraceCsv::sample`] has told is not told
    /// again.
    pub fn finish(self) -> Result<(), RecordError> {
        if self.failed {
            Ok(())
        } else {
            self.out.finish_record("trace")
        }
    }

    /// No further row comes: what is written stays beside the file that it does not become.
    pub fn give_up(mut self) {
        self.out.keep();
        // What cannot be written is not tried once more.
        let _ = self.out.close();
    }

    /// The time at which a tick stands in the trace, s.
    pub fn t_s(tick: u64, fine_period_s: f64) -> f64 {
        // A whole number of periods divided by a round number of periods a second keeps t_s free of rounding dust.
        tick as f64 / (1.0 / fine_period_s).round_if_close()
    }

    fn row(&mut self, sample: &Sample, signals: &[f64]) -> std::io::Result<()> {
        write!(
            self.out,
            "{},{}",
            number(Self::t_s(sample.tick, self.period_s)),
            sample.line
        )?;
        for position in [&sample.command, &sample.feedback] {
            for axis in 0..self.axes.count() {
                let value = if self.axes.is_rotary(axis) {
                    position[axis].to_degrees()
                } else {
                    position[axis]
                };
                write!(self.out, ",{}", number(value))?;
            }
        }
        write!(
            self.out,
            ",{},{}",
            number(sample.feed_mm_per_s),
            number(sample.sigma)
        )?;
        write!(
            self.out,
            ",{},{}",
            sample.state.name(),
            number(sample.ratio)
        )?;
        if self.switched > 0 {
            self.switched(sample)?;
        }
        for signal in signals {
            write!(self.out, ",{}", number(*signal))?;
        }
        writeln!(self.out)
    }

    fn switched(&mut self, sample: &Sample) -> std::io::Result<()> {
        let (switched, rpm) = (&sample.switched, rpm(sample.switched.spindle_rad_per_s));
        write!(
            self.out,
            ",{},{},{}",
            number(rpm),
            switched.coolant(),
            outputs_word(switched)
        )?;
        match sample.phase_ns {
            Some(ns) => write!(self.out, ",{ns}"),
            None => write!(self.out, ",nan"),
        }?;
        if self.switched == SWITCHED_COLUMNS.len() {
            write!(self.out, ",{}", age(sample))?;
        }
        Ok(())
    }
}

/// Speed in 1/min of one in rad/s.
pub fn rpm(rad_per_s: f64) -> f64 {
    rad_per_s * 60.0 / TAU
}

/// Outputs of the user as a CSV has them: hexadecimal, for a number of 62 bits is more than tables of numbers keep.
pub fn outputs_word(switched: &Switched) -> String {
    format!("{:#x}", switched.user_outputs())
}

/// How old the oldest feedback of an axis was, periods.
pub fn age(sample: &Sample) -> u32 {
    // What is true nearly always is looked at first.
    if sample.age_periods == [0; MAX_AXES] {
        return 0;
    }
    sample.age_periods.iter().copied().max().unwrap_or(0)
}

/// Names of the columns of what is switched, of the phase, and of the age of feedback.
pub const SWITCHED_COLUMNS: [&str; 5] = [
    "spindle_set_rpm",
    "coolant",
    "outputs",
    "phase_ns",
    "fb_age_periods",
];

fn head(axes: &Axes, signals: &[&str], switched: usize) -> String {
    let mut head = vec!["t_s".to_string(), "line".to_string()];
    for kind in ["cmd", "fb"] {
        for axis in 0..axes.count() {
            let unit = if axes.is_rotary(axis) { "deg" } else { "mm" };
            head.push(format!(
                "{}_{kind}_{unit}",
                axes.letter(axis).to_ascii_lowercase()
            ));
        }
    }
    head.extend(["feed_mm_s", "sigma", "state", "ratio"].map(str::to_string));
    head.extend(
        SWITCHED_COLUMNS
            .iter()
            .take(switched)
            .map(ToString::to_string),
    );
    head.extend(signals.iter().map(|signal| format!("sig_{signal}")));
    head.join(",")
}

/// 17 significant digits: reading it back gives the same number.
fn number(value: f64) -> String {
    if value == 0.0 {
        "0".to_string()
    } else {
        format!("{value:.16e}")
    }
}

pub(super) trait RoundIfClose {
    /// The nearest whole number where it is within rounding, else the number itself.
    fn round_if_close(self) -> f64;
}

impl RoundIfClose for f64 {
    fn round_if_close(self) -> f64 {
        let whole = self.round();
        if (self - whole).abs() <= 1e-9 * whole.abs() {
            whole
        } else {
            self
        }
    }
}
