//! Floating-point atomics, and how far the queue reaches.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

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

/// How far the queue reaches, and what it takes to stop within it. Written by the rough loop after each push.
///
/// The fields are stored in the order in which the fine loop may safely see them: first the stop that the new segments
/// ask for, then the new wall.
#[derive(Debug)]
pub struct Depth {
    /// Smallest path deceleration that the queued segments leave, mm/s².
    pub stop_deceleration_mm_per_s2: AtomicF64,
    /// Program time at which the queue ends; infinite where it ends at rest.
    pub wall_s: AtomicF64,
    /// Motion may start (or start again): the worst stop, or the end of the stream, is queued, or the ring is full.
    pub may_start: AtomicBool,
}

impl Default for Depth {
    /// An empty queue: a wall at the start.
    fn default() -> Self {
        Self {
            stop_deceleration_mm_per_s2: AtomicF64::new(f64::INFINITY),
            wall_s: AtomicF64::new(0.0),
            may_start: AtomicBool::new(false),
        }
    }
}
