//! Once its memory has grown, the planner allocates nothing: a program driven for the second time uses no heap.

#[path = "../../../tests/counting_allocator.rs"]
mod counting_allocator;

mod common;

use common::{context, lines, read};
use counting_allocator::heap_use_of;
use tandem_sdk::{Accepted, AxisVector, Block, BlockReport, Planner, Segment, SegmentSink};
use tandem_smooth::{Options, SmoothPlanner};

struct Nowhere;

impl SegmentSink for Nowhere {
    fn segment(&mut self, _: &Segment) {}
    fn block(&mut self, _: &BlockReport) {}
}

fn drive(planner: &mut SmoothPlanner, blocks: &[Block]) {
    let mut next = 0;
    planner.reset(&AxisVector::ZERO);
    loop {
        while next < blocks.len() && planner.accept(&blocks[next]).unwrap() == Accepted::Accepted {
            next += 1;
        }
        if next == blocks.len() {
            planner.finish();
        }
        if planner.advance(0.008, &mut Nowhere).unwrap().done != 0 {
            return;
        }
    }
}

#[test]
fn a_warm_planner_does_not_allocate() {
    for name in ["serpentine", "spiral"] {
        let (points, feed) = read(&format!("{}/../../examples/programs/{name}.ngc", env!("CARGO_MANIFEST_DIR")));
        let blocks = lines(&points, feed);
        let mut planner = SmoothPlanner::new(&Options::default(), &context(&points[0], 0.01)).unwrap();
        drive(&mut planner, &blocks);
        let uses = heap_use_of(|| drive(&mut planner, &blocks));
        assert_eq!(uses.allocations, 0, "{name}");
    }
}
