//! The planner that lets blocks overlap, through the whole chain.

use crate::examples::machine_of;
use crate::harness::{Scenario, overlapping, root};
use crate::random::OVERLAP;

fn program(path: &str) -> Scenario {
    Scenario::of(&root().join(path)).with(OVERLAP)
}

#[test]
fn every_example_runs_within_limits_and_tolerance() {
    let mut count = 0;
    let programs = std::fs::read_dir(root().join("examples/programs"))
        .unwrap()
        .map(|entry| entry.unwrap().path());
    for path in programs.filter(|path| path.extension().is_some_and(|e| e == "ngc")) {
        let done = Scenario::of(&path)
            .on(&machine_of(&path))
            .with(OVERLAP)
            .run();
        done.assert_within_tolerance();
        assert_eq!(done.number("starvations"), 0.0);
        count += 1;
    }
    assert!(count >= 6, "{count} examples");
    for name in [
        "circle-in-chords",
        "full-reversal",
        "arc-at-speed",
        "mixture",
    ] {
        program(&format!("tests/fixtures/programs/{name}.ngc"))
            .run()
            .assert_within_tolerance();
    }
    let mill = root().join("examples/machines/mill-4axis.toml");
    program("tests/fixtures/programs/rotary.ngc")
        .on(&mill)
        .run()
        .assert_within_tolerance();
}

#[test]
fn the_claim_of_the_paper() {
    let times = [
        ("constant-50", 8693),
        ("sharp-20", 8693),
        ("sharp-and-gentle-20", 4553),
        ("sharp-20-gentle-80", 12_833),
    ];
    for (name, ticks) in times {
        let path = format!("examples/block-overlap/{name}.ngc");
        program(&path).run().assert_within_tolerance();
        let set =
            ["corner_control=off", "limits=off"].map(|option| format!("planner.options.{option}"));
        let published = program(&path)
            .with(&[
                "--set",
                &set[0],
                "--set",
                &set[1],
                "--set",
                "guard.mode=count",
            ])
            .run();
        // One sample more: the first one at rest.
        assert_eq!(published.number("samples") as u64, ticks + 2, "{name}");
    }
}

#[test]
fn every_example_machine_takes_the_planner() {
    let files = std::fs::read_dir(root().join("examples/machines"))
        .unwrap()
        .map(|entry| entry.unwrap().path());
    // What other machine files include is none by itself.
    for machine in files.filter(|path| {
        std::fs::read_to_string(path)
            .unwrap()
            .contains("format = 1")
    }) {
        let set = [
            "planner.options={}",
            "machine.require_homing=false",
            "motion.jerk=report",
        ];
        let set = set.map(|set| ["--set", set]).concat();
        let done = Scenario::text("F600\nG1 X1\nM2\n")
            .on(&machine)
            .with(OVERLAP)
            .with(&set)
            .run();
        assert_eq!(done.status(), 0, "{}: {}", machine.display(), done.errors());
    }
}

#[test]
fn the_square_is_no_slower_than_with_exact_stops() {
    let square = std::fs::read_to_string(root().join("examples/programs/square.ngc")).unwrap();
    let through = Scenario::text(&square).with(OVERLAP).run();
    through.assert_within_tolerance();
    let stopping = Scenario::text(&square.replace("G64 P0.01", "G61"))
        .with(OVERLAP)
        .run();
    stopping.assert_within_tolerance();
    assert!(
        square.contains("G64 P0.01"),
        "the program asks for continuous motion"
    );
    let [through_s, stopping_s] = [&through, &stopping].map(|done| done.number("motion_time_s"));
    assert!(
        through_s < stopping_s && stopping_s < 1.30,
        "{through_s} against {stopping_s}"
    );
    assert!(
        through
            .block_cells("limited_by")
            .iter()
            .any(|reason| reason == "tolerance")
    );
}

