//! `[joints.*]`: what the drives move, where that is not simply the axes.

use tandem_sdk::{Axes, AxisLimits, MAX_AXES};

use crate::axes::AxisSet;
use crate::limits::{difference, limits, limits_without_end, position};
use crate::motion::Motion;
use crate::section::Section;
use crate::shown::shorten;
use crate::units::{Units, refuse_other_kind};

/// A joint that the file states.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Its name in the file.
    pub name: String,
    /// Index of the axis that it moves; none for a joint of the kinematics' own.
    pub axis: Option<usize>,
    /// Whether it turns.
    pub rotary: bool,
    /// Its limits, mm or rad; those of its axis where it states none. A joint without an axis may have no end of travel.
    pub limits: AxisLimits,
    /// Largest distance between its command and its feedback, mm or rad; infinite where none is stated.
    pub max_following_error_mm: f64,
    /// Its reference position, mm or rad.
    pub home: f64,
}

/// Reads `[joints.*]` in the order of the file; what is wrong is reported and left out.
pub(crate) fn read(root: &Section<'_>, axes: &AxisSet, motion: &Motion) -> Vec<Joint> {
    let section = root.section("joints");
    let count = section.keys().count();
    if count > MAX_AXES {
        section.refuse_whole(format!(
            "a machine has at most {MAX_AXES} joints, not {count}"
        ));
    }
    section
        .keys()
        .filter_map(|name| joint(&section.section(name), name, axes, motion))
        .collect()
}

fn joint(section: &Section<'_>, name: &str, set: &AxisSet, motion: &Motion) -> Option<Joint> {
    if section.has("axis") {
        joint_of_axis(section, name, set)
    } else {
        joint_of_its_own(section, name, motion)
    }
}

/// A joint that moves one axis, and takes from it what it does not state.
fn joint_of_axis(section: &Section<'_>, name: &str, set: &AxisSet) -> Option<Joint> {
    let letter = section.required("axis", Section::text)?;
    let Some(axis) = index(&set.axes, letter) else {
        section.refuse(
            "axis",
            format!(
                "no axis is called \"{}\"; the machine has {}",
                shorten(letter),
                letters(&set.axes)
            ),
        );
        return None;
    };
    let rotary = set.axes.is_rotary(axis);
    if section.has("kind") {
        section.refuse(
            "kind",
            "a joint is of the kind of its axis; a joint of its own states no axis",
        );
    }
    refuse_other_kind(section, rotary);
    let units = Units::of(rotary);
    let base = set.limits.axes().get(axis)?;
    let limits = limits(section, units, Some(base), base.speed_difference_mm_per_s)?;
    let following = following(section, units, set.max_following_error[axis])?;
    let home = position(section, units.home, units, &limits, set.home[axis])?;
    Some(Joint {
        name: name.to_owned(),
        axis: Some(axis),
        rotary,
        limits,
        max_following_error_mm: following,
        home,
    })
}

/// A joint that is no axis by itself: the kinematics say what moves it.
fn joint_of_its_own(section: &Section<'_>, name: &str, motion: &Motion) -> Option<Joint> {
    let kinds = [("linear", false), ("rotary", true)];
    let rotary = if section.has("kind") {
        section.choice("kind", &kinds)?
    } else {
        false
    };
    refuse_other_kind(section, rotary);
    let units = Units::of(rotary);
    let limits = limits_without_end(section, units, difference(rotary, motion))?;
    let following = following(section, units, f64::INFINITY)?;
    let home = position(
        section,
        units.home,
        units,
        &limits,
        0.0f64.clamp(limits.min_mm, limits.max_mm),
    )?;
    Some(Joint {
        name: name.to_owned(),
        axis: None,
        rotary,
        limits,
        max_following_error_mm: following,
        home,
    })
}

fn following(section: &Section<'_>, units: &Units, default: f64) -> Option<f64> {
    if section.has(units.following) {
        section
            .positive(units.following)
            .map(|most| most * units.scale)
    } else {
        Some(default)
    }
}

/// The index of the axis that a file calls `name`, in lower case.
pub(crate) fn index(axes: &Axes, name: &str) -> Option<usize> {
    let mut letters = name.chars();
    let letter = letters
        .next()
        .filter(|c| c.is_ascii_lowercase() && letters.next().is_none())?;
    axes.index(letter.to_ascii_uppercase())
}

/// The names of the axes as a file writes them.
pub(crate) fn letters(axes: &Axes) -> String {
    let each = (0..axes.count()).map(|i| axes.letter(i).to_ascii_lowercase().to_string());
    each.collect::<Vec<_>>().join(", ")
}
