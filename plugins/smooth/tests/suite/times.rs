//! The programs that other planners are compared on: time, limits, tolerance, and how little the settings matter.

use crate::common;

use common::{Peaks, context, judge, lines, read, run, samples};
use tandem_sdk::{AxisLimits, PlannerContext};
use tandem_smooth::{Effort, Options};

fn path(name: &str) -> String {
    let root = format!("{}/../..", env!("CARGO_MANIFEST_DIR"));
    match name {
        "square" | "serpentine" | "raster" | "spiral" => {
            format!("{root}/examples/programs/{name}.ngc")
        }
        _ => format!("{root}/tests/fixtures/cases/smooth_{name}.json"),
    }
}

/// Drives a program, and sees to it that every limit is kept.
fn drive(name: &str, options: &Options) -> (Peaks, Effort) {
    let (points, feed) = read(&path(name));
    let (collected, effort) = run(&lines(&points, feed), options, &context(&points[0], 0.01));
    let peaks = judge(&samples(&collected.segments), &points);
    let what = format!("{name} {options:?}: {peaks:?}");
    assert!(peaks.axis_speed <= 250.0 && peaks.speed <= feed, "{what}");
    assert!(
        peaks.acceleration <= 1000.0 * (1.0 + 1e-6) && peaks.jerk <= 20_000.0 * 1.01,
        "{what}"
    );
    assert!(peaks.deviation_mm.iter().all(|off| *off <= 0.01), "{what}");
    assert_eq!(collected.reports.len(), points.len() - 1, "{what}");
    (peaks, effort)
}

/// The median over neighbouring grids and shares of the tolerance.
fn median_s(name: &str) -> f64 {
    let mut times = Vec::new();
    for grid_ms in [5.5, 6.0, 6.5] {
        for tolerance_share in [0.945, 0.955, 0.965] {
            let options = Options {
                grid_ms,
                tolerance_share,
                ..Options::default()
            };
            let (peaks, effort) = drive(name, &options);
            assert_eq!(effort.stops, 0, "{name} {options:?}");
            times.push(peaks.time_s);
        }
    }
    times.sort_by(f64::total_cmp);
    println!(
        "{name}: {:.3} to {:.3} s, median {:.3} s",
        times[0], times[8], times[4]
    );
    times[4]
}

#[test]
fn times_are_near_the_best_known_whatever_the_settings() {
    for (name, max_s) in [
        ("square", 1.41),
        ("serpentine", 2.82),
        ("raster", 28.95),
        ("spiral", 20.30),
        ("corner90", 1.375),
        ("zigzag", 1.40),
        ("arcline", 1.065),
    ] {
        assert!(median_s(name) <= max_s, "{name}");
    }
}

#[test]
fn cases_of_every_kind_keep_all_limits() {
    for name in ["rand2d", "rand3d", "noisy", "tiny", "fast"] {
        let (peaks, effort) = drive(name, &Options::default());
        println!(
            "{name}: {:.3} s, {} stops, {} windows refused",
            peaks.time_s, effort.stops, effort.rejected
        );
    }
}

/// Intervals of a round in the mean.
fn intervals_a_round(name: &str, grid_ms: f64, rounds: u32) -> f64 {
    let options = Options {
        grid_ms,
        rounds,
        ..Options::default()
    };
    let (_, effort) = drive(name, &options);
    effort.intervals as f64 / effort.rounds as f64
}

#[test]
fn rounds_before_the_last_take_a_coarser_grid_except_where_it_is_short() {
    for (grid_ms, expected) in [(6.0, 0.8..0.92), (2.0, 0.94..1.06)] {
        let of = |rounds| intervals_a_round("serpentine", grid_ms, rounds);
        let share = of(4) / of(1);
        assert!(expected.contains(&share), "{grid_ms} ms: {share}");
    }
}

/// The way of a spiral takes 20 s at its feed, and its start and end a quarter of a second more. A raster turns round in every window.
#[test]
fn windows_that_go_at_their_feed_take_one_round_and_others_their_two() {
    let (peaks, effort) = drive("spiral", &Options::default());
    let of_first = 2 * u64::from(Options::default().rounds);
    assert!(effort.rounds < effort.windows + of_first, "{effort:?}");
    assert!(peaks.time_s < 20.3, "{peaks:?}");
    let (_, effort) = drive("raster", &Options::default());
    assert!(effort.rounds >= 2 * effort.windows, "{effort:?}");
}

/// On an arc whose tolerance is far below what the grid can follow no window passes but a short one. It is looked for by halving the
/// first; afterwards as long ones as that one are planned.
#[test]
fn windows_far_longer_than_those_that_pass_are_not_planned_again_and_again() {
    let axis = AxisLimits {
        feed_mm_per_s: 1900.0,
        jerk_mm_per_s3: 3e7,
        ..tandem_rig::axis(7e5)
    };
    let context = PlannerContext {
        path_tolerance_mm: 0.000_24,
        ..tandem_rig::context(&[axis; 2], 0.0016)
    };
    let arc = tandem_rig::arc(&context.position, [0.0, 30.0], 1.5, 1900.0);
    let (collected, effort) = run(
        &tandem_rig::numbered(vec![arc]),
        &Options::default(),
        &context,
    );
    assert!(
        !collected.segments.is_empty() && effort.stops > 20,
        "{effort:?}"
    );
    // Where each window begins with the longest one there are nine times as many.
    assert!(effort.intervals < 250_000, "{effort:?}");
}
