//! The summary of a run, as `--summary` writes it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::joint_peaks::JointPeaks;
use crate::lateness::Lateness;
use crate::policy_summary::PolicySummary;
use crate::record::RecordError;
use crate::stops::Stop;

/// Number of the summary format.
pub const FORMAT: u32 = 1;

/// What a run was and did. Rotary axes are in deg, under keys of their own, which machines without any lack.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// [`FORMAT`].
    pub format: u32,
    /// The program's path.
    pub program: String,
    /// The machine's name.
    pub machine: String,
    /// The planner's name.
    pub planner: String,
    /// `virtual` or `wall`.
    pub clock: String,
    /// No spindle, coolant or user output was switched, and feed motion ran at the dry-run feed.
    pub dry_run: bool,
    /// Blocks planned for good.
    pub blocks: u64,
    /// Path length of these blocks, mm.
    pub length_mm: f64,
    /// Length / programmed feed (rapids at the machine's rapid feed) and dwells, s.
    pub nominal_time_s: f64,
    /// From the first to the last sample, s.
    pub motion_time_s: f64,
    /// Best known time of this program, s, where one is stated ([`Summary::compare`]).
    pub reference_time_s: Option<f64>,
    /// `T/T_ref`: [`Summary::motion_time_s`] over that. Absent too where the run ended before its program.
    pub time_ratio: Option<f64>,
    /// Fine period, s.
    pub fine_period_s: f64,
    /// Rough period, s.
    pub rough_period_s: f64,
    /// Samples sent.
    pub samples: u64,
    /// Largest |velocity| per linear axis, finite differences, mm/s.
    pub max_velocity_mm_s: BTreeMap<String, f64>,
    /// The same per rotary axis, deg/s.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub max_velocity_deg_s: BTreeMap<String, f64>,
    /// Largest |acceleration| per linear axis, finite differences, mm/s².
    pub max_acceleration_mm_s2: BTreeMap<String, f64>,
    /// The same per rotary axis, deg/s².
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub max_acceleration_deg_s2: BTreeMap<String, f64>,
    /// Largest |jerk| per linear axis, finite differences, mm/s³.
    pub max_jerk_mm_s3: BTreeMap<String, f64>,
    /// The same per rotary axis, deg/s³.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub max_jerk_deg_s3: BTreeMap<String, f64>,
    /// The same per joint, where the joints are not the axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joints: Option<BTreeMap<String, JointPeaks>>,
    /// Largest distance of a sample from the programmed path, mm.
    pub max_path_deviation_mm: f64,
    /// Per axis the sample that used most of each limit, whatever tolerance or excuse it had. Of steps of the velocity that
    /// the machine allows, what goes beyond them counts as acceleration.
    pub worst_of_limits: BTreeMap<String, OfLimits>,
    /// What the machine does with jerk: `limit` or `report`.
    pub jerk: String,
    /// Samples beyond a limit that were sent all the same, those of `jerk_relaxed_samples` among them.
    pub limit_violations: u64,
    /// Samples the guard stopped.
    pub guard_stops: u64,
    /// Samples with σ < 1 though nothing asked for it.
    pub governed_samples: u64,
    /// Samples in which the jerk limit was given up to keep velocity and acceleration.
    pub jerk_relaxed_samples: u64,
    /// Fine periods whose work went past their end.
    pub overruns: u64,
    /// Fine periods that passed without a sample.
    pub missed_periods: u64,
    /// Those among them in which the machine moved.
    pub missed_in_motion: u64,
    /// How late the fine loop woke; absent on the virtual clock.
    pub lateness_us: Option<LatenessUs>,
    /// How long the driver's exchange took; absent on the virtual clock.
    pub exchange_us: Option<ExchangeUs>,
    /// Samples in which what some drive told was old: a frame was lost, or late.
    pub old_feedback_samples: u64,
    /// The greatest age, periods.
    pub max_feedback_age_periods: u32,
    /// How far an exchange was from where the clock of its bus wants it at most, µs; absent where no driver tells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_phase_us: Option<f64>,
    /// Page faults of the fine thread; absent on the virtual clock.
    pub page_faults: Option<PageFaults>,
    /// How often the queue ran low.
    pub starvations: u64,
    /// Samples in which program time passed slower because the ring of segments holds too little of it for a stop from
    /// full rate, or comes by in more pieces than the fine loop looks at.
    pub queue_limited_samples: u64,
    /// Ratios that came late.
    pub late_ratios: u64,
    /// Samples the recorder lost.
    pub lost_samples: u64,
    /// Files of the run that could not be written to their end.
    pub record_errors: Vec<RecordError>,
    /// Where the machine came to rest, linear axes.
    pub end_position_mm: BTreeMap<String, f64>,
    /// The same of rotary axes, deg.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub end_position_deg: BTreeMap<String, f64>,
    /// Time the run took on the wall, s.
    pub wall_time_s: f64,
    /// Time spent in the rough loop a block, ns.
    pub planning_ns_per_block: f64,
    /// What the rough loop took of a rough period.
    pub planning_us: PlanningUs,
    /// Where the time of the motion went, sample by sample, s: what the planner says held the feed of the block down, or
    /// what slowed or stopped the machine there. Together they are `motion_time_s`.
    pub limited_by_s: BTreeMap<String, f64>,
    /// The policy script, where the machine has one.
    pub policy: Option<PolicySummary>,
    /// The stops, the first thousand: holds, program stops, starvation, aborts and faults.
    pub stops: Vec<Stop>,
    /// How many stops there were.
    pub stop_count: u64,
    /// The fault that ended the run, in words.
    pub fault: Option<String>,
    /// What ended the run before its program was over, without a fault: the operator's abort, in words.
    pub stopped: Option<String>,
}

