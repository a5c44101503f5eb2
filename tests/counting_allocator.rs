//! A global allocator that counts how often the calling thread uses the heap, and how much of it. Tests of several packages
//! include this file by its path; each such test program gets the allocator.
#![allow(unsafe_code, reason = "counting allocations takes a global allocator")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// How often the heap was used.
#[allow(dead_code, reason = "each user takes its own part")]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HeapUse {
    /// Pieces of memory asked for.
    pub allocations: usize,
    /// Pieces of memory given back.
    pub frees: usize,
}

/// Bytes held, and the most that were.
#[derive(Clone, Copy, Default)]
struct Bytes {
    now: usize,
    peak: usize,
}

thread_local! {
    static BYTES: Cell<Bytes> = const { Cell::new(Bytes { now: 0, peak: 0 }) };
    static USED: Cell<HeapUse> = const { Cell::new(HeapUse { allocations: 0, frees: 0 }) };
}

/// What `work` does with the heap, on this thread.
#[allow(dead_code, reason = "each user takes its own part")]
pub fn heap_use_of(work: impl FnOnce()) -> HeapUse {
    let before = USED.get();
    work();
    let after = USED.get();
    HeapUse {
        allocations: after.allocations - before.allocations,
        frees: after.frees - before.frees,
    }
}

/// How many bytes `work` holds at most beyond what was held before, on this thread.
#[allow(dead_code, reason = "each user takes its own part")]
pub fn peak_bytes_of(work: impl FnOnce()) -> usize {
    let before = BYTES.get().now;
    BYTES.set(Bytes {
        now: before,
        peak: before,
    });
    work();
    BYTES.get().peak - before
}

struct Counting;

// SAFETY: hands every call to the system allocator unchanged; the counter is a plain thread-local number.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let used = USED.get();
        USED.set(HeapUse {
            allocations: used.allocations + 1,
            ..used
        });
        let Bytes { now, peak } = BYTES.get();
        let now = now.wrapping_add(layout.size());
        // What another thread has given away may be freed here, so that the number may fall below zero and wrap.
        BYTES.set(Bytes {
            now,
            peak: if now < usize::MAX / 2 {
                peak.max(now)
            } else {
                peak
            },
        });
        // SAFETY: the caller's promise, passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        let used = USED.get();
        USED.set(HeapUse {
            frees: used.frees + 1,
            ..used
        });
        let Bytes { now, peak } = BYTES.get();
        BYTES.set(Bytes {
            now: now.wrapping_sub(layout.size()),
            peak,
        });
        // SAFETY: the caller's promise, passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;
