//! In a steady state no method of the planner allocates.

mod common;
#[path = "../../../tests/counting_allocator.rs"]
mod counting_allocator;

use common::{FILTERS, context, open, polyline};
use counting_allocator::heap_use_of;
use tandem_rig::feed;

#[test]
fn a_steady_stream_does_not_allocate() {
    let points: Vec<_> = (1..4000_u32)
        .map(|k| [f64::from(k) * 0.05, f64::from(k % 2) * 0.01, 0.0])
        .collect();
    let blocks = polyline(&points, 50.0);
    for filter in FILTERS {
        let opening = heap_use_of(|| drop(open(filter, 50.0, &context(0.001))));
        assert!(opening.allocations > 0, "the counter counts");
        let mut planner = open(filter, 50.0, &context(0.001));
        feed(&mut *planner, &blocks[..2000]);
        let steady = heap_use_of(|| feed(&mut *planner, &blocks[2000..]));
        assert_eq!(steady.allocations, 0, "{filter}");
    }
}
