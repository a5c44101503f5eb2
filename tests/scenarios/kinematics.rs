//! Joints that are not the axes: their limits, their travel and their following errors, end to end.

use std::path::{Path, PathBuf};

use tandem_oracle::{Check, Kind, Verdict};

use crate::harness::{Done, Scenario, root};

const NURBS: [&str; 4] = [
    "--set",
    "planner.plugin=nurbs",
    "--set",
    "motion.jerk=limit",
];
const OVERLAP: [&str; 2] = ["--set", "planner.plugin=block-overlap"];
const SMOOTH: [&str; 4] = [
    "--set",
    "planner.plugin=smooth",
    "--set",
    "motion.jerk=limit",
];

/// From corner to corner of the table, where one motor of two does all the work.
const DIAGONAL: &str =
    "G21 G90 G17 G64\nG0 X-60 Y-60\nF20000\nG1 X60 Y60\nG1 X60 Y-60\nG2 X60 Y-60 I-30 J30\nM2\n";

fn machine(name: &str) -> PathBuf {
    root().join("examples/machines").join(name)
}

fn program(name: &str) -> PathBuf {
    root().join("examples/programs").join(name)
}

fn on_corexy(text: &str, settings: &[&str]) -> Scenario {
    Scenario::text(text)
        .on(&machine("corexy.toml"))
        .with(settings)
}

/// The greatest speed, mm/s, and acceleration, mm/s², of a joint, as the oracle has found them.
fn most(verdict: &Verdict, joint: &str) -> (f64, f64) {
    let found = verdict
        .maxima
        .joints
        .iter()
        .find(|(name, _)| name == joint)
        .expect("the oracle knows the joint");
    (found.1.velocity_mm_per_s, found.1.acceleration_mm_per_s2)
}

/// Within limits, jerk included, of a planner that keeps it.
fn assert_within_jerk(done: &Done) -> Verdict {
    done.assert_within_limits();
    let verdict = done.judge(|options| {
        options.checks.push(Check::Jerk);
        (
            options.speed_difference_mm_per_s,
            options.speed_difference_deg_per_s,
        ) = (Some(0.0), Some(0.0));
        (options.sample_tolerance_mm, options.vertex_tolerance_mm) = (Some(2e-6), Some(0.2));
    });
    assert!(verdict.passed(), "{verdict}");
    verdict
}

#[test]
fn every_planner_keeps_the_limits_of_the_joints() {
    for (program_name, machine_name) in [
        ("corexy.ngc", "corexy.toml"),
        ("portal.ngc", "gantry.toml"),
        ("cylinder.ngc", "rotary-table.toml"),
    ] {
        let scenario = || Scenario::of(&program(program_name)).on(&machine(machine_name));
        scenario().run().assert_within_limits();
        scenario().with(&OVERLAP).run().assert_within_tolerance();
        assert_within_jerk(&scenario().with(&NURBS).run());
        assert_within_jerk(
            &scenario()
                .with(&NURBS)
                .with(&["--set", "planner.options.form=windowed"])
                .run(),
        );
        assert_smooth(&scenario().with(&SMOOTH).run());
    }
}

/// Within limits, jerk included, and within the tolerances of the program.
fn assert_smooth(done: &Done) -> Verdict {
    done.assert_driven("", &["governed_samples", "jerk_relaxed_samples"]);
    let verdict = done.judge(|options| {
        options.checks.push(Check::Jerk);
        (
            options.speed_difference_mm_per_s,
            options.speed_difference_deg_per_s,
        ) = (Some(0.0), Some(0.0));
    });
    assert!(verdict.passed(), "{verdict}");
    verdict
}

/// A planner that looks at one axis at a time gets axes that are slow enough for the belts: on a diagonal one uses all of
/// its speed, along an axis both use half.
#[test]
fn a_planner_that_goes_axis_by_axis_keeps_the_limits_of_the_joints() {
    let verdict = assert_smooth(&on_corexy(DIAGONAL, &SMOOTH).run());
    let (speed, acceleration) = most(&verdict, "a");
    assert!(
        (245.0..250.001).contains(&speed) && acceleration > 1300.0,
        "{speed} mm/s, {acceleration} mm/s²"
    );
    let verdict =
        assert_smooth(&on_corexy("G21 G90 G17 G64\nF20000\nG1 X100\nM2\n", &SMOOTH).run());
    let speed = verdict.maxima.axes[0].velocity_mm_per_s;
    assert!((120.0..125.001).contains(&speed), "{speed} mm/s");
}

