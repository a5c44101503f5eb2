//! Live progress on a terminal: state, line, feed, override, time left. Quiet in a pipe.

use std::io::{IsTerminal, Write, stderr};
use std::time::{Duration, Instant};

use tandem_rings::Sample;

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
}

impl Progress {
    /// Shows itself only where standard error is a terminal.
    pub fn new(length_mm: f64, period_s: f64) -> Self {
        let now = Instant::now();
        Self { shown: now, started: now, active: stderr().is_terminal(), length_mm, driven_mm: 0.0, period_s }
    }

    /// A sample was sent.
    pub fn sample(&mut self, sample: &Sample) {
        self.driven_mm += sample.feed_mm_per_s * self.period_s;
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
        if self.length_mm > 0.0 { (self.driven_mm / self.length_mm).clamp(0.0, 1.0) } else { 1.0 }
    }

    fn show(&self, sample: &Sample) {
        let share = self.share();
        let left_s = self.started.elapsed().as_secs_f64() * (1.0 / share.max(1e-9) - 1.0);
        let feed = sample.feed_mm_per_s * 60.0;
        let _ = write!(
            stderr(),
            "\r\x1b[K{}  line {}  F{feed:.0}  override {:.0} %  done {:.0} %, {left_s:.0} s left",
            sample.state.name(),
            sample.line,
            sample.ratio * 100.0,
            share * 100.0
        );
        let _ = stderr().flush();
    }
}
