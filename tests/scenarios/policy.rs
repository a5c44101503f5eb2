//! Policy scripts in a run: what they ask for is driven, and what goes wrong in them is not.

use std::path::PathBuf;

use serde_json::Value;

use crate::harness::{Done, Scenario, root};

/// Corners, arcs, a rapid and a dwell; some seconds.
const PROGRAM: &str = "F2400\nG1 X20\nY20\nX12 Y14\nG2 X4 Y14 I-4 J0\nG1 X0 Y0\nG0 X5\nG4 P0.05\nG1 X30 Y3\nG3 X30 Y9 J3\nG1 X0 Y0\nM2\n";

fn fixture(name: &str) -> PathBuf {
    root().join("tests/fixtures/policies").join(name)
}

fn script(name: &str) -> PathBuf {
    root().join("scripts/policies").join(format!("{name}.wasm"))
}

/// The files of a folder of fixtures.
fn each(folder: &str) -> Vec<PathBuf> {
    let mut files: Vec<_> = std::fs::read_dir(fixture(folder))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    assert!(files.len() > 12, "{files:?}");
    files
}

fn with(script: &std::path::Path) -> Scenario {
    Scenario::text(PROGRAM).with(&["--set", &format!("policy.script={}", script.display())])
}

fn policy(done: &Done) -> Value {
    done.summary()["policy"].clone()
}

fn samples(done: &Done) -> [Vec<String>; 2] {
    [done.cells("x_cmd_mm"), done.cells("y_cmd_mm")]
}

#[test]
fn hostile_scripts_leave_a_run_within_limits() {
    let plain = Scenario::text(PROGRAM).run();
    plain.assert_within_limits();
    assert!(policy(&plain).is_null());
    for file in each("hostile") {
        let done = with(&file).run();
        done.assert_within_limits();
        let policy = policy(&done);
        assert_eq!(
            done.number("starvations") + done.number("overruns"),
            0.0,
            "{}",
            file.display()
        );
        if policy["traps"].as_u64().unwrap() == 3 {
            assert_eq!(policy["quarantined"], true, "{policy}");
            assert!(
                done.errors()
                    .contains("in quarantine until the file changes"),
                "{}",
                done.errors()
            );
        }
        // What never answers changes nothing: the samples are those of a run without it.
        let answered = ["time_constants_changed", "feeds_capped", "ratios_changed"]
            .iter()
            .any(|key| policy[key] != 0);
        if !answered {
            assert_eq!(samples(&done), samples(&plain), "{}", file.display());
        }
    }
}

#[test]
fn unfit_scripts_are_refused_before_anything_moves() {
    for file in each("refused") {
        let done = with(&file).run();
        assert_eq!(done.status(), 1, "{}", file.display());
        assert!(
            done.errors().contains("--set policy.script: "),
            "{}",
            done.errors()
        );
        assert!(!done.file("trace.csv").exists());
    }
    let slip = with(&script("load-feed"))
        .with(&["--set", "policy.parameters.lowest_ration=0.5"])
        .run();
    assert_eq!(slip.status(), 1);
    assert!(
        slip.errors()
            .contains("it has no parameter \"lowest_ration\"; the nearest is lowest_ratio"),
        "{}",
        slip.errors()
    );
    let range = with(&script("load-feed"))
        .with(&["--set", "policy.parameters.lowest_ratio=7"])
        .run();
    assert!(
        range
            .errors()
            .contains("lowest_ratio is 7; it must be from 0.05 to 1"),
        "{}",
        range.errors()
    );
    let text = with(&script("load-feed"))
        .with(&["--set", "policy.parameters.lowest_ratio=high"])
        .run();
    assert!(
        text.errors()
            .contains("a parameter is a number, or true or false"),
        "{}",
        text.errors()
    );
}

#[test]
fn what_a_script_asks_for_is_driven() {
    let done = with(&fixture("good/half-feed.wat")).run();
    done.assert_within_limits();
    let policy = policy(&done);
    assert_eq!(
        (policy["traps"].as_u64(), policy["windows"].as_u64()),
        (Some(0), Some(1)),
        "{policy}"
    );
    let nominal_s = Scenario::text(PROGRAM).run().number("nominal_time_s");
    assert_eq!(
        done.number("nominal_time_s"),
        nominal_s,
        "the nominal time is that of the program"
    );
    let fastest = done
        .column("feed_mm_s")
        .into_iter()
        .zip(done.column("line"))
        .filter(|(_, line)| *line != 7.0);
    let fastest = fastest.fold(0.0, |most: f64, (feed, _)| most.max(feed));
    assert!(
        (fastest - 20.0).abs() < 1e-6,
        "half of 2400 mm/min is 20 mm/s, {fastest} was driven"
    );
    let blocks = std::fs::read_to_string(done.file("blocks.csv")).unwrap();
    assert!(
        blocks.lines().any(|line| line.contains(",policy,")),
        "{blocks}"
    );
    assert!(
        done.errors()
            .contains("policy: line 2: feed 2400 -> 1200 mm/min"),
        "{}",
        done.errors()
    );
    assert!(policy["ratios_changed"].as_u64().unwrap() > 100, "{policy}");
}

