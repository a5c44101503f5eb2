//! The planner inside the tolerance, end to end: times, jerk too, random programs, holds, stalls and overrides.

use std::fmt::Write;
use std::path::PathBuf;

use tandem_oracle::{Check, Options};
use tandem_rings::Sample;

use crate::bench::{Bench, Ran, passed};
use crate::harness::{Done, Scenario, UNDISTURBED, root};
use crate::random::{Random, program};
use crate::replay::{for_each_seed, for_each_tick, some_of};

fn machine() -> PathBuf {
    root().join("examples/machines/mill-3axis-smooth.toml")
}

/// Jerk is judged too, tolerances are those of the program, and no block lends its feed to another.
fn strict(options: &mut Options) {
    options.checks.push(Check::Jerk);
    options.feed_window_s = Some(0.0);
}

fn assert_strict(done: &Done) {
    done.assert_driven("", &UNDISTURBED);
    let verdict = done.judge(strict);
    assert!(verdict.passed(), "{verdict}");
}

#[test]
fn programs_are_driven_near_the_best_time_within_limits() {
    for (name, max_s) in [
        ("square", 1.41),
        ("serpentine", 2.82),
        ("raster", 28.95),
        ("spiral", 20.30),
    ] {
        let done = Scenario::of(&root().join(format!("examples/programs/{name}.ngc")))
            .on(&machine())
            .run();
        assert_strict(&done);
        println!("{name}: {:.3} s", done.number("motion_time_s"));
        assert!(
            done.number("motion_time_s") <= max_s,
            "{name}: {} s",
            done.number("motion_time_s")
        );
    }
}

/// Lines, arcs, a helix, feed changes, tolerances, exact stops, rapids, dwells, reversals and a time constant that is
/// ignored.
const EVERYTHING: &str = "\
G21 G90 G94 G17 G64 P0.01
F3000 G1 X10
G3 X20 Y10 J10
G1 Y20 F600
G2 X30 Y30 I10 Z-2 P2
G64 P0.05
G1 X40 F4000
G1 X41 Y30.2
G1 X20
G1 X45
G61
G1 Y40
G3 X35 Y50 I-10
G64 P0.01
G1 X30 TA20
G1 X25
G1 X24.999
G1 X24.99 Y50.001
G4 P0.05
G0 X0 Y0 Z5
G1 X5 F12000
G1 X200
G1 X0
M2
";

#[test]
fn everything_a_program_may_hold_keeps_limits_and_tolerance() {
    let done = Scenario::text(EVERYTHING).on(&machine()).run();
    assert_strict(&done);
}

/// Linear and rotary axes together and each alone; a rapid, an arc with a rotary axis, short lines.
const ROTARY: &str = "\
G21 G90 G94 G17 G64 P0.01
F2000
G1 X10 A20 B5 C3
G1 X20 Y5 A10 C8
G1 X22 Y7
G1 A40 B10
G1 A10 B4 C1 F1000
G1 X30 Y7 A30
G2 X34 Y3 J-4 A35
G1 X40 Y0 Z2 A0 B0 C0
G0 A90
G1 A45
G1 X50 A46
G1 X50.5 Y0.2 A46.5 B0.3
G1 X51 Y0.1 A47
G1 X40 Y6 Z-3 U5 V-2 A20 B4 C9
G1 U-3 V4
G1 X38 Z1 U0 V1 A22 C5
M2
";

#[test]
fn eight_axes_keep_limits_and_tolerance() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("eight-axes.toml");
    let mut text = std::fs::read_to_string(machine()).unwrap();
    for axis in ["u", "v"] {
        write!(
            text,
            "\n[axes.{axis}]\ntravel_mm = [-50, 50]\nmax_feed_mm_per_min = 6000\nmax_rapid_mm_per_min = 6000\n\
             max_acceleration_mm_per_s2 = 700\nmax_jerk_mm_per_s3 = 20000\n"
        )
        .unwrap();
    }
    for axis in ["a", "b", "c"] {
        write!(
            text,
            "\n[axes.{axis}]\nkind = \"rotary\"\ntravel_deg = [-3600, 3600]\nmax_feed_deg_per_min = 10000\n\
             max_rapid_deg_per_min = 10000\nmax_acceleration_deg_per_s2 = 2000\nmax_jerk_deg_per_s3 = 40000\n"
        )
        .unwrap();
    }
    std::fs::write(&path, text).unwrap();
    assert_strict(&Scenario::text(ROTARY).on(&path).run());
}

