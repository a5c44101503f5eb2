//! One joint of a machine.

use tandem_sdk::AxisLimits;

/// Rounding that a travel limit forgives, mm or rad.
const ROUNDING: f64 = 1e-9;

/// One joint.
#[derive(Clone, Debug)]
pub struct Joint {
    /// Its name: that of the machine file, else the letter of its axis.
    pub name: String,
    /// Whether it turns.
    pub rotary: bool,
    /// The axis that the machine file says it moves.
    pub axis: Option<usize>,
    /// Its limits, mm or rad.
    pub limits: AxisLimits,
    /// Largest following error, mm or rad.
    pub max_following_error_mm: f64,
}

/// What is wrong with `joint` at `position`, if it is outside its travel.
pub fn beyond(joint: &Joint, position: f64) -> Option<String> {
    let (low, high) = (joint.limits.min_mm, joint.limits.max_mm);
    if position >= low - ROUNDING && position <= high + ROUNDING {
        return None;
    }
    let unit = if joint.rotary { "deg" } else { "mm" };
    let shown = |value: f64| {
        let value = if joint.rotary {
            value.to_degrees()
        } else {
            value
        };
        (value * 1e6).round() / 1e6
    };
    Some(format!(
        "joint {} would reach {} {unit}, beyond its travel of {} to {} {unit}",
        joint.name,
        shown(position),
        shown(low),
        shown(high)
    ))
}
