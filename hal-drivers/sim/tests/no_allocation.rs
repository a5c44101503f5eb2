//! `exchange` and `quick_stop` run on the fine loop: neither may allocate, not even to refuse.

#[path = "../../../tests/counting_allocator.rs"]
mod counting_allocator;

use counting_allocator::{HeapUse, heap_use_of};
use tandem_sdk::{AxisVector, DriverContext, Feedback, Setpoint};

#[test]
fn the_counter_counts() {
    let used = heap_use_of(|| drop(std::hint::black_box(vec![1_u8; 100])));
    assert_eq!(
        used,
        HeapUse {
            allocations: 1,
            frees: 1
        }
    );
}

#[test]
fn exchange_and_quick_stop_do_not_allocate() {
    let motors = "model = \"servo\"\n[[servo]]\nencoder_counts = 8192\ncurrent_noise_ma = 5\n\
                  [cutting.workpiece]\nrandom = { sections = 9, section_mm = [1, 2], depth_mm = [1, 2] }\n";
    for model in ["model = \"second-order\"\n", motors] {
        nothing_is_allocated(&format!(
            "{model}[[switches]]\ninput = 0\njoint = 0\nabove_mm = 0.5"
        ));
    }
}

fn nothing_is_allocated(options: &str) {
    let mut driver = tandem_sim::PLUGIN.driver(options).unwrap();
    driver.open(&DriverContext::new(8, 0.001)).unwrap();
    let mut feedback = Feedback::default();
    let mut setpoint = Setpoint {
        enable: 1,
        spindle_rad_per_s: 5.0,
        ..Setpoint::default()
    };
    let refused = heap_use_of(|| assert!(driver.exchange(&setpoint, &mut feedback).is_err()));
    driver.start().unwrap();
    let exchanged = heap_use_of(|| {
        for tick in 0..2000_u32 {
            setpoint.position = AxisVector([f64::from(tick) * 0.01; 8]);
            setpoint.reset = u32::from(tick == 1500);
            assert!(driver.exchange(&setpoint, &mut feedback).is_ok());
            if tick == 1000 {
                driver.quick_stop();
            }
        }
    });
    assert_eq!(
        (refused, exchanged),
        (HeapUse::default(), HeapUse::default())
    );
}
