//! Planning: a curve in, segments out, streaming, one core. `cargo bench -p tandem-nurbs`. After the table each run prints
//! the fastest of twenty runs of each curve as motion time by planning time, and the longest single call.

#[path = "../tests/common/mod.rs"]
mod common;

use std::time::{Duration, Instant};

use common::{canonical, context, curve_block};
use tandem_nurbs::{NurbsPlanner, Options};
use tandem_sdk::{AxisVector, BlockReport, OwnedBlock, Planner, Segment, SegmentSink};

const CURVES: [&str; 3] = ["butterfly", "trident", "infinity"];

fn main() {
    divan::main();
    // With the name of a benchmark that one alone is run.
    if std::env::args().skip(1).any(|argument| !argument.starts_with("--")) {
        return;
    }
    for form in ["scan", "windowed"] {
        for name in CURVES {
            let (mut planner, block) = planner(form, name);
            let runs: Vec<Run> = (0..20).map(|_| drive(&mut planner, &block)).collect();
            let best = runs.iter().min_by_key(|run| run.planning).unwrap();
            let (planning_s, longest) = (best.planning.as_secs_f64(), best.longest);
            println!("{form} {name}: {:.0} × real time, longest call {longest:?}", best.motion_s / planning_s);
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
    planning: Duration,
    longest: Duration,
}

fn planner(form: &str, name: &str) -> (NurbsPlanner, OwnedBlock) {
    let (data, length_mm) = canonical(name);
    let block = curve_block(data, length_mm, 250.0);
    let options = Options::parse(&format!("form = \"{form}\"")).unwrap();
    (NurbsPlanner::new(&options, &context(block.facts().start)).unwrap(), block)
}

/// From the curve to the last segment.
fn drive(planner: &mut NurbsPlanner, block: &OwnedBlock) -> Run {
    let (mut counter, started, mut longest) = (Counter::default(), Instant::now(), Duration::ZERO);
    let start: AxisVector = block.facts().start;
    planner.reset(&start);
    block.with(|b| planner.accept(b)).unwrap();
    planner.finish();
    loop {
        let called = Instant::now();
        let done = planner.advance(0.008, &mut counter).unwrap().done;
        longest = longest.max(called.elapsed());
        if done != 0 {
            return Run { motion_s: counter.motion_s, planning: started.elapsed(), longest };
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
