//! A ratio that strategy and policy change once in a rough period reaches the axes as a ramp and not as a staircase.

use crate::smooth;

use std::f64::consts::TAU;

use smooth::{LIMITS, Machine, PERIOD_S, Plan, profile};
use tandem_fine::FineConfig;

/// How fast the ratio changes, 1/s, and between which two it goes.
const RAMP_PER_S: f64 = 0.4;
const RATIOS: [f64; 2] = [1.0, 0.4];
/// Feed of the line, mm/s.
const FEED_MM_PER_S: f64 = 60.0;
/// Ticks before the ratio begins to fall, and between the ramps.
const STILL: u64 = 400;

/// Jerk of X, mm/s³, from where the ratio is at first to where it has gone down and up again.
fn jerks(order: u32, per_rough: u64, ratio_periods: u32) -> Vec<f64> {
    let pieces = profile(
        400.0,
        FEED_MM_PER_S,
        0.9 * LIMITS.acceleration,
        0.9 * LIMITS.jerk,
    );
    let plan = Plan::new(pieces, FEED_MM_PER_S, |s| [s, 0.0]);
    let mut machine = Machine::of(
        &plan,
        &FineConfig {
            order,
            ratio_periods,
            ..Machine::config()
        },
    );
    let ramp = ((RATIOS[0] - RATIOS[1]) / RAMP_PER_S / PERIOD_S) as u64;
    let ratio_at = |tick: u64| {
        let down = tick.saturating_sub(STILL).min(ramp) as f64;
        let up = tick.saturating_sub(2 * STILL + ramp).min(ramp) as f64;
        RATIOS[0] - (down - up) * RAMP_PER_S * PERIOD_S
    };
    let periods = (3 * STILL + 2 * ramp) / per_rough;
    for period in 0..periods {
        // As the host has it: what the samples of a period lead to acts in the one after the next.
        machine.ask_for((period + 2) * per_rough, ratio_at(period * per_rough));
        machine.run(per_rough);
    }
    let x_mm = machine.x_mm();
    let slowest = x_mm[STILL as usize..]
        .windows(2)
        .map(|x| (x[1] - x[0]) / PERIOD_S);
    let slowest = slowest.fold(f64::INFINITY, f64::min);
    assert!(
        (slowest / FEED_MM_PER_S - RATIOS[1]).abs() < 1e-3,
        "{slowest} mm/s"
    );
    let jerks = x_mm
        .windows(4)
        .map(|x| (x[3] - 3.0 * (x[2] - x[1]) - x[0]) / PERIOD_S.powi(3));
    // The line begins with a jerk of its own.
    jerks.skip(STILL as usize / 2).collect()
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

/// Root mean square between two frequencies, Hz, by the transform of the whole record.
fn band(values: &[f64], [from_hz, to_hz]: [f64; 2]) -> f64 {
    let count = values.len();
    let line_hz = 1.0 / (count as f64 * PERIOD_S);
    let lines = (from_hz / line_hz).ceil() as usize..(to_hz / line_hz).ceil() as usize;
    let power = lines.map(|line| {
        let (mut re, mut im) = (0.0, 0.0);
        for (n, value) in values.iter().enumerate() {
            let angle = TAU * ((line * n) % count) as f64 / count as f64;
            (re, im) = (re + value * angle.cos(), im + value * angle.sin());
        }
        2.0 * (re * re + im * im) / (count as f64).powi(2)
    });
    power.sum::<f64>().sqrt()
}

#[test]
fn a_ramp_of_the_ratio_is_a_ramp_of_the_feed_with_and_without_a_jerk_limit() {
    for order in [2, 3] {
        for per_rough in [1, 4, 8, 25] {
            let led = rms(&jerks(order, per_rough, per_rough as u32)) / LIMITS.jerk;
            let stairs = rms(&jerks(order, per_rough, 1)) / LIMITS.jerk;
            println!(
                "order {order}, {per_rough} periods: jerk rms {:.2} % of the limit, {:.1} % as a staircase",
                100.0 * led,
                100.0 * stairs
            );
            // Without a limit the jerk at the four ends of the ramps is that of a step of acceleration, 24 mm/s² in a period.
            let most = if order == 3 { 0.03 } else { 0.05 };
            assert!(led < most, "order {order}, {per_rough}: {led}");
            assert!(
                per_rough == 1 || stairs > 5.0 * led,
                "{per_rough}: {stairs}"
            );
        }
    }
}

/// The table of `docs/force-control.md`.
#[test]
fn the_spectrum_has_no_line_at_the_rough_period() {
    let [led, stairs] = [8, 1].map(|periods| jerks(3, 8, periods));
    for band_hz in [[0.0, 20.0], [20.0, 100.0], [100.0, 150.0], [150.0, 500.0]] {
        let [led, stairs] = [&led, &stairs].map(|jerks| band(jerks, band_hz) / LIMITS.jerk);
        println!(
            "{:3} to {:3} Hz: {:5.2} %, {:5.2} % as a staircase",
            band_hz[0],
            band_hz[1],
            100.0 * led,
            100.0 * stairs
        );
        assert!(led < 0.02, "{led} of the limit from {} Hz", band_hz[0]);
    }
}
