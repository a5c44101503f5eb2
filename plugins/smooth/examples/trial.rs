//! Plans programs of straight lines without the loops and prints what came out: time, peaks of 1 kHz differences, distances
//! by brute force over every chord, and the processor time of planning.
//!
//! `cargo run --release -p tandem-smooth --example trial -- [options as key=value,…] [repeats=N] [tolerance=MM] FILE…`, files
//! being part programs of G1 lines or cases as JSON with `points` and `limits`.

#[path = "../tests/common/mod.rs"]
mod common;

use common::{context, judge, lines, read, run, samples};
use tandem_smooth::Options;

/// Processor time of this thread, ns: what else the computer does is not counted.
fn cpu_ns() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split(' ')
        .next()
        .and_then(|word| word.parse().ok())
        .unwrap_or(f64::NAN)
}

fn main() {
    let (mut options, mut repeats, mut tolerance_mm) = (Options::default(), 3, 0.01);
    for argument in std::env::args().skip(1) {
        match argument.split_once('=') {
            Some(("repeats", value)) => repeats = value.parse().expect("a number of repeats"),
            Some(("tolerance", value)) => tolerance_mm = value.parse().expect("a tolerance in mm"),
            Some(_) => options = Options::parse(&argument.replace(',', "\n")).expect("options"),
            None => trial(&argument, &options, repeats, tolerance_mm),
        }
    }
}

fn trial(path: &str, options: &Options, repeats: usize, tolerance_mm: f64) {
    let (points, feed) = read(path);
    if points.len() < 2 {
        println!("{path}: no points");
        return;
    }
    let blocks = lines(&points, feed);
    let context = context(&points[0], tolerance_mm);
    let mut best_ns = f64::INFINITY;
    let (mut collected, mut effort) = run(&blocks, options, &context);
    for _ in 0..repeats {
        let started = cpu_ns();
        (collected, effort) = run(&blocks, options, &context);
        best_ns = best_ns.min(cpu_ns() - started);
    }
    let samples = samples(&collected.segments);
    let peaks = judge(&samples, &points);
    let name = path.rsplit('/').next().unwrap_or(path);
    let rounds = effort.rounds as f64;
    println!(
        "{name:22} T {:7.3} a {:6.1} j {:7.0} v/F {:.5} dev {:.5} {:.5} | {:4.0} kblk/s {:4.0} x | win {} rej {} rep {} \
         stops {} rounds {:.2} it {:.1}+{:.1} seg {}",
        peaks.time_s,
        peaks.acceleration,
        peaks.jerk,
        peaks.speed / feed,
        peaks.deviation_mm[0],
        peaks.deviation_mm[1],
        1e6 * blocks.len() as f64 / best_ns,
        1e9 * peaks.time_s / best_ns,
        effort.windows,
        effort.rejected,
        effort.repairs,
        effort.stops,
        rounds / effort.windows as f64,
        effort.smooth_iterations as f64 / rounds,
        effort.retime_iterations as f64 / rounds,
        collected.segments.len(),
    );
}
