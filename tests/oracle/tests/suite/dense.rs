//! Long programs of short blocks are judged in a moment.

use crate::common;

use std::{fmt::Write, time::Instant};

use common::{Profile, at, machine, polyline, trace};
use tandem_oracle::{Kind, Options, Position, judge};

/// A spiral of chords 0.05 mm long with a pitch of 0.3 mm.
fn spiral(blocks: usize) -> Vec<Position> {
    let mut angle = 40.0_f64;
    let mut points = Vec::new();
    for _ in 0..=blocks {
        let radius = 0.3 / std::f64::consts::TAU * angle;
        let round = |value: f64| (value * 1e5).round() / 1e5;
        points.push(at(
            round(radius * angle.cos()),
            round(radius * angle.sin()),
            0.0,
        ));
        angle += 0.05 / radius;
    }
    points
}

fn program(points: &[Position]) -> String {
    let mut text = String::from("G21 G90 G64 P0.01\nF2000\n");
    for [x, y, ..] in points.iter().skip(1) {
        writeln!(text, "G1X{x:.5}Y{y:.5}Z0.00000").expect("a string takes all");
    }
    text
}

#[test]
fn twenty_thousand_blocks() {
    let points = spiral(20_000);
    let length = points
        .windows(2)
        .map(|pair| common::gap(&pair[0], &pair[1]))
        .sum();
    let profile = Profile::default().then(0.0, 33.3, 0.0, length, 600.0);
    let mut samples = profile.samples(polyline(points.clone()));
    let last = points[points.len() - 1];
    samples.extend([last; 3]);
    let options = Options {
        speed_difference_mm_per_s: Some(100.0),
        ..Options::default()
    };
    let program = program(&points);
    let mut machine = machine();
    (machine.axes[0].start_mm, machine.axes[1].start_mm) = (points[0][0], points[0][1]);
    let started = Instant::now();
    let verdict = judge(&trace(&samples), &program, &machine, &options);
    let took = started.elapsed();
    eprintln!(
        "{} blocks, {} samples: {took:?}\n{verdict}",
        points.len(),
        samples.len()
    );
    common::assert_passes(&verdict);
    assert!(verdict.maxima.sample_deviation_mm < 1e-9, "{verdict}");
    assert!(took.as_secs_f64() < 5.0, "{took:?}");
    // Another turn of the spiral is no excuse.
    let leap = samples.len() / 2;
    let mut leaping = samples[..leap].to_vec();
    leaping.extend(&samples[leap + 2000..]);
    let started = Instant::now();
    let verdict = judge(&trace(&leaping), &program, &machine, &options);
    eprintln!("with a leap: {:?}", started.elapsed());
    assert!(verdict.kinds().contains(&Kind::PathDeviation), "{verdict}");
    assert!(verdict.kinds().contains(&Kind::VertexMissed), "{verdict}");
    assert!(started.elapsed().as_secs_f64() < 5.0, "{took:?}");
}
