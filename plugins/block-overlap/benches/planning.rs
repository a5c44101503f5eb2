//! Planning throughput: blocks in, segments out, streaming, one core. `cargo bench -p tandem-block-overlap`.

#[path = "../tests/common/mod.rs"]
mod common;

use common::{context, lines};
use divan::counter::ItemsCount;
use tandem_block_overlap::{BlockOverlap, Options};
use tandem_sdk::{Accepted, AxisVector, Block, BlockReport, Planner, Segment, SegmentSink};

fn main() {
    divan::main();
}

/// Counts what comes and lets it go.
#[derive(Default)]
struct Counter {
    segments: usize,
}

impl SegmentSink for Counter {
    fn segment(&mut self, segment: &Segment) {
        divan::black_box(segment);
        self.segments += 1;
    }
    fn block(&mut self, report: &BlockReport) {
        divan::black_box(report);
    }
}

/// The G1 lines of an example program, which has nothing but X, Y, Z words and one feed.
fn program(name: &str) -> Vec<Block> {
    let path = format!("{}/../../examples/programs/{name}.ngc", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap();
    let mut points = vec![AxisVector::ZERO];
    points.extend(text.lines().filter_map(|l| l.strip_prefix("G1")).map(coordinates));
    lines(&points, |_| 3000.0)
}

fn coordinates(line: &str) -> AxisVector {
    let values: Vec<f64> = line.split(['X', 'Y', 'Z']).skip(1).map(|v| v.parse().unwrap()).collect();
    AxisVector::from_slice(&values)
}

fn stream(planner: &mut BlockOverlap, blocks: &[Block]) -> usize {
    let mut counter = Counter::default();
    let mut next = 0;
    planner.reset(&AxisVector::ZERO);
    loop {
        while next < blocks.len() && planner.accept(&blocks[next]).unwrap() == Accepted::Accepted {
            next += 1;
        }
        if next == blocks.len() {
            planner.finish();
        }
        if planner.advance(0.008, &mut counter).unwrap().done != 0 {
            return counter.segments;
        }
    }
}

#[divan::bench(args = ["raster", "spiral"])]
fn block_overlap(bencher: divan::Bencher, name: &str) {
    let blocks = program(name);
    let context = context(&[1000.0, 1000.0, 1000.0], 0.001);
    let mut planner = BlockOverlap::new(&Options::default(), &context).unwrap();
    bencher.counter(ItemsCount::new(blocks.len())).bench_local(|| stream(&mut planner, &blocks));
}
