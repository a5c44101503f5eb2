//! Curves end to end: read, driven by the planner that drives them, judged against a reading of the oracle's own.

use tandem_oracle::Check;

use crate::harness::{Scenario, UNDISTURBED, percent_binding, root};

const ADAPTIVE: [&str; 6] = [
    "--set",
    "planner.plugin=nurbs",
    "--set",
    "planner.options.form=adaptive",
    "--set",
    "guard.mode=count",
];

/// Several curves in both dialects, a corner inside one, lines and arcs between.
const MIXTURE: &str = "\
F3000 G1 X10
G5.2 P1 L4
X12 Y0 P2
X14 Y5
X18 Y6
X20 Y0 Z-1
G5.3
G1 X22
G3 X24 Y2 J2
G6.2 P3 K0
K0 X24 Y6
K0 X28 Y6
K1 X28 Y3
K1 X30 Y3 R2
K2
K2
K2
G5 X40 Y3 I3 J4 P-3 Q4
G5 X50 Y3 I3 J-4 P-3 Q4
G4 P0.05
G5.1 X50 Y10 J3 I3
G0 X0 Y0
";

#[test]
fn curves_are_followed() {
    let butterfly = root().join("tests/fixtures/programs/butterfly.ngc");
    for scenario in [Scenario::of(&butterfly), Scenario::text(MIXTURE)] {
        let done = scenario.with(&ADAPTIVE).run();
        assert_eq!(done.status(), 0, "{}", done.errors());
        let verdict = done.judge(|options| {
            options.checks = vec![Check::EndPoint, Check::Path, Check::Vertices];
            options.sample_tolerance_mm = Some(1e-6);
            // Corners are passed at full feed: the chord of a period, 0.05 mm, cuts them.
            options.vertex_tolerance_mm = Some(0.025);
        });
        assert!(verdict.passed(), "{verdict}");
        assert!(
            done.number("max_path_deviation_mm") < 1e-6,
            "{}",
            done.number("max_path_deviation_mm")
        );
    }
}

#[test]
fn the_judge_sees_another_curve() {
    let butterfly =
        std::fs::read_to_string(root().join("tests/fixtures/programs/butterfly.ngc")).unwrap();
    let done = Scenario::text(&butterfly).with(&ADAPTIVE).run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    // One weight of fifty-one a hundredth off.
    let other = done.file("other.ngc");
    std::fs::write(&other, butterfly.replacen("R5", "R5.05", 1)).unwrap();
    let judged = crate::harness::judge_trace(
        &done.file("trace.csv"),
        &other,
        &crate::harness::mill(),
        |options| {
            options.checks = vec![Check::Path];
            options.sample_tolerance_mm = Some(1e-6);
        },
    );
    assert!(!judged.passed());
}

#[test]
fn planners_that_drive_no_curves_say_so() {
    for set in [
        &[][..],
        &[
            "--set",
            "planner.plugin=after-interpolation",
            "--set",
            "guard.mode=count",
        ],
    ] {
        let refused = Scenario::text("F600 G1 X1\nG5.2\nX2\nX2 Y2\nG5.3\n")
            .with(set)
            .run();
        assert_eq!(refused.status(), 1);
        let errors = refused.errors();
        assert!(
            errors.contains("program.ngc:2:1:") && errors.contains("for NURBS use planner nurbs"),
            "{errors}"
        );
    }
    // Also where they could not drive this machine at all: it is the curve that asks for another planner.
    let jerk_limited = root().join("examples/machines/mill-3axis-smooth.toml");
    for planner in ["look-ahead", "block-overlap", "after-interpolation"] {
        let set = format!("planner.plugin={planner}");
        let on = |text: &str| {
            Scenario::text(text)
                .on(&jerk_limited)
                .with(&["--set", &set])
                .run()
                .errors()
        };
        let errors = on("F600 G1 X1\nG5.2\nX2\nX2 Y2\nG5.3\n");
        assert!(
            errors.contains("program.ngc:2:1:") && errors.contains("for NURBS use planner nurbs"),
            "{errors}"
        );
        let errors = on("F600 G1 X1\n");
        assert!(errors.starts_with("--set planner.plugin: "), "{errors}");
    }
}

