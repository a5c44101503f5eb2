//! Collecting a run for its report.

use std::path::Path;

use tandem_machine::{JerkMode, Machine};
use tandem_recorder::{
    Output, PlanningRow, RecordError, Summary, age, worst_of_judged, worst_of_reported,
};
use tandem_report::{Axis, Ended, Report, Samples, Signal, Unit};
use tandem_rings::Sample;
use tandem_sdk::{Axes, AxisVector, Block, BlockReport, Curve};

use crate::corners::Corners;
use crate::curves::Curves;
use crate::tolerances::Tolerances;

/// Keeps every sample in memory: about 150 bytes a sample for three axes.
pub struct Collector {
    report: Report,
    axes: Axes,
    deviation_mm: Vec<f64>,
    /// How old feedback was, periods, and how far the exchange was from where the bus wants it, µs.
    feedback_age: Vec<f64>,
    phase_us: Vec<f64>,
    corners: Corners,
    curves: Curves,
    tolerances: Tolerances,
}

impl Collector {
    /// Nothing collected yet.
    pub fn new(machine: &Machine, program: &str, signals: &[&str], steps_allowed: bool) -> Self {
        let count = machine.axes.count();
        let samples = Samples {
            command: vec![vec![]; count],
            feedback: vec![vec![]; count],
            ..Samples::default()
        };
        let report = Report {
            title: format!("{program} on {}", machine.name),
            program: program.to_string(),
            machine: machine.name.clone(),
            planner: machine.planner.plugin.clone(),
            axes: (0..count)
                .map(|i| axis(machine, i, steps_allowed))
                .collect(),
            fine_period_s: machine.fine_period_s,
            samples,
            signals: signals.iter().map(|name| signal(name)).collect(),
            path_tolerance_mm: Some(machine.motion.path_tolerance_mm),
            jerk_is_judged: machine.motion.jerk == JerkMode::Limit,
            ..Report::default()
        };
        let tolerances = Tolerances::new(machine.motion.path_tolerance_mm);
        Self {
            report,
            axes: machine.axes,
            deviation_mm: vec![],
            feedback_age: vec![],
            phase_us: vec![],
            corners: Corners::default(),
            curves: Curves::new(machine),
            tolerances,
        }
    }

    /// A block is planned for good.
    pub fn block(&mut self, block: &Block, curve: Option<Curve<'_>>, report: &BlockReport) {
        self.corners.block(block, report);
        self.curves.block(block, curve);
        self.tolerances.block(block);
    }

    /// Adds a sample.
    pub fn sample(&mut self, sample: &Sample, deviation_mm: f64, signals: &[f64]) {
        let samples = &mut self.report.samples;
        samples
            .t_s
            .push(sample.tick as f64 * self.report.fine_period_s);
        samples.line.push(sample.line);
        samples.feed_mm_s.push(sample.feed_mm_per_s);
        samples.sigma.push(sample.sigma);
        let programmed = sample.programmed_feed_mm_per_s;
        samples
            .programmed_feed_mm_s
            .push(if programmed.is_finite() {
                programmed
            } else {
                f64::NAN
            });
        self.deviation_mm.push(deviation_mm);
        self.feedback_age.push(f64::from(age(sample)));
        let phase_us = sample.phase_ns.map_or(f64::NAN, |ns| ns as f64 / 1e3);
        self.phase_us.push(phase_us);
        self.corners.sample(sample);
        self.curves.sample(sample);
        self.tolerances.sample(sample);
        push(&mut samples.command, &sample.command, &self.axes);
        push(&mut samples.feedback, &sample.feedback, &self.axes);
        for (signal, value) in self.report.signals.iter_mut().zip(signals) {
            signal.values.push(*value);
        }
    }

    /// Writes the page.
    ///
    /// # Errors
    /// It cannot be written: nothing of it is left.
    pub fn write(mut self, path: &Path, summary: &Summary) -> Result<(), RecordError> {
        self.report.samples.deviation_mm = Some(self.deviation_mm);
        self.report.facts = facts(summary);
        let fault = summary.fault.clone().map(Ended::Fault);
        self.report.ended = fault.or_else(|| summary.stopped.clone().map(Ended::Stopped));
        self.report.signals.extend(self.corners.signals());
        // Of a bus; a driver without one has neither.
        for (name, unit, values, is_told) in [
            (
                "age of feedback",
                "periods",
                self.feedback_age,
                summary.old_feedback_samples > 0,
            ),
            (
                "phase of the exchange",
                "µs",
                self.phase_us,
                summary.max_phase_us.is_some(),
            ),
        ] {
            self.report.signals.extend(is_told.then(|| Signal {
                name: name.to_string(),
                unit: unit.to_string(),
                values,
            }));
        }
        let (curves, chord_share) = self.curves.signals();
        self.report.signals.extend(curves);
        self.report.samples.chord_share = chord_share;
        let (max_mm, each_mm) = self.tolerances.of_run_mm();
        (
            self.report.path_tolerance_mm,
            self.report.samples.tolerance_mm,
        ) = (Some(max_mm), each_mm);
        let lost = |cause: String| RecordError::lost("report", path, cause);
        let mut out = Output::create(path).map_err(lost)?;
        self.report
            .write(&mut out)
            .map_err(|e| lost(e.to_string()))?;
        out.close().map_err(|e| lost(e.to_string()))?;
        out.finish().map_err(lost)
    }
}

