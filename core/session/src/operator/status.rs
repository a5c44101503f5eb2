//! One look at the machine, as clients and the terminal are told it.

use std::sync::atomic::Ordering::Relaxed;

use serde::{Serialize, Serializer};
use tandem_host::drive_states::JointLine;
use tandem_recorder::PolicySummary;
use tandem_rings::Status;
use tandem_sdk::{Axes, AxisVector};

/// The machine at one moment.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(clippy::struct_excessive_bools, reason = "each is shown by itself")]
pub struct StatusLine {
    /// State of the machine, as in traces.
    pub state: &'static str,
    /// Number of the next fine period.
    pub tick: u64,
    /// Program line that moves.
    pub line: u32,
    /// Position sent last.
    pub position: Position,
    /// Path speed, mm/min.
    pub feed_mm_per_min: f64,
    /// Whether all axes stand; while a hold, an abort or a fault still brings them to rest they do not.
    pub at_rest: bool,
    /// Rate of program time.
    pub sigma: f64,
    /// Feed override, 1 for the programmed feed.
    pub feed_override: f64,
    /// Rapid override, 1 for the rapid feed.
    pub rapid_override: f64,
    /// Whether a feed hold is asked for.
    pub hold: bool,
    /// Whether the machine rests at the end of each block.
    pub single_block: bool,
    /// Whether M1 waits for the operator.
    pub optional_stop: bool,
    /// Line on which the program waits for the operator (M0, M1, M6).
    pub waits_on_line: Option<u32>,
    /// Share of the program's path that is driven, 0 to 1.
    pub progress: f64,
    /// What was counted so far.
    pub counters: Counters,
    /// What the policy script did, where the machine has one; some rough periods old.
    pub policy: Option<PolicySummary>,
    /// State of each joint's drive.
    pub joints: Vec<JointLine>,
    /// While the drives are told to hold: which of the joints do not yet, and why, in words.
    pub enabling: Option<String>,
    /// Inputs with a role that hold the machine now, by their names.
    pub held_by: Option<String>,
    /// What the motion waits for beside the operator, in words: the spindle, with its speed and that which it is told.
    pub waits_for: Option<String>,
    /// The fault that stopped the machine, in words.
    pub fault: Option<String>,
    /// What else ended the run before its program was over: the operator's abort, in words.
    pub stopped: Option<String>,
}

/// A position by axis, in the units of traces: `x_mm`, `a_deg`.
#[derive(Clone, Debug, PartialEq)]
pub struct Position(Vec<(String, f64)>);

impl Position {
    /// `position` in mm or rad, shown in mm and deg.
    pub fn new(axes: &Axes, position: &AxisVector) -> Self {
        let shown = |axis: usize| {
            let letter = axes.letter(axis).to_ascii_lowercase();
            if axes.is_rotary(axis) {
                (format!("{letter}_deg"), position[axis].to_degrees())
            } else {
                (format!("{letter}_mm"), position[axis])
            }
        };
        Self((0..axes.count()).map(shown).collect())
    }

    /// Names with units, and values, in the order of the axes.
    pub fn values(&self) -> &[(String, f64)] {
        &self.0
    }
}

impl Serialize for Position {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, value)| (name, value)))
    }
}

/// The counters of the summary that can be read while the machine runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counters {
    /// Samples sent.
    pub samples: u64,
    /// Samples the guard stopped.
    pub guard_stops: u64,
    /// Samples beyond a limit that were sent all the same.
    pub limit_violations: u64,
    /// Samples with σ < 1 though nothing asked for it.
    pub governed_samples: u64,
    /// How often the queue ran low.
    pub starvations: u64,
    /// Ratios that came late.
    pub late_ratios: u64,
    /// Fine periods that passed without a sample.
    pub missed_periods: u64,
    /// Samples the recorder lost.
    pub lost_samples: u64,
}

impl Counters {
    /// As the fine loop last published them.
    pub fn of(status: &Status) -> Self {
        let counted = status.counts.load();
        Self {
            samples: counted.samples,
            guard_stops: counted.guard_stops,
            limit_violations: counted.limit_violations,
            governed_samples: counted.governed_samples,
            starvations: counted.starvations,
            late_ratios: counted.late_ratios,
            missed_periods: counted.missed_periods,
            lost_samples: status.lost_samples.load(Relaxed),
        }
    }
}