/// A rotary axis that goes on where the others stand still has no path by its length: said before anything moves.
#[test]
fn a_curve_that_turns_alone_is_refused_by_the_check() {
    let machine = root().join("examples/machines/mill-4axis.toml");
    let run = |text: &str| Scenario::text(text).on(&machine).with(&ADAPTIVE).run();
    let instant = run("F600\nG5.2 L3\nX10 A10\nX10 A20\nX20 Y9 A30\nG5.3\n");
    assert_eq!(instant.status(), 1);
    let errors = instant.errors();
    assert!(
        errors.contains("program.ngc:2:1:") && errors.contains("planner smooth drives it"),
        "{errors}"
    );
    let span = run("F600\nG5.2 L3\nX10\nX10 A10\nX10 A20\nX20 Y9 A30\nG5.3\n").errors();
    assert!(
        span.contains("program.ngc:4:1: error: ") && span.contains("only rotary axes move"),
        "{span}"
    );
    let done = run("F600\nG5.2 L3\nX10 A10\nX12 A20\nX20 Y9 A30\nG5.3\n");
    assert_eq!(done.status(), 0, "{}", done.errors());
}

/// The place of an error is that of the word, with its line, though it shows only where the curve is complete.
#[test]
fn what_is_wrong_with_a_curve_is_shown_where_it_stands() {
    let refused = Scenario::text("F600\nG5.2 P1 L3\nX20 Y10\nX25 (far) Y900\nX-20\nG5.3\n").run();
    assert_eq!(refused.status(), 1);
    let errors = refused.errors();
    assert!(
        errors.contains("program.ngc:4:11: error: Y would reach "),
        "{errors}"
    );
    assert!(
        errors.contains("\n  X25 (far) Y900\n            ^^^^"),
        "{errors}"
    );
}

#[test]
fn the_baseline_does_not_start_under_the_guard() {
    let set = [
        "--set",
        "planner.plugin=nurbs",
        "--set",
        "planner.options.form=adaptive",
    ];
    let refused = Scenario::text(MIXTURE).with(&set).run();
    assert_eq!(refused.status(), 1);
    assert!(
        refused.errors().contains("guard.mode = \"count\""),
        "{}",
        refused.errors()
    );
}

/// The forms that keep it on a machine whose jerk is a limit, with corners, tangent lines, arcs and dwells between the
/// curves.
#[test]
fn curves_are_driven_within_the_jerk_limit() {
    let machine = root().join("examples/machines/nurbs-demo.toml");
    let butterfly = root().join("tests/fixtures/programs/butterfly.ngc");
    for form in ["scan", "windowed"] {
        for scenario in [
            Scenario::of(&butterfly),
            Scenario::text(MIXTURE),
            Scenario::text(&many_curves()),
        ] {
            let done = scenario
                .on(&machine)
                .with(&["--set", &format!("planner.options.form={form}")])
                .run();
            done.assert_driven(form, &UNDISTURBED);
            let verdict = done.judge(|options| {
                options.sample_tolerance_mm = Some(2e-6);
                options.vertex_tolerance_mm = Some(0.3);
            });
            assert!(verdict.passed(), "{verdict}");
        }
    }
}

/// Three hundred curves: half of them join smoothly in a line, the others meet at corners.
fn many_curves() -> String {
    let pair = |n: u32| {
        let (x, y) = (f64::from(n % 50) * 2.0, f64::from(n / 50));
        let first = format!("G0 X{x} Y{y}\nG5 X{} Y{y} I0.3 J0.4 P-0.3 Q0.4", x + 1.0);
        format!("{first}\nG5 X{} Y{y} I0.3 J-0.4 P-0.3 Q-0.4\n", x + 2.0)
    };
    let pairs: Vec<String> = (0..150).map(pair).collect();
    format!("F6000\n{}", pairs.concat())
}

