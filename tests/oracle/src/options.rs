//! What is asked of the judge.

use crate::Machine;

/// One judgement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Check {
    /// Rows follow each other by one fine period.
    Period,
    /// Every sample lies within the travel of every axis.
    Travel,
    /// Speed of every axis.
    Velocity,
    /// Acceleration of every axis, with the speed difference allowed where blocks meet.
    Acceleration,
    /// Jerk of every axis; only for planners that promise it.
    Jerk,
    /// Path speed against the programmed feed, and axis speeds in rapids.
    Feed,
    /// Every sample lies on the programmed path, in the order of travel, and none of the path is left out.
    Path,
    /// Every programmed vertex is met.
    Vertices,
    /// The run starts where the machine stands and ends at the programmed position.
    EndPoint,
}

/// Options of a judgement. `None` takes the value from machine or program.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// The judgements asked for; all but jerk by default.
    pub checks: Vec<Check>,
    /// Speed step that linear axes may make where blocks meet, mm/s. By default the machine's for the planner
    /// `look-ahead`, 0 for every other.
    pub speed_difference_mm_per_s: Option<f64>,
    /// The same for rotary axes, deg/s.
    pub speed_difference_deg_per_s: Option<f64>,
    /// Greatest distance of a sample from the path, mm. By default the G64 P in force, or else the machine's tolerance.
    pub sample_tolerance_mm: Option<f64>,
    /// Greatest distance of a vertex from the samples joined by chords, mm. Default as above.
    pub vertex_tolerance_mm: Option<f64>,
    /// Greatest distance of an exact-stop position (G61, G61.1) from the nearest sample, mm.
    pub exact_stop_tolerance_mm: f64,
    /// Greatest distance per axis of the first and the last sample from where they should be, mm or deg.
    pub end_tolerance_mm: f64,
    /// The highest feed ratio that was asked for during the run.
    pub max_ratio: f64,
    /// Relative tolerance of the path speed.
    pub feed_tolerance: f64,
    /// How long before and after a sample another block may still lend it its feed, s. By default 0 for the planner
    /// `look-ahead`, and the machine's time constant for planners that let blocks overlap.
    pub feed_window_s: Option<f64>,
    /// The run stopped before the end of the program: neither the end point nor the rest of the path is asked for.
    pub ends_early: bool,
    /// The path is judged up to this time, s, because a fault made the axes leave it; limits are judged to the end.
    pub path_until_s: Option<f64>,
    /// Leave out program lines that begin with `/`.
    pub block_delete: bool,
}

impl Default for Options {
    fn default() -> Self {
        use Check::{Acceleration, EndPoint, Feed, Path, Period, Travel, Velocity, Vertices};
        Self {
            checks: vec![
                Period,
                Travel,
                Velocity,
                Acceleration,
                Feed,
                Path,
                Vertices,
                EndPoint,
            ],
            speed_difference_mm_per_s: None,
            speed_difference_deg_per_s: None,
            sample_tolerance_mm: None,
            vertex_tolerance_mm: None,
            exact_stop_tolerance_mm: 1e-9,
            end_tolerance_mm: 1e-9,
            max_ratio: 1.0,
            feed_tolerance: 1e-6,
            feed_window_s: None,
            ends_early: false,
            path_until_s: None,
            block_delete: false,
        }
    }
}

impl Options {
    /// The default options, with the values of a machine where they depend on nothing else.
    pub fn for_machine(machine: &Machine) -> Self {
        let difference = |rotary| Some(Self::default().speed_difference(machine, rotary));
        Self {
            speed_difference_mm_per_s: difference(false),
            speed_difference_deg_per_s: difference(true),
            ..Self::default()
        }
    }

    /// The default options with these judgements only.
    pub fn only(checks: &[Check]) -> Self {
        Self {
            checks: checks.to_vec(),
            ..Self::default()
        }
    }

    /// The default options for a planner that bounds jerk: no speed step anywhere, and jerk is judged.
    pub fn with_jerk() -> Self {
        let mut options = Self {
            speed_difference_mm_per_s: Some(0.0),
            speed_difference_deg_per_s: Some(0.0),
            ..Self::default()
        };
        options.checks.push(Check::Jerk);
        options
    }

    /// Whether a judgement is asked for.
    pub fn asks(&self, check: Check) -> bool {
        self.checks.contains(&check)
    }

    pub(crate) fn asks_program(&self) -> bool {
        [Check::Feed, Check::Path, Check::Vertices, Check::EndPoint]
            .into_iter()
            .any(|check| self.asks(check))
    }

    /// Speed step that an axis may make, mm/s or deg/s.
    pub(crate) fn speed_difference(&self, machine: &Machine, rotary: bool) -> f64 {
        let (asked, stated) = if rotary {
            (
                self.speed_difference_deg_per_s,
                machine.speed_difference_deg_per_s,
            )
        } else {
            (
                self.speed_difference_mm_per_s,
                machine.speed_difference_mm_per_s,
            )
        };
        asked.unwrap_or(if steps_speed(machine) { stated } else { 0.0 })
    }

    /// Samples before and after one in which another block may lend its feed.
    pub(crate) fn feed_window_samples(&self, machine: &Machine) -> usize {
        let window_s = self.feed_window_s.unwrap_or(if steps_speed(machine) {
            0.0
        } else {
            machine.time_constant_s
        });
        (window_s / machine.fine_period_s).ceil().max(0.0) as usize
    }
}

/// The classic look-ahead alone runs one block after the other and steps the axis speeds where they meet.
fn steps_speed(machine: &Machine) -> bool {
    machine.planner == "look-ahead"
}
