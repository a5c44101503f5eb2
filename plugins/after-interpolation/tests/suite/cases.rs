//! The errors of the classical scheme as Lee and Lee compare them: corners, arcs, cycle time, feed at a corner.

use crate::common;

use common::{FILTERS, context, drive, norm, open, polyline};
use serde_json::Value;
use std::f64::consts::{FRAC_PI_2, TAU};
use tandem_rig::{arc, numbered};
use tandem_sdk::{AxisVector, Segment};

fn fixture() -> Value {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/fixtures/cases/000_adai_error.json"
    );
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// The smallest value of `of` in a segment: the best of some samples, then narrowed down around it.
fn smallest(segment: &Segment, of: impl Fn(&Segment, f64) -> f64) -> f64 {
    let step = segment.duration_s / 16.0;
    let best = (0..=16)
        .map(|k| f64::from(k) * step)
        .min_by(|a, b| of(segment, *a).total_cmp(&of(segment, *b)));
    let middle = best.unwrap();
    let (mut low, mut high) = (
        (middle - step).max(0.0),
        (middle + step).min(segment.duration_s),
    );
    for _ in 0..60 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if of(segment, a) < of(segment, b) {
            high = b;
        } else {
            low = a;
        }
    }
    of(segment, f64::midpoint(low, high)).min(of(segment, middle))
}

/// How near the emitted path comes to the vertex of a right angle with long legs.
fn corner_error(filter: &str, feed: f64, tau_ms: f64) -> f64 {
    let leg = 40.0 * feed * tau_ms / 1000.0;
    let blocks = polyline(&[[leg, 0.0, 0.0], [leg, leg, 0.0]], feed);
    let recorder = drive(&mut *open(filter, tau_ms, &context(0.001)), &blocks);
    let vertex = AxisVector::from_slice(&[leg, 0.0]);
    let distance = |s: &Segment, t: f64| norm(&(s.position(t) - vertex));
    recorder
        .segments
        .iter()
        .map(|s| smallest(s, distance))
        .fold(f64::INFINITY, f64::min)
}

/// Smallest and largest loss of radius once the transient of the start is over, before the end.
fn arc_error(filter: &str, radius: f64, feed: f64, tau_ms: f64) -> (f64, f64) {
    let turns = 6.0;
    let blocks = numbered(vec![arc(
        &AxisVector::from_slice(&[radius]),
        [0.0; 2],
        turns * TAU,
        feed,
    )]);
    let mut machine = context(0.001);
    machine.position = blocks[0].start;
    let recorder = drive(&mut *open(filter, tau_ms, &machine), &blocks);
    let commanded_s = blocks[0].length_mm / feed;
    let steady = recorder
        .timed()
        .filter(|(t, s)| *t > commanded_s / 2.0 && *t + s.duration_s <= commanded_s);
    let errors = steady.flat_map(|(_, s)| {
        [0.0, 0.3, 0.5, 0.7].map(|u| radius - norm(&s.position(u * s.duration_s)))
    });
    errors.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), e| {
        (low.min(e), high.max(e))
    })
}

/// The closed form of the bell at a right angle: `√2·F·E|A − 3τ/4|/2`, where A, the age under the filter, is the sum of two
/// variables uniform over τ and τ/2; `E|A − 3τ/4| = τ/4 + (τ/2)²/(12τ) = 13τ/48`.
fn bell_corner(feed: f64, tau_ms: f64) -> f64 {
    2.0_f64.sqrt() * 13.0 / 96.0 * feed * tau_ms / 1000.0
}

/// The bell corners of the table, and they alone, exceed the closed form by 5 µs of feed on each axis whatever τ: they come
/// from a grid of 10 µs, half a step late. The planner is held to the closed form to 1e-9, the table less this to its
/// own tolerance.
fn table_bias(feed: f64) -> f64 {
    2.0_f64.sqrt() * feed * 5e-6
}

#[test]
fn bell_corners_are_those_of_the_closed_form() {
    for tau_ms in [10.0, 30.0, 100.0] {
        let error = corner_error("bell", 5000.0 / 60.0, tau_ms);
        assert!(
            (error - bell_corner(5000.0 / 60.0, tau_ms)).abs() < 1e-9,
            "{tau_ms} ms: {error} mm"
        );
    }
}

