//! Runs that look right and are not, and runs that look wrong and are right.

use crate::common;

use std::{fmt::Write, time::Instant};

use common::{
    Profile, assert_finds, assert_passes, at, gap, machine, polyline, smooth_machine, stop_at_all,
    trace, verdict,
};
use tandem_oracle::{Check, Kind, Options, Position, judge};

fn xy(points: &[(f64, f64)]) -> Vec<Position> {
    points.iter().map(|&(x, y)| at(x, y, 0.0)).collect()
}

fn run(points: &[(f64, f64)]) -> Vec<Position> {
    stop_at_all(&xy(points), 50.0, 990.0)
}

#[test]
fn standing_still_is_no_closed_path() {
    let square = "F3000\nG1 X20\nY20\nX0\nY0\n";
    let still = verdict(&[at(0.0, 0.0, 0.0); 50], square);
    assert!(
        still.kinds().contains(&Kind::VertexMissed) || still.kinds().contains(&Kind::NotCovered),
        "{still}"
    );
}

#[test]
fn a_line_travelled_once_is_not_travelled_three_times() {
    let there_back_there = "F3000\nG1 X10\nX0\nX10\n";
    assert_passes(&verdict(
        &run(&[(0.0, 0.0), (10.0, 0.0), (0.0, 0.0), (10.0, 0.0)]),
        there_back_there,
    ));
    let once = verdict(&run(&[(0.0, 0.0), (10.0, 0.0)]), there_back_there);
    assert!(!once.passed(), "{once}");
    let thrice = verdict(
        &run(&[(0.0, 0.0), (10.0, 0.0), (0.0, 0.0), (10.0, 0.0)]),
        "F3000\nG1 X10\n",
    );
    assert!(!thrice.passed(), "{thrice}");
}

#[test]
fn a_spike_left_out_is_found() {
    let spike = "F3000\nG1 X10\nY5\nY0\nX20\n";
    let whole = [
        (0.0, 0.0),
        (10.0, 0.0),
        (10.0, 5.0),
        (10.0, 0.0),
        (20.0, 0.0),
    ];
    assert_passes(&verdict(&run(&whole), spike));
    let straight = verdict(&run(&[(0.0, 0.0), (10.0, 0.0), (20.0, 0.0)]), spike);
    assert!(straight.kinds().contains(&Kind::VertexMissed), "{straight}");
    let through = verdict(&run(&[(0.0, 0.0), (20.0, 0.0)]), spike);
    assert!(through.kinds().contains(&Kind::VertexMissed), "{through}");
    let small = "F3000\nG1 X10\nY0.02\nY0\nX20\n";
    let through = verdict(&run(&[(0.0, 0.0), (20.0, 0.0)]), small);
    assert!(!through.passed(), "{through}");
    let within = "F3000\nG1 X10\nY0.005\nY0\nX20\n";
    assert_passes(&verdict(&run(&[(0.0, 0.0), (20.0, 0.0)]), within));
}

#[test]
fn a_polygon_travelled_the_wrong_way_round_is_found() {
    let square = "F3000\nG1 X20\nY20\nX0\nY0\n";
    let wrong = verdict(
        &run(&[
            (0.0, 0.0),
            (0.0, 20.0),
            (20.0, 20.0),
            (20.0, 0.0),
            (0.0, 0.0),
        ]),
        square,
    );
    assert!(!wrong.passed(), "{wrong}");
}

#[test]
fn two_laps_are_not_one() {
    let lap = [
        (0.0, 0.0),
        (20.0, 0.0),
        (20.0, 20.0),
        (0.0, 20.0),
        (0.0, 0.0),
    ];
    let one = "F3000\nG1 X20\nY20\nX0\nY0\n";
    let two = format!("{one}X20\nY20\nX0\nY0\n");
    let twice: Vec<_> = lap.iter().chain(&lap[1..]).copied().collect();
    assert_passes(&verdict(&run(&lap), one));
    assert_passes(&verdict(&run(&twice), &two));
    assert!(!verdict(&run(&lap), &two).passed());
    assert!(!verdict(&run(&twice), one).passed());
}

