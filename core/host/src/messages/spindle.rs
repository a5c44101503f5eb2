//! The spindle in words.

use std::f64::consts::PI;
use std::sync::atomic::Ordering::Relaxed;

use tandem_rings::Status;

/// Both speeds, rad/s, as people read them.
pub fn speeds(turns_rad_per_s: f64, told_rad_per_s: f64) -> String {
    let rpm = |rad_per_s: f64| rad_per_s.abs() * 30.0 / PI;
    format!(
        "{:.0} of {:.0} rpm",
        rpm(turns_rad_per_s),
        rpm(told_rad_per_s)
    )
}

/// What a cut waits for, where it waits for the spindle.
pub fn awaited(status: &Status) -> Option<String> {
    let spindle = &status.spindle;
    let of = speeds(
        spindle.turns_rad_per_s.load(),
        spindle.told_rad_per_s.load(),
    );
    spindle
        .waits
        .load(Relaxed)
        .then(|| format!("the spindle: {of}"))
}
