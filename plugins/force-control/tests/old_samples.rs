//! What is old is never taken for new: the answers do not depend on it, and a gap is no jump.

use tandem_sdk::{Axes, AxisVector, FineSample, MAX_AXES, StrategyContext, Window};

const OPTIONS: &str = "reference_torque_nm = 0.1\nmin_feed_mm_per_min = 10\nmax_feed_mm_per_min = 300\n\
                       stability = { torque_per_feed_nm_min_per_mm = 0.001 }\n\
                       axes.x = { lead_mm = 20, torque_constant_nm_per_a = 0.378, inertia_kg_m2 = 1.842e-4 }\n";

/// Every answer where each seventh to ninth sample is old and says `spoilt` times as much.
fn answers(spoilt: f64) -> Vec<f64> {
    let context = StrategyContext::new(Axes::new(&[('X', false)]).unwrap(), 1e-3, 8e-3, 2.0);
    let mut strategy = tandem_force_control::PLUGIN
        .feed_strategy(OPTIONS, &context)
        .unwrap();
    let sample = |tick: u64| {
        let old = tick % 9 > 5;
        let by = if old { spoilt } else { 1.0 };
        FineSample {
            tick,
            command: AxisVector::from_slice(&[0.0025 * tick as f64]),
            speed: AxisVector::from_slice(&[2.5 * by]),
            current_a: AxisVector::from_slice(&[0.25 * by]),
            feed_mm_per_s: 2.5,
            programmed_feed_mm_per_s: 2.5,
            sigma: 1.0,
            spindle_rad_per_s: 94.2,
            age_periods: [if old { (tick % 9 - 5) as u32 } else { 0 }; MAX_AXES],
            ..FineSample::default()
        }
    };
    let samples: Vec<FineSample> = (0..4000).map(sample).collect();
    let answer = |(period, eight): (usize, &[FineSample])| {
        let answer = strategy.update(&Window::new(period as u64, eight)).unwrap();
        [answer.ratio, answer.signals[0]]
    };
    samples.chunks(8).enumerate().flat_map(answer).collect()
}

#[test]
fn what_is_old_changes_no_answer() {
    let whole = answers(1.0);
    assert!(
        whole.iter().any(|value| *value > 0.0 && *value != 1.0),
        "something is felt"
    );
    for spoilt in [0.0, -3.0, 1e6] {
        assert_eq!(answers(spoilt), whole, "{spoilt}");
    }
}