#[test]
fn feeds_that_alternate_hold_up_to_where_they_change() {
    for (low, high, length_mm) in [(600, 9000, 2.0), (100, 9000, 0.4), (20, 9000, 0.4)] {
        let mut program = "G21 G90 G94 G17 G64 P0.01\n".to_string();
        for n in 1..20 {
            writeln!(
                program,
                "G1 X{:.1} F{}",
                length_mm * f64::from(n),
                if n % 2 == 1 { low } else { high }
            )
            .unwrap();
        }
        assert_strict(&Scenario::text(&(program + "M2\n")).on(&machine()).run());
    }
}

#[test]
fn a_curve_is_driven_inside_the_tolerance() {
    assert_strict(
        &Scenario::of(&root().join("tests/fixtures/programs/butterfly.ngc"))
            .on(&machine())
            .run(),
    );
}

/// Corners, arcs, short lines and a rapid, with a tolerance that a policy lowers.
const POLICY: &str = "\
G21 G90 G94 G17 G64 P0.02
F2400
G1 X20
Y20
X12 Y14
G2 X4 Y14 I-4
G1 X0 Y0
G0 X5
G1 X30 Y3
G3 X30 Y9 J3
G1 X29.9
X29.8 Y9.05
X0 Y0
M2
";

fn with_policy(script: &str, parameters: &[&str]) -> Done {
    let script = format!("policy.script={}", root().join(script).display());
    let settings = parameters.iter().flat_map(|setting| ["--set", setting]);
    Scenario::text(POLICY)
        .on(&machine())
        .with(&["--set", &script])
        .with(&settings.collect::<Vec<_>>())
        .run()
}

#[test]
fn a_tolerance_that_a_policy_lowers_is_kept() {
    let within_2_um = |options: &mut Options| {
        strict(options);
        (options.sample_tolerance_mm, options.vertex_tolerance_mm) = (Some(0.002), Some(0.002));
    };
    let plain = Scenario::text(POLICY).on(&machine()).run();
    assert_strict(&plain);
    assert!(
        !plain.judge(within_2_um).passed(),
        "without the policy the tolerance of the program is used"
    );
    let done = with_policy("tests/fixtures/policies/good/close.wat", &[]);
    assert_strict(&done);
    let verdict = done.judge(within_2_um);
    assert!(verdict.passed(), "{verdict}");
    assert!(done.number("motion_time_s") > plain.number("motion_time_s"));
    assert!(
        done.errors()
            .contains("policy: line 3: path tolerance 0.02 -> 0.002 mm"),
        "{}",
        done.errors()
    );
}

#[test]
fn a_feed_that_a_policy_caps_is_kept() {
    let done = with_policy(
        "scripts/policies/material-feed.wasm",
        &["policy.parameters.material=3"],
    );
    assert_strict(&done);
    let rows = done
        .column("feed_mm_s")
        .into_iter()
        .zip(done.column("line"));
    let fastest = rows
        .filter(|(_, line)| *line != 8.0)
        .fold(0.0, |most: f64, (feed, _)| most.max(feed));
    let cap = 800.0 / 60.0;
    assert!(
        fastest <= cap * (1.0 + 1e-6) && fastest > 0.99 * cap,
        "{fastest} mm/s of {cap}"
    );
    let blocks = std::fs::read_to_string(done.file("blocks.csv")).unwrap();
    assert!(
        blocks.lines().any(|line| line.contains(",policy,")),
        "{blocks}"
    );
}

fn bench(text: &str) -> Bench {
    Bench::text(text).on(&machine())
}

