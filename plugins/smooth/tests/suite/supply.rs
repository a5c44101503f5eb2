//! The supply of blocks ends, or is late, behind any block: at rest at the end of what was there, within all limits.

use crate::common;

use common::programs::program;
use common::{Collected, Point, context, judge, lines, read, run, samples};
use tandem_sdk::{Accepted, Block, Planner, PlannerContext};
use tandem_smooth::{Options, SmoothPlanner};

/// A program whose points are the ends of its blocks, with its name.
struct Case {
    name: String,
    blocks: Vec<Block>,
    points: Vec<Point>,
    /// How many blocks lie between two cuts.
    step: usize,
}

/// Dense blocks of a raster, a zigzag, and random programs of all kinds of lines.
fn cases() -> Vec<Case> {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let (raster, raster_feed) = read(&format!("{root}/examples/programs/raster.ngc"));
    let (zigzag, zigzag_feed) = read(&format!("{root}/tests/fixtures/cases/smooth_zigzag.json"));
    let of = |name: &str, points: &[Point], feed, step| Case {
        name: name.to_string(),
        blocks: lines(points, feed),
        points: points.to_vec(),
        step,
    };
    let mut cases = vec![
        of("raster", &raster[..400], raster_feed, 13),
        of("zigzag", &zigzag, zigzag_feed, 1),
    ];
    for (seed, step) in [(0, 1), (1, 1), (2, 17), (3, 131), (4, 13), (7, 3)] {
        let (kind, blocks, points) = program(seed);
        cases.push(Case {
            name: format!("{kind}, seed {seed}"),
            blocks,
            points,
            step,
        });
    }
    cases
}

/// All limits are kept, and the whole of the path through `points` is driven, from rest to rest.
fn assert_driven(collected: &Collected, blocks: &[Block], points: &[Point], what: &str) {
    let driven = samples(&collected.segments);
    let peaks = judge(&driven, points);
    let what = format!("{what}: {peaks:?}");
    assert!(
        peaks.axis_speed <= 250.0 && peaks.speed <= blocks[0].feed_mm_per_s * (1.0 + 1e-6),
        "{what}"
    );
    assert!(
        peaks.acceleration <= 1000.0 * (1.0 + 1e-6) && peaks.jerk <= 20_000.0 * 1.01,
        "{what}"
    );
    assert!(peaks.deviation_mm.iter().all(|off| *off <= 0.01), "{what}");
    let (last, end) = (driven[driven.len() - 1], points[points.len() - 1]);
    assert!(
        (0..3).all(|i| (last[i] - end[i]).abs() < 1e-9),
        "{what}: ends at {last:?}, not {end:?}"
    );
    assert_eq!(collected.reports.len(), blocks.len(), "{what}");
}

#[test]
fn a_program_may_end_at_any_block() {
    for case in cases() {
        for cut in (1..case.blocks.len()).step_by(case.step) {
            let (blocks, points) = (&case.blocks[..cut], &case.points[..=cut]);
            let collected = run(blocks, &Options::default(), &context(&points[0], 0.01)).0;
            assert_driven(
                &collected,
                blocks,
                points,
                &format!("{}, {cut} blocks", case.name),
            );
        }
    }
}

/// Drives `blocks`; behind the first `cut` none comes for `periods` rough periods. Gives what was emitted by then too.
fn run_late(
    blocks: &[Block],
    cut: usize,
    periods: usize,
    context: &PlannerContext,
) -> (usize, Collected) {
    let mut planner = SmoothPlanner::new(&Options::default(), context).unwrap();
    let (mut collected, mut next, mut left, mut emitted) = (Collected::default(), 0, periods, 0);
    loop {
        let end = if left > 0 { cut } else { blocks.len() };
        while next < end && planner.accept(&blocks[next], None).unwrap() == Accepted::Accepted {
            next += 1;
        }
        if next == blocks.len() {
            planner.finish();
        }
        let advanced = planner.advance(0.008, &mut collected).unwrap();
        if left > 0 && next == cut {
            left -= 1;
            emitted = collected.segments.len();
            left *= usize::from(advanced.duration_s > 0.0);
        }
        if advanced.done != 0 {
            return (emitted, collected);
        }
    }
}

#[test]
fn blocks_may_fail_to_come_behind_any_block_until_the_machine_rests() {
    for case in cases() {
        for cut in (1..case.blocks.len()).step_by(case.step) {
            let context = context(&case.points[0], 0.01);
            let (emitted, whole) = run_late(&case.blocks, cut, usize::MAX, &context);
            let what = format!("{}, none behind block {cut}", case.name);
            assert_driven(&whole, &case.blocks, &case.points, &what);
            let rested = samples(&whole.segments[..emitted]);
            let (last, end) = (rested[rested.len() - 1], case.points[cut]);
            assert!(
                (0..3).all(|i| (last[i] - end[i]).abs() < 1e-9),
                "{what}: rests at {last:?}, not {end:?}"
            );
            let peaks = judge(&rested, &case.points[..=cut]);
            assert!(
                peaks.acceleration <= 1000.0 * (1.0 + 1e-6) && peaks.jerk <= 20_000.0 * 1.01,
                "{what}: {peaks:?}"
            );
        }
    }
}

#[test]
fn blocks_may_be_late_behind_any_block() {
    for case in cases() {
        for (n, cut) in (1..case.blocks.len()).step_by(case.step).enumerate() {
            let periods = 1 + 7 * n % 40;
            let whole = run_late(&case.blocks, cut, periods, &context(&case.points[0], 0.01)).1;
            let what = format!("{}, {periods} periods behind block {cut}", case.name);
            assert_driven(&whole, &case.blocks, &case.points, &what);
        }
    }
}

/// One block may take a great many chords; what takes more than the planner holds is refused before anything moves, and
/// not driven as a chord.
#[test]
fn an_arc_of_too_many_chords_is_refused() {
    let check = |turns: f64| {
        let context = context(&[0.0; 3], 0.01);
        let planner = SmoothPlanner::new(&Options::default(), &context).unwrap();
        let arc = tandem_rig::arc(
            &context.position,
            [0.0, 500.0],
            turns * std::f64::consts::TAU,
            100.0,
        );
        planner.check(&tandem_rig::numbered(vec![arc])[0], None)
    };
    assert!(
        check(100.0).is_ok(),
        "four hundred thousand chords of a millimetre"
    );
    let refused = check(1000.0).unwrap_err().to_string();
    assert_eq!(
        refused,
        "within its tolerance the path takes more than 500000 chords; nurbs drives it as it is"
    );
}