#[test]
fn the_reason_is_what_cut_the_overlap() {
    let reasons = |text: &str, set: &[&str]| {
        let done = Scenario::text(text).with(OVERLAP).with(set).run();
        assert_eq!(done.status(), 0, "{}", done.errors());
        (done.number("motion_time_s"), done.block_cells("limited_by"))
    };
    let square = |p: f64| format!("G21 G90\nG64 P{p}\nF5000\nG1 X20\nG1 Y20\nG1 X0\nG1 Y0\nM2\n");
    let wide = [0.5, 2.0, 10.0].map(|p| reasons(&square(p), &[]));
    assert_eq!(wide[0], wide[1], "the tolerance no longer acts");
    assert_eq!(wide[0], wide[2]);
    assert!(
        wide[0].1[..3].iter().all(|reason| reason == "junction"),
        "{:?}",
        wide[0]
    );
    assert_eq!(reasons(&square(0.01), &[]).1[0], "tolerance");
    let reversal = reasons("G21 G90\nG64 P0.5\nF3000\nG1 X20\nG1 X0\nM2\n", &[]).1;
    assert!(
        reversal[0] == "junction" || reversal[0] == "acceleration",
        "{reversal:?}"
    );
    let off = ["--set", "planner.options.corner_control=off"];
    let angle = reasons("G21 G90\nF3000\nG1 X20 TA50\nG1 Y20\nM2\n", &off).1;
    assert_eq!(angle[0], "junction");
    let rise = reasons("G21 G90\nG64\nF1000\nG1 X10 TA5\nG1 X70 F15000\nM2\n", &[]).1;
    assert_eq!(rise[0], "time-constant");
}

#[test]
fn a_tighter_tolerance_is_kept_and_costs_time() {
    let text =
        |tolerance: f64| format!("G21 G90\nG64 P{tolerance}\nF3000\nG1 X20\nG1 Y20\nG1 X0\nM2\n");
    let mut last_s = 0.0;
    for tolerance in [0.2, 0.05, 0.01, 0.002] {
        let done = Scenario::text(&text(tolerance)).with(OVERLAP).run();
        let verdict = done.assert_within_tolerance();
        assert!(
            verdict.maxima.vertex_deviation_mm > 0.5 * tolerance,
            "{tolerance} is not made use of"
        );
        assert!(done.number("motion_time_s") > last_s);
        last_s = done.number("motion_time_s");
    }
}

#[test]
fn a_line_into_a_tangent_arc_stays_within_the_tolerance() {
    let text = "G21 G90 G64\nF3000\nG1 X20\nG3 X20 Y10 J5\nG1 X0\nM2\n";
    let done = Scenario::text(text).with(OVERLAP).run();
    assert!(
        done.assert_within_tolerance().maxima.sample_deviation_mm > 0.004,
        "they overlap"
    );
    let count = [
        "--set",
        "planner.options.corner_control=off",
        "--set",
        "planner.options.limits=off",
    ];
    let published = Scenario::text(text)
        .with(OVERLAP)
        .with(&count)
        .with(&["--set", "guard.mode=count"])
        .run();
    let off_um = published.number("max_path_deviation_mm") * 1e3;
    assert!(
        (13.0..16.0).contains(&off_um),
        "TA50 loses 14 µm where the closed form for lines says none: {off_um}"
    );
}

#[test]
fn without_corner_control_the_constant_is_the_programs() {
    let text = "G21 G90\nF1200\nG1 X20 TA29.6\nG1 Y20\nTA80.4\nG1 X0\nG1 Y0\nM2\n";
    let done = Scenario::text(text)
        .with(OVERLAP)
        .with(&["--set", "planner.options.corner_control=off"])
        .run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    let constants = done.block_cells("time_constant_ms");
    let constants: Vec<f64> = constants.iter().filter_map(|ms| ms.parse().ok()).collect();
    assert_eq!(constants.len(), 4, "the end of the program has none");
    assert!(
        constants
            .iter()
            .zip([30.0, 30.0, 80.0, 80.0])
            .all(|(ms, ta)| (ms - ta).abs() < 1e-9),
        "{constants:?}"
    );
    let verdict = done.judge(|options| {
        overlapping(options);
        (options.sample_tolerance_mm, options.vertex_tolerance_mm) = (Some(0.3), Some(0.3));
    });
    assert!(verdict.passed(), "{verdict}");
    // F·τ·sin(θ/2)/4 with 20 mm/s and 80 ms: constants are whole periods.
    assert!(
        (verdict.maxima.vertex_deviation_mm - 0.4 * 0.5f64.sqrt()).abs() < 1e-5,
        "{verdict}"
    );
}