/// Nothing went wrong, no jerk was given away, and the oracle passes.
fn check(bench: &Bench, ran: &Ran) -> Result<(), String> {
    ran.expect_clean()?;
    let judge = |options: &mut Options| {
        options.sample_tolerance_mm = None;
        options.vertex_tolerance_mm = None;
        strict(options);
    };
    passed(&bench.judge(ran, judge))?;
    let relaxed = ran.outcome.summary.jerk_relaxed_samples;
    (relaxed == 0)
        .then_some(())
        .ok_or(format!("{relaxed} samples beyond the jerk limit"))
}

#[test]
fn random_programs_run_smoothly_within_limits() {
    for_each_seed("random_programs_run_smoothly_within_limits", 50, |seed| {
        let bench = bench(&program(seed));
        let ran = bench.run("");
        if ran.outcome.summary.starvations > 0 {
            return Err("it starved".to_string());
        }
        check(&bench, &ran)
    });
}

#[test]
fn smooth_holds_at_every_tick() {
    let text =
        std::fs::read_to_string(root().join("tests/fixtures/programs/every-tick.ngc")).unwrap();
    let bench = bench(&text);
    let free = bench.run("");
    check(&bench, &free).unwrap();
    let mut worst = 0.0f64;
    for_each_tick(
        "smooth_holds_at_every_tick",
        some_of(4, "smooth_holds_at_every_tick", 1..free.samples.len() - 1),
        |tick| {
            let ran = bench.run(&format!("{tick},hold\n{},resume", tick + 400));
            check(&bench, &ran)?;
            worst = worst.max(jerk_share(&ran));
            let stood = ran.samples[tick + 300..tick + 400]
                .iter()
                .all(|sample| sample.feed_mm_per_s == 0.0);
            stood
                .then_some(())
                .ok_or("it does not stand still".to_string())
        },
    );
    println!("{worst:.4} of the jerk limit at most");
}

/// Corners of 90 degrees, half a millimetre apart: the plan uses all of the jerk everywhere.
#[test]
fn smooth_holds_in_zigzags() {
    let mut text = "G21 G90 G64 P0.01\nF3000\n".to_string();
    for n in 1..20 {
        writeln!(
            text,
            "G1 X{} Y{}",
            0.35 * f64::from(n),
            0.35 * f64::from(n % 2)
        )
        .unwrap();
    }
    let bench = bench(&(text + "M2\n"));
    let free = bench.run("");
    for_each_tick(
        "smooth_holds_in_zigzags",
        some_of(6, "smooth_holds_in_zigzags", 1..free.samples.len() - 1),
        |tick| {
            check(
                &bench,
                &bench.run(&format!("{tick},hold\n{},resume", tick + 400)),
            )
        },
    );
}

/// Corners of 90 degrees at the end of long lines, where resuming takes as long as the plan has jerk to spare.
#[test]
fn smooth_holds_on_the_square() {
    let bench = Bench::of(&root().join("examples/programs/square.ngc")).on(&machine());
    let free = bench.run("");
    for_each_tick(
        "smooth_holds_on_the_square",
        some_of(9, "smooth_holds_on_the_square", 2..free.samples.len() - 1),
        |tick| {
            check(
                &bench,
                &bench.run(&format!("{tick},hold\n{},resume", tick + 400)),
            )
        },
    );
}

/// The largest jerk of the samples as a share of the limit.
fn jerk_share(ran: &Ran) -> f64 {
    let third = |w: &[Sample], axis: usize| {
        let at = |n: usize| w[n].command[axis];
        (at(3) - 3.0 * at(2) + 3.0 * at(1) - at(0)).abs() / 1e-9 / 20_000.0
    };
    let worst = |w: &[Sample]| (0..3).map(|axis| third(w, axis)).fold(0.0, f64::max);
    ran.samples.windows(4).map(worst).fold(0.0, f64::max)
}

