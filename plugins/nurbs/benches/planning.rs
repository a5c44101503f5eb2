//! Planning: a curve in, segments out, streaming, one core. `cargo bench -p tandem-nurbs`. After the table each run prints
//! the fastest of some batches of runs of each curve as motion time by processor time of planning (what else the computer
//! does is not counted), the time against the best known, and the longest single call.

#[path = "../tests/common/mod.rs"]
mod common;

use std::time::{Duration, Instant};

use common::measure::BEST_S;
use common::{canonical, context, curve_block};
use tandem_nurbs::{NurbsPlanner, Options};
use tandem_rig::{Given, Offer, processor_time};
use tandem_sdk::{AxisVector, BlockReport, Planner, Segment, SegmentSink};

/// Batches of which the fastest counts, and runs in one.
const BATCHES: u32 = 8;
const RUNS: u32 = 20;

const CURVES: [&str; 3] = ["butterfly", "trident", "infinity"];

fn main() {
    divan::main();
    // With the name of a benchmark that one alone is run.
    if std::env::args()
        .skip(1)
        .any(|argument| !argument.starts_with("--"))
    {
        return;
    }
    for form in ["scan", "windowed"] {
        for (name, path_s, axes_s) in BEST_S {
            let (mut planner, block) = planner(form, name);
            let batches: Vec<Batch> = (0..BATCHES)
                .map(|_| Batch::drive(&mut planner, &block))
                .collect();
            let best = batches.iter().min_by_key(|batch| batch.planning).unwrap();
            let (planning_s, longest) =
                (best.planning.as_secs_f64() / f64::from(RUNS), best.longest);
            let ratio = best.motion_s / if form == "scan" { axes_s } else { path_s };
            let speed = best.motion_s / planning_s;
            println!(
                "{form} {name}: {speed:.0} × real time, {ratio:.4} of T_ref, longest call {longest:?}"
            );
        }
    }
}

/// Adds up the time of what comes.
#[derive(Default)]
struct Counter {
    motion_s: f64,
}

impl SegmentSink for Counter {
    fn segment(&mut self, segment: &Segment) {
        self.motion_s += divan::black_box(segment).duration_s;
    }
    fn block(&mut self, report: &BlockReport) {
        divan::black_box(report);
    }
}

struct Run {
    motion_s: f64,
    longest: Duration,
}

/// Runs measured together: the system counts the time of a thread in steps of milliseconds.
struct Batch {
    motion_s: f64,
    planning: Duration,
    longest: Duration,
}

impl Batch {
    fn drive(planner: &mut NurbsPlanner, block: &Given) -> Self {
        let started = processor_time();
        let runs: Vec<Run> = (0..RUNS).map(|_| drive(planner, block)).collect();
        let longest = runs.iter().map(|run| run.longest).min().unwrap_or_default();
        Self {
            motion_s: runs[0].motion_s,
            planning: processor_time().saturating_sub(started),
            longest,
        }
    }
}

fn planner(form: &str, name: &str) -> (NurbsPlanner, Given) {
    let (data, length_mm) = canonical(name);
    let block = curve_block(data, length_mm, 250.0);
    let options = Options::parse(&format!("form = \"{form}\"")).unwrap();
    (
        NurbsPlanner::new(&options, &context(block.0.start)).unwrap(),
        block,
    )
}

/// From the curve to the last segment.
fn drive(planner: &mut NurbsPlanner, block: &Given) -> Run {
    let (mut counter, mut longest) = (Counter::default(), Duration::ZERO);
    let start: AxisVector = block.0.start;
    planner.reset(&start);
    block.offer(planner).unwrap();
    planner.finish();
    loop {
        let called = Instant::now();
        let done = planner.advance(0.008, &mut counter).unwrap().done;
        longest = longest.max(called.elapsed());
        if done != 0 {
            return Run {
                motion_s: counter.motion_s,
                longest,
            };
        }
    }
}

#[divan::bench(args = CURVES)]
fn scan(bencher: divan::Bencher, name: &str) {
    let (mut planner, block) = planner("scan", name);
    bencher.bench_local(|| drive(&mut planner, &block).motion_s);
}

#[divan::bench(args = CURVES)]
fn windowed(bencher: divan::Bencher, name: &str) {
    let (mut planner, block) = planner("windowed", name);
    bencher.bench_local(|| drive(&mut planner, &block).motion_s);
}
