//! Live progress on a terminal: state, line, feed, override, time left. Quiet in a pipe.

use std::f64::consts::PI;
use std::io::{IsTerminal, Write, stderr};
use std::time::{Duration, Instant};

use tandem_rings::{MachineState, Sample, StopCause};

/// How often the line is written.
const EVERY: Duration = Duration::from_millis(100);

/// Writes one line over and over.
pub struct Progress {
    shown: Instant,
    started: Instant,
    active: bool,
    /// Path length of the whole program, mm.
    length_mm: f64,
    driven_mm: f64,
    period_s: f64,
    /// Samples so far.
    samples: u64,
    /// Those of them in which the machine did not hold: a hold says nothing of how long the rest of the path takes.
    samples_on_the_way: u64,
}

impl Progress {
    /// Shows itself only where standard error is a terminal.
    pub fn new(length_mm: f64, period_s: f64) -> Self {
        let now = Instant::now();
        Self {
            shown: now,
            started: now,
            active: stderr().is_terminal(),
            length_mm,
            driven_mm: 0.0,
            period_s,
            samples: 0,
            samples_on_the_way: 0,
        }
    }

    /// A sample was sent.
    pub fn sample(&mut self, sample: &Sample) {
        self.driven_mm += sample.feed_mm_per_s * self.period_s;
        self.samples += 1;
        self.samples_on_the_way += u64::from(sample.state != MachineState::Holding);
        if self.active && sample.tick.is_multiple_of(64) && self.shown.elapsed() >= EVERY {
            self.shown = Instant::now();
            self.show(sample);
        }
    }

    /// Clears the line.
    pub fn finish(&self) {
        if self.active {
            let _ = write!(stderr(), "\r\x1b[K");
        }
    }

    /// Share of the program's path that is driven, 0 to 1.
    pub fn share(&self) -> f64 {
        if self.length_mm > 0.0 {
            (self.driven_mm / self.length_mm).clamp(0.0, 1.0)
        } else {
            1.0
        }
    }

    /// How long the rest of the path takes, s, at the pace of the `elapsed_s` so far, holds left out.
    fn left_s(&self, elapsed_s: f64) -> f64 {
        let on_the_way = self.samples_on_the_way as f64 / self.samples.max(1) as f64;
        elapsed_s * on_the_way * (1.0 / self.share().max(1e-9) - 1.0)
    }

    fn show(&self, sample: &Sample) {
        let share = self.share();
        let left_s = self.left_s(self.started.elapsed().as_secs_f64());
        let feed = sample.feed_mm_per_s * 60.0;
        let _ = write!(
            stderr(),
            "\r\x1b[K{}  line {}  F{feed:.0}  override {:.0} %  done {:.0} %, {left_s:.0} s left",
            state(sample),
            sample.line,
            sample.ratio * 100.0,
            share * 100.0
        );
        let _ = stderr().flush();
    }
}

/// What the machine does; what it waits for where that is the spindle.
fn state(sample: &Sample) -> String {
    let rpm = |rad_per_s: f64| rad_per_s.abs() * 30.0 / PI;
    match sample.cause {
        StopCause::Spindle => {
            let turns = rpm(sample.spindle_rad_per_s);
            let told = rpm(sample.switched.spindle_rad_per_s);
            format!("waits for the spindle: {turns:.0} of {told:.0} rpm")
        }
        _ => sample.state.name().to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half the path is driven in 5 s; a hold of 55 s behind it does not make the other half any longer.
    #[test]
    fn a_hold_does_not_count_as_time_that_the_path_takes() {
        let mut progress = Progress::new(100.0, 0.01);
        for tick in 0..6000 {
            let (state, feed_mm_per_s) = if tick < 500 {
                (MachineState::Running, 10.0)
            } else {
                (MachineState::Holding, 0.0)
            };
            progress.sample(&Sample {
                tick,
                state,
                feed_mm_per_s,
                ..Sample::default()
            });
        }
        assert!(
            (progress.left_s(60.0) - 5.0).abs() < 1e-9,
            "{}",
            progress.left_s(60.0)
        );
    }
}
