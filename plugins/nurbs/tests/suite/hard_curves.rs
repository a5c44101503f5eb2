//! The forms with windows on curves that are hard to drive: limits kept on every sample, the end met, or an error that says why.

use crate::common;

use std::f64::consts::FRAC_PI_2;

use common::{Collected, context, curve_block, run};
use tandem_nurbs::{NurbsPlanner, Options};
use tandem_rig::{Given, Offer, Random, arc, line, numbered};
use tandem_sdk::{AxisVector, NurbsData, Planner, PlannerContext, Segment};

fn clamped(points: &[[f64; 2]], weights: Vec<f64>, degree: usize) -> NurbsData {
    let spans = points.len() - degree;
    let mut knots = vec![0.0; degree];
    knots.extend((0..=spans).map(|n| n as f64));
    knots.extend(vec![spans as f64; degree]);
    let control_points = points.iter().map(|p| AxisVector::from_slice(p)).collect();
    NurbsData {
        degree,
        control_points,
        weights,
        knots,
    }
}

fn even(points: &[[f64; 2]], degree: usize) -> NurbsData {
    clamped(points, vec![1.0; points.len()], degree)
}

/// Largest acceleration and jerk as shares of their limits: of differences of samples, the acceleration also of the points
/// at which the governor of the fine loop looks.
fn shares(collected: &Collected, context: &PlannerContext) -> [f64; 2] {
    let period_s = context.fine_period_s;
    // A rest restarts the ticks, so each motion from rest to rest is looked at by itself.
    let mut worst = [at_points(&collected.segments), 0.0f64];
    let mut motion = Collected::default();
    for segment in &collected.segments {
        motion.segments.push(*segment);
        if segment.duration_s > 0.0 {
            continue;
        }
        let mut positions: Vec<AxisVector> = motion
            .path_samples(period_s)
            .into_iter()
            .map(|sample| sample.0)
            .collect();
        positions.splice(0..0, [positions[0]; 3]);
        positions.extend([positions[positions.len() - 1]; 3]);
        for axis in 0..2 {
            let mut values: Vec<f64> = positions.iter().map(|p| p[axis]).collect();
            for (order, limit) in [f64::INFINITY, 5000.0, 4e5].into_iter().enumerate() {
                values = values
                    .windows(2)
                    .map(|pair| (pair[1] - pair[0]) / period_s)
                    .collect();
                if order > 0 {
                    worst[order - 1] = values
                        .iter()
                        .fold(worst[order - 1], |most, v| most.max(v.abs() / limit));
                }
            }
        }
        motion.segments.clear();
    }
    worst
}

/// Of both ends, the middle and between.
fn at_points(segments: &[Segment]) -> f64 {
    let at =
        |segment: &Segment, n: i32| segment.acceleration(f64::from(n) / 8.0 * segment.duration_s);
    let all = segments
        .iter()
        .flat_map(|segment| (0..=8).map(move |n| at(segment, n)));
    all.flat_map(|a| a.0)
        .fold(0.0, |most, a| most.max(a.abs() / 5000.0))
}

/// In both forms; where both find a motion `scan` is no slower.
fn drive(name: &str, data: &NurbsData) {
    let [scan_s, windowed_s] = ["scan", "windowed"].map(|form| drive_in(form, name, data.clone()));
    if let (Some(scan_s), Some(windowed_s)) = (scan_s, windowed_s) {
        assert!(
            scan_s <= windowed_s * 1.001,
            "{name}: {scan_s} s, {windowed_s} s"
        );
    }
}

