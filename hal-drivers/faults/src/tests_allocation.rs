//! Wrappers run on the fine loop: they may not allocate, whatever they do.

#[path = "../../../tests/counting_allocator.rs"]
mod counting_allocator;

use counting_allocator::{HeapUse, heap_use_of};
use tandem_sdk::{Feedback, Setpoint};

use crate::tests::wrapped;

#[test]
fn no_wrapper_allocates_in_an_exchange() {
    let text = "[[wrap]]\nkind = \"drop\"\nevery = 7\n[[wrap]]\nkind = \"delay\"\nperiods = 3\nfrom_tick = 100\n\
                [[wrap]]\nkind = \"freeze\"\nprobability = 0.5\n[[wrap]]\nkind = \"duplicate\"\nevery = 5\n\
                [[wrap]]\nkind = \"corrupt\"\nevery = 3\nvalue = \"nan\"\n[[wrap]]\nkind = \"fail\"\nevery = 11\n";
    let (mut driver, ticks) = wrapped(text);
    ticks.lock().unwrap().reserve(2000); // the test's own driver writes down what it gets
    let mut failed = 0;
    let used = heap_use_of(|| {
        for tick in 0..1000 {
            let setpoint = Setpoint {
                tick,
                ..Setpoint::default()
            };
            failed += usize::from(
                driver
                    .exchange(&setpoint, &mut Feedback::default())
                    .is_err(),
            );
        }
        driver.quick_stop();
    });
    assert_eq!((used, failed), (HeapUse::default(), 1000 / 11));
    let used = heap_use_of(|| drop(std::hint::black_box(vec![1_u8; 100])));
    assert_eq!(
        used,
        HeapUse {
            allocations: 1,
            frees: 1
        },
        "the counter counts"
    );
}
