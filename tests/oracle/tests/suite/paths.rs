//! The programmed path: lines, corners, arcs, helices, rotary axes, and what a judge could be fooled by.

use crate::common;

use std::f64::consts::PI;

use common::{
    Profile, assert_finds, assert_passes, at, machine, polyline, smooth_machine, stop_at_all,
    trace, verdict,
};
use tandem_oracle::{Check, Kind, Options, Position, judge};

const CORNER: &str = "G64 P0.002\nG1 X20 F3000\nY15\nM2\n";

/// Through the corner at a speed that the look-ahead may step by.
fn corner_run(step: f64) -> Vec<Position> {
    let corner = vec![at(0.0, 0.0, 0.0), at(20.0, 0.0, 0.0), at(20.0, 15.0, 0.0)];
    let profile = Profile::default()
        .then(0.0, 50.0, step, 20.0, 990.0)
        .then(step, 50.0, 0.0, 15.0, 990.0);
    profile.samples(polyline(corner))
}

fn exact() -> Options {
    Options {
        sample_tolerance_mm: Some(2e-6),
        ..Options::default()
    }
}

#[test]
fn a_corner_with_an_allowed_step_passes_and_a_larger_one_does_not() {
    let good = judge(&trace(&corner_run(1.6)), CORNER, &machine(), &exact());
    assert_passes(&good);
    assert!(good.maxima.sample_deviation_mm < 1e-11, "{good}");
    assert!(
        good.maxima.vertex_deviation_mm > 1e-5 && good.maxima.vertex_deviation_mm < 1e-3,
        "{good}"
    );
    let fast = judge(&trace(&corner_run(3.0)), CORNER, &machine(), &exact());
    assert_finds(&fast, &[Kind::SpeedStep]);
}

#[test]
fn a_corner_cut_off_is_found() {
    let cut = [
        at(0.0, 0.0, 0.0),
        at(19.0, 0.0, 0.0),
        at(20.0, 1.0, 0.0),
        at(20.0, 15.0, 0.0),
    ];
    let verdict = verdict(&stop_at_all(&cut, 50.0, 990.0), CORNER);
    assert_finds(&verdict, &[Kind::PathDeviation, Kind::VertexMissed]);
    let vertex = verdict
        .findings
        .iter()
        .find(|finding| finding.kind == Kind::VertexMissed)
        .expect("found");
    assert_eq!(vertex.line, 2);
    assert!((vertex.value - 0.5_f64.sqrt()).abs() < 1e-3, "{verdict}");
}

#[test]
fn an_axis_shifted_is_off_the_path_and_off_its_ends() {
    let mut samples = corner_run(1.6);
    for sample in &mut samples {
        sample[1] += 0.005;
    }
    let verdict = judge(&trace(&samples), CORNER, &machine(), &Options::default());
    assert_finds(
        &verdict,
        &[
            Kind::StartPoint,
            Kind::PathDeviation,
            Kind::VertexMissed,
            Kind::EndPoint,
        ],
    );
}

#[test]
fn a_wrong_end_point_is_found() {
    let ends = [
        at(0.0, 0.0, 0.0),
        at(20.0, 0.0, 0.0),
        at(20.0, 15.0 - 1e-8, 0.0),
    ];
    assert_finds(
        &verdict(&stop_at_all(&ends, 50.0, 990.0), CORNER),
        &[Kind::EndPoint],
    );
    let short = [at(0.0, 0.0, 0.0), at(20.0, 0.0, 0.0), at(20.0, 14.0, 0.0)];
    assert_finds(
        &verdict(&stop_at_all(&short, 50.0, 990.0), CORNER),
        &[Kind::NotCovered, Kind::EndPoint],
    );
    let far = [at(0.0, 0.0, 0.0), at(20.0, 0.0, 0.0), at(20.0, 16.0, 0.0)];
    assert_finds(
        &verdict(&stop_at_all(&far, 50.0, 990.0), CORNER),
        &[Kind::PathDeviation, Kind::EndPoint],
    );
}

