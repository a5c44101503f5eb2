//! The limits and positions of one axis or joint.

use tandem_sdk::AxisLimits;

use crate::motion::Motion;
use crate::section::Section;
use crate::units::Units;

/// The allowable speed difference of an axis, mm/s or rad/s.
pub fn difference(rotary: bool, motion: &Motion) -> f64 {
    if rotary {
        motion.speed_difference_rad_per_s
    } else {
        motion.speed_difference_mm_per_s
    }
}

/// The limits of an axis, or those of a joint where `base`, its axis, gives what it does not state.
pub fn limits(
    section: &Section<'_>,
    units: &Units,
    base: Option<&AxisLimits>,
    difference: f64,
) -> Option<AxisLimits> {
    read(
        &Reader {
            section,
            base,
            endless: false,
        },
        units,
        difference,
    )
}

/// The limits of a joint that belongs to no axis: without `travel` it has no end.
pub fn limits_without_end(
    section: &Section<'_>,
    units: &Units,
    difference: f64,
) -> Option<AxisLimits> {
    read(
        &Reader {
            section,
            base: None,
            endless: true,
        },
        units,
        difference,
    )
}

fn read(read: &Reader<'_>, units: &Units, difference: f64) -> Option<AxisLimits> {
    let (scale, per_minute) = (units.scale, units.scale / 60.0);
    // Everything is read before the first failure ends it, so that all problems are told.
    let travel = read.travel(units);
    let feed = read.value(units.feed, per_minute, |b| b.feed_mm_per_s);
    let rapid = read.optional(units.rapid, per_minute, |b| b.rapid_mm_per_s, feed);
    let acceleration = read.value(units.acceleration, scale, |b| b.acceleration_mm_per_s2);
    let jerk = read.optional(units.jerk, scale, |b| b.jerk_mm_per_s3, Some(f64::INFINITY));
    let (min_mm, max_mm) = travel?;
    Some(AxisLimits {
        min_mm,
        max_mm,
        feed_mm_per_s: feed?,
        rapid_mm_per_s: rapid?,
        acceleration_mm_per_s2: acceleration?,
        jerk_mm_per_s3: jerk?,
        speed_difference_mm_per_s: difference,
    })
}

struct Reader<'a> {
    section: &'a Section<'a>,
    base: Option<&'a AxisLimits>,
    /// Without a travel of its own there is none.
    endless: bool,
}

impl Reader<'_> {
    fn travel(&self, units: &Units) -> Option<(f64, f64)> {
        if let Some(base) = self.base.filter(|_| !self.section.has(units.travel)) {
            return Some((base.min_mm, base.max_mm));
        }
        if self.endless && !self.section.has(units.travel) {
            return Some((f64::NEG_INFINITY, f64::INFINITY));
        }
        let (low, high) = self.section.required(units.travel, Section::range)?;
        Some((low * units.scale, high * units.scale))
    }

    fn value(&self, key: &str, factor: f64, of: fn(&AxisLimits) -> f64) -> Option<f64> {
        if let Some(base) = self.base.filter(|_| !self.section.has(key)) {
            return Some(of(base));
        }
        self.section
            .required(key, Section::positive)
            .map(|value| value * factor)
    }

    fn optional(
        &self,
        key: &str,
        factor: f64,
        of: fn(&AxisLimits) -> f64,
        default: Option<f64>,
    ) -> Option<f64> {
        if self.section.has(key) {
            self.value(key, factor, of)
        } else {
            self.base.map(of).or(default)
        }
    }
}

/// A position within the travel of an axis or joint, mm or rad.
pub fn position(
    section: &Section<'_>,
    key: &str,
    units: &Units,
    limits: &AxisLimits,
    default: f64,
) -> Option<f64> {
    let value = if section.has(key) {
        section.number(key)? * units.scale
    } else {
        default
    };
    if (limits.min_mm..=limits.max_mm).contains(&value) {
        return Some(value);
    }
    let [value, low, high] =
        [value, limits.min_mm, limits.max_mm].map(|v| as_written(v / units.scale));
    let which = if section.has(key) {
        format!("{value} is")
    } else {
        format!("missing, and its default, {value}, is")
    };
    section.refuse(key, format!("{which} outside the travel, {low} to {high}"));
    None
}

/// A number turned into internal units and back, without the digits that this has cost.
fn as_written(value: f64) -> f64 {
    let rounded = (value * 1e9).round() / 1e9;
    if rounded.is_finite() { rounded } else { value }
}
