//! The order of the judgements.

use crate::{
    Check, Finding, Joints, Kind, LETTERS, Machine, Maxima, Options, Position, Row, Trace, Verdict,
    feed::judge_feed,
    follow::{Followed, follow},
    geometry::{distance, minus},
    limits::judge_limits,
    path::Path,
    program,
    vertices::{length_to_mm, lengths_mm, vertices},
};

/// Findings on their way to the verdict.
pub struct Report<'a> {
    rows: &'a [Row],
    pub findings: Vec<Finding>,
    pub maxima: Maxima,
    /// The joint that is judged, where it is no axis.
    pub joint: Option<String>,
}

impl Report<'_> {
    pub fn add(&mut self, kind: Kind, sample: usize, axis: Option<usize>, value: f64, limit: f64) {
        let Row { t_s, line, .. } = self.rows[sample];
        let joint = self.joint.clone();
        self.findings.push(Finding {
            kind,
            sample,
            t_s,
            line,
            axis,
            joint,
            value,
            limit,
        });
    }
}

/// Judges a trace against the program and the machine it ran on.
///
/// Limits are judged even where the program cannot be read; the verdict is then a failure, or *not judged*.
pub fn judge(trace: &Trace, program: &str, machine: &Machine, options: &Options) -> Verdict {
    if let Some(reason) = unfit(trace, machine, options) {
        return Verdict {
            not_judged: Some(reason),
            ..Verdict::default()
        }
        .settle();
    }
    let mut report = Report {
        rows: &trace.rows,
        findings: Vec::new(),
        maxima: Maxima::default(),
        joint: None,
    };
    let mut not_judged = match &machine.joints {
        Joints::Unknown(reason) if limits_asked(options) => Some(format!("the joints: {reason}")),
        _ => None,
    };
    judge_finite(trace, &mut report);
    // Differences of what is no number say nothing more.
    if report.findings.is_empty() {
        judge_limits(&trace.rows, machine, options, &mut report);
        if options.asks_program() {
            match program::read(program, machine, options, &trace.rows) {
                Ok(path) => judge_program(&path, trace, machine, options, &mut report),
                Err(unread) => {
                    not_judged = Some(
                        not_judged
                            .map_or(unread.to_string(), |joints| format!("{joints}; {unread}")),
                    );
                }
            }
        }
    }
    let Report {
        findings, maxima, ..
    } = report;
    Verdict {
        findings,
        not_judged,
        maxima,
        ..Verdict::default()
    }
    .settle()
}

fn limits_asked(options: &Options) -> bool {
    [
        Check::Travel,
        Check::Velocity,
        Check::Acceleration,
        Check::Jerk,
    ]
    .into_iter()
    .any(|check| options.asks(check))
}

/// Why a trace cannot be judged on a machine at all.
fn unfit(trace: &Trace, machine: &Machine, options: &Options) -> Option<String> {
    if trace.rows.is_empty() {
        return Some("the trace has no rows".into());
    }
    if !(machine.fine_period_s.is_finite() && machine.fine_period_s > 0.0) {
        return Some("the machine has no fine period".into());
    }
    if let Some(axis) = machine
        .axes
        .iter()
        .find(|axis| !trace.axes.contains(&axis.index))
    {
        return Some(format!("the trace has no axis {}", LETTERS[axis.index]));
    }
    if let Some(&axis) = trace
        .axes
        .iter()
        .find(|&&axis| machine.axis(axis).is_none())
    {
        return Some(format!("the machine has no axis {}", LETTERS[axis]));
    }
    if let Some(axis) = machine
        .axes
        .iter()
        .find(|axis| axis.rotary != trace.degrees.contains(&axis.index))
    {
        let (letter, unit) = (
            LETTERS[axis.index],
            if axis.rotary { "mm" } else { "degrees" },
        );
        return Some(format!("the trace has axis {letter} in {unit}"));
    }
    if options.checks.is_empty() {
        return Some("no judgement is asked for".into());
    }
    let mut jerkless = machine
        .axes
        .iter()
        .filter(|axis| axis.max_jerk_mm_per_s3.is_none());
    let jerkless = jerkless.next().filter(|_| options.asks(Check::Jerk))?;
    Some(format!("axis {} has no max_jerk", LETTERS[jerkless.index]))
}

fn judge_finite(trace: &Trace, report: &mut Report) {
    for (index, row) in trace.rows.iter().enumerate() {
        if !row.t_s.is_finite() {
            report.add(Kind::NotFinite, index, None, row.t_s, f64::MAX);
        }
        for &axis in trace
            .axes
            .iter()
            .filter(|&&axis| !row.command[axis].is_finite())
        {
            report.add(
                Kind::NotFinite,
                index,
                Some(axis),
                row.command[axis],
                f64::MAX,
            );
        }
    }
    for &(row, _, value) in &trace.not_finite {
        report.add(Kind::NotFinite, row, None, value, f64::MAX);
    }
}

