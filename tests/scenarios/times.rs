//! Where the time of a run went: each table adds up to the whole, whatever the planner guesses and whoever disturbs it.

use std::path::PathBuf;

use crate::harness::{Done, Scenario, mill, root};

/// The built-in planners, each on a machine that it runs on.
fn planners() -> Vec<(&'static str, PathBuf)> {
    let smooth = root().join("examples/machines/mill-3axis-smooth.toml");
    let of_mill =
        ["look-ahead", "block-overlap", "after-interpolation"].map(|planner| (planner, mill()));
    of_mill
        .into_iter()
        .chain(["smooth", "nurbs"].map(|planner| (planner, smooth.clone())))
        .collect()
}

fn run(program: &str, (planner, machine): &(&str, PathBuf), commands: &str) -> Done {
    let planner = format!("planner.plugin={planner}");
    Scenario::text(program)
        .on(machine)
        .with(&["--set", &planner, "--set", "guard.mode=count"])
        .commands(commands)
        .run()
}

fn times_of_blocks(done: &Done) -> Vec<f64> {
    let cells = done.block_cells("time_s");
    cells.iter().map(|cell| cell.parse().unwrap()).collect()
}

/// A circle of short chords, blocks shorter than a period, a dwell, a rapid.
fn program() -> String {
    let chords = (1..=400).map(|i| (f64::from(i) * 0.01).sin_cos());
    let chords: Vec<_> = chords
        .map(|(sin, cos)| format!("G1 X{:.4} Y{:.4}", 20.0 + 5.0 * sin, 5.0 - 5.0 * cos))
        .collect();
    let tiny: Vec<_> = (1..=300)
        .map(|i| format!("G1 X{:.4}", f64::from(i) * 0.005))
        .collect();
    let (chords, tiny) = (chords.join("\n"), tiny.join("\n"));
    format!("G21 G90 G64 P0.01\nF3000\nG1 X20\n{chords}\nG4 P0.2\nG0 X0 Y0\n{tiny}\nG1 Y10\nM2\n")
}

#[test]
fn the_times_by_cause_and_the_times_of_the_blocks_add_up_to_the_motion_time() {
    let disturbed =
        "100,feed-override,0.5\n250,feed-override,1\n350,hold\n500,resume\n700,stall-rough,60\n";
    for planner in planners() {
        for commands in ["", disturbed] {
            let done = run(&program(), &planner, commands);
            assert_eq!(done.status(), 0, "{}: {}", planner.0, done.errors());
            let summary = done.summary();
            let by_cause = summary["limited_by_s"].as_object().unwrap();
            let motion_s = done.number("motion_time_s");
            let (causes_s, blocks) = (
                by_cause.values().map(|s| s.as_f64().unwrap()).sum::<f64>(),
                times_of_blocks(&done),
            );
            let told = format!(
                "{} {commands:?}: {motion_s} s, {}",
                planner.0, summary["limited_by_s"]
            );
            assert!(
                (causes_s - motion_s).abs() < 1e-9 * done.number("samples"),
                "{causes_s} of {told}"
            );
            let blocks_s: f64 = blocks.iter().sum();
            assert!(
                (blocks_s - motion_s).abs() < 1e-9 * done.number("samples"),
                "blocks: {blocks_s} of {told}"
            );
            assert_eq!(blocks.len() as f64, done.number("blocks"), "{told}");
            assert!(by_cause["dwell"].as_f64().unwrap() > 0.199, "{told}");
            assert!(!by_cause.contains_key("unreported"), "{told}");
            for cause in ["hold", "override"] {
                assert_eq!(
                    by_cause.contains_key(cause),
                    !commands.is_empty(),
                    "{cause}: {told}"
                );
            }
        }
    }
}

#[test]
fn a_sample_beyond_a_limit_is_told_with_its_size() {
    let done = run(
        "G21 G90 G94\nF6000\nG1 X20\nG1 Y20\nM2\n",
        &planners()[2],
        "",
    );
    let worst = done.summary()["worst_of_limits"]["x"]["acceleration"]["share"]
        .as_f64()
        .unwrap();
    let highest = done.summary()["max_acceleration_mm_s2"]["x"]
        .as_f64()
        .unwrap();
    assert!(
        highest > 1500.0 && (worst - highest / 1000.0).abs() < 1e-6,
        "{worst} of {highest}"
    );
    assert!(done.number("limit_violations") > 0.0);
    let told = String::from_utf8_lossy(&done.output.stdout).into_owned();
    let line = told
        .lines()
        .find_map(|line| line.strip_prefix("largest share of a limit: "));
    assert!(
        line.is_some_and(
            |line| line.contains(" acceleration ") && line.ends_with("beyond the tolerance")
        ),
        "{told}"
    );
}

#[test]
fn a_jerk_that_is_only_reported_is_told_with_its_size() {
    let done = run("G21 G90 G94\nF6000\nG1 X20\nM2\n", &planners()[0], "");
    assert_eq!(done.summary()["jerk"], "report");
    assert!(done.number("limit_violations") == 0.0);
    let highest = done.summary()["max_jerk_mm_s3"]["x"].as_f64().unwrap();
    let told = String::from_utf8_lossy(&done.output.stdout).into_owned();
    let size = format!(": X {:.2} times its limit at tick ", highest / 20_000.0);
    let line = told
        .lines()
        .find_map(|line| line.strip_prefix("largest jerk, which is only reported"));
    assert!(
        highest > 20_001.0 && line.is_some_and(|line| line.starts_with(&size)),
        "{highest}: {told}"
    );
}