#[test]
fn a_hold_on_the_butterfly_stays_within_the_limits() {
    let machine = root().join("examples/machines/nurbs-demo.toml");
    let butterfly = root().join("tests/fixtures/programs/butterfly.ngc");
    let commands = "300,hold\n420,resume\n700,feed-override,0.4\n900,feed-override,1\n";
    let done = Scenario::of(&butterfly)
        .on(&machine)
        .commands(commands)
        .run();
    done.assert_driven("", &["jerk_relaxed_samples", "starvations"]);
}

/// Lines run into arcs that turn a little less, without rest: the steps of velocity and acceleration there are in the samples
/// beside what the rate of program time does. Held at any tick around them nothing exceeds a limit.
#[test]
fn holds_around_a_line_that_runs_into_an_arc() {
    let machine = root().join("examples/machines/nurbs-demo.toml");
    let contour = "F9000 G1 X20\nG3 X27.0708 Y2.9282 J10\nG1 X35 Y10.8579\nG2 X42.0687 Y13.788 I7.0711 J-7.0711\nG1 X60\n";
    for tick in (60..260).step_by(5) {
        let commands = format!(
            "{tick},hold\n{},resume\n{},feed-override,0.5\n",
            tick + 120,
            tick + 170
        );
        let done = Scenario::text(contour)
            .on(&machine)
            .commands(&commands)
            .run();
        done.assert_driven(
            &format!("hold at {tick}"),
            &["jerk_relaxed_samples", "starvations"],
        );
    }
    let done = Scenario::text(contour).on(&machine).run();
    assert!(
        done.number("motion_time_s") < 0.65,
        "{} s: it rested",
        done.number("motion_time_s")
    );
}

/// A script sees curves as one block each and lowers the feed of those it is asked to.
#[test]
fn a_policy_script_slows_curves() {
    let machine = root().join("examples/machines/nurbs-demo.toml");
    let script = root().join("scripts/policies/gentle-start.wasm");
    let plain = Scenario::text(MIXTURE).on(&machine).run();
    let done = Scenario::text(MIXTURE)
        .on(&machine)
        .with(&[
            "--set",
            &format!("policy.script={}", script.display()),
            "--set",
            "policy.parameters.ramp_mm=80",
        ])
        .run();
    done.assert_driven("", &["governed_samples", "starvations"]);
    let policy = done.summary()["policy"].clone();
    assert!(policy["feeds_capped"].as_u64().unwrap() > 0, "{policy}");
    assert_eq!(policy["traps"], 0, "{policy}");
    assert!(done.number("motion_time_s") > plain.number("motion_time_s") + 0.02);
    let verdict = done.judge(|options| {
        options.sample_tolerance_mm = Some(2e-6);
        options.vertex_tolerance_mm = Some(0.3);
    });
    assert!(verdict.passed(), "{verdict}");
}

/// The butterfly alone, from where it begins, beside the best time known under limits of the axes: by the samples sent.
#[test]
fn the_butterfly_takes_little_more_than_the_best_time_known() {
    let machine = root().join("examples/machines/nurbs-demo.toml");
    let butterfly = root().join("tests/fixtures/programs/butterfly.ngc");
    let begin = [
        "--set",
        "axes.x.start_mm=54.493",
        "--set",
        "axes.y.start_mm=52.139",
    ];
    let done = Scenario::of(&butterfly)
        .on(&machine)
        .with(&begin)
        .with(&["--reference-time-s", "2.75293"])
        .run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    let ratio = done.number("time_ratio");
    assert!((0.999..1.02).contains(&ratio), "{ratio}");
}

