//! In a steady state no method of the planner allocates.

mod common;
#[path = "../../../tests/counting_allocator.rs"]
mod counting_allocator;

use common::{context, published};
use counting_allocator::heap_use_of;
use tandem_block_overlap::{BlockOverlap, Options};
use tandem_rig::{feed, lines};
use tandem_sdk::AxisVector;

#[test]
fn a_steady_stream_does_not_allocate() {
    let at =
        |k: u32| AxisVector::from_slice(&[f64::from(k) * 0.05, f64::from(k % 3 / 2) * 0.02, 0.0]);
    let blocks = lines(&(0..4000).map(at).collect::<Vec<_>>(), |_| 3000.0);
    for options in [Options::default(), published()] {
        let opening = heap_use_of(|| {
            drop(BlockOverlap::new(&options, &context(&[1000.0; 3], 0.001)).unwrap());
        });
        assert!(opening.allocations > 0, "the counter counts");
        let mut planner = BlockOverlap::new(&options, &context(&[1000.0; 3], 0.001)).unwrap();
        feed(&mut planner, &blocks[..2000]);
        let steady = heap_use_of(|| feed(&mut planner, &blocks[2000..]));
        assert_eq!(steady.allocations, 0, "{options:?}");
    }
}
