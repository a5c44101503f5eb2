//! Once its memory has grown, the planner allocates nothing: a program driven for the second time uses no heap.

#[path = "../../../tests/counting_allocator.rs"]
mod counting_allocator;

mod common;

use common::{context, lines, read};
use counting_allocator::heap_use_of;
use tandem_rig::{Away, stream};
use tandem_sdk::{AxisVector, Block, Planner};
use tandem_smooth::{Options, SmoothPlanner};

fn drive(planner: &mut SmoothPlanner, blocks: &[Block]) {
    planner.reset(&AxisVector::ZERO);
    stream(planner, blocks, 0.008, &mut Away::default());
}

#[test]
fn a_warm_planner_does_not_allocate() {
    for name in ["serpentine", "spiral"] {
        let (points, feed) = read(&format!(
            "{}/../../examples/programs/{name}.ngc",
            env!("CARGO_MANIFEST_DIR")
        ));
        let blocks = lines(&points, feed);
        let mut planner =
            SmoothPlanner::new(&Options::default(), &context(&points[0], 0.01)).unwrap();
        drive(&mut planner, &blocks);
        let uses = heap_use_of(|| drive(&mut planner, &blocks));
        assert_eq!(uses.allocations, 0, "{name}");
    }
}
