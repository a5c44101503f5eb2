//! In a steady state no method of the planner allocates.

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use common::{FILTERS, context, open, polyline};
use tandem_sdk::{Accepted, Block, BlockReport, Planner, Segment, SegmentSink};

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: hands every call to the system allocator unchanged; the counter is a plain thread-local number.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promise, passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise, passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

struct Nowhere;

impl SegmentSink for Nowhere {
    fn segment(&mut self, _segment: &Segment) {}
    fn block(&mut self, _report: &BlockReport) {}
}

/// Drives the blocks by rough periods; the planner need not come to an end.
fn stream(planner: &mut dyn Planner, blocks: &[Block]) {
    for block in blocks {
        while planner.accept(block).unwrap() == Accepted::Full {
            planner.advance(0.008, &mut Nowhere).unwrap();
        }
    }
}

#[test]
fn a_steady_stream_does_not_allocate() {
    let points: Vec<_> = (1..4000_u32).map(|k| [f64::from(k) * 0.05, f64::from(k % 2) * 0.01, 0.0]).collect();
    let blocks = polyline(&points, 50.0);
    for filter in FILTERS {
        let before = ALLOCATIONS.with(Cell::get);
        let mut planner = open(filter, 50.0, &context(0.001));
        stream(&mut *planner, &blocks[..2000]);
        let opened = ALLOCATIONS.with(Cell::get);
        assert!(opened > before, "the counter counts");
        stream(&mut *planner, &blocks[2000..]);
        assert_eq!(ALLOCATIONS.with(Cell::get), opened, "{filter}");
    }
}
