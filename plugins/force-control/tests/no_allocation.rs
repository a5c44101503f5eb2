//! The strategy runs beside the planner: in a steady state it must not allocate, not even where the guard trips.

#[path = "../../../tests/counting_allocator.rs"]
mod counting_allocator;

use counting_allocator::{HeapUse, heap_use_of};
use tandem_sdk::{Axes, AxisVector, FineSample, Request, StrategyContext, Window};

const OPTIONS: &str = "reference_torque_nm = 0.1\nmin_feed_mm_per_min = 10\nmax_feed_mm_per_min = 300\nteeth = 2\n\
                       stability = { torque_per_feed_nm_min_per_mm = 0.001 }\n\
                       axes.x = { lead_mm = 20, torque_constant_nm_per_a = 0.378, inertia_kg_m2 = 1.842e-4 }\n";

#[test]
fn updates_do_not_allocate() {
    let context = StrategyContext::new(Axes::new(&[('X', false)]).unwrap(), 1e-3, 8e-3, 2.0);
    let mut strategy = tandem_force_control::PLUGIN
        .feed_strategy(OPTIONS, &context)
        .unwrap();
    let sample = |tick: u64| FineSample {
        tick,
        command: AxisVector::from_slice(&[0.0025 * tick as f64]),
        speed: AxisVector::from_slice(&[2.5]),
        // From 4 s on three times the reference.
        current_a: AxisVector::from_slice(&[if tick < 4000 { 0.25 } else { 0.8 }]),
        feed_mm_per_s: 2.5,
        programmed_feed_mm_per_s: 2.5,
        sigma: 1.0,
        spindle_rad_per_s: 94.2,
        ..FineSample::default()
    };
    let samples: Vec<FineSample> = (0..8000).map(sample).collect();
    let (mut holds, mut ratios) = (0, 0.0);
    let used = heap_use_of(|| {
        for (period, eight) in samples.chunks(8).enumerate() {
            let answer = strategy.update(&Window::new(period as u64, eight)).unwrap();
            holds += u32::from(answer.request == Request::Hold);
            ratios += answer.ratio;
        }
    });
    assert_eq!(used, HeapUse::default());
    assert!(holds >= 1 && ratios > 0.0, "{holds} holds");
}
