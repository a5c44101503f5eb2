//! A steady state allocates nothing: neither lines to items, nor chunks to lines.
#![allow(unsafe_code, reason = "counting allocations takes a global allocator")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use tandem_gcode::{Config, Program, Stream, check};
use tandem_sdk::Axes;

struct Counting;

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system's allocator as it is.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller keeps the promises of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the promises of `dealloc`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_steady_state_allocates_nothing() {
    let line =
        "N5 G1 X[#1 + 0.5] Y0.25 F1000 S500 M8 (along)\n#1=[#1 + 0.001] #<depth>=[#1 * 2]\nG2 X0 Y0 R40\nG4 P0.1\n";
    let text = "M3 S500 TA 20\n".to_owned() + &line.repeat(10_000);
    let config = Config::new(Axes::new(&[('X', false), ('Y', false)]).unwrap());
    let mut program = Program::spool("steady.ngc", text.as_bytes()).unwrap();
    assert!(check(&mut program, &config, &mut |_| Ok(())).unwrap().is_ok());
    let mut stream = Stream::new(program, &config).unwrap();
    let mut items = Vec::with_capacity(100);
    for _ in 0..100 {
        stream.next_items(&mut items).unwrap();
        items.clear();
    }
    let before = COUNT.with(Cell::get);
    while stream.next_items(&mut items).unwrap() {
        items.clear();
    }
    assert_eq!(COUNT.with(Cell::get) - before, 0);
}
