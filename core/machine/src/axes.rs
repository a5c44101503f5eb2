//! `[axes.*]`.

use tandem_sdk::{Axes, AxisLimits, AxisVector, Limits, MAX_AXES};

use crate::limits::{difference, limits, position};
use crate::motion::Motion;
use crate::section::Section;
use crate::units::{Units, refuse_other_kind};

/// The letters that axes may have, as the file writes them.
const LETTERS: &str = "xyzabcuvw";

/// How far apart the joints of an axis may be found where the file states nothing, mm or deg: more than a gantry that was squared
/// is out by after it stood without torque, and less than bends the bridge of an ordinary one.
const MAX_SKEW: f64 = 1.0;

/// The axes of a machine, what they may do and where they stand.
#[derive(Clone, Debug)]
pub(crate) struct AxisSet {
    pub axes: Axes,
    pub limits: Limits,
    pub max_following_error: AxisVector,
    /// Highest feed while it is not known where the axis is, mm/s or rad/s; not a number where none is stated.
    pub unhomed_feed: AxisVector,
    pub max_skew: AxisVector,
    pub start: AxisVector,
    pub home: AxisVector,
}

struct Axis {
    letter: char,
    rotary: bool,
    limits: AxisLimits,
    following: f64,
    unhomed: f64,
    skew: f64,
    start: f64,
    home: f64,
}

impl AxisSet {
    /// Reads `[axes.*]`; `None` where anything in it is wrong, which is reported.
    pub fn read(root: &Section<'_>, motion: &Motion) -> Option<Self> {
        let section = root.section("axes");
        let names: Vec<_> = section.keys().collect();
        if names.is_empty() && !section.is_broken() {
            section.refuse_whole("missing: a machine has at least one axis");
        }
        if names.len() > MAX_AXES {
            section.refuse_whole(format!(
                "a machine has at most {MAX_AXES} axes, not {}",
                names.len()
            ));
        }
        // All axes are read before any failure counts, so that all problems are told.
        let all: Vec<_> = names
            .iter()
            .map(|name| axis(&section, name, motion))
            .collect();
        Self::from_axes(&all.into_iter().collect::<Option<Vec<_>>>()?)
    }

    fn from_axes(all: &[Axis]) -> Option<Self> {
        let letters: Vec<_> = all.iter().map(|a| (a.letter, a.rotary)).collect();
        let limits: Vec<_> = all.iter().map(|a| a.limits).collect();
        let vector =
            |of: fn(&Axis) -> f64| AxisVector::from_slice(&all.iter().map(of).collect::<Vec<_>>());
        Some(Self {
            axes: Axes::new(&letters).ok()?,
            limits: Limits::new(&limits).ok()?,
            max_following_error: vector(|a| a.following),
            unhomed_feed: vector(|a| a.unhomed),
            max_skew: vector(|a| a.skew),
            start: vector(|a| a.start),
            home: vector(|a| a.home),
        })
    }
}

fn axis(axes: &Section<'_>, name: &str, motion: &Motion) -> Option<Axis> {
    let section = axes.section(name);
    let letter = letter(&section, name);
    let kinds = [("linear", false), ("rotary", true)];
    // Where the kind is wrong, nobody knows which units are right.
    let rotary = if section.has("kind") {
        section.choice("kind", &kinds)?
    } else {
        false
    };
    refuse_other_kind(&section, rotary);
    let units = Units::of(rotary);
    let limits = limits(&section, units, None, difference(rotary, motion))?;
    let stated = if section.has(units.following) {
        section.positive(units.following)
    } else {
        Some(f64::INFINITY)
    };
    let following = stated.map(|most| most * units.scale);
    let unhomed = if section.has(units.unhomed) {
        unhomed(&section, units, &limits)
    } else {
        Some(f64::NAN)
    };
    let skew = if section.has(units.skew) {
        section.positive(units.skew)
    } else {
        Some(MAX_SKEW)
    };
    let skew = skew.map(|most| most * units.scale);
    let start = position(&section, units.start, units, &limits, 0.0);
    let home = position(
        &section,
        units.home,
        units,
        &limits,
        start.unwrap_or(limits.min_mm),
    );
    Some(Axis {
        letter: letter?,
        rotary,
        limits,
        following: following?,
        unhomed: unhomed?,
        skew: skew?,
        start: start?,
        home: home?,
    })
}

/// The stated feed of an axis of which it is not known where it is, mm/s or rad/s.
fn unhomed(section: &Section<'_>, units: &Units, limits: &AxisLimits) -> Option<f64> {
    let (per_minute, stated) = (units.scale / 60.0, section.positive(units.unhomed)?);
    if stated * per_minute > limits.feed_mm_per_s * (1.0 + 1e-12) {
        section.refuse(
            units.unhomed,
            format!(
                "is more than the axis's highest feed, {}",
                limits.feed_mm_per_s / per_minute
            ),
        );
        return None;
    }
    Some(stated * per_minute)
}

/// The letter of an axis, upper case.
fn letter(section: &Section<'_>, name: &str) -> Option<char> {
    let mut letters = name.chars();
    let letter = letters
        .next()
        .filter(|c| letters.next().is_none() && LETTERS.contains(*c));
    if letter.is_none() {
        let lower = name.to_lowercase();
        let meant = if lower.len() == 1 && LETTERS.contains(&lower) {
            format!("; did you mean `{lower}`?")
        } else {
            String::new()
        };
        section.refuse_whole(format!(
            "an axis is called x, y, z, a, b, c, u, v or w{meant}"
        ));
    }
    letter.map(|c| c.to_ascii_uppercase())
}