impl Summary {
    /// Puts the run beside the best known time of its program, s. One that did not come to the end of the program keeps
    /// no ratio.
    pub fn compare(&mut self, reference_time_s: f64) {
        let whole = self.fault.is_none() && self.stopped.is_none();
        self.reference_time_s = Some(reference_time_s);
        self.time_ratio = whole.then_some(self.motion_time_s / reference_time_s);
    }

    /// What is to be known of a run that came to its end all the same, in words.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = vec![];
        let Self {
            old_feedback_samples,
            max_feedback_age_periods,
            ..
        } = self;
        if *old_feedback_samples > 0 {
            warnings.push(format!(
                "what the drives tell was old in {old_feedback_samples} samples, by {max_feedback_age_periods} periods at most: \
                 frames were lost, or late"
            ));
        }
        if self.missed_periods == 0 && self.overruns == 0 {
            return warnings;
        }
        let Self {
            missed_periods,
            missed_in_motion,
            overruns,
            samples,
            ..
        } = self;
        let over = match overruns {
            0 => String::new(),
            1 => "; once the work of a period went past its end".to_string(),
            _ => format!("; {overruns} times the work of a period went past its end"),
        };
        let cause = self
            .late_cause()
            .map(|cause| format!(": {cause}"))
            .unwrap_or_default();
        let beside = format!(
            "{missed_periods} fine periods went by without a sample, {missed_in_motion} of them in motion, \
             beside {samples} with one"
        );
        warnings.push(beside + &over + &cause);
        warnings
    }

    /// What made the fine loop late by a period or more, in words, where that is known.
    pub fn late_cause(&self) -> Option<String> {
        let period_ms = self.fine_period_s * 1e3;
        if let Some(ExchangeUs {
            max,
            longer_than_period,
        }) = self.exchange_us.filter(|e| e.longer_than_period > 0)
        {
            return Some(format!(
                "the driver's exchange took longer than the period of {period_ms} ms {longer_than_period} times, \
                 at most {:.3} ms",
                max / 1e3
            ));
        }
        let late_us = self.lateness_us?.max;
        let late = late_us >= period_ms * 1e3;
        late.then(|| {
            format!(
                "the computer woke the fine loop up to {:.3} ms late",
                late_us / 1e3
            )
        })
    }

    /// How the periods of the fine loop were kept, in words; nothing on the virtual clock.
    pub fn timing(&self) -> Option<String> {
        let late_us = self.lateness_us?.max;
        let Self {
            overruns,
            missed_periods,
            missed_in_motion,
            ..
        } = self;
        Some(format!(
            "overruns {overruns}, missed periods {missed_periods}, in motion {missed_in_motion}, \
             latest wake-up {late_us:.0} µs"
        ))
    }
}

