//! `tandem trace export`.

use std::error::Error;
use std::io::Write;
use std::path::Path;

use tandem_recorder::{Output, TraceCsv};

use super::binary::Binary;
use super::samples::switched_columns;

/// Writes a binary trace as the CSV that the run would have written, and the operator's commands as a command file.
/// Status 1 where not every record could be read; what could is written all the same.
pub fn export(trace: &Path, csv: &Path, commands: Option<&Path>) -> Result<u8, Box<dyn Error>> {
    if trace == csv || commands == Some(trace) {
        return Err(format!("{}: it would be replaced", trace.display()).into());
    }
    if commands == Some(csv) {
        return Err(format!("{}: samples and commands need a file each", csv.display()).into());
    }
    let mut trace = Binary::open(trace)?;
    let header = trace.header();
    let signals: Vec<&str> = header.signals.iter().map(String::as_str).collect();
    let mut csv = TraceCsv::of_axes(
        csv,
        header.axes,
        header.fine_period_s,
        &signals,
        switched_columns(trace.format()),
    )?;
    let count = signals.len();
    while let Some(record) = trace.next()? {
        csv.sample(&record.sample, &record.signals[..count])?;
    }
    csv.finish()?;
    if let Some(path) = commands {
        write_commands(path, &trace.commands)?;
    }
    Ok(trace.conclude())
}

fn write_commands(path: &Path, lines: &[String]) -> Result<(), String> {
    let mut out = Output::create(path)?;
    let mut write = || {
        writeln!(out, "# tick,command[,value]")?;
        lines.iter().try_for_each(|line| writeln!(out, "{line}"))
    };
    write().map_err(|e: std::io::Error| format!("{}: {e}", path.display()))?;
    out.finish()
}
