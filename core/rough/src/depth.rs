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
    /// Stops of each segment from its own speed with its own deceleration, s.
    stops: SlidingMax,
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
            stops: SlidingMax::default(),
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
        let at = |share: f64| segment.path_speed_mm_per_s(share * segment.duration_s);
        let speed = at(0.0).max(at(0.5)).max(at(1.0));
        self.speeds.push(speed, until_s);
        self.decelerations.push(-segment.stop_deceleration_mm_per_s2, until_s);
        if speed > 0.0 {
            self.stops.push(speed / segment.stop_deceleration_mm_per_s2, until_s);
        }
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
        self.stops.forget(now_s);
        self.ramps.forget(now_s);
    }

    /// Smallest stop deceleration queued, mm/s²; infinite where nothing moves.
    pub fn stop_deceleration_mm_per_s2(&self) -> f64 {
        self.decelerations.max().map_or(f64::INFINITY, |negative| -negative)
    }

    /// Longest stop of a segment queued from its own speed with its own deceleration, s. On its path program time slows at
    /// `a_s/v` at most, so no stop from full rate takes longer, whatever speeds and decelerations the others have. Infinite
    /// where nothing moves.
    pub fn stop_s(&self) -> f64 {
        self.stops.max().unwrap_or(f64::INFINITY)
    }

    /// Longest time in which a deceleration queued is built up, s.
    pub fn stop_ramp_s(&self) -> f64 {
        self.ramps.max().unwrap_or(0.0)
    }

    /// Program time that must be queued, s: the worst stop `v/a_s + a_s/J` and two rough periods. Of highest speed over least
    /// deceleration and the longest of single segments the shorter one counts.
    pub fn required_s(&self) -> f64 {
        let worst_s = self.speeds.max().map_or(0.0, |v| v / self.stop_deceleration_mm_per_s2());
        let worst_s = worst_s.min(self.stop_s()) / STOP_SHARE;
        self.factor * (worst_s + self.stop_ramp_s() / STOP_JERK_SHARE) + 2.0 * self.rough_period_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::AxisVector;

    /// A segment of 1 s at this speed, mm/s, that leaves this deceleration, mm/s².
    fn level(speed: f64, deceleration: f64) -> Segment {
        let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
        segment.path[1] = speed;
        segment.stop_deceleration_mm_per_s2 = deceleration;
        segment
    }

    #[test]
    fn the_worst_stop_of_equal_segments_is_speed_over_deceleration() {
        let mut depth = QueueDepth::new(0.01, 1.0);
        depth.push(&level(50.0, 100.0), 1.0);
        depth.push(&level(20.0, 100.0), 2.0);
        assert!((depth.required_s() - (0.5 / STOP_SHARE + 0.02)).abs() < 1e-12);
    }

    #[test]
    fn a_slow_segment_that_leaves_little_does_not_lengthen_the_stop_of_a_fast_one() {
        let mut depth = QueueDepth::new(0.01, 1.0);
        depth.push(&level(50.0, 1000.0), 1.0);
        depth.push(&level(0.004, 0.05), 2.0);
        assert!((depth.required_s() - (0.08 / STOP_SHARE + 0.02)).abs() < 1e-12);
        depth.passed(1.5);
        assert!((depth.required_s() - (0.08 / STOP_SHARE + 0.02)).abs() < 1e-12);
    }
}
