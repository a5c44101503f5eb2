//! The period runner with an empty body: what this computer can keep.

use std::thread;
use std::time::Duration;

use tandem_machine::FineThread;
use tandem_recorder::PageFaults;

use crate::clock::periods::{Body, Timing};
use crate::clock::wall_clock::TimedThread;
use crate::error::HostError;

/// What was measured.
#[derive(Debug)]
pub struct Latency {
    /// What the clock saw.
    pub timing: Timing,
    /// Page faults of the thread meanwhile.
    pub page_faults: PageFaults,
    /// What was not granted, in words.
    pub notes: Vec<String>,
}

/// Lets the fine loop's thread run for `periods` of `period` with nothing to do in them. Host; takes that long.
///
/// # Errors
/// The thread cannot be started.
pub fn measure_latency(period: Duration, periods: u64) -> Result<Latency, HostError> {
    let period_ns = i64::try_from(period.as_nanos()).unwrap_or(i64::MAX).max(1);
    let thread = TimedThread::start(Empty { left: periods }, period_ns, FineThread::default())?;
    let notes = thread.notes.clone();
    while !thread.is_over() {
        thread::sleep(Duration::from_millis(20));
    }
    let timed = thread.join()?;
    Ok(Latency {
        timing: timed.timing,
        page_faults: timed.page_faults,
        notes,
    })
}

struct Empty {
    /// Periods to go, missed ones among them.
    left: u64,
}

impl Body for Empty {
    fn is_over(&self) -> bool {
        self.left == 0
    }

    fn period(&mut self) {
        self.left = self.left.saturating_sub(1);
    }

    fn missed(&mut self, periods: u64, _in_a_row: u64) {
        self.left = self.left.saturating_sub(periods);
    }
}