#[test]
fn a_run_with_a_script_is_the_same_again_and_on_the_wall_clock() {
    let run = |clock: &str| {
        let set = [
            "--set",
            "policy.parameters.reference_current_a=0.5",
            "--clock",
            clock,
        ];
        with(&script("load-feed")).with(&set).run()
    };
    let first = run("virtual");
    first.assert_within_limits();
    assert_eq!(samples(&run("virtual")), samples(&first));
    let wall = run("wall");
    let late = ["starvations", "late_ratios", "missed_periods"]
        .iter()
        .map(|key| wall.number(key))
        .sum::<f64>();
    if late == 0.0 {
        assert_eq!(samples(&wall), samples(&first));
    } else {
        println!("skipped: this computer was late {late} times");
    }
}

/// Loads the script anew before every rough period of `ticks`.
fn reloads(ticks: usize) -> String {
    (0..ticks)
        .step_by(8)
        .map(|tick| format!("{tick},reload-policy\n"))
        .collect::<Vec<_>>()
        .concat()
}

#[test]
fn a_reload_in_every_rough_period_changes_no_sample() {
    for file in [
        fixture("good/half-feed.wat"),
        script("gentle-start"),
        script("load-feed"),
    ] {
        let plain = with(&file).run();
        let ticks = plain.number("samples") as usize;
        let reloaded = with(&file).commands(&reloads(ticks)).run();
        reloaded.assert_within_limits();
        assert_eq!(samples(&reloaded), samples(&plain), "{}", file.display());
        let policy = policy(&reloaded);
        assert!(
            policy["reloads"].as_u64().unwrap() as usize >= ticks / 8 - 1,
            "{policy}"
        );
    }
}

#[test]
fn a_reload_ends_a_quarantine() {
    let done = with(&fixture("hostile/unreachable.wat"))
        .commands("800,reload-policy\n")
        .run();
    done.assert_within_limits();
    let policy = policy(&done);
    assert_eq!(
        (policy["traps"].as_u64(), policy["reloads"].as_u64()),
        (Some(6), Some(1)),
        "three strikes, twice"
    );
    assert_eq!(policy["quarantined"], true);
}

/// Distance of each corner of the star from the path that was driven, mm.
fn corner_errors_mm(done: &Done) -> Vec<f64> {
    let text = std::fs::read_to_string(root().join("examples/policies/corners.ngc")).unwrap();
    let word = |line: &str, letter: char| {
        let rest = &line[line.find(letter)? + 1..];
        rest.split(' ').next()?.parse::<f64>().ok()
    };
    let corners: Vec<_> = text
        .lines()
        .skip(3)
        .filter_map(|line| word(line, 'X').zip(word(line, 'Y')))
        .collect();
    assert_eq!(corners.len(), 10);
    let driven: Vec<_> = done
        .column("x_cmd_mm")
        .into_iter()
        .zip(done.column("y_cmd_mm"))
        .collect();
    let nearest = |corner: &(f64, f64)| {
        driven
            .windows(2)
            .map(|pair| distance_mm(*corner, pair[0], pair[1]))
            .fold(9.0, f64::min)
    };
    corners[..9].iter().map(nearest).collect()
}

/// Distance of a point from a chord.
fn distance_mm(point: (f64, f64), from: (f64, f64), to: (f64, f64)) -> f64 {
    let (way, ray) = (
        (to.0 - from.0, to.1 - from.1),
        (point.0 - from.0, point.1 - from.1),
    );
    let square = way.0 * way.0 + way.1 * way.1;
    let along = if square == 0.0 {
        0.0
    } else {
        ((ray.0 * way.0 + ray.1 * way.1) / square).clamp(0.0, 1.0)
    };
    (ray.0 - along * way.0).hypot(ray.1 - along * way.1)
}

#[test]
fn the_time_constant_of_each_corner_keeps_the_error_that_a_constant_one_does_not() {
    let star = || {
        let set = [
            "planner.plugin=block-overlap",
            "planner.options.corner_control=off",
            "motion.time_constant_ms=50",
        ];
        let set: Vec<&str> = set.iter().flat_map(|key| ["--set", key]).collect();
        Scenario::of(&root().join("examples/policies/corners.ngc")).with(&set)
    };
    let worst = |done: &Done| corner_errors_mm(done).into_iter().fold(0.0, f64::max);
    let constant = star().run();
    assert!(worst(&constant) > 0.16, "{:?}", corner_errors_mm(&constant));
    for (error_um, longer) in [(20.0, 1.04), (50.0, 1.03), (100.0, 1.02)] {
        let script = format!("policy.script={}", script("corner-time-constant").display());
        let error = format!("policy.parameters.corner_error_um={error_um}");
        let done = star().with(&["--set", &script, "--set", &error]).run();
        assert_eq!(
            (done.status(), policy(&done)["traps"].as_u64()),
            (0, Some(0)),
            "{}",
            done.errors()
        );
        assert!(
            worst(&done) <= error_um * 1e-3,
            "{error_um}: {:?}",
            corner_errors_mm(&done)
        );
        done.assert_driven("", &["governed_samples"]);
        let verdict = done.judge(|options| {
            options.sample_tolerance_mm = Some(error_um * 1e-3);
            options.vertex_tolerance_mm = Some(error_um * 1e-3);
        });
        assert!(verdict.passed(), "{verdict}");
        assert!(
            done.number("motion_time_s") < longer * constant.number("motion_time_s"),
            "{error_um}"
        );
    }
}
