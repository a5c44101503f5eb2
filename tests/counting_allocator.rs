//! A global allocator that counts how often the calling thread uses the heap. Tests of several packages include this
//! file by its path; each such test program gets the allocator.
#![allow(unsafe_code, reason = "counting allocations takes a global allocator")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// How often the heap was used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HeapUse {
    /// Pieces of memory asked for.
    pub allocations: usize,
    /// Pieces of memory given back.
    pub frees: usize,
}

thread_local! {
    static USED: Cell<HeapUse> = const { Cell::new(HeapUse { allocations: 0, frees: 0 }) };
}

/// What `work` does with the heap, on this thread.
pub fn heap_use_of(work: impl FnOnce()) -> HeapUse {
    let before = USED.get();
    work();
    let after = USED.get();
    HeapUse { allocations: after.allocations - before.allocations, frees: after.frees - before.frees }
}

struct Counting;

// SAFETY: hands every call to the system allocator unchanged; the counter is a plain thread-local number.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let used = USED.get();
        USED.set(HeapUse { allocations: used.allocations + 1, ..used });
        // SAFETY: the caller's promise, passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        let used = USED.get();
        USED.set(HeapUse { frees: used.frees + 1, ..used });
        // SAFETY: the caller's promise, passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;
