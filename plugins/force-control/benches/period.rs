//! What observer and strategy cost: three axes with friction, a rough period of eight samples.

use divan::Bencher;
use divan::counter::ItemsCount;
use tandem_sdk::{Axes, AxisVector, FineSample, StrategyContext, Window};

const OPTIONS: &str = "reference_torque_nm = 0.1\nmin_feed_mm_per_min = 10\nmax_feed_mm_per_min = 300\nteeth = 2\n\
                       stability = { torque_per_feed_nm_min_per_mm = 0.001 }\n";
const AXIS: &str = "lead_mm = 20\ntorque_constant_nm_per_a = 0.378\ninertia_kg_m2 = 1.842e-4\nfriction = { coulomb_nm = 0.06, \
                    viscous_nm_s_per_rad = 6e-4, stribeck_nm = 0.02, stribeck_speed_rad_per_s = 0.4 }\n";

fn main() {
    divan::main();
}

/// A fine period; the samples differ, so that no branch is always the same.
#[divan::bench]
fn fine_period_of_three_axes(bencher: Bencher<'_, '_>) {
    let axes = Axes::new(&[('X', false), ('Y', false), ('Z', false)]).unwrap();
    let context = StrategyContext::new(axes, 1e-3, 8e-3, 2.0);
    let options = ["x", "y", "z"]
        .iter()
        .fold(OPTIONS.to_string(), |text, axis| {
            text + &format!("[axes.{axis}]\n{AXIS}")
        });
    let mut strategy = tandem_force_control::PLUGIN
        .feed_strategy(&options, &context)
        .unwrap();
    let sample = |tick: u64| {
        let place = |axis: f64| 0.0025 * tick as f64 + 0.01 * (tick as f64 * axis).sin();
        FineSample {
            tick,
            line: 1,
            command: AxisVector::from_slice(&[place(0.1), place(0.2), place(0.3)]),
            speed: AxisVector::from_slice(&[2.5, 2.4, 2.6]),
            current_a: AxisVector::from_slice(&[0.3, 0.2, 0.1]),
            feed_mm_per_s: 2.5,
            programmed_feed_mm_per_s: 2.5,
            sigma: 1.0,
            spindle_rad_per_s: 94.2,
            ..FineSample::default()
        }
    };
    let samples: Vec<FineSample> = (0..8000).map(sample).collect();
    bencher.counter(ItemsCount::new(8000u32)).bench_local(|| {
        samples
            .chunks(8)
            .enumerate()
            .map(|(n, eight)| {
                strategy
                    .update(&Window::new(n as u64, eight))
                    .unwrap()
                    .ratio
            })
            .sum::<f64>()
    });
}