fn judge_program(
    path: &Path,
    trace: &Trace,
    machine: &Machine,
    options: &Options,
    report: &mut Report,
) {
    if options.asks(Check::EndPoint) {
        judge_ends(path, &trace.rows, machine, options, report);
    }
    let until_s = options.path_until_s.unwrap_or(f64::INFINITY);
    let rows = &trace.rows[..trace.rows.partition_point(|row| row.t_s <= until_s)];
    let commands: Vec<Position> = rows.iter().map(|row| row.command).collect();
    if path.elements.is_empty() || rows.is_empty() {
        return judge_standstill(path, &commands, machine, options, report);
    }
    let followed = follow(path, &commands, options);
    if options.asks(Check::Path) {
        judge_path(path, &followed, machine, options, report);
    }
    if options.asks(Check::Vertices) {
        judge_vertices(path, &followed, options, report);
    }
    // Off the path it is not known which block a sample belongs to.
    if options.asks(Check::Feed) && followed.misses.is_empty() {
        judge_feed(&path.elements, rows, &followed, machine, options, report);
    }
}

fn judge_ends(
    path: &Path,
    rows: &[Row],
    machine: &Machine,
    options: &Options,
    report: &mut Report,
) {
    let last = rows.len() - 1;
    let off_start = minus(&rows[0].command, &machine.start());
    let off_end = minus(&rows[last].command, &path.end);
    for axis in machine.axes.iter().map(|axis| axis.index) {
        if off_start[axis].abs() > options.end_tolerance_mm {
            report.add(
                Kind::StartPoint,
                0,
                Some(axis),
                off_start[axis],
                options.end_tolerance_mm,
            );
        }
        report.maxima.end_error_mm = report.maxima.end_error_mm.max(off_end[axis].abs());
        if off_end[axis].abs() > options.end_tolerance_mm && !options.ends_early {
            report.add(
                Kind::EndPoint,
                last,
                Some(axis),
                off_end[axis],
                options.end_tolerance_mm,
            );
        }
    }
}

/// A program that moves nothing: neither may the samples.
fn judge_standstill(
    path: &Path,
    commands: &[Position],
    machine: &Machine,
    options: &Options,
    report: &mut Report,
) {
    let tolerance_mm = options
        .sample_tolerance_mm
        .unwrap_or(machine.path_tolerance_mm);
    for (sample, command) in commands
        .iter()
        .enumerate()
        .filter(|_| path.elements.is_empty())
    {
        let off_mm = distance(command, &path.end);
        report.maxima.sample_deviation_mm = report.maxima.sample_deviation_mm.max(off_mm);
        if off_mm > tolerance_mm && options.asks(Check::Path) {
            report.add(Kind::PathDeviation, sample, None, off_mm, tolerance_mm);
        }
    }
}

fn judge_path(
    path: &Path,
    followed: &Followed,
    machine: &Machine,
    options: &Options,
    report: &mut Report,
) {
    report.maxima.sample_deviation_mm = followed.deviation_mm;
    for &(link, off_mm) in &followed.misses {
        let tolerance_mm = path.elements[followed.places[link].element].tolerance_mm;
        let tolerance_mm = options.sample_tolerance_mm.unwrap_or(tolerance_mm);
        report.add(
            Kind::PathDeviation,
            followed.samples[link],
            None,
            off_mm,
            tolerance_mm,
        );
    }
    let lengths_mm = lengths_mm(&path.elements);
    let left_mm = lengths_mm[path.elements.len()] - length_to_mm(&lengths_mm, followed.end);
    if left_mm > 0.0 && !options.ends_early {
        let tolerance_mm = options
            .sample_tolerance_mm
            .unwrap_or(machine.path_tolerance_mm);
        report.add(
            Kind::NotCovered,
            followed.links.len() - 1,
            None,
            left_mm,
            tolerance_mm,
        );
    }
}

fn judge_vertices(path: &Path, followed: &Followed, options: &Options, report: &mut Report) {
    for vertex in vertices(&path.elements, followed, options) {
        let most = if vertex.exact_stop {
            &mut report.maxima.exact_stop_error_mm
        } else {
            &mut report.maxima.vertex_deviation_mm
        };
        *most = most.max(vertex.off_mm);
        if vertex.off_mm > vertex.limit_mm {
            report.add(
                Kind::VertexMissed,
                vertex.sample,
                None,
                vertex.off_mm,
                vertex.limit_mm,
            );
            if let Some(finding) = report.findings.last_mut() {
                finding.line = vertex.line;
            }
        }
    }
}
