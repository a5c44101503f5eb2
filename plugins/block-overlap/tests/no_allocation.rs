//! In a steady state no method of the planner allocates.

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use common::{context, lines, published};
use tandem_block_overlap::{BlockOverlap, Options};
use tandem_sdk::{Accepted, AxisVector, Block, BlockReport, Planner, Segment, SegmentSink};

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
    let at = |k: u32| AxisVector::from_slice(&[f64::from(k) * 0.05, f64::from(k % 3 / 2) * 0.02, 0.0]);
    let blocks = lines(&(0..4000).map(at).collect::<Vec<_>>(), |_| 3000.0);
    for options in [Options::default(), published()] {
        let before = ALLOCATIONS.with(Cell::get);
        let mut planner = BlockOverlap::new(&options, &context(&[1000.0; 3], 0.001)).unwrap();
        stream(&mut planner, &blocks[..2000]);
        let opened = ALLOCATIONS.with(Cell::get);
        assert!(opened > before, "the counter counts");
        stream(&mut planner, &blocks[2000..]);
        assert_eq!(ALLOCATIONS.with(Cell::get), opened, "{options:?}");
    }
}