/// The time; none where it is refused, with a reason.
fn drive_in(form: &str, name: &str, data: NurbsData) -> Option<f64> {
    let name = format!("{form} {name}");
    let block = curve_block(data, 1.0, 100.0);
    let context = context(block.0.start);
    let end = block.0.end;
    let mut planner = NurbsPlanner::new(
        &Options::parse(&format!("form = \"{form}\"")).unwrap(),
        &context,
    )
    .unwrap();
    if let Err(error) = block.offer(&mut planner) {
        println!("{name}: refused: {error}");
        return None;
    }
    planner.finish();
    let mut collected = Collected::default();
    for _ in 0..200_000 {
        match planner.advance(0.008, &mut collected) {
            Ok(advanced) if advanced.done != 0 => break,
            Ok(_) => {}
            Err(error) => {
                println!("{name}: {error}");
                assert!(error.to_string().contains("line 1"), "{name}: {error}");
                return None;
            }
        }
    }
    let numbers = |segment: &Segment| {
        segment
            .coefficients
            .iter()
            .flatten()
            .chain(&segment.path)
            .all(|v| v.is_finite())
    };
    assert!(
        collected.segments.iter().all(numbers),
        "{name}: a number that is not finite"
    );
    let [acceleration, jerk] = shares(&collected, &context);
    println!(
        "{name}: {:.3} s, acceleration {acceleration:.3}, jerk {jerk:.3}",
        collected.duration_s()
    );
    assert!(
        acceleration <= 1.0 && jerk <= 1.0,
        "{name}: {acceleration} {jerk}"
    );
    let last = collected.segments.last().unwrap();
    assert_eq!(last.position(0.0), end, "{name}");
    Some(collected.duration_s())
}

/// Corners of control points that coincide are rests: between them the curves are lines, driven as fast as lines are.
#[test]
fn corners_of_coinciding_points_are_rests() {
    let rests = |form: &str, data: &NurbsData| {
        let block = curve_block(data.clone(), 1.0, 100.0);
        let collected = run(
            &format!("form = \"{form}\""),
            &context(block.0.start),
            &[block],
        );
        let rests: Vec<AxisVector> = collected
            .segments
            .iter()
            .filter(|s| s.duration_s == 0.0)
            .map(|s| s.position(0.0))
            .collect();
        (rests, collected.duration_s())
    };
    let (start, corner, end) = ([0.0, 0.0], [10.0, 0.0], [20.0, 10.0]);
    let straight = (10.0 + 200f64.sqrt()) / 100.0;
    for form in ["scan", "windowed"] {
        for (degree, count) in [(2, 2), (2, 3), (2, 5), (3, 3), (3, 4), (3, 6)] {
            // As often as the degree; and so often that the curve waits there.
            let points: Vec<_> = std::iter::once(start)
                .chain(std::iter::repeat_n(corner, count))
                .chain([end])
                .collect();
            let (rests, time_s) = rests(form, &even(&points, degree));
            let what = format!("{form}, degree {degree}, {count} points: {rests:?}, {time_s} s");
            let near = |(at, programmed): (&AxisVector, &[f64; 2])| {
                (0..2).all(|n| (at[n] - programmed[n]).abs() < 1e-9)
            };
            assert!(
                rests.len() == 2 && rests.iter().zip([&corner, &end]).all(near),
                "{what}"
            );
            assert!(time_s > straight && time_s < straight + 0.15, "{what}");
        }
    }
}

/// Three control points at the start: the curve stands still there and bends without bound just behind. Corners found there
/// within rounding of each other are one, or their number doubles in every round.
#[test]
fn a_start_that_bends_without_bound_costs_no_time() {
    let data = even(
        &[
            [0.0, 0.0],
            [0.0, 0.0],
            [0.0, 0.0],
            [-0.0448, 0.0588],
            [26.22, 0.06],
        ],
        4,
    );
    for form in ["scan", "windowed"] {
        let block = curve_block(data.clone(), 1.0, 1.0);
        let collected = run(
            &format!("form = \"{form}\""),
            &context(block.0.start),
            &[block],
        );
        let length_mm: f64 = collected
            .segments
            .iter()
            .map(|s| s.path_mm(s.duration_s))
            .fold(0.0, f64::max);
        let time_s = collected.duration_s();
        assert!(
            length_mm > 26.0 && time_s < 1.005 * length_mm + 0.1,
            "{form}: {length_mm} mm in {time_s} s"
        );
    }
}

