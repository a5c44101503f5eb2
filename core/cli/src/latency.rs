//! `tandem latency`.

use std::error::Error;
use std::fmt::Write as _;
use std::hint::black_box;
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use tandem_host::{Latency, LatenessUs, measure_latency};

use crate::args;

/// Longest bar, characters.
const BAR: u64 = 50;
/// Memory that each busy thread walks through, to keep the caches busy as well, bytes.
const WALK_BYTES: usize = 4 * 1024 * 1024;

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
    Ok(0)
}

/// Busy threads of ordinary priority, one a core, until this is dropped.
struct Load {
    over: Arc<AtomicBool>,
    threads: Vec<thread::JoinHandle<()>>,
}

impl Load {
    fn start() -> Self {
        let over = Arc::new(AtomicBool::new(false));
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let busy = |_| {
            let over = Arc::clone(&over);
            thread::spawn(move || be_busy(&over))
        };
        let threads = (0..cores).map(busy).collect();
        Self { over, threads }
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            // What a busy thread computed does not matter, nor how it ended.
            let _ = thread.join();
        }
    }
}

fn be_busy(over: &AtomicBool) {
    let mut memory = vec![1_u64; WALK_BYTES / size_of::<u64>()];
    while !over.load(Ordering::Relaxed) {
        for word in &mut memory {
            *word = word.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        }
        black_box(&mut memory);
    }
}

/// The histogram with its figures.
fn text(latency: &Latency, options: &args::Latency) -> String {
    let timing = &latency.timing;
    let rows = timing.lateness.rows();
    let most = rows.iter().map(|row| row.count).max().unwrap_or(1);
    let mut text = "wake-up lateness, us      wake-ups\n".to_string();
    for row in &rows {
        let (from, below) = (row.from_ns as f64 / 1e3, row.below_ns as f64 / 1e3);
        let _ = writeln!(text, "{from:9.1} to {below:9.1} {:10} {}", row.count, bar(row.count, most));
    }
    let LatenessUs { p50, p99, p999, max } = LatenessUs::from(&timing.lateness);
    let _ = writeln!(text, "p50 {p50:.1}, p99 {p99:.1}, p99.9 {p999:.1}, max {max:.1} us");
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

/// A bar on a logarithmic scale: one late wake-up among a million is what is looked for.
fn bar(count: u64, most: u64) -> String {
    let length = |n: u64| (n as f64).ln_1p();
    "#".repeat((BAR as f64 * length(count) / length(most)).ceil() as usize)
}
