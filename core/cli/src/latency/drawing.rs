//! The measurement as a page.

use std::path::Path;

use tandem_host::Latency;
use tandem_recorder::{Lateness, LatenessUs, Output, Row};
use tandem_report::{LatencyBin, LatencyReport, LatencySeries};

use super::cyclictest::Cyclictest;
use crate::args;

/// Draws the measurement, beside that of `cyclictest` where there is one.
pub fn write(
    path: &Path,
    options: &args::Latency,
    latency: &Latency,
    beside: Option<&Cyclictest>,
) -> Result<(), String> {
    let mut report = LatencyReport {
        title: "Wake-up lateness of the fine loop".to_string(),
        facts: facts(options, latency),
        notes: latency.notes.clone(),
        series: vec![series("tandem latency", &latency.timing.lateness)],
    };
    if let Some(cyclictest) = beside {
        report
            .series
            .push(series("cyclictest", &cyclictest.lateness));
        if cyclictest.overflows > 1 {
            report.notes.push(format!(
                "{} wake-ups of cyclictest lie beyond its histogram; all but the latest are drawn at its end.",
                cyclictest.overflows
            ));
        }
    }
    let mut out = Output::create(path)?;
    report
        .write(&mut out)
        .map_err(|e| format!("{}: {e}", path.display()))?;
    out.finish()
}

fn facts(options: &args::Latency, latency: &Latency) -> Vec<(String, String)> {
    let timing = &latency.timing;
    let facts = [
        ("period", format!("{} ms", options.period_ms)),
        (
            "periods",
            (timing.lateness.count() + timing.missed_periods).to_string(),
        ),
        ("missed", timing.missed_periods.to_string()),
        ("overruns", timing.overruns.to_string()),
        (
            "page faults",
            (latency.page_faults.major + latency.page_faults.minor).to_string(),
        ),
        (
            "cores",
            if options.load {
                "kept busy"
            } else {
                "left alone"
            }
            .to_string(),
        ),
    ];
    facts.map(|(name, value)| (name.to_string(), value)).into()
}

fn series(name: &str, lateness: &Lateness) -> LatencySeries {
    let LatenessUs {
        p50,
        p99,
        p999,
        max,
    } = LatenessUs::from(lateness);
    let us = |ns: u64| ns as f64 / 1e3;
    let bin = |row: &Row| LatencyBin {
        from_us: us(row.from_ns),
        below_us: us(row.below_ns),
        count: row.count,
    };
    let bins = lateness.rows().iter().map(bin).collect();
    LatencySeries {
        name: name.to_string(),
        bins,
        percentiles_us: [p50, p99, p999, max],
    }
}