#[test]
fn a_run_that_ends_early_is_judged_as_far_as_it_went() {
    let short = [at(0.0, 0.0, 0.0), at(12.0, 0.0, 0.0)];
    let samples = stop_at_all(&short, 50.0, 990.0);
    let early = Options {
        ends_early: true,
        ..Options::default()
    };
    assert_passes(&judge(&trace(&samples), CORNER, &smooth_machine(), &early));
    // A fault ramps out beside the path.
    let mut off: Vec<Position> = samples.clone();
    off.extend(stop_at_all(
        &[at(12.0, 0.0, 0.0), at(12.0, 1.0, 0.0)],
        50.0,
        990.0,
    ));
    assert_finds(
        &judge(&trace(&off), CORNER, &smooth_machine(), &early),
        &[Kind::PathDeviation],
    );
    let until = Options {
        path_until_s: Some((samples.len() - 1) as f64 * common::PERIOD_S),
        ..early
    };
    assert_passes(&judge(&trace(&off), CORNER, &smooth_machine(), &until));
}

#[test]
fn a_run_that_ends_early_beside_a_later_part_of_the_path_has_not_passed_what_lies_between() {
    let early = Options {
        ends_early: true,
        ..Options::default()
    };
    // It ends on the way back, and exactly on the way that follows.
    let program = "G61\nG1 X0.01 F3000\nX0.005\nX0.01 Y0.0000001\nX20 Y15\n";
    let samples = stop_at_all(
        &[at(0.0, 0.0, 0.0), at(0.01, 0.0, 0.0), at(0.0075, 5e-8, 0.0)],
        50.0,
        990.0,
    );
    assert_passes(&judge(&trace(&samples), program, &smooth_machine(), &early));
    // Further on nothing is left to doubt.
    let cut = [
        at(0.0, 0.0, 0.0),
        at(19.995, 0.0, 0.0),
        at(20.0, 0.005, 0.0),
        at(20.0, 8.0, 0.0),
    ];
    let verdict = judge(
        &trace(&stop_at_all(&cut, 50.0, 990.0)),
        "G61\nG1 X20 F3000\nY15\n",
        &smooth_machine(),
        &early,
    );
    assert_finds(&verdict, &[Kind::VertexMissed]);
}

#[test]
fn a_reversal_and_a_crossing_fool_nobody() {
    let points = [
        (0.0, 0.0),
        (20.0, 0.0),
        (5.0, 0.0),
        (5.0, 5.0),
        (10.0, 5.0),
        (10.0, -5.0),
        (0.0, 0.0),
        (20.0, 0.0),
    ];
    let points = points.map(|(x, y)| at(x, y, 0.0));
    let program = "F3000\nG1 X20\nX5\nY5\nX10\nY-5\nX0Y0\nX20\n";
    let judge = |points: &[Position]| {
        judge(
            &trace(&stop_at_all(points, 50.0, 990.0)),
            program,
            &smooth_machine(),
            &exact(),
        )
    };
    assert_passes(&judge(&points));
    // Turning back before the far end, leaving out the loop, taking it the other way round.
    let early = [&[points[0], at(19.0, 0.0, 0.0)], &points[2..]].concat();
    assert_finds(&judge(&early), &[Kind::PathDeviation, Kind::VertexMissed]);
    let no_loop = [&points[..3], &[at(10.0, 0.0, 0.0)], &points[5..]].concat();
    assert_finds(&judge(&no_loop), &[Kind::PathDeviation, Kind::VertexMissed]);
    let other_way = [
        points[0],
        points[1],
        at(10.0, 0.0, 0.0),
        points[4],
        points[3],
        points[2],
        at(10.0, 0.0, 0.0),
        points[5],
    ];
    let other_way = [&other_way[..], &points[6..]].concat();
    assert!(judge(&other_way).kinds().contains(&Kind::PathDeviation));
}

/// Samples along a polyline, each the mean of those around it: a motion that rounds what is small.
fn rounded(points: &[(f64, f64)]) -> Vec<Position> {
    const STEP_MM: f64 = 8e-4;
    const AROUND: usize = 25;
    let mut along = vec![points[0]; AROUND];
    for pair in points.windows(2) {
        let (x, y) = (pair[1].0 - pair[0].0, pair[1].1 - pair[0].1);
        let count = (x.hypot(y) / STEP_MM).round();
        along.extend(
            (0..count as usize)
                .map(|n| n as f64 / count)
                .map(|t| (pair[0].0 + t * x, pair[0].1 + t * y)),
        );
    }
    along.extend(vec![points[points.len() - 1]; AROUND + 1]);
    let mean = |of: &[(f64, f64)]| {
        let [x, y] = [|p: &(f64, f64)| p.0, |p: &(f64, f64)| p.1]
            .map(|part| of.iter().map(part).sum::<f64>());
        at(x / of.len() as f64, y / of.len() as f64, 0.0)
    };
    along.windows(2 * AROUND + 1).map(mean).collect()
}

