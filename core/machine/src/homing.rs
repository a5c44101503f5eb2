//! `[homing.*]`: how each axis finds its place.

use crate::axes::AxisSet;
use crate::joints::{index, letters};
use crate::probe::LAST_INPUT;
use crate::section::Section;
use crate::shown::shorten;

/// How one axis finds its switch, in internal units: mm, or rad for a rotary axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisHoming {
    /// Index of the axis.
    pub axis: usize,
    /// Axes home one after the other, the lowest number first; where numbers are equal, in the order of the axes.
    pub sequence: u32,
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
    let mut all: Vec<_> = section.keys().filter_map(|name| axis(&section.section(name), name, axes)).collect();
    all.sort_by_key(|homing| (homing.sequence, homing.axis));
    all
}

fn axis(section: &Section<'_>, name: &str, set: &AxisSet) -> Option<AxisHoming> {
    let Some(axis) = index(&set.axes, name) else {
        let have = letters(&set.axes);
        section.refuse_whole(format!("no axis is called \"{}\"; the machine has {have}", shorten(name)));
        return None;
    };
    let rotary = set.axes.is_rotary(axis);
    let (keys, other) = if rotary { (ROTARY, LINEAR) } else { (LINEAR, ROTARY) };
    refuse_other_unit(section, &keys, &other, rotary);
    // Everything is read before the first failure ends it, so that all problems are told.
    let inverted = section.truth("invert").unwrap_or(false);
    let sequence = section.whole("sequence", 0, u32::MAX);
    let input = section.required("input", |section, key| section.whole(key, 0, LAST_INPUT));
    let search = section.required(keys.search, Section::number).filter(|search| {
        if *search == 0.0 {
            section.refuse(keys.search, "must not be 0: its sign is the direction of the search");
        }
        *search != 0.0
    });
    let latch = section.required(keys.latch, Section::positive);
    let back_off = section.required(keys.back_off, Section::positive);
    let switch = section.required(keys.switch, Section::number);
    let (per_minute, most) = (keys.scale / 60.0, set.limits.axes().get(axis)?.feed_mm_per_s);
    for (key, feed) in [(keys.search, search), (keys.latch, latch)] {
        if feed.is_some_and(|feed| feed.abs() * per_minute > most * (1.0 + 1e-12)) {
            section.refuse(key, format!("is more than the axis's highest feed, {}", most / per_minute));
        }
    }
    Some(AxisHoming {
        axis,
        sequence: sequence.unwrap_or(0),
        input: input?,
        inverted,
        search_mm_per_s: search? * per_minute,
        latch_mm_per_s: latch? * per_minute,
        back_off_mm: back_off? * keys.scale,
        switch_mm: switch? * keys.scale,
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
        let kind = if rotary { "rotary axis is in degrees" } else { "linear axis is in mm" };
        section.suggest(right);
        section.refuse(wrong, format!("a {kind}; did you mean `{right}`?"));
    }
}
