//! Estimates as a page.

use std::path::Path;

use tandem_estimate::Estimate;
use tandem_machine::Machine;
use tandem_recorder::Output;
use tandem_report::{EstimateReport, EstimatedField, EstimatedProgram};

/// Draws all programs, one below the other.
pub fn write(path: &Path, machine: &Machine, estimates: &[Estimate]) -> Result<(), String> {
    let model = estimates.first().map_or("", |estimate| estimate.model);
    let report = EstimateReport {
        title: format!("Machining time on {}", machine.name),
        facts: vec![("model".to_string(), model.to_string())],
        programs: estimates.iter().map(program).collect(),
    };
    let mut out = Output::create(path)?;
    report
        .write(&mut out)
        .map_err(|e| format!("{}: {e}", path.display()))?;
    out.finish()
}

fn program(estimate: &Estimate) -> EstimatedProgram {
    let tally = &estimate.tally;
    let (long, short) = tally.long_and_short();
    let seconds = |time_s: f64| format!("{time_s:.3} s");
    let facts = [
        ("estimated", seconds(estimate.estimated_s)),
        ("nominal", seconds(tally.all.nominal_s)),
        ("cutting", seconds(tally.cutting.time_s)),
        ("rapid", seconds(tally.rapid.time_s)),
        ("dwell", seconds(tally.dwell.time_s)),
        (
            "blocks that reach their feed",
            format!("{long} of {}", long + short),
        ),
    ];
    let fields = tally
        .histogram
        .fields()
        .map(|(length_mm, feed_mm_per_min, field)| EstimatedField {
            length_mm,
            feed_mm_per_min,
            blocks: field.blocks,
            time_s: field.time_s,
        });
    EstimatedProgram {
        name: estimate.program.clone(),
        facts: facts.map(|(name, value)| (name.to_string(), value)).into(),
        fields: fields.collect(),
        programmed_mm_per_min: tally.feeds_mm_per_min.clone(),
    }
}
