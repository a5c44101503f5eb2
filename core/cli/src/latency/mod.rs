//! `tandem latency`.

mod cyclictest;
mod drawing;
mod load;

use std::error::Error;
use std::fmt::Write as _;
use std::io::Write;
use std::time::Duration;

use tandem_host::{Latency, measure_latency};
use tandem_recorder::{Lateness, LatenessUs};

use crate::args;
use cyclictest::Cyclictest;
use load::Load;

/// Longest bar, characters.
const BAR: u64 = 50;

/// Measures how late the fine loop's thread wakes on this computer.
pub fn latency(options: &args::Latency) -> Result<u8, Box<dyn Error>> {
    let period = Duration::from_secs_f64(options.period_ms / 1e3);
    let periods = (options.duration_s / period.as_secs_f64()).round().max(1.0) as u64;
    let load = options.load.then(Load::start);
    let latency = measure_latency(period, periods)?;
    drop(load);
    for note in &latency.notes {
        say!("{note}");
    }
    // A reader that has gone away (a closed pipe) is no reason to fail.
    let _ = std::io::stdout().write_all(text(&latency, options).as_bytes());
    // Read only now: so it may have measured in the same minutes.
    let beside = options
        .cyclictest
        .as_ref()
        .map(|path| Cyclictest::read(path))
        .transpose()?;
    if let Some(Cyclictest { lateness, .. }) = &beside {
        let _ = writeln!(
            std::io::stdout(),
            "cyclictest: {} wake-ups, {}",
            lateness.count(),
            figures(lateness)
        );
    }
    if let Some(path) = &options.report {
        drawing::write(path, options, &latency, beside.as_ref())?;
    }
    Ok(0)
}

/// The histogram with its figures.
fn text(latency: &Latency, options: &args::Latency) -> String {
    let timing = &latency.timing;
    let rows = timing.lateness.rows();
    let most = rows.iter().map(|row| row.count).max().unwrap_or(1);
    let mut text = "wake-up lateness, us      wake-ups\n".to_string();
    for row in &rows {
        let (from, below) = (row.from_ns as f64 / 1e3, row.below_ns as f64 / 1e3);
        let _ = writeln!(
            text,
            "{from:9.1} to {below:9.1} {:10} {}",
            row.count,
            bar(row.count, most)
        );
    }
    let _ = writeln!(text, "{}", figures(&timing.lateness));
    let (wake_ups, missed) = (timing.lateness.count(), timing.missed_periods);
    let _ = writeln!(
        text,
        "periods {} of {} ms: wake-ups {wake_ups}, missed {missed}, overruns {}, page faults {} major {} minor",
        wake_ups + missed,
        options.period_ms,
        timing.overruns,
        latency.page_faults.major,
        latency.page_faults.minor
    );
    text
}

fn figures(lateness: &Lateness) -> String {
    let LatenessUs {
        p50,
        p99,
        p999,
        max,
    } = LatenessUs::from(lateness);
    format!("p50 {p50:.1}, p99 {p99:.1}, p99.9 {p999:.1}, max {max:.1} us")
}

/// A bar on a logarithmic scale: one late wake-up among a million is what is looked for.
fn bar(count: u64, most: u64) -> String {
    let length = |n: u64| (n as f64).ln_1p();
    "#".repeat((BAR as f64 * length(count) / length(most)).ceil() as usize)
}
