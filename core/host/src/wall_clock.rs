//! The fine loop on a thread of its own with absolute deadlines; the rough loop on the caller's.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use rustix::thread::{ClockId, clock_nanosleep_absolute};
use rustix::time::{Timespec, clock_gettime};
use tandem_fine::FineLoop;

use crate::error::HostError;
use crate::pump::Pump;

const NS_PER_S: i64 = 1_000_000_000;

/// What the clock saw.
#[derive(Clone, Copy, Debug, Default)]
pub struct Timing {
    /// Periods whose work went past the next deadline.
    pub overruns: u64,
}

/// Drives the run to its end in real time; gives the fine loop back.
pub fn drive(pump: &mut Pump<'_>, fine: FineLoop, periods: Periods) -> Result<(FineLoop, Timing), HostError> {
    fill_first(pump);
    let over = Arc::new(AtomicBool::new(false));
    let thread = spawn(fine, periods, Arc::clone(&over))?;
    while !over.load(Ordering::Acquire) {
        pump.step();
        pump.drain();
        pump.serve_stop();
        thread::sleep(Duration::from_nanos(periods.rough_ns.unsigned_abs()));
    }
    let joined = thread.join().map_err(|_| HostError::System("the fine loop panicked".to_string()));
    pump.drain();
    joined
}

/// The periods of both loops.
#[derive(Clone, Copy, Debug)]
pub struct Periods {
    /// Rough period, ns.
    pub rough_ns: i64,
    /// Fine period, ns.
    pub fine_ns: i64,
    /// Missed periods above which the machine faults.
    pub max_missed: u64,
}

/// Fills the queue before the first fine period, so that its first tick is the first tick on either clock.
fn fill_first(pump: &mut Pump<'_>) {
    pump.step();
}

fn spawn(
    mut fine: FineLoop,
    periods: Periods,
    over: Arc<AtomicBool>,
) -> Result<thread::JoinHandle<(FineLoop, Timing)>, HostError> {
    let work = move || {
        let timing = run_fine(&mut fine, periods);
        over.store(true, Ordering::Release);
        (fine, timing)
    };
    let builder = thread::Builder::new().name("tandem-fine".to_string());
    builder.spawn(work).map_err(|e| HostError::System(format!("the fine thread cannot be started: {e}")))
}

/// One sample a period. After a stall the deadlines shift by whole periods: no burst, no period with two samples.
fn run_fine(fine: &mut FineLoop, periods: Periods) -> Timing {
    let mut timing = Timing::default();
    let mut deadline_ns = now_ns();
    while !fine.is_over() {
        fine.tick();
        deadline_ns += periods.fine_ns;
        let late_ns = now_ns() - deadline_ns;
        if late_ns > 0 {
            timing.overruns += 1;
            let missed = late_ns / periods.fine_ns;
            if missed > 0 {
                fine.missed(missed.unsigned_abs(), periods.max_missed);
                deadline_ns += missed * periods.fine_ns;
            }
        }
        sleep_until(deadline_ns);
    }
    timing
}

fn now_ns() -> i64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec * NS_PER_S + now.tv_nsec
}

fn sleep_until(deadline_ns: i64) {
    let deadline = Timespec { tv_sec: deadline_ns / NS_PER_S, tv_nsec: deadline_ns % NS_PER_S };
    // A signal ends the sleep early: then the rest of it follows.
    while clock_nanosleep_absolute(ClockId::Monotonic, &deadline).is_err() {}
}
