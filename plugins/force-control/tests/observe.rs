//! Mode `observe`: the torque is told, and nothing is done with it.

use tandem_rig::Random;
use tandem_sdk::{
    Answer, Axes, AxisVector, FineSample, PluginError, Request, StrategyContext, Window,
};

const AXIS: &str =
    "axes.x = { lead_mm = 20, torque_constant_nm_per_a = 0.378, inertia_kg_m2 = 1.842e-4 }\n";
const CONTROL: &str = "reference_torque_nm = 0.1\nmin_feed_mm_per_min = 10\nmax_feed_mm_per_min = 300\n\
                       stability = { torque_per_feed_nm_min_per_mm = 0.001 }\n";

/// Answers to a cut whose current rises to many times the guard's.
fn answers(options: &str, random: &mut Random) -> Result<Vec<Answer>, PluginError> {
    let context = StrategyContext {
        axis_count: 1,
        axes: Axes::new(&[('X', false)]).unwrap(),
        fine_period_s: 1e-3,
        rough_period_s: 8e-3,
        max_feed_ratio: 2.0,
        joints_are_axes: 1,
    };
    let mut strategy = tandem_force_control::PLUGIN.feed_strategy(options, &context)?;
    let most_a = random.between(1.0, 5.0);
    let sample = |tick: u64| FineSample {
        tick,
        command: AxisVector::from_slice(&[0.0025 * tick as f64]),
        speed: AxisVector::from_slice(&[2.5]),
        current_a: AxisVector::from_slice(&[most_a * tick as f64 / 4000.0]),
        feed_mm_per_s: 2.5,
        programmed_feed_mm_per_s: 2.5,
        sigma: 1.0,
        spindle_rad_per_s: 94.2,
        ..FineSample::default()
    };
    let samples: Vec<FineSample> = (0..4000).map(sample).collect();
    let windows = samples.chunks(8).enumerate();
    windows
        .map(|(period, eight)| strategy.update(&Window::new(period as u64, eight)))
        .collect()
}

#[test]
fn the_torque_is_that_of_control_and_nothing_is_done_with_it() {
    let seed = Random::from_the_clock().below(u64::from(u32::MAX));
    let of = |options: &str| answers(options, &mut Random::new(seed)).unwrap();
    let observed = of(&format!("mode = \"observe\"\n{AXIS}"));
    let controlled = of(&format!("{CONTROL}{AXIS}"));
    assert!(
        controlled
            .iter()
            .any(|answer| answer.request == Request::Hold && answer.ratio < 1.0)
    );
    for (here, there) in observed.iter().zip(&controlled) {
        assert_eq!((here.ratio, here.request), (1.0, Request::None));
        assert_eq!(
            here.signals[0], there.signals[0],
            "the estimate is the same"
        );
        assert!(here.signals.iter().all(|signal| signal.is_finite()));
    }
    let last = observed.last().unwrap();
    assert!(last.signals[0] > 0.3, "{} N·m", last.signals[0]);
    assert_eq!(last.signals[3], 150.0, "the programmed feed");
}

#[test]
fn control_still_asks_for_what_observing_may_leave_out() {
    let words = answers(AXIS, &mut Random::new(1)).unwrap_err().to_string();
    assert!(words.contains("reference_torque_nm"), "{words}");
    let words = answers("mode = \"observe\"\n", &mut Random::new(1))
        .unwrap_err()
        .to_string();
    assert!(words.contains("no axis is listed"), "{words}");
}
