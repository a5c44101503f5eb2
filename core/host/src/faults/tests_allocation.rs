//! Wrappers run on the fine loop: they may not allocate, whatever they do.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use tandem_sdk::{Feedback, Setpoint};

use super::tests::wrapped;

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

fn allocations_in(work: impl FnOnce()) -> usize {
    let before = ALLOCATIONS.with(Cell::get);
    work();
    ALLOCATIONS.with(Cell::get) - before
}

#[test]
fn no_wrapper_allocates_in_an_exchange() {
    let text = "[[wrap]]\nkind = \"drop\"\nevery = 7\n[[wrap]]\nkind = \"delay\"\nperiods = 3\nfrom_tick = 100\n\
                [[wrap]]\nkind = \"freeze\"\nprobability = 0.5\n[[wrap]]\nkind = \"duplicate\"\nevery = 5\n\
                [[wrap]]\nkind = \"corrupt\"\nevery = 3\nvalue = \"nan\"\n[[wrap]]\nkind = \"fail\"\nevery = 11\n";
    let (mut driver, ticks) = wrapped(text);
    ticks.lock().unwrap().reserve(2000); // the test's own driver writes down what it gets
    let mut failed = 0;
    let allocated = allocations_in(|| {
        for tick in 0..1000 {
            let setpoint = Setpoint { tick, ..Setpoint::default() };
            failed += usize::from(driver.exchange(&setpoint, &mut Feedback::default()).is_err());
        }
        driver.quick_stop();
    });
    assert_eq!((allocated, failed), (0, 1000 / 11));
    assert!(allocations_in(|| drop(std::hint::black_box(vec![1_u8; 100]))) > 0, "the counter counts");
}
