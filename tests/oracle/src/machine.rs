//! What the judge needs to know of a machine.

mod joints;
mod keys;

use std::path::Path;

pub use joints::{Joint, Joints, Map};
use keys::Keys;

use crate::{Error, Position, axis::axis_of_name};

/// The planner of a machine that names none.
const DEFAULT_PLANNER: &str = "look-ahead";

/// A machine as `machine.toml` describes it, in mm and s, rotary axes in degrees.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine {
    /// Period of the samples, s.
    pub fine_period_s: f64,
    /// Name of the planner plugin.
    pub planner: String,
    /// Allowable speed difference of linear axes, mm/s.
    pub speed_difference_mm_per_s: f64,
    /// Allowable speed difference of rotary axes, deg/s.
    pub speed_difference_deg_per_s: f64,
    /// Distance allowed between samples and path where the program gives none, mm.
    pub path_tolerance_mm: f64,
    /// Time constant of planners that overlap blocks, s; 0 where the machine states none.
    pub time_constant_s: f64,
    /// The axes, in the order of [`crate::LETTERS`].
    pub axes: Vec<Axis>,
    /// What the drives move.
    pub joints: Joints,
}

/// The limits of one axis; for a rotary axis read deg for mm.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Index of the axis letter in [`crate::LETTERS`].
    pub index: usize,
    /// Whether it turns.
    pub rotary: bool,
    /// Lower and upper end of travel, mm.
    pub travel_mm: [f64; 2],
    /// Where the machine stands before the run, mm.
    pub start_mm: f64,
    /// Greatest speed in feed, mm/s.
    pub max_feed_mm_per_s: f64,
    /// Greatest speed in rapid, mm/s.
    pub max_rapid_mm_per_s: f64,
    /// Greatest acceleration, mm/s².
    pub max_acceleration_mm_per_s2: f64,
    /// Greatest jerk, mm/s³, where the machine states one.
    pub max_jerk_mm_per_s3: Option<f64>,
}

impl Machine {
    /// Reads a `machine.toml` and the files it includes.
    ///
    /// # Errors
    /// A file cannot be read, or a key that the judge needs is missing or is no number.
    pub fn read(path: &Path) -> Result<Self, Error> {
        Self::from_keys(&Keys::read(path)?)
    }

    /// Reads the text of a `machine.toml` that includes nothing; `name` stands for the file in errors.
    ///
    /// # Errors
    /// The text is no TOML, or a key that the judge needs is missing or is no number.
    pub fn from_toml(text: &str, name: &str) -> Result<Self, Error> {
        Self::from_keys(&Keys::parse(text, name)?)
    }

    /// Where the machine stands before the run.
    pub fn start(&self) -> Position {
        let mut start = Position::default();
        for axis in &self.axes {
            start[axis.index] = axis.start_mm;
        }
        start
    }

    pub(crate) fn axis(&self, index: usize) -> Option<&Axis> {
        self.axes.iter().find(|axis| axis.index == index)
    }

    fn from_keys(keys: &Keys) -> Result<Self, Error> {
        let difference = keys
            .number("motion.allowable_speed_difference_mm_per_min")?
            .unwrap_or(0.0);
        let rotary_difference = keys
            .number("motion.allowable_speed_difference_deg_per_min")?
            .unwrap_or(difference);
        let mut axes: Vec<Axis> = keys
            .names("axes")
            .iter()
            .map(|name| Axis::from_keys(keys, name))
            .collect::<Result<_, _>>()?;
        axes.sort_by_key(|axis| axis.index);
        let joints = Joints::read(keys, &axes)?;
        Ok(Self {
            fine_period_s: keys.need("loops.fine_period_ms")? / 1000.0,
            planner: keys
                .text("planner.plugin")
                .unwrap_or_else(|| DEFAULT_PLANNER.into()),
            speed_difference_mm_per_s: difference / 60.0,
            speed_difference_deg_per_s: rotary_difference / 60.0,
            path_tolerance_mm: keys.need("motion.path_tolerance_mm")?,
            time_constant_s: keys.number("motion.time_constant_ms")?.unwrap_or(0.0) / 1000.0,
            axes,
            joints,
        })
    }
}

impl Axis {
    /// The greatest speed of any sample, mm/s.
    pub fn max_speed_mm_per_s(&self) -> f64 {
        self.max_feed_mm_per_s.max(self.max_rapid_mm_per_s)
    }

    fn from_keys(keys: &Keys, name: &str) -> Result<Self, Error> {
        let table = format!("axes.{name}");
        let index = axis_of_name(name).ok_or_else(|| keys.error(&table, "no axis letter"))?;
        let rotary = keys
            .text(&format!("{table}.kind"))
            .is_some_and(|kind| kind == "rotary");
        let unit = if rotary { "deg" } else { "mm" };
        let key = |quantity: &str, per: &str| format!("{table}.{quantity}_{unit}{per}");
        let max_feed = keys.need(&key("max_feed", "_per_min"))?;
        Ok(Self {
            index,
            rotary,
            travel_mm: keys.range(&key("travel", ""))?,
            start_mm: keys.number(&key("start", ""))?.unwrap_or(0.0),
            max_feed_mm_per_s: max_feed / 60.0,
            max_rapid_mm_per_s: keys
                .number(&key("max_rapid", "_per_min"))?
                .unwrap_or(max_feed)
                / 60.0,
            max_acceleration_mm_per_s2: keys.need(&key("max_acceleration", "_per_s2"))?,
            max_jerk_mm_per_s3: keys.number(&key("max_jerk", "_per_s3"))?,
        })
    }
}