/// A curve called after a signal; its unit stands at the end of the name.
fn signal(name: &str) -> Signal {
    let units = [
        ("_mm_per_min", "mm/min"),
        ("_mm_per_s", "mm/s"),
        ("_nm", "N·m"),
        ("_mm", "mm"),
        ("_n", "N"),
        ("_a", "A"),
    ];
    let unit = units
        .iter()
        .find(|(suffix, _)| name.ends_with(suffix))
        .map_or("", |(_, unit)| unit);
    Signal {
        name: name.to_string(),
        unit: unit.to_string(),
        ..Signal::default()
    }
}

fn push(columns: &mut [Vec<f64>], position: &AxisVector, axes: &Axes) {
    for (axis, column) in columns.iter_mut().enumerate() {
        column.push(if axes.is_rotary(axis) {
            position[axis].to_degrees()
        } else {
            position[axis]
        });
    }
}

fn axis(machine: &Machine, index: usize, steps_allowed: bool) -> Axis {
    let limits = &machine.limits.axes()[index];
    let rotary = machine.axes.is_rotary(index);
    let shown = |value: f64| if rotary { value.to_degrees() } else { value };
    Axis {
        letter: machine.axes.letter(index),
        unit: if rotary { Unit::Deg } else { Unit::Mm },
        max_velocity: shown(limits.feed_mm_per_s.max(limits.rapid_mm_per_s)),
        max_acceleration: shown(limits.acceleration_mm_per_s2),
        max_jerk: Some(shown(limits.jerk_mm_per_s3)).filter(|j| j.is_finite()),
        speed_difference: if steps_allowed {
            shown(limits.speed_difference_mm_per_s)
        } else {
            0.0
        },
    }
}

fn facts(summary: &Summary) -> Vec<(String, String)> {
    let fact = |name: &str, value: String| (name.to_string(), value);
    let mut facts = vec![
        fact("time", format!("{:.3} s", summary.motion_time_s)),
        fact("nominal time", format!("{:.3} s", summary.nominal_time_s)),
        fact(
            "path",
            format!("{:.3} mm in {} blocks", summary.length_mm, summary.blocks),
        ),
        fact("clock", summary.clock.clone()),
        fact(
            "samples",
            format!("{} at {} ms", summary.samples, summary.fine_period_s * 1e3),
        ),
        fact(
            "largest distance from the path",
            format!("{:.3} µm", summary.max_path_deviation_mm * 1e3),
        ),
        fact(
            "samples beyond a limit sent, guard stops",
            format!("{}, {}", summary.limit_violations, summary.guard_stops),
        ),
        fact(
            "largest share of a limit, beyond it",
            worst_of_judged(&summary.jerk, &summary.worst_of_limits)
                .unwrap_or_else(|| "none".to_string()),
        ),
        fact(
            "governed samples, starvations",
            format!("{}, {}", summary.governed_samples, summary.starvations),
        ),
    ];
    facts.extend(
        worst_of_reported(&summary.jerk, &summary.worst_of_limits)
            .map(|worst| fact("largest jerk, which is only reported", worst)),
    );
    facts.extend(
        summary
            .max_phase_us
            .map(|us| fact("largest phase of an exchange", format!("{us:.1} µs"))),
    );
    facts.extend(summary.timing().map(|timing| fact("fine loop", timing)));
    facts.extend(
        summary
            .warnings()
            .into_iter()
            .map(|warning| fact("warning", warning)),
    );
    facts.extend(
        summary
            .record_errors
            .iter()
            .map(|error| fact("not complete", error.to_string())),
    );
    if let (Some(ratio), Some(reference_time_s)) = (summary.time_ratio, summary.reference_time_s) {
        facts.insert(
            1,
            fact("T/T_ref", format!("{ratio:.4} of {reference_time_s} s")),
        );
    }
    let total_s: f64 = summary.limited_by_s.values().sum();
    let percent = |(by, time_s): (&String, &f64)| format!("{by} {:.1} %", 100.0 * time_s / total_s);
    if total_s > 0.0 {
        let each: Vec<_> = summary.limited_by_s.iter().map(percent).collect();
        facts.push(fact("what the time of the motion went to", each.join(", ")));
    }
    facts.push(fact(
        "planning a rough period, µs: periods",
        planning(summary),
    ));
    facts.extend(
        summary
            .fault
            .iter()
            .map(|fault| fact("fault", fault.clone())),
    );
    facts
}

/// The histogram of planning times, by doublings; short ones together.
fn planning(summary: &Summary) -> String {
    const SHORT_US: f64 = 100.0;
    let rows = &summary.planning_us.histogram;
    let first = rows
        .iter()
        .position(|row| row.from_us >= SHORT_US)
        .unwrap_or(rows.len());
    let words = |rows: &[PlanningRow]| {
        let below_us = rows.iter().map(|row| row.below_us).fold(0.0, f64::max);
        let periods: u64 = rows.iter().map(|row| row.periods).sum();
        (periods > 0).then(|| format!("below {below_us:.0}: {periods}"))
    };
    let (short, long) = rows.split_at(first);
    let rows: Vec<_> = std::iter::once(short)
        .chain(long.chunks(2))
        .filter_map(words)
        .collect();
    format!(
        "{}; at most {:.0}",
        rows.join(", "),
        summary.planning_us.max
    )
}