/// The first place of each sample would lag behind until what it leaves behind is beside no chord.
#[test]
fn loops_as_small_as_the_tolerance_are_followed() {
    let marks = [
        (0.24, 0.0),
        (0.24, 0.02),
        (0.22, 0.0),
        (0.25, 0.02),
        (0.2304, 0.02),
        (0.25, 0.0),
        (0.25, 0.02),
        (0.2304, 0.0),
    ];
    let path = [
        &[(0.0, 0.0), (0.0, 0.02), (0.2, 0.02)][..],
        &marks,
        &[(0.2, 0.0), (0.2, 0.0528)],
    ]
    .concat();
    let blocks: Vec<_> = path[1..]
        .iter()
        .map(|(x, y)| format!("X{x} Y{y}"))
        .collect();
    let program = format!("F600\nG1\n{}\n", blocks.join("\n"));
    let options = Options {
        checks: vec![Check::Path, Check::Vertices],
        ..Options::default()
    };
    let judged = |points: &[(f64, f64)]| {
        judge(
            &trace(&rounded(points)),
            &program,
            &smooth_machine(),
            &options,
        )
    };
    assert_passes(&judged(&path));
    let without = [&path[..3], &path[11..]].concat();
    assert!(!judged(&without).kinds().is_empty());
}

/// A walk that takes the first place of each sample would still be on the first piece where the samples are on the third.
#[test]
fn reversals_closer_than_a_few_tolerances_are_followed() {
    let program = "F600\nG1 X-0.1\nX0\nX-0.135\nX0\nX0.1\nM2\n";
    let wide = Options {
        sample_tolerance_mm: Some(0.036),
        vertex_tolerance_mm: Some(0.036),
        ..Options::default()
    };
    let judged = |turns: &[f64]| {
        let points: Vec<Position> = turns.iter().map(|x| at(*x, 0.0, 0.0)).collect();
        judge(
            &trace(&stop_at_all(&points, 5.0, 500.0)),
            program,
            &smooth_machine(),
            &wide,
        )
    };
    assert_passes(&judged(&[0.0, -0.075, -0.025, -0.135, 0.1]));
    assert!(
        !judged(&[0.0, -0.075, -0.025, -0.09, 0.1]).passed(),
        "the greatest way is missed by more than allowed"
    );
}

/// The first place of each sample lags by a whole turn wherever a sample may not have turned yet.
#[test]
fn motion_to_and_fro_within_a_period_is_followed_to_its_end() {
    const TURN_MM: f64 = 0.21;
    let program = format!("F600\n{}M2\n", "G1 X0.21\nX0\n".repeat(13) + "X0.21\n");
    let exact = Options {
        checks: vec![Check::Path],
        sample_tolerance_mm: Some(1e-6),
        vertex_tolerance_mm: Some(0.14),
        ..Options::default()
    };
    let judged = |turns: f64| {
        let way = |sample: u32| (0.278 * f64::from(sample)).min(turns * TURN_MM);
        let place = |way_mm: f64| TURN_MM - (way_mm % (2.0 * TURN_MM) - TURN_MM).abs();
        let samples: Vec<Position> = (0..32).map(|n| at(place(way(n)), 0.0, 0.0)).collect();
        judge(&trace(&samples), &program, &smooth_machine(), &exact)
    };
    assert_passes(&judged(27.0));
    assert_finds(&judged(26.5), &[Kind::NotCovered]);
}

/// 0.362 − 0.0003 is not 0.3617 by a rounding: no motion is between them, and no exact stop.
#[test]
fn where_distances_add_up_to_where_the_machine_is_nothing_moves() {
    let program =
        |end: &str| format!("F600\nG1 X0.362\nG91\nX-0.0003\nG90\nG61\nX{end}\nX0.3\nM2\n");
    let motion = stop_at_all(
        &[at(0.0, 0.0, 0.0), at(0.362, 0.0, 0.0), at(0.3, 0.0, 0.0)],
        10.0,
        900.0,
    );
    assert_passes(&verdict(&motion, &program("0.3617")));
    assert_finds(
        &verdict(&motion, &program("0.36169")),
        &[Kind::VertexMissed],
    );
}