#[test]
fn on_a_diagonal_the_joint_limits_and_along_an_axis_the_axis() {
    for settings in [&[][..], &OVERLAP] {
        let done = on_corexy(DIAGONAL, settings).run();
        let verdict = if settings.is_empty() {
            done.assert_within_limits()
        } else {
            done.assert_within_tolerance()
        };
        for joint in ["a", "b"] {
            let (speed, acceleration) = most(&verdict, joint);
            assert!(
                (249.0..250.001).contains(&speed),
                "{joint}: {speed} mm/s of 250"
            );
            assert!(
                acceleration > 1490.0,
                "{joint}: {acceleration} mm/s² of 1500"
            );
        }
        let x = &verdict.maxima.axes[0];
        assert!(
            x.velocity_mm_per_s < 215.0,
            "{} mm/s: what a quarter of the circle leaves the axis",
            x.velocity_mm_per_s
        );
        let along = on_corexy("G21 G90 G17 G64\nF20000\nG1 X100\nM2\n", settings).run();
        assert!(along.judge(|_| {}).maxima.axes[0].velocity_mm_per_s > 249.0);
    }
}

#[test]
fn hold_and_override_keep_the_limits_of_the_joints() {
    let free = on_corexy(DIAGONAL, &[]).run();
    let ticks = free.number("samples") as u32;
    for settings in [&[][..], &OVERLAP, &NURBS, &SMOOTH] {
        for tick in (100..ticks - 100).step_by(211) {
            let (back, again, on) = (tick + 150, tick + 300, tick + 400);
            let commands = format!(
                "{tick},hold\n{back},resume\n{again},feed-override,0.3\n{on},feed-override,1\n"
            );
            let done = on_corexy(DIAGONAL, settings).commands(&commands).run();
            assert_eq!(
                (done.status(), done.number("guard_stops")),
                (0, 0.0),
                "{}",
                done.errors()
            );
            let verdict = done.judge(|options| {
                options.checks = vec![Check::Travel, Check::Velocity, Check::Acceleration];
                if !settings.is_empty() {
                    options.speed_difference_mm_per_s = Some(0.0);
                }
            });
            assert!(
                verdict.passed(),
                "{settings:?}, hold at tick {tick}: {verdict}"
            );
        }
    }
}

#[test]
fn a_machine_that_ramps_out_keeps_the_limits_of_the_joints() {
    for settings in [&[][..], &OVERLAP, &NURBS, &SMOOTH] {
        for tick in (150..1500).step_by(191) {
            let done = on_corexy(DIAGONAL, settings)
                .commands(&format!("{tick},emergency-stop\n"))
                .run();
            assert_eq!(done.status(), 3, "{}", done.errors());
            let verdict = done.judge(|options| {
                (options.ends_early, options.path_until_s) =
                    (true, Some(f64::from(tick - 1) * 1e-3));
                options.checks = vec![Check::Travel, Check::Velocity, Check::Acceleration];
                if settings.len() == NURBS.len() {
                    options.checks.push(Check::Jerk);
                }
                if !settings.is_empty() {
                    options.speed_difference_mm_per_s = Some(0.0);
                }
            });
            assert!(verdict.passed(), "{settings:?}, tick {tick}: {verdict}");
        }
    }
}

#[test]
fn a_program_that_takes_a_joint_out_of_its_travel_is_refused_at_its_place() {
    let cases = [
        (
            "G21 G90\nG1 X100 Y100 F1000\nG1 X130 Y130\nM2\n",
            "program.ngc:3:1: error: joint a would reach 260 mm",
        ),
        (
            "G21 G90\nG0 X-130 Y130\nM2\n",
            "program.ngc:2:1: error: joint b would reach -260 mm",
        ),
        // Its ends are within the travel of the joints, and all of it within the travel of the axes.
        (
            "G21 G90 G17\nG0 X140 Y100\nG3 X100 Y140 I-40 J0 F1000\nM2\n",
            "program.ngc:3:1: error: joint a would reach 256",
        ),
        (
            "G21 G90 G17\nG0 X100 Y100\nG5 X140 Y100 I20 J60 P-20 Q60 F999\nM2\n",
            "program.ngc:3:1: error: joint a would reach 251.",
        ),
    ];
    for (text, words) in cases {
        let done = on_corexy(text, &NURBS).run();
        assert_eq!(done.status(), 1);
        assert!(
            done.errors().contains(words),
            "{words:?} is not in\n{}",
            done.errors()
        );
        assert!(
            done.errors()
                .contains("beyond its travel of -250 to 250 mm"),
            "{}",
            done.errors()
        );
        assert!(!done.file("trace.csv").exists(), "nothing has moved");
    }
    let gantry = Scenario::text("G21 G90\nG0 Y-148\nM2\n")
        .on(&machine("gantry.toml"))
        .run();
    assert!(
        gantry.errors().contains("joint y2 would reach -148 mm"),
        "{}",
        gantry.errors()
    );
}

