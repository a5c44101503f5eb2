//! Machines that differ by next to nothing take about as long: what a window is given by the one before decides little.

use crate::common;

use common::{Point, judge, lines, samples};
use tandem_rig::Random;
use tandem_sdk::{AxisLimits, AxisVector, PlannerContext};
use tandem_smooth::{Options, SmoothPlanner};

/// Machines beside each other.
const MACHINES: u32 = 16;
/// By how much more acceleration the next one has, as a share.
const STRONGER: f64 = 1e-3;
/// Jerk in a second of the acceleration, and the tolerance, mm.
const JERK_PER_S: f64 = 27.0;
const TOLERANCE_MM: f64 = 0.006;
/// 5000 mm/min.
const FEED_MM_PER_S: f64 = 5000.0 / 60.0;

/// Long lines, and half circles in short ones.
fn points() -> Vec<Point> {
    let root = format!("{}/../..", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(format!("{root}/examples/programs/two-step-arcs.ngc"));
    let mut points = vec![[0.0; 3]];
    for line in text.unwrap().lines() {
        let number = |axis| {
            let mut words = line.strip_prefix("G1 ")?.split(' ');
            words.find_map(|word| word.strip_prefix(axis)?.parse().ok())
        };
        if let (Some(x), Some(y)) = (number('X'), number('Y')) {
            points.push([x, y, 0.0]);
        }
    }
    assert_eq!(points.len(), 81);
    points
}

/// Three axes alike, with this much jerk in a second of the acceleration.
fn machine(acceleration_mm_per_s2: f64, jerk_per_s: f64, position: &Point) -> PlannerContext {
    let axis = AxisLimits {
        feed_mm_per_s: 1.1 * FEED_MM_PER_S,
        jerk_mm_per_s3: jerk_per_s * acceleration_mm_per_s2,
        ..tandem_rig::axis(acceleration_mm_per_s2)
    };
    PlannerContext {
        path_tolerance_mm: TOLERANCE_MM,
        position: AxisVector::from_slice(position),
        ..tandem_rig::context(&[axis; 3], 1e-3)
    }
}

/// The time of the program on machines beside each other: the mean over the least, which is 1 where they all take as long.
fn mean_over_least(acceleration_mm_per_s2: f64) -> f64 {
    let points = points();
    let blocks = lines(&points, FEED_MM_PER_S);
    let times_s: Vec<f64> = (0..MACHINES)
        .map(|n| {
            let acceleration = acceleration_mm_per_s2 * (1.0 + STRONGER * f64::from(n));
            let context = machine(acceleration, JERK_PER_S, &points[0]);
            let mut planner = SmoothPlanner::new(&Options::default(), &context).unwrap();
            let collected = tandem_rig::drive(&mut planner, &blocks, 0.008);
            let peaks = judge(&samples(&collected.segments), &points);
            assert!(
                peaks.acceleration <= acceleration * (1.0 + 1e-6)
                    && peaks.jerk <= JERK_PER_S * acceleration * 1.01
                    && peaks.deviation_mm.iter().all(|off| *off <= TOLERANCE_MM),
                "{acceleration} mm/s²: {peaks:?}"
            );
            collected.duration_s()
        })
        .collect();
    let least_s = times_s.iter().copied().fold(f64::INFINITY, f64::min);
    times_s.iter().sum::<f64>() / f64::from(MACHINES) / least_s
}

#[test]
fn machines_beside_each_other_take_about_as_long_on_arcs_of_short_lines() {
    let mut random = Random::from_the_clock();
    let drawn: Vec<f64> = (0..4).map(|_| random.between(560.0, 640.0)).collect();
    let ratios: Vec<f64> = drawn.iter().map(|a| mean_over_least(*a)).collect();
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    println!("from {drawn:?} mm/s² on: {ratios:?}, mean {mean}");
    assert!(mean <= 1.015, "{ratios:?}");
}

/// How long the program takes on machines of this acceleration, mm/s², and jerk in a second of it, and how often it rests where it need
/// not.
fn driven_on(machines: &[(f64, f64)], options: &Options) -> (f64, u64) {
    let points = points();
    let blocks = lines(&points, FEED_MM_PER_S);
    let (mut time_s, mut rests) = (0.0, 0);
    for (acceleration_mm_per_s2, jerk_per_s) in machines {
        let context = machine(*acceleration_mm_per_s2, *jerk_per_s, &points[0]);
        let mut planner = SmoothPlanner::new(options, &context).unwrap();
        time_s += tandem_rig::drive(&mut planner, &blocks, 0.008).duration_s();
        rests += planner.effort().stops;
    }
    (time_s, rests)
}

#[test]
fn windows_are_long_enough_for_axes_that_build_up_their_acceleration_slowly() {
    let mut random = Random::from_the_clock();
    // In a fifth to two thirds of a second.
    let machines: Vec<(f64, f64)> = (0..8)
        .map(|_| (random.length(300.0, 3000.0), random.length(1.5, 5.0)))
        .collect();
    let (time_s, rests) = driven_on(&machines, &Options::default());
    let second = Options {
        window_ms: 1000.0,
        ..Options::default()
    };
    let (short_s, short_rests) = driven_on(&machines, &second);
    let found = format!(
        "{machines:?}: {time_s} s with {rests} rests, in windows of a second {short_s} s with {short_rests}"
    );
    println!("{found}");
    assert!(time_s <= 0.995 * short_s && rests <= 1, "{found}");
}