#[test]
fn stopping_and_going_back_a_little_is_off_the_order_of_travel() {
    let back = [
        at(0.0, 0.0, 0.0),
        at(10.0, 0.0, 0.0),
        at(9.9, 0.0, 0.0),
        at(20.0, 0.0, 0.0),
        at(20.0, 15.0, 0.0),
    ];
    assert_finds(
        &verdict(&stop_at_all(&back, 50.0, 990.0), CORNER),
        &[Kind::PathDeviation],
    );
}

#[test]
fn samples_and_vertices_have_tolerances_of_their_own() {
    // A corner rounded by the inscribed arc of 0.5 mm: 0.207 mm from the vertex, at most 0.146 mm off the path.
    let (radius, sweep) = (0.5, PI / 2.0);
    let rounded = |length: f64| match length {
        _ if length < 19.5 => at(length, 0.0, 0.0),
        _ if length < 19.5 + radius * sweep => {
            let angle = (length - 19.5) / radius;
            at(
                19.5 + radius * angle.sin(),
                radius - radius * angle.cos(),
                0.0,
            )
        }
        _ => at(20.0, length - 19.5 - radius * sweep + radius, 0.0),
    };
    let length = 19.5 + radius * sweep + 14.5;
    let samples = ending_at(
        Profile::rest_to_rest(20.0, length, 500.0).samples(rounded),
        at(20.0, 15.0, 0.0),
    );
    let judge = |sample_mm, vertex_mm| {
        let options = Options {
            sample_tolerance_mm: Some(sample_mm),
            vertex_tolerance_mm: Some(vertex_mm),
            ..Options::default()
        };
        judge(&trace(&samples), CORNER, &smooth_machine(), &options)
    };
    let wide = judge(0.15, 0.21);
    assert_passes(&wide);
    assert!(
        (wide.maxima.vertex_deviation_mm - 0.2071).abs() < 1e-3,
        "{wide}"
    );
    assert!(
        (wide.maxima.sample_deviation_mm - 0.1464).abs() < 6e-3,
        "{wide}"
    );
    assert_finds(&judge(0.15, 0.2), &[Kind::VertexMissed]);
    assert_finds(&judge(0.14, 0.21), &[Kind::PathDeviation]);
    assert_passes(&judge(5.0, 0.21));
}

/// From an arc of 0.05 mm, which is judged where it is cut, back on a line of a wide tolerance: who cuts that corner off as far as the
/// line allows leaves out the end of the arc.
#[test]
fn the_end_of_an_arc_may_be_left_out_as_far_as_the_corner_behind_it() {
    const RADIUS: f64 = 0.05;
    let on_arc = |degrees: f64| {
        let angle = degrees.to_radians();
        at(
            1.0 + RADIUS * angle.sin(),
            RADIUS - RADIUS * angle.cos(),
            0.0,
        )
    };
    let driven = |tolerance: &str, degrees: &[f64]| {
        let program = format!(
            "G64 P0.002\nG1 X1 F3000\nG3 X1.05 Y0.05 J0.05\nG64 P{tolerance}\nG1 Y-1\nM2\n"
        );
        let mut points = vec![at(0.0, 0.0, 0.0)];
        points.extend(degrees.iter().map(|angle| on_arc(*angle)));
        let last = points[points.len() - 1];
        points.extend([at(1.0 + RADIUS, last[1], 0.0), at(1.0 + RADIUS, -1.0, 0.0)]);
        verdict(&stop_at_all(&points, 50.0, 990.0), &program)
    };
    assert_passes(&driven("0.1", &[0.0, 15.0, 30.0, 45.0]));
    // The corner is not the end of the tolerance of the arc: far before it that holds.
    let far = driven("0.02", &[0.0, 15.0, 67.5, 75.0, 90.0]);
    assert_finds(&far, &[Kind::PathDeviation, Kind::VertexMissed]);
}

/// An arc in XY around (0, 10) from the origin, counter-clockwise, rising along Z.
fn arc(radius: f64, rise_per_rad: f64) -> impl Fn(f64) -> Position {
    let per_rad = radius.hypot(rise_per_rad);
    move |length| {
        let angle = length / per_rad;
        at(
            radius * angle.sin(),
            10.0 - radius * angle.cos(),
            rise_per_rad * angle,
        )
    }
}

fn arc_run(radius: f64, rise_per_rad: f64, speed: f64, turn_rad: f64) -> Vec<Position> {
    let length = turn_rad * radius.hypot(rise_per_rad);
    Profile::rest_to_rest(speed, length, 700.0).samples(arc(radius, rise_per_rad))
}

