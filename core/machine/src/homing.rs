//! `[homing.*]`: how each axis finds its place.

use crate::axes::AxisSet;
use crate::joints::{Joint, index, letters};
use crate::probe::LAST_INPUT;
use crate::section::Section;
use crate::shown::shorten;
use crate::units::Units;

/// How one axis finds its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisHoming {
    /// Index of the axis.
    pub axis: usize,
    /// The joint of a gantry that this is, which has a switch of its own; none where the axis is one joint.
    pub foot: Option<Foot>,
    /// The lowest number homes first. Where it is stated, axes of one number home together, by switches; else in the order of the
    /// axes.
    pub sequence: Option<u32>,
    /// Torque that its drive keeps to meanwhile, percent of the rated one, where the file states it.
    pub max_torque_percent: Option<f64>,
    /// By whom.
    pub by: HomingBy,
}

/// A joint of a gantry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// Its index in [`crate::Machine::joints`].
    pub joint: usize,
    /// The axis that it moves with others.
    pub axis: usize,
    /// How far it goes on alone, mm or rad: how far apart the joints of the axis may stand.
    pub max_skew_mm: f64,
}

/// An index pulse that follows the switch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IndexPulse {
    /// Digital input that is 1 at the pulse, 0 to 63.
    pub input: u32,
    /// Machine coordinate of the pulse, mm or rad.
    pub at_mm: f64,
    /// How far behind the edge of the switch it comes at most, mm or rad.
    pub within_mm: f64,
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
    /// Machine coordinate of the edge of the switch, mm; nothing where an index pulse has it.
    pub switch_mm: f64,
    /// The pulse whose place counts instead of the edge of the switch.
    pub index: Option<IndexPulse>,
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
    /// The name of its table behind `homing.`.
    pub fn table(&self, axes: &tandem_sdk::Axes, joints: &[Joint]) -> String {
        let foot = self.foot.and_then(|foot| joints.get(foot.joint));
        foot.map_or_else(
            || axes.letter(self.axis).to_ascii_lowercase().to_string(),
            |joint| joint.name.clone(),
        )
    }

    /// Whether it homes together with `other`, which stands beside it in the order: feet of one gantry, or axes whose stated
    /// numbers are equal. What a drive or an index pulse homes does so alone.
    pub fn goes_with(&self, other: &Self) -> bool {
        let by_switch = |of: &Self| of.switch().is_some_and(|switch| switch.index.is_none());
        let feet = self.foot.zip(other.foot);
        let of_one_gantry = feet.is_some_and(|(a, b)| a.axis == b.axis);
        let of_one_number = self.sequence.is_some() && self.sequence == other.sequence;
        by_switch(self) && by_switch(other) && (of_one_gantry || of_one_number)
    }

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
    index: &'static str,
    index_within: &'static str,
    scale: f64,
}

const LINEAR: Keys = Keys {
    search: "search_mm_per_min",
    latch: "latch_mm_per_min",
    back_off: "back_off_mm",
    switch: "switch_mm",
    index: "index_mm",
    index_within: "index_within_mm",
    scale: 1.0,
};
const ROTARY: Keys = Keys {
    search: "search_deg_per_min",
    latch: "latch_deg_per_min",
    back_off: "back_off_deg",
    switch: "switch_deg",
    index: "index_deg",
    index_within: "index_within_deg",
    scale: std::f64::consts::PI / 180.0,
};

/// Reads `[homing.*]`, in the order in which the axes home; what is wrong is reported and left out.
pub(crate) fn read(root: &Section<'_>, axes: &AxisSet, joints: &[Joint]) -> Vec<AxisHoming> {
    let section = root.section("homing");
    let mut all: Vec<_> = section
        .keys()
        .filter_map(|name| axis(&section.section(name), name, axes, joints))
        .collect();
    let foot = |homing: &AxisHoming| homing.foot.map(|foot| foot.joint);
    all.sort_by_key(|homing| (homing.sequence.unwrap_or(0), homing.axis, foot(homing)));
    check_feet(&section, axes, joints, &all);
    all
}

