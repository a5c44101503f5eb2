//! How much program time must be queued so that the machine can stop within it.

use crate::window::SlidingMax;
use tandem_rings::{STOP_JERK_SHARE, STOP_SHARE};
use tandem_sdk::{Segment, SegmentFlags};

/// The worst stop over what is queued.
#[derive(Debug)]
pub struct QueueDepth {
    /// Path speeds, mm/s.
    speeds: SlidingMax,
    /// Negative stop decelerations, mm/s²: their largest is the smallest deceleration.
    decelerations: SlidingMax,
    /// Times in which the deceleration is built up, s.
    ramps: SlidingMax,
    rough_period_s: f64,
    factor: f64,
}

impl QueueDepth {
    /// Nothing queued. `factor` is the share of the worst stop that is asked for, 1 but in tests.
    pub fn new(rough_period_s: f64, factor: f64) -> Self {
        Self {
            speeds: SlidingMax::default(),
            decelerations: SlidingMax::default(),
            ramps: SlidingMax::default(),
            rough_period_s,
            factor,
        }
    }

    /// Nothing is queued any more.
    pub fn clear(&mut self) {
        *self = Self::new(self.rough_period_s, self.factor);
    }

    /// A segment has been queued that ends at `until_s`.
    pub fn push(&mut self, segment: &Segment, until_s: f64) {
        if segment.flags.contains(SegmentFlags::DWELL) || segment.duration_s == 0.0 {
            return;
        }
        let speed = segment.path_speed_mm_per_s(0.0).max(segment.path_speed_mm_per_s(segment.duration_s));
        self.speeds.push(speed, until_s);
        self.decelerations.push(-segment.stop_deceleration_mm_per_s2, until_s);
        // Without a jerk limit both bounds are infinite.
        let ramp_s = segment.max_sigma_rate_per_s / segment.max_sigma_acceleration_per_s2;
        if ramp_s > 0.0 {
            self.ramps.push(ramp_s, until_s);
        }
    }

    /// The fine loop has come to `now_s`.
    pub fn passed(&mut self, now_s: f64) {
        self.speeds.forget(now_s);
        self.decelerations.forget(now_s);
        self.ramps.forget(now_s);
    }

    /// Smallest stop deceleration queued, mm/s²; infinite where nothing moves.
    pub fn stop_deceleration_mm_per_s2(&self) -> f64 {
        self.decelerations.max().map_or(f64::INFINITY, |negative| -negative)
    }

    /// Longest time in which a deceleration queued is built up, s.
    pub fn stop_ramp_s(&self) -> f64 {
        self.ramps.max().unwrap_or(0.0)
    }

    /// Program time that must be queued, s: the worst stop `v/a_s + a_s/J` and two rough periods.
    pub fn required_s(&self) -> f64 {
        let worst_s = self.speeds.max().map_or(0.0, |v| v / (STOP_SHARE * self.stop_deceleration_mm_per_s2()));
        self.factor * (worst_s + self.stop_ramp_s() / STOP_JERK_SHARE) + 2.0 * self.rough_period_s
    }
}