#[test]
fn hard_curves_keep_their_limits() {
    let zigzag: Vec<[f64; 2]> = (0..12)
        .map(|n| [f64::from(n), f64::from(n % 2) * 3.0])
        .collect();
    drive("degree 1", &even(&zigzag, 1));
    drive("degree 2", &even(&zigzag, 2));
    drive("degree 3", &even(&zigzag, 3));
    drive("degree 5", &even(&zigzag, 5));
    let doubled: Vec<[f64; 2]> = zigzag.iter().flat_map(|p| [*p, *p]).collect();
    drive("coincident points", &even(&doubled, 3));
    let weights = (0..12)
        .map(|n| if n % 3 == 0 { 1e4 } else { 1.0 })
        .collect();
    drive("weights 1e4", &clamped(&zigzag, weights, 3));
    let small: Vec<[f64; 2]> = zigzag.iter().map(|p| [p[0] * 1e-3, p[1] * 1e-3]).collect();
    drive("small", &even(&small, 3));
    drive(
        "straight",
        &even(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [9.0, 0.0]], 3),
    );
    drive(
        "cusp",
        &even(&[[0.0, 0.0], [10.0, 10.0], [0.0, 10.0], [10.0, 0.0]], 3),
    );
    let mut pinched = even(&zigzag, 3);
    let knot = pinched.knots[6];
    pinched.knots[7] = knot;
    drive("double knot", &pinched);
    let long: Vec<[f64; 2]> = (0..10_000)
        .map(|n| [0.02 * f64::from(n), (0.05 * f64::from(n)).sin()])
        .collect();
    drive("10 000 points", &even(&long, 3));
}

/// Curves that turn back, on their line and ever less sharply beside it: each is driven about as fast as the others, because
/// it is slow at the turn only.
#[test]
fn turns_back_are_slow_at_the_turn_only() {
    for form in ["scan", "windowed"] {
        for (degree, points) in [
            (3, [0.0, 10.0, 0.0, 5.0, 6.0]),
            (2, [0.0, 10.0, 0.0, 5.0, 6.0]),
        ] {
            let time_s = |off: f64| {
                let points: Vec<[f64; 2]> = points
                    .iter()
                    .zip([0.0, 1.0, 1.0, 0.0, 0.0])
                    .map(|(x, y)| [*x, y * off])
                    .collect();
                let name = format!("turns back, degree {degree}, beside by {off:e} mm");
                drive_in(form, &name, even(&points, degree)).expect("driven")
            };
            let on_line_s = time_s(0.0);
            for off in [1e-12, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2] {
                let beside_s = time_s(off);
                assert!(
                    beside_s < 1.25 * on_line_s,
                    "{form} {degree} {off}: {beside_s} s, {on_line_s} s"
                );
            }
        }
    }
}

/// Control points that programs round to 10 nm make curves that turn back on next to no radius, and some nanometres beside a knot.
/// What is looked at beside the knot lies between it and the turn, and where the curve stands still at the knot what is left of its
/// derivatives there says nothing of its direction.
#[test]
fn turns_back_beside_a_knot_are_slow_at_the_turn_only() {
    let turns_before = [
        [10.80, 6.30],
        [7.75, 4.80],
        [7.96, 4.90],
        [8.47, 5.15],
        [9.23, 5.53],
        [8.71, 5.27],
        [9.04, 5.43],
    ];
    let stands_still = [
        [45.16, 0.19],
        [43.90, 1.39],
        [43.92, 1.37],
        [43.89, 1.40],
        [45.06, 0.29],
        [42.50, 2.73],
    ];
    for form in ["scan", "windowed"] {
        for points in [&turns_before[..], &stands_still[..]] {
            let curve = |share: f64| {
                let points: Vec<[f64; 2]> = points.iter().map(|p| p.map(|x| x * share)).collect();
                even(&points, 3)
            };
            let name = format!("a turn beside a knot, {} points", points.len());
            let time_s = drive_in(form, &name, curve(1e-3)).expect("driven");
            assert!(time_s < 0.1, "{name}: {time_s} s");
        }
    }
}