#[test]
fn what_does_not_fit_is_refused_with_its_place() {
    let cases: [(&str, &[&str], &str); 8] = [
        (
            "mill-3axis.toml",
            &["kinematics.plugin=corexy"],
            "--set kinematics.plugin: corexy has 3 joints on these axes, and 0",
        ),
        (
            "corexy.toml",
            &["joints.c={axis = \"z\"}"],
            "corexy has 3 joints on these axes, and 4 are stated",
        ),
        (
            "corexy.toml",
            &["joints.z.axis=x"],
            "--set joints.z.axis: corexy does not move this joint with X",
        ),
        (
            "corexy.toml",
            &["kinematics.plugin=identity"],
            "joints.a: states no axis, and without a kinematics plugin",
        ),
        (
            "corexy.toml",
            &["kinematics.plugin=tripod"],
            "no kinematics is called \"tripod\"; there is: corexy, wrapped-rotary, scara, delta",
        ),
        (
            "corexy.toml",
            &["axes.x.max_following_error_mm=1"],
            "following errors are those of joints, and no joint states",
        ),
        (
            "gantry.toml",
            &["joints.y2.travel_mm=[300, 400]", "joints.y2.home_mm=300"],
            "its travel and that of axis Y have nothing in common",
        ),
        (
            "corexy.toml",
            &["joints.a.travel_mm=[20, 90]"],
            "where the machine starts, joint a would reach 0 mm, beyond",
        ),
    ];
    for (name, settings, words) in cases {
        let arguments: Vec<&str> = settings
            .iter()
            .flat_map(|setting| ["--set", *setting])
            .collect();
        let done = Scenario::text("G21 G90\nG0 X1\nM2\n")
            .on(&machine(name))
            .with(&arguments)
            .run();
        assert_eq!(done.status(), 1, "{words}");
        assert!(
            done.errors().contains(words),
            "{words:?} is not in\n{}",
            done.errors()
        );
    }
    let homing = Scenario::text("M2\n")
        .on(&machine("gantry.toml"))
        .with(&["--home"])
        .run();
    assert_eq!(homing.status(), 1, "{}", homing.errors());
}

#[test]
fn each_joint_has_a_following_error_of_its_own() {
    let wrap = "faults.wrap=[{kind = \"corrupt\", from_tick = 300, until_tick = 301, joint = 2, magnitude_mm = 0.5}]";
    let done = Scenario::of(&program("portal.ngc"))
        .on(&machine("gantry.toml"))
        .with(&["--set", wrap])
        .run();
    assert_eq!(done.status(), 3);
    assert!(
        done.errors().contains("joint 2 (y2) is 0."),
        "{}",
        done.errors()
    );
    assert!(
        done.errors().contains("limit 0.200000 mm"),
        "{}",
        done.errors()
    );
}

#[test]
fn a_feed_on_the_cylinder_is_tangential() {
    let text = "G21 G90 G17 G64\nG1 X100 Y100 F3000\nG1 X100 Y300\nM2\n";
    let done = Scenario::text(text).on(&machine("rotary-table.toml")).run();
    let verdict = done.assert_within_limits();
    let feed = done.column("feed_mm_s").into_iter().fold(0.0, f64::max);
    assert!(
        (49.9..50.001).contains(&feed),
        "{feed} mm/s along the surface"
    );
    let (table, _) = most(&verdict, "a");
    let expected = (50.0f64 / 30.0).to_degrees();
    assert!(
        (table - expected).abs() < 0.01,
        "{table} deg/s where 50 mm/s on 30 mm are {expected}"
    );
}

