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
    let context = StrategyContext::new(Axes::new(&[('X', false)]).unwrap(), 1e-3, 8e-3, 2.0);
    let mut strategy = tandem_force_control::PLUGIN.feed_strategy(options, &context)?;
    let max_a = random.between(1.0, 5.0);
    let sample = |tick: u64| FineSample {
        tick,
        command: AxisVector::from_slice(&[0.0025 * tick as f64]),
        speed: AxisVector::from_slice(&[2.5]),
        current_a: AxisVector::from_slice(&[max_a * tick as f64 / 4000.0]),
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

/// What is asked for, mm/min, in air at 250 mm/min with an override.
fn asked_in_air(options: &str, feed_override: f64) -> f64 {
    let context = StrategyContext::new(Axes::new(&[('X', false)]).unwrap(), 1e-3, 8e-3, 3.0);
    let text = format!("{options}{CONTROL}{AXIS}");
    let mut strategy = tandem_force_control::PLUGIN
        .feed_strategy(&text, &context)
        .unwrap();
    assert!(strategy.takes_override());
    let programmed_feed_mm_per_s = 250.0 / 60.0;
    let sample = |tick: u64| FineSample {
        tick,
        command: AxisVector::from_slice(&[4e-3 * tick as f64]),
        speed: AxisVector::from_slice(&[4.0]),
        feed_mm_per_s: 4.0,
        programmed_feed_mm_per_s,
        feed_override,
        sigma: 1.0,
        ..FineSample::default()
    };
    let samples: Vec<FineSample> = (0..4000).map(sample).collect();
    let windows = samples.chunks(8).enumerate();
    let answers =
        windows.map(|(period, eight)| strategy.update(&Window::new(period as u64, eight)));
    answers.last().unwrap().unwrap().ratio * 250.0
}

#[test]
fn an_override_comes_before_the_bounds_and_one_below_1_is_left_to_the_machine() {
    for (options, feed_override, expected) in [
        ("", 1.0, 250.0),
        ("", 1.1, 275.0),
        ("", 2.0, 300.0),
        ("", 0.5, 250.0),
        ("air_feed_mm_per_min = 200\n", 2.0, 200.0),
    ] {
        let asked = asked_in_air(options, feed_override);
        assert!(
            (asked - expected).abs() < 1e-9,
            "{options}override {feed_override}: {asked} mm/min, not {expected}"
        );
    }
}

#[test]
fn a_law_without_gain_observes() {
    let seed = 1;
    for gains in [
        "law = \"p\"\ngain_mm_per_min_per_nm = 0\n",
        "law = \"ratio\"\nexponent = 0\n",
        "gain_mm_per_min_per_nm = 0\nintegral_gain_mm_per_min_per_nm = 0\n",
    ] {
        let answers = answers(&format!("{gains}{CONTROL}{AXIS}"), &mut Random::new(seed)).unwrap();
        let plain = |answer: &Answer| (answer.ratio, answer.request) == (1.0, Request::None);
        assert!(answers.iter().all(plain), "{gains}");
    }
}