/// Samples whose last one is the programmed end to the last bit.
fn ending_at(mut samples: Vec<Position>, end: Position) -> Vec<Position> {
    let last = samples[samples.len() - 1];
    samples
        .iter_mut()
        .filter(|sample| **sample == last)
        .for_each(|sample| *sample = end);
    samples
}

#[test]
fn an_arc_passes_and_its_chords_do_not() {
    let samples = ending_at(arc_run(10.0, 0.0, 70.0, PI / 2.0), at(10.0, 10.0, 0.0));
    for program in [
        "G3 X10 Y10 I0 J10 F4200",
        "G3 X10 Y10 J10.0001 F4200",
        "G3 X10 Y10 R10 F4200",
        "G90.1 G3 X10 Y10 I0 J10 F4200",
    ] {
        let verdict = judge(
            &trace(&samples),
            program,
            &smooth_machine(),
            &Options::default(),
        );
        assert_passes(&verdict);
    }
    let exactly = judge(
        &trace(&samples),
        "G3 X10 Y10 J10 F4200",
        &smooth_machine(),
        &exact(),
    );
    assert_passes(&exactly);
    assert!(exactly.maxima.sample_deviation_mm < 1e-12, "{exactly}");
    let other_side = verdict(&samples, "G2 X10 Y10 R10 F4200");
    assert!(
        other_side.kinds().contains(&Kind::PathDeviation),
        "{other_side}"
    );
    let chord = stop_at_all(&[at(0.0, 0.0, 0.0), at(10.0, 10.0, 0.0)], 50.0, 700.0);
    assert!(
        verdict(&chord, "G3 X10 Y10 J10 F4200")
            .kinds()
            .contains(&Kind::PathDeviation)
    );
    let wide = ending_at(arc_run(10.0, 0.0, 70.7, PI / 2.0), at(10.0, 10.0, 0.0));
    assert_finds(&verdict(&wide, "G3 X10 Y10 J10 F4200"), &[Kind::Feed]);
}

#[test]
fn a_negative_radius_takes_the_long_way() {
    let samples = ending_at(arc_run(10.0, 0.0, 70.0, 1.5 * PI), at(-10.0, 10.0, 0.0));
    assert_passes(&verdict(&samples, "G3 X-10 Y10 R-10 F4200"));
    let mirrored: Vec<Position> = samples.iter().map(|&[x, y, ..]| at(-x, y, 0.0)).collect();
    assert_passes(&verdict(&mirrored, "G2 X10 Y10 R-10 F4200"));
    assert!(!verdict(&mirrored, "G2 X10 Y10 R10 F4200").passed());
}

#[test]
fn absolute_centres_are_program_coordinates() {
    let line = stop_at_all(&[at(0.0, 0.0, 0.0), at(5.0, 2.0, 0.0)], 50.0, 700.0);
    let arc = ending_at(arc_run(10.0, 0.0, 70.0, PI / 2.0), at(10.0, 10.0, 0.0));
    let arc = arc.iter().map(|&[x, y, ..]| at(x + 5.0, y + 2.0, 0.0));
    let samples: Vec<Position> = line.into_iter().chain(arc).collect();
    assert_passes(&verdict(
        &samples,
        "F4200 G90.1\nG1 X5 Y2\nG3 X15 Y12 I5 J12\n",
    ));
    assert_passes(&verdict(
        &samples,
        "F4200 G10 L2 P1 X1\nG90.1\nG1 X4 Y2\nG3 X14 Y12 I4 J12\n",
    ));
    assert_passes(&verdict(
        &samples,
        "F4200 G90.1\nG1 X5 Y2\nG91.1 G3 X15 Y12 J10\n",
    ));
}

#[test]
fn a_full_circle_cannot_be_left_out() {
    let circle = ending_at(arc_run(10.0, 0.0, 70.0, 2.0 * PI), at(0.0, 0.0, 0.0));
    let line = stop_at_all(&[at(0.0, 0.0, 0.0), at(-20.0, 0.0, 0.0)], 50.0, 700.0);
    let program = "G3 J10 F4200\nG1 X-20 F3000\n";
    assert_passes(&verdict(&[&circle[..], &line].concat(), program));
    let left_out = verdict(&line, program);
    assert!(left_out.kinds().contains(&Kind::VertexMissed), "{left_out}");
    assert!(!verdict(&line[..1], "G3 J10 F4200").passed());
    let twice = "G3 J10 P2 F4200\nG1 X-20 F3000\n";
    assert!(!verdict(&[&circle[..], &line].concat(), twice).passed());
    assert_passes(&verdict(&[&circle[..], &circle, &line].concat(), twice));
}