/// The report shows curvature, chord error and what binds along a curve.
#[test]
fn the_report_shows_what_binds_along_a_curve() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("report.html");
    let machine = root().join("examples/machines/nurbs-demo.toml");
    let butterfly = root().join("tests/fixtures/programs/butterfly.ngc");
    let path = page.to_string_lossy().into_owned();
    let done = Scenario::of(&butterfly)
        .on(&machine)
        .with(&["--report", &path])
        .run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(html.contains("curvature of the curve") && html.contains("chord error on the curve"));
    let [chord, acceleration, none] =
        ["chord error", "acceleration", "none of these"].map(|limit| percent_binding(&html, limit));
    // The chord error holds the feed down along most of it; something binds nearly everywhere.
    assert!(
        chord > 15.0 && acceleration > 10.0 && none < 30.0,
        "{chord} {acceleration} {none}"
    );
    let plain = Scenario::text("F600 G1 X1\n")
        .on(&machine)
        .with(&["--report", &path])
        .run();
    assert_eq!(plain.status(), 0, "{}", plain.errors());
    assert!(
        !std::fs::read_to_string(&page)
            .unwrap()
            .contains("curvature of the curve")
    );
}

/// Curves that are hard to drive, through the binary and the judge: points that coincide, spans without length, weights
/// that differ by 1e4, corners inside a curve, and ten thousand points.
#[test]
fn degenerate_curves_are_driven_to_their_ends() {
    let machine = root().join("examples/machines/nurbs-demo.toml");
    let coincident =
        "F6000\nG5.2 P1 L4\nX10 Y0\nX10 Y0\nX20 Y10\nX20 Y10\nX20 Y10\nX30 Y0\nX40 Y0\nG5.3\n";
    let weights = "F6000\nG5.2 P1 L4\nX10 Y6 P10000\nX20 Y-6 P1\nX30 Y6 P10000\nX40 Y0 P1\nG5.3\n";
    let knots = "F6000\nG6.2 P3 K0 X0 Y0 R1\nK0 X5 Y5\nK0 X10 Y0\nK1 X15 Y5\nK1 X20 Y0\nK1.5 X25 Y5\nK3\nK3\nK3\n";
    let spread = "F6000\nG5.2 P1 L3\nX-40 Y-80 P73\nX-140 Y-146 P1.8\nX10 Y-100 P0.13\nX-148 Y26 P0.04\nX-140 Y25 P3\n\
                  X-135 Y-115 P86\nX-90 Y-71 P0.04\nG5.3\n";
    let corner = "F6000\nG5.2 P1 L3\nX10 Y0\nX10 Y0\nX10 Y0\nX20 Y10\nX0 Y0\nX0 Y0\nG5.3\nG1 X3\n";
    let wave: Vec<String> = (1..10_000)
        .map(|n| {
            format!(
                "X{:.4} Y{:.6}\n",
                0.02 * f64::from(n),
                (0.05 * f64::from(n)).sin()
            )
        })
        .collect();
    let wave = format!("F6000\nG5.2 P1 L4\n{}G5.3\n", wave.concat());
    for program in [coincident, weights, spread, knots, corner, &wave] {
        let shown = &program[..program.len().min(120)];
        for form in ["scan", "windowed"] {
            let form = format!("planner.options.form={form}");
            let done = Scenario::text(program)
                .on(&machine)
                .with(&["--set", &form])
                .run();
            done.assert_driven(&format!("{form}: {shown}"), &UNDISTURBED);
            assert!(
                done.number("max_path_deviation_mm") < 1e-6,
                "{form} {shown}"
            );
            // Ends are rests, met to 1e-6 mm.
            let verdict = done.judge(|options| options.sample_tolerance_mm = Some(2e-6));
            assert!(verdict.passed(), "{form}: {shown}\n{verdict}");
        }
    }
}

