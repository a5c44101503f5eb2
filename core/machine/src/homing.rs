//! `[homing.*]`: how each axis finds its place.

use crate::axes::AxisSet;
use crate::joints::{index, letters};
use crate::probe::LAST_INPUT;
use crate::section::Section;
use crate::shown::shorten;
use crate::units::Units;

/// How one axis finds its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisHoming {
    /// Index of the axis.
    pub axis: usize,
    /// Axes home one after the other, the lowest number first; where numbers are equal, in the order of the axes.
    pub sequence: u32,
    /// Torque that its drive keeps to meanwhile, percent of the rated one, where the file states it.
    pub max_torque_percent: Option<f64>,
    /// By whom.
    pub by: HomingBy,
}

/// Who finds the place of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HomingBy {
    /// The host, by a switch on a digital input.
    Switch(SwitchHoming),
    /// The drive by itself.
    Drive(DriveHoming),
}

/// How one axis finds its switch, in internal units: mm, or rad for a rotary axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SwitchHoming {
    /// Digital input of the switch, 0 to 63.
    pub input: u32,
    /// The input is 0 on the switch.
    pub inverted: bool,
    /// Velocity towards the switch, mm/s; its sign is the direction.
    pub search_mm_per_s: f64,
    /// Feed at which the position of the switch is taken, mm/s.
    pub latch_mm_per_s: f64,
    /// How far the axis backs off the switch before that, mm.
    pub back_off_mm: f64,
    /// Machine coordinate of the edge of the switch, mm.
    pub switch_mm: f64,
}

/// How a drive homes its axis by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveHoming {
    /// Number of the method, as `CiA 402` and the drive's manual have it.
    pub method: i32,
    /// Time that it has for it, s.
    pub within_s: f64,
}

impl AxisHoming {
    /// The switch that the host looks for, if it does.
    pub fn switch(&self) -> Option<&SwitchHoming> {
        match &self.by {
            HomingBy::Switch(switch) => Some(switch),
            HomingBy::Drive(_) => None,
        }
    }

    /// How the drive homes the axis, if it does.
    pub fn drive(&self) -> Option<&DriveHoming> {
        match &self.by {
            HomingBy::Switch(_) => None,
            HomingBy::Drive(drive) => Some(drive),
        }
    }
}

/// Time that a drive has for its homing where the file states none, s: an axis of 2 m at a search feed of 2 m/min needs as much.
const DRIVE_WITHIN_S: f64 = 60.0;

/// Greatest number of a homing method: `CiA 402` has an 8-bit number for it, of which the negative ones are the makers' own.
const LAST_METHOD: u32 = 127;

/// Greatest torque that can be stated as a limit, percent of the rated one: what servo drives give for seconds.
const MAX_TORQUE_PERCENT: f64 = 300.0;

/// The keys of `[homing.<axis>]`, which carry their unit in their name.
struct Keys {
    search: &'static str,
    latch: &'static str,
    back_off: &'static str,
    switch: &'static str,
    scale: f64,
}

const LINEAR: Keys = Keys {
    search: "search_mm_per_min",
    latch: "latch_mm_per_min",
    back_off: "back_off_mm",
    switch: "switch_mm",
    scale: 1.0,
};
const ROTARY: Keys = Keys {
    search: "search_deg_per_min",
    latch: "latch_deg_per_min",
    back_off: "back_off_deg",
    switch: "switch_deg",
    scale: std::f64::consts::PI / 180.0,
};

/// Reads `[homing.*]`, in the order in which the axes home; what is wrong is reported and left out.
pub(crate) fn read(root: &Section<'_>, axes: &AxisSet) -> Vec<AxisHoming> {
    let section = root.section("homing");
    let mut all: Vec<_> = section
        .keys()
        .filter_map(|name| axis(&section.section(name), name, axes))
        .collect();
    all.sort_by_key(|homing| (homing.sequence, homing.axis));
    all
}