#[test]
fn a_helix_passes_and_a_wrong_pitch_does_not() {
    let samples = ending_at(
        arc_run(10.0, 0.8, 70.0, 1.5 * PI),
        at(-10.0, 10.0, 1.2 * PI),
    );
    let program = format!("G3 X-10 Y10 Z{} J10 F4200", 1.2 * PI);
    let good = judge(&trace(&samples), &program, &smooth_machine(), &exact());
    assert_passes(&good);
    assert!(good.maxima.sample_deviation_mm < 1e-11, "{good}");
    let mut bent = samples.clone();
    let middle = bent.len() / 2;
    bent[middle][2] += 1e-5;
    let options = Options {
        checks: vec![Check::Path],
        ..exact()
    };
    let verdict = judge(&trace(&bent), &program, &smooth_machine(), &options);
    assert_finds(&verdict, &[Kind::PathDeviation]);
    assert_eq!(
        (verdict.findings.len(), verdict.findings[0].sample),
        (1, middle)
    );
    assert!((verdict.findings[0].value - 1e-5).abs() < 1e-7, "{verdict}");
}

#[test]
fn arcs_lie_in_the_plane_chosen() {
    let xy = arc_run(10.0, 0.8, 70.0, PI / 2.0);
    let turned = |order: [usize; 3]| -> Vec<Position> {
        xy.iter()
            .map(|sample| {
                let mut turned = Position::default();
                (0..3).for_each(|axis| turned[order[axis]] = sample[axis]);
                turned
            })
            .collect()
    };
    let rise = 0.4 * PI;
    let zx = ending_at(turned([2, 0, 1]), at(10.0, rise, 10.0));
    assert_passes(&verdict(
        &zx,
        &format!("G18 G3 Z10 X10 Y{rise} K0 I10 F4200"),
    ));
    let yz = ending_at(turned([1, 2, 0]), at(rise, 10.0, 10.0));
    assert_passes(&verdict(&yz, &format!("G19 G3 Y10 Z10 X{rise} K10 F4200")));
    assert!(!verdict(&yz, &format!("G19 G2 Y10 Z10 X{rise} R10 F4200")).passed());
}

#[test]
fn a_rotary_axis_is_judged_in_degrees() {
    let turn = |speed, acceleration| {
        let path = |degrees| {
            let mut position = Position::default();
            position[3] = degrees;
            position
        };
        Profile::rest_to_rest(speed, 90.0, acceleration).samples(path)
    };
    assert_passes(&verdict(&turn(60.0, 1990.0), "G20 G1 A90 F3600"));
    assert_finds(&verdict(&turn(60.6, 1990.0), "G1 A90 F3600"), &[Kind::Feed]);
    assert_finds(
        &verdict(&turn(60.0, 2020.0), "G1 A90 F3600"),
        &[Kind::Acceleration],
    );
    assert_finds(
        &verdict(&turn(60.0, 1990.0), "G1 A90.001 F3600"),
        &[Kind::EndPoint],
    );
}

#[test]
fn path_speed_counts_linear_axes_where_any_moves() {
    let both = |length: f64| {
        let mut position = at(length, 0.0, 0.0);
        position[3] = 2.0 * length;
        position
    };
    let run = |speed| Profile::rest_to_rest(speed, 40.0, 900.0).samples(both);
    assert_passes(&verdict(&run(50.0), "G1 X40 A80 F3000"));
    assert_passes(&verdict(&run(50.0), "G93 G1 X40 A80 F75"));
    assert_finds(&verdict(&run(50.5), "G1 X40 A80 F3000"), &[Kind::Feed]);
    assert_finds(&verdict(&run(50.0), "G93 G1 X40 A80 F74"), &[Kind::Feed]);
}

#[test]
fn an_exact_stop_is_met_by_a_sample() {
    let program = "G61.1\nG1 X20 F3000\nX30\n";
    let stops = [at(0.0, 0.0, 0.0), at(20.0, 0.0, 0.0), at(30.0, 0.0, 0.0)];
    assert_passes(&verdict(&stop_at_all(&stops, 50.0, 990.0), program));
    let through = stop_at_all(&[stops[0], stops[2]], 50.0, 990.0);
    assert_finds(&verdict(&through, program), &[Kind::VertexMissed]);
    assert_passes(&verdict(&through, &program.replace("G61.1", "G64")));
}
