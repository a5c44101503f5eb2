//! What a script is told of a rough period.

use tandem_sdk::AxisVector;

use crate::abi::{period as at, put_f64, put_u32};
use crate::geometry::put_vector;
use crate::inputs::MAX_SCRIPT_SIGNALS;

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
    /// Position commanded at its end, mm or rad.
    pub position: AxisVector,
    /// Speed measured, mean, mm/s or rad/s.
    pub speed: AxisVector,
    /// Position commanded less measured, mean per axis, mm or rad.
    pub axis_error: AxisVector,
    /// Its largest magnitude per axis.
    pub max_axis_error: AxisVector,
    /// The signals that the script asked for, in the order of [`crate::Policy::signals`].
    pub signals: [f64; MAX_SCRIPT_SIGNALS],
    /// Rate of program time, mean.
    pub sigma: f64,
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
            position: AxisVector::ZERO,
            speed: AxisVector::ZERO,
            axis_error: AxisVector::ZERO,
            max_axis_error: AxisVector::ZERO,
            signals: [f64::NAN; MAX_SCRIPT_SIGNALS],
            sigma: 0.0,
        }
    }
}

impl Period {
    /// The bytes that cross into the script, as version 2 lays them out; version 1 is their beginning. `ratio` is what it
    /// asked for last.
    pub(crate) fn bytes(&self, ratio: f64, version: u32) -> [u8; at::BYTES_V2] {
        let mut bytes = [0; at::BYTES_V2];
        put_u32(&mut bytes, at::SIZE, of_version(version) as u32);
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
        put_vector(&mut bytes, at::CURRENT, &self.current_a);
        if version > 1 {
            put_vector(&mut bytes, at::POSITION, &self.position);
            put_vector(&mut bytes, at::SPEED, &self.speed);
            put_vector(&mut bytes, at::AXIS_ERROR, &self.axis_error);
            put_vector(&mut bytes, at::MAX_AXIS_ERROR, &self.max_axis_error);
            for (index, signal) in self.signals.iter().enumerate() {
                put_f64(&mut bytes, at::SIGNALS + 8 * index, *signal);
            }
            put_f64(&mut bytes, at::SIGMA, self.sigma);
        }
        bytes
    }
}

/// Bytes of a period in `version` of the ABI.
pub(crate) fn of_version(version: u32) -> usize {
    if version == 1 {
        at::BYTES
    } else {
        at::BYTES_V2
    }
}
