//! Peaks and totals of a run, from its samples and blocks.

use tandem_machine::Machine;
use tandem_rings::Sample;
use tandem_sdk::{Axes, AxisVector, Block, BlockKind, BlockReport, Curve, MAX_AXES};

use crate::block_times::{BlockTimes, TimeGoesTo};
use crate::joint_peaks::{JointWatch, larger};
use crate::path_watch::PathWatch;
use crate::record::age;
use crate::stops::StopWatch;
use crate::worst::Worst;

/// Watches a run. Finite differences at the fine period, with rest before the first sample.
pub struct Monitor {
    rapid_mm_per_s: Vec<f64>,
    period_s: f64,
    last: [[f64; 3]; MAX_AXES],
    last_tick: u64,
    /// Samples seen.
    pub samples: u64,
    /// Largest velocity, acceleration, jerk per axis.
    pub peaks: [AxisVector; 3],
    /// Blocks driven.
    pub blocks: u64,
    /// Their path length, mm.
    pub length_mm: f64,
    /// Their nominal time, s.
    pub nominal_s: f64,
    /// The time of the motion by what held it down, s.
    pub limited_by_s: Vec<(TimeGoesTo, f64)>,
    times: BlockTimes,
    /// What each axis used most of its limits.
    pub worst: Worst,
    /// The last position sent.
    pub position: AxisVector,
    /// What each stop took.
    pub stops: StopWatch,
    watch: PathWatch,
    axes: Axes,
    /// Samples whose feedback was old, and by how many periods at most.
    pub old_feedback_samples: u64,
    /// The greatest age, periods.
    pub max_feedback_age_periods: u32,
    /// How far an exchange was from where the bus wants it at most, ns; none where no driver tells.
    pub max_phase_ns: Option<u64>,
    /// What the joints do, where they are not the axes.
    pub joints: Option<JointWatch>,
}

impl Monitor {
    /// Nothing seen yet; `leaves_path` as the planner describes itself.
    pub fn new(machine: &Machine, leaves_path: bool) -> Self {
        Self {
            rapid_mm_per_s: machine
                .limits
                .axes()
                .iter()
                .map(|a| a.rapid_mm_per_s)
                .collect(),
            period_s: machine.fine_period_s,
            last_tick: 0,
            last: [[0.0; 3]; MAX_AXES],
            samples: 0,
            peaks: [AxisVector::ZERO; 3],
            blocks: 0,
            length_mm: 0.0,
            nominal_s: 0.0,
            limited_by_s: Vec::new(),
            times: BlockTimes::new(machine.fine_period_s, machine.motion.max_feed_ratio),
            worst: Worst::new(machine),
            position: machine.start,
            stops: StopWatch::new(machine.axes, machine.fine_period_s),
            watch: PathWatch::new(
                leaves_path,
                machine.motion.path_tolerance_mm,
                &machine.start,
            ),
            axes: machine.axes,
            old_feedback_samples: 0,
            max_feedback_age_periods: 0,
            max_phase_ns: None,
            joints: None,
        }
    }

    /// Fine period, s.
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// Largest distance of a sample from the path, mm.
    pub fn max_path_deviation_mm(&self) -> f64 {
        self.watch.max_mm
    }

    /// A block is planned for good.
    pub fn block(&mut self, block: &Block, curve: Option<Curve<'_>>, report: &BlockReport) {
        self.watch.block(&self.axes, block, curve);
        self.blocks += 1;
        self.times.block(block, report);
        self.length_mm += block.length_mm;
        self.nominal_s += match block.kind {
            BlockKind::Dwell => block.dwell_s,
            BlockKind::Rapid => self.rapid_time_s(block),
            // Of the program: what a policy takes away is seen in the time, not in what it is compared with.
            _ => block.length_mm / block.feed_mm_per_s,
        };
    }

    fn rapid_time_s(&self, block: &Block) -> f64 {
        let each = self
            .rapid_mm_per_s
            .iter()
            .enumerate()
            .map(|(i, v)| (block.end[i] - block.start[i]).abs() / v);
        each.fold(0.0, f64::max)
    }

    /// A sample was sent. Gives its distance from the path, mm; where nobody needs `each` of them, only the largest so far is exact,
    /// and the others are less than that.
    pub fn sample(&mut self, sample: &Sample, each: bool) -> f64 {
        // A drive that homes its joint by itself has no samples; where it stands then is no motion.
        if self.samples == 0 || sample.tick != self.last_tick + 1 {
            self.last = sample.command.0.map(|position| [position, 0.0, 0.0]);
        }
        self.stops.sample(sample);
        let age_periods = age(sample);
        self.old_feedback_samples += u64::from(age_periods > 0);
        self.max_feedback_age_periods = self.max_feedback_age_periods.max(age_periods);
        let phase_ns = sample.phase_ns.map(i64::unsigned_abs);
        self.max_phase_ns = self.max_phase_ns.max(phase_ns);
        let by = &mut self.limited_by_s;
        // A handful of reasons: looking through them is the quickest, and this is done for every block.
        let part = |goes_to, time_s| match by.iter_mut().find(|(by, _)| *by == goes_to) {
            Some((_, all_s)) => *all_s += time_s,
            None => by.push((goes_to, time_s)),
        };
        self.times.sample(sample, part, |_, _| {});
        self.samples += 1;
        self.look_at_motion(sample);
        self.last_tick = sample.tick;
        if let Some(joints) = &mut self.joints {
            joints.sample(&sample.command);
        }
        self.position = sample.command;
        self.watch.sample(sample.block, &sample.command, each)
    }

    /// How each axis has moved up to `sample`.
    fn look_at_motion(&mut self, sample: &Sample) {
        let per_s = 1.0 / self.period_s;
        let [velocities, accelerations, jerks] = &mut self.peaks;
        let each = self.last[..self.axes.count()].iter_mut();
        for (axis, (last, position)) in each.zip(&sample.command.0).enumerate() {
            // Where an axis stood and goes on standing, nothing gets larger.
            if *position == last[0] && last[1..] == [0.0; 2] && self.worst.is_settled(axis) {
                continue;
            }
            let velocity = (position - last[0]) * per_s;
            let acceleration = (velocity - last[1]) * per_s;
            let jerk = (acceleration - last[2]) * per_s;
            *last = [*position, velocity, acceleration];
            velocities[axis] = larger(velocities[axis], velocity.abs());
            accelerations[axis] = larger(accelerations[axis], acceleration.abs());
            jerks[axis] = larger(jerks[axis], jerk.abs());
            self.worst
                .sample(axis, [velocity, acceleration, jerk], sample);
        }
    }
}
