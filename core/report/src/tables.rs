//! The tables of the page: the summary, peaks beside limits, what exceeds a limit.

use std::fmt::Write;

use crate::columns::Derived;
use crate::differences::peak;
use crate::model::{Axis, Report};
use crate::text::{count, escape, number};

/// The summary as rows of a table.
pub(crate) fn facts(report: &Report, derived: &Derived) -> String {
    let row =
        |(name, value): &(String, String)| format!("<tr><th>{}<td>{}", escape(name), escape(value));
    let binds = (
        "what binds, of the time in motion".to_string(),
        derived.binding.words(),
    );
    report
        .facts
        .iter()
        .chain([&binds])
        .map(row)
        .collect::<Vec<_>>()
        .concat()
}

/// Per axis the peaks, as rows of a table, with the part of the limit that they use.
pub(crate) fn peaks(report: &Report, derived: &Derived) -> String {
    let mut rows = String::new();
    for (axis, motion) in report.axes.iter().zip(&derived.motions) {
        let unit = axis.unit.as_str();
        let _ = write!(
            rows,
            "<tr><th>{}<small>{unit}</small>",
            escape(&axis.letter.to_string())
        );
        rows += &usage(peak(&motion.velocity), Some(axis.max_velocity), 1e-6, true);
        rows += &usage(
            peak(&motion.acceleration),
            Some(axis.max_acceleration),
            1e-6,
            axis.speed_difference == 0.0,
        );
        rows += &usage(
            peak(&motion.jerk),
            axis.max_jerk,
            1e-2,
            report.jerk_is_judged,
        );
        if steps_are_allowed(&report.axes) {
            rows += &usage(motion.max_step, Some(axis.speed_difference), 1e-6, true);
        }
    }
    rows
}

/// The heading of [`peaks`].
pub(crate) fn peaks_head(report: &Report) -> String {
    let step = if steps_are_allowed(&report.axes) {
        "<th>step /s"
    } else {
        ""
    };
    format!("<tr><th>axis<th>velocity /s<th>acceleration /s²<th>jerk /s³{step}")
}

fn steps_are_allowed(axes: &[Axis]) -> bool {
    axes.iter().any(|axis| axis.speed_difference > 0.0)
}

/// Shares so near to 1 are rounding.
const ROUNDING: f64 = 1e-6;

/// A cell: the value, and a bar that says how much of the limit it is. Red only where exceeding it is a violation.
fn usage(value: f64, limit: Option<f64>, tolerance: f64, judged: bool) -> String {
    let Some(limit) = limit.filter(|limit| *limit > 0.0) else {
        return format!("<td>{}", number(value));
    };
    let part = value / limit;
    // By the value itself: what is beyond the limit but within the tolerance is told so, and not as what keeps it.
    let (state, excess) = match part {
        part if part > 1.0 + tolerance && judged => {
            ("over", format!(", {:.2} % beyond", 100.0 * (part - 1.0)))
        }
        part if part > 1.0 + tolerance => (
            "above",
            format!(", {:.2} % beyond, not judged", 100.0 * (part - 1.0)),
        ),
        part if part > 1.0 + ROUNDING => (
            "above",
            format!(", {:.2} % beyond, within tolerance", 100.0 * (part - 1.0)),
        ),
        _ => ("", String::new()),
    };
    let width = (part * 100.0).clamp(0.0, 100.0);
    let of = format!("{} of {}", number(value), number(limit));
    format!(
        "<td class=\"{state}\" title=\"{of}\">{}<small>/{}{excess}</small><u style=\"width:{width:.1}%\"></u>",
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
        let _ = write!(
            rows,
            "<tr><td colspan=\"6\">and {} more, marked in the plots",
            count(derived.findings.unlisted)
        );
    }
    rows
}
