//! The page of a program that is refused.

use std::path::Path;

use tandem_gcode::{CheckReport, Diagnostic};
use tandem_recorder::Output;
use tandem_report::{RefusalReport, RefusedPlace};

/// Writes what is wrong with the program `name`, with the places in the path.
pub fn write(path: &Path, name: &str, report: &CheckReport) -> Result<(), String> {
    let count = report.diagnostics.len() as u64 + report.unlisted;
    let page = RefusalReport {
        title: format!("{name} is refused"),
        facts: vec![("errors".to_string(), count.to_string())],
        errors: report.diagnostics.iter().map(place).collect(),
    };
    let mut out = Output::create(path)?;
    page.write(&mut out)
        .map_err(|e| format!("{}: {e}", path.display()))?;
    out.finish()
}

fn place(error: &Diagnostic) -> RefusedPlace {
    let message = error.to_string();
    let Some(sketch) = &error.sketch else {
        return RefusedPlace {
            message,
            ..RefusedPlace::default()
        };
    };
    let moves = sketch.moves.iter();
    RefusedPlace {
        message,
        axes: sketch.axes.map(String::from),
        moves: moves
            .map(|(line, points)| (format!("line {line}"), points.clone()))
            .collect(),
        tool_at_mm: sketch.tool_at_mm,
        tool_radius_mm: sketch.tool_radius_mm,
    }
}
