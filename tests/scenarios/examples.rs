//! Every example program, within limits; the published cases through the whole chain.

use crate::harness::{Scenario, mill, root};

fn example(name: &str) -> std::path::PathBuf {
    root().join("examples/programs").join(name)
}

/// The machine that an example is for.
pub fn machine_of(program: &std::path::Path) -> std::path::PathBuf {
    match program.file_stem().and_then(|stem| stem.to_str()) {
        Some("corexy") => root().join("examples/machines/corexy.toml"),
        Some("portal") => root().join("examples/machines/gantry.toml"),
        Some("cylinder") => root().join("examples/machines/rotary-table.toml"),
        _ => mill(),
    }
}

#[test]
fn every_example_runs_within_limits() {
    let programs = std::fs::read_dir(root().join("examples/programs")).unwrap();
    let mut count = 0;
    for program in programs
        .map(|entry| entry.unwrap().path())
        .filter(|p| p.extension().is_some_and(|e| e == "ngc"))
    {
        let done = Scenario::of(&program).on(&machine_of(&program)).run();
        done.assert_within_limits();
        assert_eq!(done.number("starvations"), 0.0);
        count += 1;
    }
    assert!(count >= 6, "{count} examples");
}

#[test]
fn long_tests_of_the_path_run_within_limits() {
    for name in [
        "circle-in-chords",
        "full-reversal",
        "arc-at-speed",
        "mixture",
    ] {
        let path = root()
            .join("tests/fixtures/programs")
            .join(name)
            .with_extension("ngc");
        Scenario::of(&path).run().assert_within_limits();
    }
}

#[test]
fn rotary_axes_run_within_limits() {
    let program = root().join("tests/fixtures/programs/rotary.ngc");
    Scenario::of(&program)
        .on(&root().join("examples/machines/mill-4axis.toml"))
        .run()
        .assert_within_limits();
}

#[test]
fn the_published_path_takes_the_published_time() {
    let loop_machine = root().join("examples/machines/two-step-loop.toml");
    for (name, time_s) in [
        ("two-step-square.ngc", 1.871_080),
        ("two-step-arcs.ngc", 3.292_509),
    ] {
        let done = Scenario::of(&example(name)).on(&loop_machine).run();
        assert_eq!(done.status(), 0, "{}", done.errors());
        let taken_s = done.number("motion_time_s");
        // The last sample is the first one at rest, and the first one is at rest too.
        assert!(
            (time_s..time_s + 2.0 * 0.0005).contains(&taken_s),
            "{name}: {taken_s}"
        );
    }
}

#[test]
fn the_rough_record_is_the_published_one() {
    let loop_machine = root().join("examples/machines/two-step-loop.toml");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rough.csv");
    let done = Scenario::of(&example("two-step-square.ngc"))
        .on(&loop_machine)
        .with(&["--rough", path.to_str().unwrap()])
        .run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    let mut reader = csv::Reader::from_path(&path).unwrap();
    let rows: Vec<Vec<f64>> = reader
        .records()
        .map(|row| {
            row.unwrap()
                .iter()
                .map(|cell| cell.parse().unwrap())
                .collect()
        })
        .collect();
    let text = std::fs::read_to_string(root().join("tests/fixtures/cases/000_two_step.json"));
    let case: serde_json::Value = serde_json::from_str(&text.unwrap()).unwrap();
    let expect = &case["expect"];
    // The last one ends with the run.
    assert_eq!(rows.len() as u64, expect["n_rough"].as_u64().unwrap());
    for record in expect["rough"].as_array().unwrap() {
        let row = &rows[record["index"].as_u64().unwrap() as usize];
        let number = |key: &str| record[key].as_f64().unwrap();
        for axis in 0..2 {
            let way_mm = record["dx_mm"][axis].as_f64().unwrap();
            assert!((row[1 + axis] - way_mm).abs() < 1e-9, "{row:?}: {record}");
        }
        let feeds = [
            row[4] * 60.0 - number("fs_mm_min"),
            row[5] * 60.0 - number("fe_mm_min"),
        ];
        assert!(
            feeds.iter().all(|off| off.abs() < 1e-6),
            "{row:?}: {record}"
        );
    }
}

#[test]
fn the_published_junction_feeds_are_in_the_blocks_file() {
    let loop_machine = root().join("examples/machines/two-step-loop.toml");
    let done = Scenario::of(&example("two-step-arcs.ngc"))
        .on(&loop_machine)
        .run();
    let feeds: Vec<f64> = done
        .block_cells("start_feed_mm_s")
        .iter()
        .map(|cell| cell.parse::<f64>().unwrap() * 60.0)
        .collect();
    for (block, feed) in [
        (1, 100.0),
        (2, 100.0),
        (20, 3118.13),
        (50, 1143.43),
        (70, 554.26),
        (79, 100.0),
    ] {
        assert!(
            (feeds[block] - feed).abs() < 0.005,
            "block {block}: {} instead of {feed}",
            feeds[block]
        );
    }
}

#[test]
fn the_forms_that_break_limits_do_not_start_under_the_guard() {
    for set in [
        &["--set", "planner.options.junction=tangent"][..],
        &["--set", "planner.plugin=after-interpolation"],
    ] {
        let refused = Scenario::of(&example("square.ngc")).with(set).run();
        assert_eq!(refused.status(), 1);
        assert!(
            refused.errors().contains("guard.mode = \"count\""),
            "{}",
            refused.errors()
        );
        assert!(!refused.file("trace.csv").exists());
        let counted = Scenario::of(&example("square.ngc"))
            .with(set)
            .with(&["--set", "guard.mode=count"])
            .run();
        assert_eq!(counted.status(), 0, "{}", counted.errors());
    }
}

#[test]
fn a_jerk_limit_that_is_meant_refuses_a_planner_that_keeps_none() {
    let refused = Scenario::of(&example("square.ngc"))
        .with(&["--set", "motion.jerk=limit"])
        .run();
    assert_eq!(refused.status(), 1);
    assert!(
        refused.errors().contains("motion.jerk = \"report\""),
        "{}",
        refused.errors()
    );
}