#[test]
fn the_ring_runs_dry_smoothly_wherever_the_rough_loop_can_be_late() {
    let text =
        std::fs::read_to_string(root().join("tests/fixtures/programs/every-tick.ngc")).unwrap();
    let bench = bench(&text);
    let free = bench.run("");
    let mut starved = 0;
    for_each_tick(
        "the_ring_runs_dry_smoothly",
        (0..free.samples.len()).step_by(8),
        |tick| {
            let ran = bench.run(&format!("{tick},stall-rough,100"));
            starved += ran.outcome.summary.starvations;
            check(&bench, &ran)?;
            let same = ran.ends() == free.ends();
            same.then_some(()).ok_or("it ends elsewhere".to_string())
        },
    );
    println!("starved {starved} times");
    assert!(starved > 20 || std::env::var("TANDEM_TICK").is_ok());
}

/// Circles that are driven as fast as the jerk allows leave next to none of it to begin a stop with: the queue is as deep as that takes.
#[test]
fn a_starved_machine_rests_on_circles_that_use_all_of_the_jerk() {
    for_each_seed("a_starved_machine_rests_on_circles", 24, |seed| {
        let mut random = Random::new(seed ^ 1 << 44);
        let radius = random.between(0.3, 3.0);
        let mut text = "G21 G90 G17 G64 P0.01\nF15000\n".to_string();
        for _ in 0..8 {
            writeln!(text, "G2 X0 Y0 I{radius:.3} J0").unwrap();
        }
        text.push_str("M2\n");
        let bench = bench(&text);
        let free = bench.run("");
        let tick = random.below(free.samples.len() as u64);
        let ran = bench.run(&format!("{tick},stall-rough,100"));
        check(&bench, &ran).map_err(|e| format!("radius {radius:.3} mm, tick {tick}: {e}"))
    });
}

#[test]
fn override_steps_are_followed_smoothly() {
    for_each_seed("override_steps_are_followed_smoothly", 60, |seed| {
        let bench = bench(&program(seed));
        let mut random = Random::new(seed ^ 1 << 43);
        let mut lines = String::new();
        let mut tick = 0;
        for _ in 0..6 {
            tick += 1 + random.below(400);
            writeln!(
                lines,
                "{tick},feed-override,{:.3}",
                random.between(0.0, 1.0)
            )
            .unwrap();
            tick += 150;
        }
        writeln!(lines, "{tick},feed-override,1").unwrap();
        check(&bench, &bench.run(&lines))
    });
}

/// A quarter of a circle in blocks of 0.6 µm: about eighty of them share a period.
#[test]
fn the_summary_measures_micro_blocks_as_brute_force_does() {
    let point = |n: u32| {
        let angle = f64::from(n) * 0.6e-3 / 5.0;
        [5.0 * angle.sin(), 5.0 - 5.0 * angle.cos()].map(|value| (value * 1e6).round() / 1e6)
    };
    let points: Vec<[f64; 2]> = (0..13_000).map(point).collect();
    let mut text = "G21 G90 G94 G17 G64 P0.01\nF3000\n".to_string();
    for [x, y] in &points[1..] {
        writeln!(text, "G1 X{x:.6} Y{y:.6}").unwrap();
    }
    let done = Scenario::text(&(text + "M2\n")).on(&machine()).run();
    assert_strict(&done);
    let samples = done
        .column("x_cmd_mm")
        .into_iter()
        .zip(done.column("y_cmd_mm"));
    let off = |(x, y): (f64, f64)| {
        points
            .windows(2)
            .map(|c| to_chord([x, y], c))
            .fold(f64::INFINITY, f64::min)
    };
    let worst = samples.map(off).fold(0.0, f64::max);
    let said = done.number("max_path_deviation_mm");
    assert!(
        (said - worst).abs() < 1e-8,
        "{said} mm instead of {worst} mm"
    );
}

/// Distance of a point from a chord, mm.
fn to_chord(p: [f64; 2], chord: &[[f64; 2]]) -> f64 {
    let (a, b) = (chord[0], chord[1]);
    let d = [b[0] - a[0], b[1] - a[1]];
    let along = ((p[0] - a[0]) * d[0] + (p[1] - a[1]) * d[1]) / (d[0] * d[0] + d[1] * d[1]);
    let t = along.clamp(0.0, 1.0);
    (p[0] - a[0] - t * d[0]).hypot(p[1] - a[1] - t * d[1])
}
