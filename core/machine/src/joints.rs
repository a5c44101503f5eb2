//! `[joints.*]`: what the drives move, where that is not simply the axes.

use tandem_sdk::{Axes, AxisLimits, MAX_AXES};

use crate::axes::AxisSet;
use crate::limits::{limits, position};
use crate::section::Section;
use crate::shown::shorten;
use crate::units::{Units, refuse_other_kind};

/// A joint that the file states.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Its name in the file.
    pub name: String,
    /// Index of the axis that it moves.
    pub axis: usize,
    /// Its limits, mm or rad; those of its axis where it states none.
    pub limits: AxisLimits,
    /// Its reference position, mm or rad.
    pub home: f64,
}

/// Reads `[joints.*]` in the order of the file; what is wrong is reported and left out.
pub(crate) fn read(root: &Section<'_>, axes: &AxisSet) -> Vec<Joint> {
    let section = root.section("joints");
    let count = section.keys().count();
    if count > MAX_AXES {
        section.refuse_whole(format!("a machine has at most {MAX_AXES} joints, not {count}"));
    }
    section.keys().filter_map(|name| joint(&section.section(name), name, axes)).collect()
}

fn joint(section: &Section<'_>, name: &str, set: &AxisSet) -> Option<Joint> {
    let letter = section.required("axis", Section::text)?;
    let Some(axis) = index(&set.axes, letter) else {
        section.refuse(
            "axis",
            format!("no axis is called \"{}\"; the machine has {}", shorten(letter), letters(&set.axes)),
        );
        return None;
    };
    refuse_other_kind(section, set.axes.is_rotary(axis));
    let units = Units::of(set.axes.is_rotary(axis));
    let base = set.limits.axes().get(axis)?;
    let limits = limits(section, units, Some(base), base.speed_difference_mm_per_s)?;
    let home = position(section, units.home, units, &limits, set.home[axis])?;
    Some(Joint { name: name.to_owned(), axis, limits, home })
}

/// The index of the axis that a file calls `name`, in lower case.
pub(crate) fn index(axes: &Axes, name: &str) -> Option<usize> {
    let mut letters = name.chars();
    let letter = letters.next().filter(|c| c.is_ascii_lowercase() && letters.next().is_none())?;
    axes.index(letter.to_ascii_uppercase())
}

/// The names of the axes as a file writes them.
pub(crate) fn letters(axes: &Axes) -> String {
    let each = (0..axes.count()).map(|i| axes.letter(i).to_ascii_lowercase().to_string());
    each.collect::<Vec<_>>().join(", ")
}
