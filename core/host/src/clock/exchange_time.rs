//! How long a driver's exchange takes, on the wall clock.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;

use tandem_recorder::ExchangeUs;
use tandem_sdk::{
    Attached, Driver, DriverContext, DriverDescription, Feedback, PluginError, Setpoint, Words,
};

use crate::clock::wall_clock::now_ns;

/// What was measured, shared with who reads it.
#[derive(Debug, Default)]
pub struct ExchangeTimes {
    /// Whether to measure: the virtual clock has no time to take.
    pub measures: AtomicBool,
    longest_ns: AtomicU64,
    longer_than_period: AtomicU64,
}

impl ExchangeTimes {
    /// What was measured.
    pub fn read(&self) -> ExchangeUs {
        let max = self.longest_ns.load(Relaxed) as f64 / 1e3;
        ExchangeUs {
            max,
            longer_than_period: self.longer_than_period.load(Relaxed),
        }
    }
}

/// A driver with its drives claimed, measured. Where a run ends before it has begun, and nobody stops it, it is stopped.
pub struct Timed {
    driver: Box<dyn Driver>,
    times: Arc<ExchangeTimes>,
    period_ns: u64,
    is_stopped: bool,
}

impl Timed {
    /// `driver`, whose exchange has `fine_period_s`.
    pub fn new(driver: Box<dyn Driver>, fine_period_s: f64, times: Arc<ExchangeTimes>) -> Self {
        Self {
            driver,
            times,
            period_ns: (fine_period_s * 1e9).round() as u64,
            is_stopped: false,
        }
    }
}

impl Driver for Timed {
    fn describe(&self) -> DriverDescription {
        self.driver.describe()
    }

    fn check(&self, context: &DriverContext) -> Result<(), PluginError> {
        self.driver.check(context)
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        self.driver.open(context)
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        self.is_stopped = false;
        self.driver.start()
    }

    fn send(&mut self, setpoint: &Setpoint) -> bool {
        self.driver.send(setpoint)
    }

    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        if !self.times.measures.load(Relaxed) {
            return self.driver.exchange(setpoint, feedback);
        }
        let began_ns = now_ns();
        let answer = self.driver.exchange(setpoint, feedback);
        let took_ns = (now_ns() - began_ns).unsigned_abs();
        self.times.longest_ns.fetch_max(took_ns, Relaxed);
        self.times
            .longer_than_period
            .fetch_add(u64::from(took_ns > self.period_ns), Relaxed);
        answer
    }

    fn quick_stop(&mut self) {
        self.driver.quick_stop();
    }

    fn stop(&mut self) -> Result<(), PluginError> {
        self.is_stopped = true;
        self.driver.stop()
    }

    fn explain(&self, joint: u32, code: u32) -> Words {
        self.driver.explain(joint, code)
    }
}

impl Drop for Timed {
    fn drop(&mut self) {
        if !self.is_stopped {
            // What ended the run is told; that the drives could not be let go of either would hide it.
            let _ = self.driver.stop();
        }
    }
}
