//! What a script is told of a rough period.

use tandem_sdk::AxisVector;

use crate::abi::{period as at, put_f64, put_u32};

/// Means over the fine periods of a rough period. NaN where there is nothing to tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Period {
    /// Line of the part program that moved last.
    pub line: u32,
    /// Number of the rough period.
    pub period: u64,
    /// Duration, s.
    pub duration_s: f64,
    /// Path speed commanded, mm/s.
    pub feed_mm_per_s: f64,
    /// Programmed feed, mm/s; infinite in a rapid.
    pub programmed_feed_mm_per_s: f64,
    /// Distance between command and feedback, mean over what was heard anew, mm; not a number where that is nothing.
    pub following_error_mm: f64,
    /// The same, its largest, mm.
    pub max_following_error_mm: f64,
    /// Estimated cutting torque, N·m.
    pub cutting_torque_nm: f64,
    /// Its reference, N·m.
    pub reference_torque_nm: f64,
    /// Spindle load, 1 at full load.
    pub spindle_load: f64,
    /// Spindle speed measured, rad/s.
    pub spindle_rad_per_s: f64,
    /// Length still to be driven, mm.
    pub distance_left_mm: f64,
    /// Ratio of the feed strategy; 1 where there is none.
    pub strategy_ratio: f64,
    /// Magnitude of the motor currents, A.
    pub current_a: AxisVector,
}

impl Default for Period {
    fn default() -> Self {
        Self {
            line: 0,
            period: 0,
            duration_s: 0.0,
            feed_mm_per_s: 0.0,
            programmed_feed_mm_per_s: 0.0,
            following_error_mm: 0.0,
            max_following_error_mm: 0.0,
            cutting_torque_nm: f64::NAN,
            reference_torque_nm: f64::NAN,
            spindle_load: f64::NAN,
            spindle_rad_per_s: 0.0,
            distance_left_mm: 0.0,
            strategy_ratio: 1.0,
            current_a: AxisVector::ZERO,
        }
    }
}

impl Period {
    /// The bytes that cross into the script; `ratio` is what it asked for last.
    pub(crate) fn bytes(&self, ratio: f64) -> [u8; at::BYTES] {
        let mut bytes = [0; at::BYTES];
        put_u32(&mut bytes, at::SIZE, at::BYTES as u32);
        put_u32(&mut bytes, at::LINE, self.line);
        bytes[at::PERIOD..at::PERIOD + 8].copy_from_slice(&self.period.to_le_bytes());
        let numbers = [
            (at::DURATION, self.duration_s),
            (at::FEED, self.feed_mm_per_s),
            (at::PROGRAMMED_FEED, self.programmed_feed_mm_per_s),
            (at::FOLLOWING_ERROR, self.following_error_mm),
            (at::MAX_FOLLOWING_ERROR, self.max_following_error_mm),
            (at::CUTTING_TORQUE, self.cutting_torque_nm),
            (at::REFERENCE_TORQUE, self.reference_torque_nm),
            (at::SPINDLE_LOAD, self.spindle_load),
            (at::SPINDLE, self.spindle_rad_per_s),
            (at::DISTANCE_LEFT, self.distance_left_mm),
            (at::RATIO, ratio),
            (at::STRATEGY_RATIO, self.strategy_ratio),
        ];
        for (place, number) in numbers {
            put_f64(&mut bytes, place, number);
        }
        for (axis, current_a) in self.current_a.0.iter().enumerate() {
            put_f64(&mut bytes, at::CURRENT + 8 * axis, *current_a);
        }
        bytes
    }
}
