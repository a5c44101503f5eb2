//! Planning throughput: blocks in, segments out, streaming, one core. `cargo bench -p tandem-smooth`. After the table each
//! program's windows by their planning time.

#[path = "../tests/common/mod.rs"]
mod common;

use std::time::Instant;

use common::{context, lines, read};
use divan::counter::ItemsCount;
use tandem_sdk::{Accepted, AxisVector, Block, BlockReport, Planner, Segment, SegmentSink};
use tandem_smooth::{Options, SmoothPlanner};

fn main() {
    divan::main();
    for name in ["raster", "spiral"] {
        histogram(name);
    }
}

/// Lets go what comes.
struct Away;

impl SegmentSink for Away {
    fn segment(&mut self, segment: &Segment) {
        divan::black_box(segment);
    }
    fn block(&mut self, report: &BlockReport) {
        divan::black_box(report);
    }
}

fn program(name: &str) -> Vec<Block> {
    let (points, feed) = read(&format!(
        "{}/../../examples/programs/{name}.ngc",
        env!("CARGO_MANIFEST_DIR")
    ));
    lines(&points, feed)
}

fn stream(planner: &mut SmoothPlanner, blocks: &[Block], mut advanced: impl FnMut(f64)) {
    let mut next = 0;
    planner.reset(&AxisVector::ZERO);
    loop {
        while next < blocks.len()
            && planner.accept(&blocks[next], None).unwrap() == Accepted::Accepted
        {
            next += 1;
        }
        if next == blocks.len() {
            planner.finish();
        }
        let begun = Instant::now();
        let done = planner.advance(0.008, &mut Away).unwrap().done != 0;
        advanced(begun.elapsed().as_secs_f64());
        if done {
            return;
        }
    }
}

#[divan::bench(args = ["raster", "spiral"])]
fn smooth(bencher: divan::Bencher, name: &str) {
    let blocks = program(name);
    let mut planner = SmoothPlanner::new(&Options::default(), &context(&[0.0; 3], 0.01)).unwrap();
    bencher
        .counter(ItemsCount::new(blocks.len()))
        .bench_local(|| stream(&mut planner, &blocks, |_| ()));
}

/// The calls of `advance` that plan a window, by their time: of 20 runs the fastest of each call.
fn histogram(name: &str) {
    let blocks = program(name);
    let mut planner = SmoothPlanner::new(&Options::default(), &context(&[0.0; 3], 0.01)).unwrap();
    let mut fastest: Vec<f64> = Vec::new();
    for _ in 0..20 {
        let mut call = 0;
        stream(&mut planner, &blocks, |took_s| {
            if fastest.len() == call {
                fastest.push(took_s);
            }
            fastest[call] = fastest[call].min(took_s);
            call += 1;
        });
    }
    let windows = planner.effort().windows as usize / 20;
    fastest.sort_by(|a, b| b.total_cmp(a));
    fastest.truncate(windows);
    println!(
        "{name}: {windows} windows, the longest {:.2} ms",
        fastest[0] * 1e3
    );
    for bin in 0..10 {
        let (low, high) = (f64::from(bin) * 0.5, f64::from(bin + 1) * 0.5);
        let count = fastest
            .iter()
            .filter(|took_s| (low..high).contains(&(**took_s * 1e3)))
            .count();
        if count > 0 {
            println!(
                "  {low:.1} to {high:.1} ms: {count:3} {}",
                "#".repeat(count)
            );
        }
    }
}
