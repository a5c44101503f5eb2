//! Floating-point atomics, and how far the queue reaches.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// An `f64` in an atomic.
#[derive(Debug, Default)]
pub struct AtomicF64(AtomicU64);

impl AtomicF64 {
    /// An atomic with a value.
    pub fn new(value: f64) -> Self {
        Self(AtomicU64::new(value.to_bits()))
    }

    /// The value. What was written before the store is visible.
    pub fn load(&self) -> f64 {
        f64::from_bits(self.0.load(Ordering::Acquire))
    }

    /// Stores `value`.
    pub fn store(&self, value: f64) {
        self.0.store(value.to_bits(), Ordering::Release);
    }
}

/// Share of the declared stop deceleration that both loops count on: the governor stays inside the limits, and it acts
/// from the next period on.
pub const STOP_SHARE: f64 = 0.95;

/// Share of the jerk that both loops count on for a stop: turning, and the plan's own jerk, take what they need.
pub const STOP_JERK_SHARE: f64 = 0.8;

/// How far the queue reaches, and what it takes to stop within it. Written by the rough loop after each push.
///
/// The fields are stored in the order in which the fine loop may safely see them: first the stop that the new segments
/// ask for, then the new wall.
#[derive(Debug)]
pub struct Depth {
    /// Smallest path deceleration that the queued segments leave, mm/s².
    pub stop_deceleration_mm_per_s2: AtomicF64,
    /// Longest stop of any queued segment from its own speed with its own deceleration, s of program time: a bound on every
    /// stop where speeds and decelerations of the queue differ by much; infinite where nothing moves.
    pub stop_s: AtomicF64,
    /// Longest time in which that deceleration can be built up, s; zero where no jerk limit is kept.
    pub stop_ramp_s: AtomicF64,
    /// Program time at which the queue ends; infinite where it ends at rest.
    pub wall_s: AtomicF64,
    /// Program time that must lie before the wall for motion to start (or start again), s: the worst stop; zero where the
    /// end of the stream is queued or the ring is full.
    pub required_s: AtomicF64,
    /// Epoch that the other fields are about; stored behind them when an epoch begins.
    pub epoch: AtomicU32,
}

impl Depth {
    /// Begins `epoch` at program time `now_s`: nothing is queued yet. Rough loop.
    pub fn begin(&self, epoch: u32, now_s: f64) {
        self.required_s.store(f64::INFINITY);
        self.stop_deceleration_mm_per_s2.store(f64::INFINITY);
        self.stop_s.store(f64::INFINITY);
        self.stop_ramp_s.store(0.0);
        self.wall_s.store(now_s);
        self.epoch.store(epoch, Ordering::Release);
    }

    /// Whether the fields are about `epoch`. Fine loop.
    pub fn is_of(&self, epoch: u32) -> bool {
        self.epoch.load(Ordering::Acquire) == epoch
    }

    /// Whether motion may start at program time `now_s`.
    pub fn may_start(&self, now_s: f64) -> bool {
        let required_s = self.required_s.load();
        required_s.is_finite() && self.wall_s.load() - now_s >= required_s
    }
}

impl Default for Depth {
    /// An empty queue: a wall at the start.
    fn default() -> Self {
        Self {
            stop_deceleration_mm_per_s2: AtomicF64::new(f64::INFINITY),
            stop_s: AtomicF64::new(f64::INFINITY),
            stop_ramp_s: AtomicF64::new(0.0),
            wall_s: AtomicF64::new(0.0),
            required_s: AtomicF64::new(f64::INFINITY),
            epoch: AtomicU32::new(0),
        }
    }
}
