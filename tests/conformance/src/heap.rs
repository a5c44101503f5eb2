//! A global allocator that counts how often the calling thread uses the heap.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static USES: Cell<u64> = const { Cell::new(0) };
}

/// Hands every call on to the system's allocator, and counts it. The test program of a plugin's crate makes it the global
/// one; it cannot see into a shared library, which has an allocator of its own.
#[derive(Clone, Copy, Debug, Default)]
pub struct CountingAllocator;

// SAFETY: every call goes to the system's allocator unchanged; the counter is a plain number of the thread.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        USES.set(USES.get() + 1);
        // SAFETY: the caller's promise, passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        USES.set(USES.get() + 1);
        // SAFETY: the caller's promise, passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// Uses of the heap by this thread so far.
pub fn uses() -> u64 {
    USES.get()
}

/// Whether the allocator counts at all: a box is made to find out.
pub fn counts() -> bool {
    let before = uses();
    drop(std::hint::black_box(Box::new(1_u8)));
    uses() > before
}

/// Why allocations are not judged where the allocator does not count.
pub const NOT_COUNTED: &str = "a shared library allocates unseen; a test of the crate with CountingAllocator as its global allocator sees it";