/// Page faults of a thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct PageFaults {
    /// Pages read from a disk.
    pub major: u64,
    /// Pages that only had to be mapped.
    pub minor: u64,
}

impl PageFaults {
    /// Those since `earlier`.
    #[must_use]
    pub fn since(self, earlier: Self) -> Self {
        Self {
            major: self.major - earlier.major,
            minor: self.minor - earlier.minor,
        }
    }
}

/// How long the driver's exchange took of a fine period.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ExchangeUs {
    /// The longest, µs.
    pub max: f64,
    /// How many took longer than the fine period.
    pub longer_than_period: u64,
}

/// The sample that used most of a limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OfLimit<S = &'static str> {
    /// Share of the limit; zero where there is none.
    pub share: f64,
    /// Its tick.
    pub tick: u64,
    /// Its program line.
    pub line: u32,
    /// What the machine was doing.
    pub state: S,
}

/// What was used most of the limits of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OfLimits<S = &'static str> {
    /// Of its highest speed.
    pub velocity: OfLimit<S>,
    /// Of its acceleration.
    pub acceleration: OfLimit<S>,
    /// Of its jerk, where it has a limit.
    pub jerk: OfLimit<S>,
}

impl OfLimits {
    /// The same, as it is read from a file.
    #[must_use]
    pub fn owned(self) -> OfLimits<String> {
        let owned = |of: OfLimit| OfLimit {
            share: of.share,
            tick: of.tick,
            line: of.line,
            state: of.state.to_string(),
        };
        OfLimits {
            velocity: owned(self.velocity),
            acceleration: owned(self.acceleration),
            jerk: owned(self.jerk),
        }
    }
}

/// How late the fine loop woke, µs: percentiles to a hundredth, the maximum exactly.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LatenessUs {
    /// Half of the wake-ups were at most so late.
    pub p50: f64,
    /// 99 % were.
    pub p99: f64,
    /// 99.9 % were.
    pub p999: f64,
    /// All were.
    pub max: f64,
}

/// What the rough loop took of a period (program, policy, planner), µs: percentiles to a hundredth, the maximum exactly.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlanningUs {
    /// Half of the periods took at most so long.
    pub p50: f64,
    /// 99 % did.
    pub p99: f64,
    /// 99.9 % did.
    pub p999: f64,
    /// All did.
    pub max: f64,
    /// How many took how long, by half doublings.
    pub histogram: Vec<PlanningRow>,
}

/// A row of the histogram.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PlanningRow {
    /// Shortest time counted here, µs.
    pub from_us: f64,
    /// The time from which the next row counts, µs.
    pub below_us: f64,
    /// Rough periods.
    pub periods: u64,
}

impl From<&Lateness> for PlanningUs {
    fn from(times: &Lateness) -> Self {
        let us = |ns: u64| ns as f64 / 1e3;
        let LatenessUs {
            p50,
            p99,
            p999,
            max,
        } = LatenessUs::from(times);
        let row = |r: crate::lateness::Row| PlanningRow {
            from_us: us(r.from_ns),
            below_us: us(r.below_ns),
            periods: r.count,
        };
        Self {
            p50,
            p99,
            p999,
            max,
            histogram: times.rows().into_iter().map(row).collect(),
        }
    }
}

impl From<&Lateness> for LatenessUs {
    fn from(lateness: &Lateness) -> Self {
        let us = |ns: u64| ns as f64 / 1e3;
        let kept_by = |share| us(lateness.percentile_ns(share));
        Self {
            p50: kept_by(0.5),
            p99: kept_by(0.99),
            p999: kept_by(0.999),
            max: us(lateness.max_ns()),
        }
    }
}
