//! The parts of the page that are text: facts, verdict, peaks, findings. They read the same without a script.

use std::fmt::Write;

use crate::columns::Derived;
use crate::differences::peak;
use crate::model::{Axis, Report};
use crate::text::{count, escape, number};

/// One line under the heading: program, machine, planner.
pub(crate) fn subtitle(report: &Report) -> String {
    let parts = [("program", &report.program), ("machine", &report.machine), ("planner", &report.planner)];
    let shown = parts.iter().filter(|(_, value)| !value.is_empty());
    shown.map(|(name, value)| format!("<span><i>{name}</i> {}</span>", escape(value))).collect()
}

/// The summary as rows of a table.
pub(crate) fn facts(report: &Report) -> String {
    let row = |(name, value): &(String, String)| format!("<tr><th>{}<td>{}", escape(name), escape(value));
    report.facts.iter().map(row).collect()
}

/// The verdict strip: what was judged, and how it went.
pub(crate) fn verdict(report: &Report, derived: &Derived) -> String {
    let findings = &derived.findings;
    let mut strip = chip(
        if findings.limit_violations == 0 { "good" } else { "bad" },
        "limit violations",
        &count(findings.limit_violations),
        if report.jerk_is_judged { "velocity, acceleration, jerk" } else { "velocity, acceleration" },
    );
    strip += &deviation_chip(report, findings.off_path);
    strip += &duration_chip(report);
    let fastest = number(peak(&report.samples.feed_mm_s) * 60.0);
    strip += &chip("", "peak path feed", &format!("{fastest} mm/min"), "");
    strip += &sigma_chip(report);
    strip + &following_chip(report, derived)
}

fn deviation_chip(report: &Report, off_path: usize) -> String {
    let Some(values) = &report.samples.deviation_mm else {
        return chip("", "path deviation", "not measured", "");
    };
    let note = report.path_tolerance_mm.map(|limit| format!("of {} mm allowed", number(limit)));
    let state = match report.path_tolerance_mm {
        None => "",
        Some(_) if off_path == 0 => "good",
        Some(_) => "bad",
    };
    chip(state, "path deviation", &format!("{} mm", number(peak(values))), &note.unwrap_or_default())
}

fn duration_chip(report: &Report) -> String {
    let t_s = &report.samples.t_s;
    let duration = t_s.last().copied().unwrap_or(0.0) - t_s.first().copied().unwrap_or(0.0);
    let note = format!("{} samples of {} ms", count(t_s.len()), number(report.fine_period_s * 1000.0));
    chip("", "duration", &format!("{duration:.3} s"), &note)
}

fn sigma_chip(report: &Report) -> String {
    let slowed = report.samples.sigma.iter().filter(|&&sigma| sigma < 1.0).count();
    if report.samples.sigma.is_empty() {
        return String::new();
    }
    chip("", "σ below 1", &count(slowed), "samples slowed by the governor")
}

fn following_chip(report: &Report, derived: &Derived) -> String {
    let worst = report.axes.iter().zip(&derived.following).filter(|(_, error)| !error.is_empty());
    let worst = worst.map(|(axis, error)| (peak(error), axis)).max_by(|a, b| a.0.total_cmp(&b.0));
    worst.map_or_else(String::new, |(error, axis)| {
        let value = format!("{} {}", number(error), axis.unit.as_str());
        chip("", "following error", &value, &format!("largest, axis {}", axis.letter))
    })
}

fn chip(state: &str, name: &str, value: &str, note: &str) -> String {
    format!("<li class=\"{state}\"><i>{name}</i><b>{value}</b><small>{}</small>", escape(note))
}

/// Per axis the peaks, as rows of a table, with the part of the limit that they use.
pub(crate) fn peaks(report: &Report, derived: &Derived) -> String {
    let mut rows = String::new();
    for (axis, motion) in report.axes.iter().zip(&derived.motions) {
        let unit = axis.unit.as_str();
        let _ = write!(rows, "<tr><th>{}<small>{unit}</small>", escape(&axis.letter.to_string()));
        rows += &usage(peak(&motion.velocity), Some(axis.max_velocity), 1e-6, true);
        rows += &usage(peak(&motion.acceleration), Some(axis.max_acceleration), 1e-6, axis.speed_difference == 0.0);
        rows += &usage(peak(&motion.jerk), axis.max_jerk, 1e-2, report.jerk_is_judged);
        if steps_are_allowed(&report.axes) {
            rows += &usage(motion.max_step, Some(axis.speed_difference), 1e-6, true);
        }
    }
    rows
}

/// The heading of [`peaks`].
pub(crate) fn peaks_head(report: &Report) -> String {
    let step = if steps_are_allowed(&report.axes) { "<th>step /s" } else { "" };
    format!("<tr><th>axis<th>velocity /s<th>acceleration /s²<th>jerk /s³{step}")
}

fn steps_are_allowed(axes: &[Axis]) -> bool {
    axes.iter().any(|axis| axis.speed_difference > 0.0)
}

/// A cell: the value, and a bar that says how much of the limit it is. Red only where exceeding it is a violation.
fn usage(value: f64, limit: Option<f64>, tolerance: f64, judged: bool) -> String {
    let Some(limit) = limit.filter(|limit| *limit > 0.0) else {
        return format!("<td>{}", number(value));
    };
    let part = value / limit;
    let state = match part > 1.0 + tolerance {
        true if judged => "over",
        true => "above",
        false => "",
    };
    let width = (part * 100.0).clamp(0.0, 100.0);
    let of = format!("{} of {}", number(value), number(limit));
    format!(
        "<td class=\"{state}\" title=\"{of}\">{}<small>/{}</small><u style=\"width:{width:.1}%\"></u>",
        number(value),
        number(limit)
    )
}

/// What exceeds a limit, as rows of a table; the script makes them lead to the place.
pub(crate) fn findings(derived: &Derived) -> String {
    let mut rows = String::new();
    for finding in &derived.findings.listed {
        let _ = write!(
            rows,
            "<tr class=\"over\" tabindex=\"0\" data-from=\"{}\" data-to=\"{}\"><td>{}<td>{:.4} s<td>{}<td>{} {}<td>{}<td>{}",
            finding.from_s,
            finding.to_s,
            escape(&finding.what),
            finding.from_s,
            finding.line,
            number(finding.peak),
            finding.unit,
            number(finding.limit),
            count(finding.samples),
        );
    }
    if derived.findings.unlisted > 0 {
        let _ =
            write!(rows, "<tr><td colspan=\"6\">and {} more, marked in the plots", count(derived.findings.unlisted));
    }
    rows
}

/// Sentences that a reader must know to read the curves right.
pub(crate) fn notes(report: &Report, derived: &Derived) -> String {
    let mut notes: Vec<String> = report.decimated.iter().map(|note| escape(note)).collect();
    if let Some(slice) = derived.thinning.slice() {
        notes.push(format!(
            "{} samples are too many for a page: every curve shows the smallest and the largest of each {slice} \
             samples, the path every {} samples. Limits were judged on all of them.",
            count(report.samples.t_s.len()),
            slice.div_ceil(2),
        ));
    }
    if !report.jerk_is_judged && report.axes.iter().any(|axis| axis.max_jerk.is_some()) {
        notes.push("Jerk is reported, not judged: this planner does not promise to limit it.".into());
    }
    notes.iter().map(|note| format!("<p>{note}</p>")).collect()
}