#[test]
fn every_error_of_the_table_is_reproduced() {
    let fixture = fixture();
    let keys = ["linear_mm", "exp_mm", "bell_mm"];
    let cases = fixture["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 12);
    for case in cases {
        let number = |key: &str| case[key].as_f64().unwrap();
        let (feed, tau_ms) = (number("F_mm_min") / 60.0, number("tau_ms"));
        for (filter, key) in FILTERS.iter().zip(keys) {
            let tolerance = fixture["tolerance"][key].as_f64().unwrap();
            let (low, high) = match case["kind"].as_str().unwrap() {
                "corner90" => [corner_error(filter, feed, tau_ms); 2].into(),
                "arc" => arc_error(filter, number("R_mm"), feed, tau_ms),
                kind => panic!("no such kind: {kind}"),
            };
            let mut expected = number(key);
            if *filter == "bell" && case["kind"] == "corner90" {
                expected -= table_bias(feed);
                assert!(
                    (expected - bell_corner(feed, tau_ms)).abs() < tolerance,
                    "{case}"
                );
            }
            println!(
                "{filter:12} {expected:.9} found {:+.1e} {:+.1e}",
                low - expected,
                high - expected
            );
            assert!(
                (low - expected).abs() <= tolerance && (high - expected).abs() <= tolerance,
                "{filter} {case}"
            );
        }
    }
}

/// F/A for 5000 mm/min and 355 mm/s², ms.
const SQUARE_TAU_MS: f64 = 5000.0 / 60.0 / 355.0 * 1000.0;

fn square() -> Vec<tandem_sdk::Block> {
    polyline(
        &[
            [20.0, 0.0, 0.0],
            [20.0, 20.0, 0.0],
            [0.0, 20.0, 0.0],
            [0.0; 3],
        ],
        5000.0 / 60.0,
    )
}

#[test]
fn square_takes_its_nominal_time_and_one_time_constant() {
    let recorder = drive(
        &mut *open("linear", SQUARE_TAU_MS, &context(0.001)),
        &square(),
    );
    assert!((recorder.duration_s() - (0.96 + SQUARE_TAU_MS / 1000.0)).abs() < 1e-9);
    assert!((recorder.duration_s() - 1.1947).abs() < 5e-5);
    let bell = drive(
        &mut *open("bell", SQUARE_TAU_MS, &context(0.001)),
        &square(),
    );
    assert!((bell.duration_s() - (0.96 + 1.5 * SQUARE_TAU_MS / 1000.0)).abs() < 1e-9);
}

#[test]
fn feed_at_a_corner_falls_to_the_cosine_of_half_the_turn() {
    let feed = 50.0;
    for turn in [0.3, FRAC_PI_2, 2.5] {
        for (filter, tau_ms) in [("linear", 80.0), ("exponential", 20.0)] {
            let (sin, cos) = f64::sin_cos(turn);
            let blocks = polyline(
                &[[60.0, 0.0, 0.0], [60.0 + 60.0 * cos, 60.0 * sin, 0.0]],
                feed,
            );
            let recorder = drive(&mut *open(filter, tau_ms, &context(0.0005)), &blocks);
            // Near the corner only: at both ends the machine is at rest anyway.
            let corner_s = 60.0 / feed;
            let near = recorder
                .timed()
                .filter(|(t, _)| (*t - corner_s).abs() < 0.2)
                .map(|(_, s)| s);
            let (speed, path): (Vec<f64>, Vec<f64>) = near
                .map(|s| {
                    (
                        smallest(s, |s, t| norm(&s.velocity(t))),
                        smallest(s, Segment::path_speed_mm_per_s),
                    )
                })
                .unzip();
            let lowest = speed.into_iter().fold(f64::INFINITY, f64::min);
            let expected = feed * (turn / 2.0).cos();
            assert!(
                (lowest - expected).abs() < 1e-6 * feed,
                "{filter}, turn {turn}: {lowest}, not {expected}"
            );
            let declared = path.into_iter().fold(f64::INFINITY, f64::min);
            assert!(
                (declared - expected).abs() < 1e-4 * feed,
                "{filter}, turn {turn}: path speed {declared}"
            );
        }
    }
}
