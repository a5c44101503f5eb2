//! `tandem trace export`.

use std::error::Error;
use std::path::Path;

use tandem_host::TraceCsv;

use super::binary::Binary;

/// Writes a binary trace as the CSV that the run would have written. Status 1 where not every record could be read; what
/// could is written all the same.
pub fn export(trace: &Path, csv: &Path) -> Result<u8, Box<dyn Error>> {
    if trace == csv {
        return Err(format!("{}: the CSV would replace the trace", csv.display()).into());
    }
    let mut trace = Binary::open(trace)?;
    let header = trace.header();
    let signals: Vec<&str> = header.signals.iter().map(String::as_str).collect();
    let mut csv = TraceCsv::of_axes(csv, header.axes, header.fine_period_s, &signals)?;
    let count = signals.len();
    while let Some(record) = trace.next()? {
        csv.sample(&record.sample, &record.signals[..count]);
    }
    csv.finish()?;
    Ok(trace.conclude())
}