/// The joints of a gantry square it together: each has a switch, and they move alike.
fn check_feet(section: &Section<'_>, set: &AxisSet, joints: &[Joint], all: &[AxisHoming]) {
    for homing in all.iter().filter(|homing| homing.foot.is_some()) {
        let table = section.section(&homing.table(&set.axes, joints));
        let feet = || {
            joints
                .iter()
                .enumerate()
                .filter(|(_, joint)| joint.axis == Some(homing.axis))
        };
        let of = |at: usize| {
            all.iter()
                .find(|of| of.foot.is_some_and(|foot| foot.joint == at))
        };
        if let Some((_, missing)) = feet().find(|(at, _)| of(*at).is_none()) {
            table.refuse_whole(format!(
                "the gantry of {} squares itself by a switch at each joint, and [homing.{}] is missing",
                set.axes.letter(homing.axis).to_ascii_lowercase(),
                missing.name
            ));
        }
        let alike = |of: &AxisHoming| {
            let motion = of.switch().map(|switch| {
                (
                    switch.search_mm_per_s,
                    switch.latch_mm_per_s,
                    switch.back_off_mm,
                )
            });
            (of.sequence, motion)
        };
        let Some(switch) = homing.switch() else {
            table.refuse(
                "drive_method",
                "a joint of a gantry is homed by a switch: its drive would go alone",
            );
            continue;
        };
        if switch.index.is_some() {
            table.refuse(
                "index_input",
                "a joint of a gantry is homed by its switch alone",
            );
        }
        if feet()
            .filter_map(|(at, _)| of(at))
            .any(|of| alike(of) != alike(homing))
        {
            table.refuse_whole(
                "the joints of a gantry move alike: sequence, search, latch and back_off are the same for all of them"
                    .to_string(),
            );
        }
    }
}

/// The axis that a table is of, and the joint where it is one of a gantry.
fn of_name(name: &str, set: &AxisSet, joints: &[Joint]) -> Option<(usize, Option<Foot>)> {
    if let Some(axis) = index(&set.axes, name) {
        return Some((axis, None));
    }
    let joint = joints.iter().position(|joint| joint.name == name)?;
    let axis = joints[joint].axis?;
    let is_gantry = joints.iter().filter(|of| of.axis == Some(axis)).count() > 1;
    let foot = Foot {
        joint,
        axis,
        max_skew_mm: set.max_skew[axis],
    };
    Some((axis, is_gantry.then_some(foot)))
}

fn axis(section: &Section<'_>, name: &str, set: &AxisSet, joints: &[Joint]) -> Option<AxisHoming> {
    let Some((axis, foot)) = of_name(name, set, joints) else {
        let have = letters(&set.axes);
        section.refuse_whole(format!(
            "no axis and no joint of a gantry is called \"{}\"; the machine has the axes {have}",
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
        return by_drive(section, (axis, foot), max_torque_percent, &keys);
    }
    if section.has("drive_within_s") {
        section.refuse("drive_within_s", "goes with drive_method");
    }
    // Everything is read before the first failure ends it, so that all problems are told.
    let inverted = section.truth("invert").unwrap_or(false);
    let sequence = section.whole("sequence", 0, u32::MAX);
    let index_input = section
        .has("index_input")
        .then(|| section.whole("index_input", 0, LAST_INPUT));
    let index = index_pulse(section, &keys, index_input);
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
    let switch = if let Some(input) = index_input {
        if input.is_some() && section.has(keys.switch) {
            section.refuse(
                keys.switch,
                "with index_input the place of the pulse counts, not that of the switch",
            );
        }
        Some(0.0)
    } else {
        section.required(keys.switch, Section::number)
    };
    let per_minute = keys.scale / 60.0;
    let most = set.limits.axes().get(axis)?.feed_mm_per_s;
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
        index: index?,
    });
    Some(AxisHoming {
        axis,
        foot,
        sequence,
        max_torque_percent,
        by,
    })
}

/// The pulse that counts instead of the switch; the outer option is none where it is stated wrongly.
#[allow(clippy::option_option)] // wrong, or not there
fn index_pulse(
    section: &Section<'_>,
    keys: &Keys,
    input: Option<Option<u32>>,
) -> Option<Option<IndexPulse>> {
    let Some(input) = input else {
        for key in [keys.index, keys.index_within] {
            if section.has(key) {
                section.refuse(key, "goes with index_input");
            }
        }
        return Some(None);
    };
    let input = input?;
    let at = section.required(keys.index, Section::number);
    let within = section.required(keys.index_within, Section::positive);
    Some(Some(IndexPulse {
        input,
        at_mm: at? * keys.scale,
        within_mm: within? * keys.scale,
    }))
}

/// An axis that its drive homes: the keys of a switch say nothing then.
fn by_drive(
    section: &Section<'_>,
    (axis, foot): (usize, Option<Foot>),
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
        "index_input",
        keys.index,
        keys.index_within,
    ] {
        if section.has(key) {
            section.refuse(
                key,
                "is of a switch that the host looks for: with drive_method the drive finds its place by itself",
            );
        }
    }
    let sequence = section.whole("sequence", 0, u32::MAX);
    let within_s = section.positive("drive_within_s").unwrap_or(DRIVE_WITHIN_S);
    Some(AxisHoming {
        axis,
        foot,
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
        (other.index, keys.index),
        (other.index_within, keys.index_within),
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
