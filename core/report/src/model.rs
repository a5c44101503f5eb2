//! What a report is made from: the public data of this crate. How it is written stands in `page.rs`.

/// A run to be drawn. Everything a caller knows goes in here; [`Report::write`] makes the page.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Heading of the page and of the browser's tab.
    pub title: String,
    /// Name of the part program; shown under the heading.
    pub program: String,
    /// Name of the machine.
    pub machine: String,
    /// Name of the planner that made the motion.
    pub planner: String,
    /// The summary, shown as a table in this order: name and value, both as they shall be read.
    pub facts: Vec<(String, String)>,
    /// What ended the run before its program was over: it stands first on the page.
    pub ended: Option<Ended>,
    /// The axes, in the order of [`Samples::command`].
    pub axes: Vec<Axis>,
    /// Period at which the drives get a sample, in s. Velocity, acceleration and jerk are differences over it.
    pub fine_period_s: f64,
    /// What was sent to the drives, one entry per fine period.
    pub samples: Samples,
    /// Further curves over the same time axis, each in a plot of its own.
    pub signals: Vec<Signal>,
    /// How far a sample may lie from the programmed path, in mm; `None` where nothing was promised. Where the program
    /// changes it, [`Samples::tolerance_mm`] says it sample by sample.
    pub path_tolerance_mm: Option<f64>,
    /// `false` where the jerk limit is only reported: jerk above it is still red, but is no violation.
    pub jerk_is_judged: bool,
    /// A sentence that says how the caller thinned the samples, if so; the page repeats it.
    pub decimated: Option<String>,
}

/// What ended a run before its program was over, in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ended {
    /// A fault.
    Fault(String),
    /// Somebody stopped it.
    Stopped(String),
}

impl Report {
    /// How far sample `i` may lie from the path, mm, where something was promised.
    pub(crate) fn tolerance_at_mm(&self, i: usize) -> Option<f64> {
        let each = self
            .samples
            .tolerance_mm
            .as_ref()
            .and_then(|each| each.get(i));
        each.copied().or(self.path_tolerance_mm)
    }
}

/// What the positions of an axis are measured in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unit {
    /// A linear axis, in mm.
    #[default]
    Mm,
    /// A rotary axis, in degrees.
    Deg,
}

impl Unit {
    /// The unit as it is written after a number.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Mm => "mm",
            Self::Deg => "deg",
        }
    }
}

/// An axis and its limits, in the axis' own unit (mm or degrees) and s.
#[derive(Clone, Debug, Default)]
pub struct Axis {
    /// Its letter in part programs, such as `X`.
    pub letter: char,
    /// mm or degrees.
    pub unit: Unit,
    /// Limit of the velocity, in unit/s.
    pub max_velocity: f64,
    /// Limit of the acceleration, in unit/s².
    pub max_acceleration: f64,
    /// Limit of the jerk, in unit/s³, where the machine has one.
    pub max_jerk: Option<f64>,
    /// Velocity step allowed where blocks meet, in unit/s; 0 for planners that keep the velocity continuous.
    ///
    /// Over every window of length Δt the velocity may change by at most `max_acceleration`·Δt plus this.
    pub speed_difference: f64,
}

/// The samples of a run: columns of equal length.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    /// Program-independent time of each sample, in s, rising by whole fine periods.
    pub t_s: Vec<f64>,
    /// Line of the part program that each sample belongs to.
    pub line: Vec<u32>,
    /// Commanded positions: one column per axis, in mm or degrees.
    pub command: Vec<Vec<f64>>,
    /// Actual positions: one column per axis like `command`, an empty one where an axis reports none; or no columns.
    pub feedback: Vec<Vec<f64>>,
    /// Speed along the path, in mm/s.
    pub feed_mm_s: Vec<f64>,
    /// Rate of program time, 0 to 1; empty where the run has none.
    pub sigma: Vec<f64>,
    /// Feed the program asks for, in mm/s; empty where unknown.
    pub programmed_feed_mm_s: Vec<f64>,
    /// Distance from the programmed path, in mm; `None` where nobody measured it.
    pub deviation_mm: Option<Vec<f64>>,
    /// Path speed as a share of what the chord error of a fine period allows, on curves; NaN elsewhere, `None` where there are
    /// none.
    pub chord_share: Option<Vec<f64>>,
    /// How far each sample may lie from the path, mm; `None` where it is the same for all.
    pub tolerance_mm: Option<Vec<f64>>,
}

/// A further curve, such as a spindle load.
#[derive(Clone, Debug, Default)]
pub struct Signal {
    /// Name, as shown.
    pub name: String,
    /// Unit, as shown; may be empty.
    pub unit: String,
    /// One value per sample; NaN leaves a gap.
    pub values: Vec<f64>,
}
