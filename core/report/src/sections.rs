//! The head of the page: what ran, the verdict, what a reader must know. It reads the same without a script.

use crate::columns::Derived;
use crate::differences::peak;
use crate::model::{Ended, Report};
use crate::text::{count, escape, number};

/// One line under the heading: program, machine, planner.
pub(crate) fn subtitle(report: &Report) -> String {
    let parts = [
        ("program", &report.program),
        ("machine", &report.machine),
        ("planner", &report.planner),
    ];
    let shown = parts.iter().filter(|(_, value)| !value.is_empty());
    shown
        .map(|(name, value)| format!("<span><i>{name}</i> {}</span>", escape(value)))
        .collect::<Vec<_>>()
        .concat()
}

/// The verdict strip: what was judged, and how it went.
pub(crate) fn verdict(report: &Report, derived: &Derived) -> String {
    let findings = &derived.findings;
    let mut strip = ended_chip(report);
    strip += &limits_chip(report, derived);
    strip += &deviation_chip(report, findings.off_path);
    strip += &duration_chip(report);
    let fastest = number(peak(&report.samples.feed_mm_s) * 60.0);
    strip += &chip("", "peak path feed", &format!("{fastest} mm/min"), "");
    strip += &sigma_chip(report);
    strip + &following_chip(report, derived)
}

fn ended_chip(report: &Report) -> String {
    match &report.ended {
        None => String::new(),
        Some(Ended::Fault(words)) => chip("bad ended", "the run", "ended in a fault", words),
        Some(Ended::Stopped(words)) => chip("warn ended", "the run", "was stopped", words),
    }
}

/// How often a limit was exceeded. It is green only where nothing lies above a limit at all: a peak that the judge still
/// lets pass stands beside the count.
fn limits_chip(report: &Report, derived: &Derived) -> String {
    let violations = derived.findings.limit_violations;
    let judged = if report.jerk_is_judged {
        "velocity, acceleration, jerk"
    } else {
        "velocity, acceleration"
    };
    let above = furthest_above(report, derived);
    let state = match (violations, &above) {
        (0, None) => "good",
        (0, Some(_)) => "warn",
        _ => "bad",
    };
    let note = above.map_or_else(|| judged.to_string(), |above| format!("{judged}; {above}"));
    chip(state, "limit violations", &count(violations), &note)
}

/// The judged peak that lies furthest above its limit, in words. Accelerations where steps are allowed have no plain limit.
fn furthest_above(report: &Report, derived: &Derived) -> Option<String> {
    let peaks = report
        .axes
        .iter()
        .zip(&derived.motions)
        .flat_map(|(axis, motion)| {
            let plain = axis.speed_difference == 0.0;
            [
                (
                    axis,
                    "velocity",
                    peak(&motion.velocity),
                    Some(axis.max_velocity),
                ),
                (
                    axis,
                    "acceleration",
                    peak(&motion.acceleration),
                    Some(axis.max_acceleration).filter(|_| plain),
                ),
                (
                    axis,
                    "jerk",
                    peak(&motion.jerk),
                    axis.max_jerk.filter(|_| report.jerk_is_judged),
                ),
            ]
        });
    let shares = peaks.filter_map(|(axis, name, peak, limit)| {
        Some((peak / limit.filter(|l| *l > 0.0)?, axis, name))
    });
    // Beyond what rounding of positions alone makes of a peak.
    let above = shares.filter(|(share, ..)| *share > 1.0 + ROUNDING);
    let (share, axis, name) = above.max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(format!(
        "{name} of {} {} % above",
        axis.letter,
        number(100.0 * (share - 1.0))
    ))
}

/// Share above a limit that is no more than rounding.
const ROUNDING: f64 = 1e-4;

fn deviation_chip(report: &Report, off_path: usize) -> String {
    let Some(values) = &report.samples.deviation_mm else {
        return chip("", "path deviation", "not measured", "");
    };
    let note = report
        .path_tolerance_mm
        .map(|limit| match &report.samples.tolerance_mm {
            None => format!("of {} mm allowed", number(limit)),
            Some(each) => {
                let low = each.iter().copied().fold(f64::INFINITY, f64::min);
                format!("of {} to {} mm allowed", number(low), number(peak(each)))
            }
        });
    let state = match report.path_tolerance_mm {
        None => "",
        Some(_) if off_path == 0 => "good",
        Some(_) => "bad",
    };
    chip(
        state,
        "path deviation",
        &format!("{} mm", number(peak(values))),
        &note.unwrap_or_default(),
    )
}

fn duration_chip(report: &Report) -> String {
    let t_s = &report.samples.t_s;
    let duration = t_s.last().copied().unwrap_or(0.0) - t_s.first().copied().unwrap_or(0.0);
    let note = format!(
        "{} samples of {} ms",
        count(t_s.len()),
        number(report.fine_period_s * 1000.0)
    );
    chip("", "duration", &format!("{duration:.3} s"), &note)
}

fn sigma_chip(report: &Report) -> String {
    let slowed = report
        .samples
        .sigma
        .iter()
        .filter(|&&sigma| sigma < 1.0)
        .count();
    if report.samples.sigma.is_empty() {
        return String::new();
    }
    chip(
        "",
        "σ below 1",
        &count(slowed),
        "samples at less than full rate",
    )
}

fn following_chip(report: &Report, derived: &Derived) -> String {
    let worst = report
        .axes
        .iter()
        .zip(&derived.following)
        .filter(|(_, error)| !error.is_empty());
    let worst = worst
        .map(|(axis, error)| (peak(error), axis))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    worst.map_or_else(String::new, |(error, axis)| {
        let value = format!("{} {}", number(error), axis.unit.as_str());
        chip(
            "",
            "following error",
            &value,
            &format!("largest, axis {}", axis.letter),
        )
    })
}

fn chip(state: &str, name: &str, value: &str, note: &str) -> String {
    format!(
        "<li class=\"{state}\"><i>{name}</i><b>{value}</b><small>{}</small>",
        escape(note)
    )
}

/// Sentences that a reader must know to read the curves right.
pub(crate) fn notes(report: &Report, derived: &Derived) -> String {
    let mut notes: Vec<String> = report.decimated.iter().map(|note| escape(note)).collect();
    if let Some(slice) = derived.thinning.slice() {
        notes.push(format!(
            "{} samples are too many for a page: every curve shows the smallest and the largest of each {slice} \
             samples, the path two points of them. Limits were judged on all of them.",
            count(report.samples.t_s.len()),
        ));
    }
    if !report.jerk_is_judged && report.axes.iter().any(|axis| axis.max_jerk.is_some()) {
        notes.push(
            "Jerk is reported, not judged: this planner does not promise to limit it.".into(),
        );
    }
    notes
        .iter()
        .map(|note| format!("<p>{note}</p>"))
        .collect::<Vec<_>>()
        .concat()
}