/// Degrees a second stood under `max_velocity_mm_s`.
#[test]
fn what_the_summary_says_of_a_rotary_axis_is_called_after_its_unit() {
    let done = Scenario::text("G21 G90 G94\nF1800\nG1 X5 A45\nM2\n")
        .on(&machine("mill-4axis.toml"))
        .run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    let summary = done.summary();
    for (linear, rotary) in [
        ("max_velocity_mm_s", "max_velocity_deg_s"),
        ("max_acceleration_mm_s2", "max_acceleration_deg_s2"),
        ("max_jerk_mm_s3", "max_jerk_deg_s3"),
        ("end_position_mm", "end_position_deg"),
    ] {
        assert!(
            summary[linear]["x"].is_f64() && summary[linear]["a"].is_null(),
            "{linear}: {}",
            summary[linear]
        );
        assert!(
            summary[rotary]["a"].is_f64() && summary[rotary]["x"].is_null(),
            "{rotary}: {}",
            summary[rotary]
        );
    }
    assert!((summary["end_position_deg"]["a"].as_f64().unwrap() - 45.0).abs() < 1e-9);
    let three = Scenario::of(&program("square.ngc")).run().summary();
    assert!(
        three["max_velocity_deg_s"].is_null(),
        "no rotary axes, no such key"
    );
}

#[test]
fn the_summary_and_manual_input_know_the_joints() {
    let done = on_corexy(DIAGONAL, &[]).run();
    let joints = &done.summary()["joints"];
    let speed = joints["a"]["max_velocity_mm_s"].as_f64().unwrap();
    assert!((249.0..250.001).contains(&speed), "{joints}");
    assert_eq!(
        Scenario::of(&program("square.ngc")).run().summary()["joints"],
        serde_json::Value::Null
    );
}

/// Joint limits 1 % higher than the oracle's: what a planner does that is 1 % off.
#[test]
fn the_oracle_sees_a_joint_one_percent_off() {
    let off = |keys: &[&str]| {
        let settings: Vec<String> = keys
            .iter()
            .flat_map(|key| ["--set".into(), (*key).into()])
            .collect();
        let settings: Vec<&str> = settings.iter().map(String::as_str).collect();
        let verdict = on_corexy(DIAGONAL, &OVERLAP)
            .with(&settings)
            .run()
            .judge(|options| {
                options.checks = vec![Check::Travel, Check::Velocity, Check::Acceleration];
                options.speed_difference_mm_per_s = Some(0.0);
            });
        let joints: Vec<_> = verdict
            .findings
            .iter()
            .map(|f| f.joint.clone().expect("a joint's"))
            .collect();
        assert!(joints.iter().all(|joint| joint == "a"), "{verdict}");
        verdict.kinds()
    };
    assert_eq!(off(&[]), []);
    assert_eq!(
        off(&["joints.a.max_feed_mm_per_min=15150"]),
        [Kind::Velocity]
    );
    assert_eq!(
        off(&["joints.a.max_acceleration_mm_per_s2=1515"]),
        [Kind::Acceleration]
    );
}

#[test]
fn the_oracle_judges_no_joints_of_kinematics_it_does_not_know() {
    let done = Scenario::of(&program("corexy.ngc"))
        .on(&machine("corexy.toml"))
        .run();
    let text = std::fs::read_to_string(machine("corexy.toml"))
        .unwrap()
        .replace("\"corexy\"", "\"hexapod\"");
    let unknown = done.file("unknown.toml");
    std::fs::write(&unknown, text).unwrap();
    let verdict = crate::harness::judge_trace(
        &done.file("trace.csv"),
        Path::new(&program("corexy.ngc")),
        &unknown,
        |options| {
            (options.sample_tolerance_mm, options.vertex_tolerance_mm) = (Some(2e-6), Some(0.2));
        },
    );
    let reason = verdict.not_judged.as_deref().unwrap_or_default();
    assert!(
        reason.contains("joints") && reason.contains("hexapod"),
        "{verdict}"
    );
}

#[test]
fn homing_is_refused_where_axes_have_no_drive_of_their_own() {
    let home =
        "homing.z={input=12,search_mm_per_min=600,latch_mm_per_min=60,back_off_mm=2,switch_mm=50}";
    for (name, why) in [
        (
            "corexy.toml",
            "kinematics.plugin: --home is refused: each axis",
        ),
        ("gantry.toml", "joints: --home is refused: a gantry squares"),
    ] {
        let scenario = Scenario::text("G21 G90\nG0 X1\nM2\n")
            .on(&machine(name))
            .with(&["--set", home]);
        let done = scenario.with(&["--home"]).run();
        assert_eq!(done.status(), 1, "{}", done.errors());
        let said = done.errors();
        assert!(said.contains(name) && said.contains(why), "{said}");
    }
}