/// A rounded square; with arcs that turn a little less, as programs round their ends.
#[test]
fn lines_run_into_arcs_without_rest() {
    for form in ["scan", "windowed"] {
        for short_rad in [0.0, 4e-4] {
            let context = context(AxisVector::ZERO);
            let collected = run(
                &format!("form = \"{form}\""),
                &context,
                &rounded(40.0, 10.0, short_rad),
            );
            let rests = collected
                .segments
                .iter()
                .filter(|segment| segment.duration_s == 0.0)
                .count();
            assert_eq!(rests, 1, "{form} {short_rad}: at the end only");
            let [acceleration, jerk] = shares(&collected, &context);
            assert!(
                acceleration <= 1.0 && jerk <= 1.0,
                "{form} {short_rad}: {acceleration} {jerk}"
            );
        }
    }
}

/// Four lines and arcs anticlockwise.
fn rounded(side_mm: f64, radius_mm: f64, short_rad: f64) -> Vec<Given> {
    let (mut at, mut along, mut blocks) = (AxisVector::ZERO, [1.0, 0.0], Vec::new());
    for _ in 0..4 {
        let side = [-along[1], along[0]];
        let to = AxisVector::from_slice(&[at[0] + along[0] * side_mm, at[1] + along[1] * side_mm]);
        blocks.push(line(&at, &to, 100.0));
        let center_mm = [to[0] + side[0] * radius_mm, to[1] + side[1] * radius_mm];
        let corner = arc(&to, center_mm, FRAC_PI_2 - short_rad, 100.0);
        (at, along) = (corner.end, side);
        blocks.push(corner);
    }
    numbered(blocks)
        .into_iter()
        .map(|block| (block, None))
        .collect()
}

/// Random curves, among them on lines and near to lines as programs with six decimals write them, with weights up to 1e3 apart
/// from 1. Both forms drive every one of them; `scan` is no slower.
#[test]
fn random_curves_are_driven() {
    for seed in 1..=40 {
        let mut random = Random::new(seed);
        let data = random_curve(&mut random);
        println!("seed {seed}");
        let [scan_s, windowed_s] = ["scan", "windowed"].map(|form| {
            let time_s = drive_in(form, &format!("seed {seed}"), data.clone());
            time_s.unwrap_or_else(|| panic!("seed {seed} {form}: refused"))
        });
        assert!(
            scan_s <= windowed_s * 1.001,
            "seed {seed}: {scan_s} s, {windowed_s} s"
        );
    }
}

fn random_curve(random: &mut Random) -> NurbsData {
    let (degree, kind, weighted) = (
        random.pick(&[1, 2, 2, 3, 3, 4, 5]),
        random.below(5),
        random.below(3),
    );
    let scale = random.pick(&[0.01, 0.1, 1.0, 10.0]);
    let mut points = vec![[0.0, 0.0]];
    for n in 1..=degree as u64 + random.below(9) {
        let [x, y] = points[points.len() - 1];
        let free = [random.between(-scale, scale), random.between(-scale, scale)];
        let next = match kind {
            1 => [x + free[0].abs(), y + 0.3 * free[1]],
            2 => [free[0], 2.0 * free[0]],
            3 if random.below(3) == 0 => points[random.below(n) as usize],
            0 | 3 => free,
            _ => [free[0], free[1] * 10f64.powf(random.between(-6.0, 0.0))],
        };
        points.push(next.map(|v| (v * 1e6).round() / 1e6));
    }
    let decades = [0.0, 1.0, 3.0][weighted as usize];
    let weights = points
        .iter()
        .map(|_| 10f64.powf(random.between(-decades, decades)))
        .collect();
    clamped(&points, weights, degree)
}