#[test]
fn the_published_form_runs_under_count_only() {
    let off = &["--set", "planner.options.limits=off"];
    let refused = program("examples/programs/square.ngc").with(off).run();
    assert_eq!(refused.status(), 1);
    assert!(
        refused.errors().contains("guard.mode = \"count\""),
        "{}",
        refused.errors()
    );
    let counted = program("examples/programs/square.ngc")
        .with(off)
        .with(&["--set", "guard.mode=count"])
        .run();
    assert_eq!(counted.status(), 0, "{}", counted.errors());
    assert!(counted.number("limit_violations") > 0.0);
}

#[test]
fn the_tolerance_holds_where_the_axes_do_not_count() {
    let off = [
        "--set",
        "planner.options.limits=off",
        "--set",
        "guard.mode=count",
    ];
    for tolerance in [0.2, 0.05, 0.01, 0.001] {
        let text =
            format!("G21 G90\nG64 P{tolerance}\nF5000\nG1 X20\nG1 Y20\nG1 X0\nG1 X20 Y19\nM2\n");
        let done = Scenario::text(&text).with(OVERLAP).with(&off).run();
        assert_eq!(done.status(), 0, "{}", done.errors());
        let verdict = done.judge(overlapping);
        let vertex_mm = verdict.maxima.vertex_deviation_mm;
        assert!(vertex_mm <= tolerance, "{vertex_mm} of {tolerance} mm");
        let overlaps = vertex_mm > 0.3 * tolerance;
        assert_eq!(overlaps, tolerance > 0.04, "{vertex_mm} of {tolerance} mm");
        assert_eq!(
            done.block_cells("limited_by")[0],
            if overlaps { "feed" } else { "tolerance" }
        );
    }
}

#[test]
fn time_constants_that_cannot_be_are_refused_with_their_place() {
    for (word, column, words) in [
        ("TA0", 7, "greater than zero"),
        ("TA-5", 7, "greater than zero"),
        ("TA5000", 7, "1 to 1000 ms"),
        ("TA0.2", 7, "1 to"),
    ] {
        let done = Scenario::text(&format!("F600\nG1 X1 {word}\nM2\n"))
            .with(OVERLAP)
            .run();
        assert_eq!(done.status(), 1);
        assert!(
            done.errors().contains(&format!(":2:{column}:")) && done.errors().contains(words),
            "{}",
            done.errors()
        );
    }
    let range = [
        "--set",
        "motion.time_constant_range_ms=[5, 40]",
        "--set",
        "motion.time_constant_ms=20",
    ];
    let done = Scenario::text("F600\nG1 X1 TA50\nM2\n")
        .with(OVERLAP)
        .with(&range)
        .run();
    assert!(
        done.status() == 1 && done.errors().contains("5 to 40 ms"),
        "{}",
        done.errors()
    );
}

#[test]
fn a_planner_that_takes_no_time_constants_says_so_once() {
    let text = "F600\nG1 X1\nG1 X2 TA20\nG1 X3\nM2\n";
    let told = |set: &[&str]| {
        let done = Scenario::text(text).with(set).run();
        assert_eq!(done.status(), 0, "{}", done.errors());
        done.errors().matches("line 3: TA has no effect").count()
    };
    let count = "guard.mode=count";
    assert_eq!(told(&[]), 1);
    assert_eq!(
        told(&[
            "--set",
            "planner.plugin=after-interpolation",
            "--set",
            count
        ]),
        1
    );
    assert_eq!(told(OVERLAP), 0);
}
