//! Floating-point atomics, and how far the queue reaches.

use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

/// An `f64` in an atomic.
#[derive(Debug, Default)]
pub struct AtomicF64(AtomicU64);

impl AtomicF64 {
    /// An atomic with a value.
    pub fn new(value: f64) -> Self {
        Self(AtomicU64::new(value.to_bits()))
    }

    /// The value. What was written before the store is visible.
    #[inline]
    pub fn load(&self) -> f64 {
        f64::from_bits(self.0.load(Ordering::Acquire))
    }

    /// Stores `value`.
    #[inline]
    pub fn store(&self, value: f64) {
        self.0.store(value.to_bits(), Ordering::Release);
    }
}

/// Share of the declared stop deceleration that both loops count on: the governor stays inside the limits, and it acts
/// from the next period on.
pub const STOP_SHARE: f64 = 0.95;

/// Share of the jerk that both loops count on for a stop: turning, and the plan's own jerk, take what they need.
pub const STOP_JERK_SHARE: f64 = 0.8;

/// Share of the jerk limit that a change of the rate has at least, where the plan uses all of it: without any it would never leave a
/// rest there, and a stop would never begin. The one tolerance on jerk covers it.
pub const MIN_JERK_SHARE: f64 = 0.006;

/// Most entries of the ring that the fine loop looks at in one period, whatever the period.
pub const MAX_ENTRIES: usize = 250;

/// Entries of the ring that the fine loop comes past in one period at most: each may be a cache miss and takes up to a
/// tenth of a µs for every axis, and a period of 1 ms has time for 250.
pub fn max_entries_a_period(fine_period_s: f64) -> usize {
    const FEWEST: f64 = 60.0;
    const PER_S: f64 = 250_000.0;
    (fine_period_s * PER_S).clamp(FEWEST, MAX_ENTRIES as f64) as usize
}

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
    /// Longest time in which that deceleration is built up, s; zero where no jerk limit is kept.
    pub build_up_s: AtomicF64,
    /// Program time at which the queue ends; infinite where it ends at rest.
    pub wall_s: AtomicF64,
    /// Program time that must lie before the wall for motion to start (or start again), s: the worst stop; zero where the
    /// end of the stream is queued or the ring is full.
    pub required_s: AtomicF64,
    /// The ring has no room for more: it gets no deeper, and what it holds may be less than the worst stop.
    pub full: AtomicBool,
    /// Highest rate of program time from which the machine comes to rest inside what the ring holds, and at which no more
    /// entries come in a fine period than the fine loop looks at; 1 where neither matters.
    pub max_rate: AtomicF64,
    /// Counts how often the rough loop has looked after the ring.
    pub served: AtomicU32,
    /// Machine time behind such a look for which `max_rate` holds without the next one, s.
    pub served_for_s: AtomicF64,
    /// Epoch that the other fields are about; stored behind them when an epoch begins.
    pub epoch: AtomicU32,
}

impl Depth {
    /// Begins `epoch` at program time `now_s`: nothing is queued yet. Rough loop.
    pub fn begin(&self, epoch: u32, now_s: f64) {
        self.required_s.store(f64::INFINITY);
        self.stop_deceleration_mm_per_s2.store(f64::INFINITY);
        self.stop_s.store(f64::INFINITY);
        self.build_up_s.store(0.0);
        self.full.store(false, Ordering::Release);
        self.max_rate.store(1.0);
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
            build_up_s: AtomicF64::new(0.0),
            wall_s: AtomicF64::new(0.0),
            required_s: AtomicF64::new(f64::INFINITY),
            full: AtomicBool::new(false),
            max_rate: AtomicF64::new(1.0),
            served: AtomicU32::new(0),
            served_for_s: AtomicF64::new(0.0),
            epoch: AtomicU32::new(0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_comes_back_as_it_was_stored() {
        for value in [0.0, -0.0, 1.5, -1e300, f64::INFINITY, f64::MIN_POSITIVE] {
            let stored = AtomicF64::new(value);
            assert_eq!(stored.load().to_bits(), value.to_bits());
            stored.store(-value);
            assert_eq!(stored.load().to_bits(), (-value).to_bits());
        }
    }

    #[test]
    fn a_period_has_time_for_entries_in_proportion_within_bounds() {
        let entries = [1e-6, 0.0004, 0.000_5, 0.001, 0.01].map(max_entries_a_period);
        assert_eq!(entries, [60, 100, 125, 250, 250]);
    }

    #[test]
    fn motion_starts_when_the_worst_stop_is_queued_and_not_before() {
        let depth = Depth::default();
        assert!(!depth.may_start(0.0), "nothing is known of the queue");
        depth.required_s.store(0.5);
        depth.wall_s.store(2.0);
        assert!(depth.may_start(1.5) && depth.may_start(0.0));
        assert!(!depth.may_start(1.6));
        depth.wall_s.store(f64::INFINITY);
        assert!(depth.may_start(1e9), "it ends at rest");
    }

    #[test]
    fn an_epoch_begins_with_an_empty_queue() {
        let depth = Depth::default();
        assert!(depth.is_of(0) && !depth.is_of(1));
        for (number, shared) in [
            &depth.stop_deceleration_mm_per_s2,
            &depth.stop_s,
            &depth.build_up_s,
            &depth.wall_s,
            &depth.required_s,
            &depth.max_rate,
        ]
        .into_iter()
        .enumerate()
        {
            shared.store(number as f64 + 0.5);
        }
        depth.full.store(true, Ordering::Release);
        depth.begin(3, 7.0);
        assert!(depth.is_of(3) && !depth.is_of(0));
        assert!(!depth.may_start(0.0), "nothing of it is queued");
        assert_eq!(depth.wall_s.load(), 7.0);
        assert_eq!((depth.max_rate.load(), depth.build_up_s.load()), (1.0, 0.0));
        let stops = [&depth.stop_deceleration_mm_per_s2, &depth.stop_s];
        assert!(stops.iter().all(|stop| stop.load() == f64::INFINITY));
        assert!(!depth.full.load(Ordering::Acquire));
    }
}
