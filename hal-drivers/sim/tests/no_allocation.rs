//! `exchange` and `quick_stop` run on the fine loop: neither may allocate, not even to refuse.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use tandem_sdk::{AxisVector, DriverContext, Feedback, PluginKind, Setpoint};

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
fn the_counter_counts() {
    assert!(allocations_in(|| drop(std::hint::black_box(vec![1_u8; 100]))) > 0);
}

#[test]
fn exchange_and_quick_stop_do_not_allocate() {
    let options = "model = \"second-order\"\n[[switches]]\ninput = 0\njoint = 0\nabove_mm = 0.5";
    let PluginKind::Driver(make) = tandem_sim::PLUGIN.kind else { panic!("sim is a driver") };
    let mut driver = make(options).unwrap();
    driver.open(&DriverContext::new(8, 0.001)).unwrap();
    let mut feedback = Feedback::default();
    let mut setpoint = Setpoint { enable: 1, spindle_rad_per_s: 5.0, ..Setpoint::default() };
    let refused = allocations_in(|| assert!(driver.exchange(&setpoint, &mut feedback).is_err()));
    driver.start().unwrap();
    let exchanged = allocations_in(|| {
        for tick in 0..2000_u32 {
            setpoint.position = AxisVector([f64::from(tick) * 0.01; 8]);
            setpoint.reset = u32::from(tick == 1500);
            assert!(driver.exchange(&setpoint, &mut feedback).is_ok());
            if tick == 1000 {
                driver.quick_stop();
            }
        }
    });
    assert_eq!((refused, exchanged), (0, 0));
}