/// A rotary axis as fast as the linear ones of the demo.
const ROTARY: [&str; 12] = [
    "--set",
    "axes.a.kind=rotary",
    "--set",
    "axes.a.travel_deg=[-3600,3600]",
    "--set",
    "axes.a.max_feed_deg_per_min=18000",
    "--set",
    "axes.a.max_rapid_deg_per_min=18000",
    "--set",
    "axes.a.max_acceleration_deg_per_s2=5000",
    "--set",
    "axes.a.max_jerk_deg_per_s3=400000",
];

#[test]
fn where_linear_axes_nearly_stand_still_the_others_are_driven_at_their_limits() {
    // Per mm of path the axis A turns 360 000°: little path deceleration is left, and little is needed.
    let line = "F1000\nG1 X0.001 A360\nG1 X100 A361\nG1 X100.001 A0\nG1 X0 A1\n";
    let curve = "F600\nG5.2 P1 L3\nY-38.24 Z-17.64 A-18.52 P2\nX0 Y0 Z0.0003 P2\nX-10 Y2 Z21.6715 P100\nX37 P0.01\n\
        X0 Y0 Z-0.0227 P0.5\nX0.0727 Y0 A-0.0549\nX0 Y0.0002\nX-24.27 Y-15.9502 Z20.32 A0 P2\nX1\nG5.3\n";
    for (text, max_s) in [(line, 16.0), (curve, 34.0)] {
        for form in ["scan", "windowed"] {
            let machine = root().join("examples/machines/nurbs-demo.toml");
            let form = format!("planner.options.form={form}");
            let done = Scenario::text(text)
                .on(&machine)
                .with(&ROTARY)
                .with(&["--set", &form])
                .run();
            // The judge knows the machine of the file alone, which has no axis A.
            done.assert_driven(&form, &["governed_samples", "starvations"]);
            assert!(
                done.number("motion_time_s") < max_s,
                "{form}: {} s",
                done.number("motion_time_s")
            );
        }
    }
}

/// Lines that join with a turn below 0.001 rad, or end at a rest soon behind one, on machines whose periods and limits are no
/// round numbers: what samples show of the step of velocity there is bounded at every phase of the tick, per axis, per joint that
/// is a sum of axes, on a gantry and on a rotary axis.
#[test]
fn steps_of_velocity_between_lines_keep_acceleration_and_jerk() {
    let programs = [
        (
            "small-turn",
            "F2507.093\nG1 X0.0551 Y0.0171 Z0.0000\nG1 X3.2931 Y1.0187 Z0.0000\n",
        ),
        (
            "slow-jerk",
            "F2013.371\nG1 X21.0911 Y-5.7398 Z0.0000\nG1 X22.8720 Y-7.3211 Z-0.5179\nG1 X22.7259 Y-7.0584 Z-0.5179\n\
             G1 X21.5440 Y-4.9335 Z-0.5179\n",
        ),
        (
            "gantry",
            "F4252.039\nG1 X-0.6286 Y0.2235 Z0.0000\nG1 X3.2855 Y3.7124 Z-0.0208\nG1 X5.8723 Y4.7110 Z-0.0208\n\
             G1 X7.1441 Y5.2019 Z-0.0208\n",
        ),
        (
            "corexy",
            "F1220.073\nG1 X-0.9695 Y-4.9403 Z0.0163\nG1 X-1.5739 Y-4.5943 Z1.9243\nG1 X-1.7563 Y-4.3623 Z1.9243\n\
             G1 X-1.7358 Y-4.4264 Z1.9243\nG1 X-1.4765 Y-5.2380 Z1.9243\n",
        ),
        ("rotary-alone", "F600\nG1 X0.001 A90\n"),
    ];
    for (name, program) in programs {
        for form in ["scan", "windowed"] {
            let machine = root().join(format!("tests/fixtures/machines/{name}.toml"));
            let set = format!("planner.options.form={form}");
            let done = Scenario::text(program)
                .on(&machine)
                .with(&["--set", &set])
                .run();
            done.assert_driven(&format!("{name} {form}"), &UNDISTURBED);
        }
    }
}