fn axis(section: &Section<'_>, name: &str, set: &AxisSet) -> Option<AxisHoming> {
    let Some(axis) = index(&set.axes, name) else {
        let have = letters(&set.axes);
        section.refuse_whole(format!(
            "no axis is called \"{}\"; the machine has {have}",
            shorten(name)
        ));
        return None;
    };
    let rotary = set.axes.is_rotary(axis);
    let (keys, other) = if rotary {
        (ROTARY, LINEAR)
    } else {
        (LINEAR, ROTARY)
    };
    refuse_other_unit(section, &keys, &other, rotary);
    let max_torque_percent = section.positive("max_torque_percent").filter(|percent| {
        if *percent > MAX_TORQUE_PERCENT {
            section.refuse(
                "max_torque_percent",
                format!("must be at most {MAX_TORQUE_PERCENT}, not {percent}"),
            );
        }
        *percent <= MAX_TORQUE_PERCENT
    });
    if section.has("drive_method") {
        return by_drive(section, axis, max_torque_percent, &keys);
    }
    if section.has("drive_within_s") {
        section.refuse("drive_within_s", "goes with drive_method");
    }
    // Everything is read before the first failure ends it, so that all problems are told.
    let inverted = section.truth("invert").unwrap_or(false);
    let sequence = section.whole("sequence", 0, u32::MAX);
    let input = section.required("input", |section, key| section.whole(key, 0, LAST_INPUT));
    let search = section
        .required(keys.search, Section::number)
        .filter(|search| {
            if *search == 0.0 {
                section.refuse(
                    keys.search,
                    "must not be 0: its sign is the direction of the search",
                );
            }
            *search != 0.0
        });
    let latch = section.required(keys.latch, Section::positive);
    let back_off = section.required(keys.back_off, Section::positive);
    let switch = section.required(keys.switch, Section::number);
    let (per_minute, most) = (
        keys.scale / 60.0,
        set.limits.axes().get(axis)?.feed_mm_per_s,
    );
    for (key, feed) in [(keys.search, search), (keys.latch, latch)] {
        if feed.is_some_and(|feed| feed.abs() * per_minute > most * (1.0 + 1e-12)) {
            section.refuse(
                key,
                format!(
                    "is more than the axis's highest feed, {}",
                    most / per_minute
                ),
            );
        }
    }
    let slowest = set.unhomed_feed[axis] / per_minute;
    if search.is_some_and(|feed| feed.abs() > slowest * (1.0 + 1e-12)) {
        section.refuse(
            keys.search,
            format!(
                "is more than {} of axes.{name}, {slowest}",
                Units::of(rotary).unhomed
            ),
        );
    }
    let by = HomingBy::Switch(SwitchHoming {
        input: input?,
        inverted,
        search_mm_per_s: search? * per_minute,
        latch_mm_per_s: latch? * per_minute,
        back_off_mm: back_off? * keys.scale,
        switch_mm: switch? * keys.scale,
    });
    Some(AxisHoming {
        axis,
        sequence: sequence.unwrap_or(0),
        max_torque_percent,
        by,
    })
}

/// An axis that its drive homes: the keys of a switch say nothing then.
fn by_drive(
    section: &Section<'_>,
    axis: usize,
    max_torque_percent: Option<f64>,
    keys: &Keys,
) -> Option<AxisHoming> {
    let method = section.whole("drive_method", 1, LAST_METHOD)?.cast_signed();
    for key in [
        "input",
        "invert",
        keys.search,
        keys.latch,
        keys.back_off,
        keys.switch,
    ] {
        if section.has(key) {
            section.refuse(
                key,
                "is of a switch that the host looks for: with drive_method the drive finds its place by itself",
            );
        }
    }
    let sequence = section.whole("sequence", 0, u32::MAX).unwrap_or(0);
    let within_s = section.positive("drive_within_s").unwrap_or(DRIVE_WITHIN_S);
    Some(AxisHoming {
        axis,
        sequence,
        max_torque_percent,
        by: HomingBy::Drive(DriveHoming { method, within_s }),
    })
}

fn refuse_other_unit(section: &Section<'_>, keys: &Keys, other: &Keys, rotary: bool) {
    let pairs = [
        (other.search, keys.search),
        (other.latch, keys.latch),
        (other.back_off, keys.back_off),
        (other.switch, keys.switch),
    ];
    for (wrong, right) in pairs.into_iter().filter(|(wrong, _)| section.has(wrong)) {
        let kind = if rotary {
            "rotary axis is in degrees"
        } else {
            "linear axis is in mm"
        };
        section.suggest(right);
        section.refuse(wrong, format!("a {kind}; did you mean `{right}`?"));
    }
}