/// Blocks far shorter than the tolerance, to and fro within it: the place of a sample is not known, but nothing is wrong.
#[test]
fn a_tangle_within_the_tolerance_passes() {
    let mut points = vec![(0.0, 0.0), (5.0, 0.0)];
    let mut program = String::from("F3000\nG1 X5\n");
    for index in 0..400 {
        let x = 5.0 + 0.004 * f64::from(index % 2);
        let y = 0.003 * f64::from(index % 3);
        points.push((x, y));
        writeln!(program, "X{x}Y{y}").expect("a string takes all");
    }
    points.push((9.0, 0.0));
    program += "X9Y0\n";
    let ends = [points[0], points[1], (9.0, 0.0)];
    assert_passes(&verdict(&run(&ends), &program));
    let path = xy(&points);
    let length: f64 = path.windows(2).map(|pair| gap(&pair[0], &pair[1])).sum();
    let slow = Profile::rest_to_rest(0.4, length, 300.0).samples(polyline(path));
    let options = Options {
        sample_tolerance_mm: Some(2e-6),
        speed_difference_mm_per_s: Some(2.0),
        ..Options::default()
    };
    assert_passes(&judge(&trace(&slow), &program, &machine(), &options));
}

#[test]
fn rounded_corners_of_a_wide_tolerance_pass() {
    let cut = [(0.0, 0.0), (19.0, 0.0), (20.0, 1.0), (20.0, 15.0)];
    assert_passes(&verdict(&run(&cut), "G64 P0.8\nF3000\nG1 X20\nY15\n"));
    assert_finds(
        &verdict(&run(&cut), "G64 P0.6\nF3000\nG1 X20\nY15\n"),
        &[Kind::VertexMissed],
    );
    assert_finds(
        &verdict(&run(&cut), "G64 P0.4\nF3000\nG1 X20\nY15\n"),
        &[Kind::PathDeviation, Kind::VertexMissed],
    );
    let vertex = Options {
        vertex_tolerance_mm: Some(0.6),
        ..Options::default()
    };
    let program = "G64 P0.8\nF3000\nG1 X20\nY15\n";
    assert_finds(
        &judge(&trace(&run(&cut)), program, &smooth_machine(), &vertex),
        &[Kind::VertexMissed],
    );
    let sample = Options {
        sample_tolerance_mm: Some(0.4),
        ..Options::default()
    };
    let found = judge(&trace(&run(&cut)), program, &smooth_machine(), &sample);
    assert!(found.kinds().contains(&Kind::PathDeviation), "{found}");
}

#[test]
fn the_tolerance_in_force_is_that_of_the_last_g64_or_the_machine() {
    let cut = [(0.0, 0.0), (19.0, 0.0), (20.0, 1.0), (20.0, 15.0)];
    for program in [
        "G64 P0.8\nG64\nF3000\nG1 X20\nY15\n",
        "G64 P0.8\nG61\nF3000\nG1 X20\nY15\n",
    ] {
        let found = verdict(&run(&cut), program);
        assert!(found.kinds().contains(&Kind::PathDeviation), "{found}");
    }
    assert_passes(&verdict(&run(&cut), "G64 P0.8 Q0.01\nF3000\nG1 X20\nY15\n"));
    assert_passes(&verdict(
        &run(&cut),
        "G20 G64 P0.03 G21\nG64 P0.8\nF3000\nG1 X20\nY15\n",
    ));
}

#[test]
fn a_run_wholly_off_the_path_is_not_searched_for_long() {
    let mut points = vec![(0.0, 0.0)];
    let mut program = String::from("F3000\nG1\n");
    for index in 1..=20_000 {
        let turn = 0.05 * f64::from(index);
        let (x, y) = (0.02 * turn * turn.cos(), 0.02 * turn * turn.sin());
        points.push((x, y));
        writeln!(program, "X{x}Y{y}").expect("a string takes all");
    }
    let mut samples = xy(&points);
    let options = Options {
        checks: vec![Check::Path, Check::Vertices],
        ..Options::default()
    };
    assert_passes(&judge(&trace(&samples), &program, &machine(), &options));
    for sample in &mut samples {
        sample[2] = 0.5;
    }
    let started = Instant::now();
    let found = judge(&trace(&samples), &program, &machine(), &options);
    assert!(found.kinds().contains(&Kind::PathDeviation), "{found}");
    assert!(
        started.elapsed().as_secs_f64() < 5.0,
        "{:?}",
        started.elapsed()
    );
}
