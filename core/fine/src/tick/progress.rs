//! Progress of program time: where nothing is asked to stop, it gets on, or the machine faults.
//!
//! In any window of [`Progress::max_periods`] fine periods in which nothing asks for a stop, the queue is not starved and
//! something is queued, program time grows by at least one fine period at the least rate that was asked for in the window, or a
//! rest further on is reached: blocks of far less than a period that each end at rest take one period each, however short they are.
//! The window is derived from the machine: from rest an axis is at its highest speed V after `V/A + A/J`. At half the rate
//! the plan itself takes a quarter of the acceleration and an eighth of the jerk at most, so that what is left brings σ up in
//! four times that, and by then far more than one period of program time has passed.

use super::govern::Ask;
use crate::config::FineConfig;
use crate::cursor::{Cursor, Reached};
use crate::fault::FaultKind;

/// How many times the longest way of an axis from rest to its highest speed a window lasts.
const WINDOW: f64 = 4.0;
/// Periods beside that: in the first 16 a jerk limit lets σ change by hundredths only, whatever the axes could.
const FIRST_PERIODS: f64 = 32.0;

/// An override or a ratio below it is as good as 0, and a rate of program time that is none: a period of it is the rounding of a day of program time.
const NO_RATE: f64 = 1e-8;

/// What has passed since progress was last made.
#[derive(Debug)]
pub(super) struct Progress {
    max_periods: u64,
    periods: u64,
    /// Program time when the window began, s.
    from_s: f64,
    /// Program time after the last period, s.
    last_s: f64,
    /// Least rate asked for in the window.
    asked: f64,
}

impl Progress {
    /// A window that has just begun. Host.
    pub(super) fn new(config: &FineConfig) -> Self {
        let longest_s =
            config.limits.axes[..config.lane_count()]
                .iter()
                .fold(0.0, |most: f64, axis| {
                    let build_up_s = if config.order >= 3 {
                        axis.acceleration_mm_per_s2 / axis.jerk_mm_per_s3
                    } else {
                        0.0
                    };
                    most.max(
                        axis.feed_mm_per_s.max(axis.rapid_mm_per_s) / axis.acceleration_mm_per_s2
                            + build_up_s,
                    )
                });
        let max_periods = (WINDOW * longest_s / config.period_s + FIRST_PERIODS).ceil() as u64;
        Self {
            max_periods,
            periods: 0,
            from_s: 0.0,
            last_s: 0.0,
            asked: 1.0,
        }
    }

    /// The least rate that was asked for in a period.
    pub(super) fn ask(&mut self, rate: f64) {
        self.asked = self.asked.min(rate);
    }

    fn begin(&mut self, now_s: f64) {
        (self.periods, self.from_s, self.asked) = (0, now_s, 1.0);
    }

    /// After a move that `reached` something: program time has got on, or nothing asks for it, or that is the fault given. It is
    /// to get on at a rate of `least_ratio`, the lower one of those for feeds and rapids.
    #[inline]
    pub(super) fn watch(
        &mut self,
        cursor: &Cursor,
        ask: Ask,
        reached: Reached,
        period_s: f64,
        least_ratio: impl FnOnce() -> f64,
    ) -> Option<FaultKind> {
        let now_s = cursor.program_time_s();
        let grown_s = now_s - self.from_s;
        let min_s = self.asked * period_s;
        let is_at_next_rest = reached == Reached::Rest && now_s > self.last_s;
        self.last_s = now_s;
        // What is true nearly always is looked at first.
        if grown_s > min_s
            || is_at_next_rest
            || ask != Ask::Run
            || least_ratio() < NO_RATE
            || (reached == Reached::Rest && cursor.is_last())
        {
            self.begin(now_s);
            return None;
        }
        self.periods += 1;
        (self.periods > self.max_periods).then_some(FaultKind::NoProgress {
            periods: self.periods,
            grown_s,
            asked: self.asked,
        })
    }
}
