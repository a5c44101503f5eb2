//! What policy scripts see: the direction of a cut, what the program says, a sensor, a curvature, the axis that lags.

use std::path::PathBuf;

use crate::harness::{Done, Scenario, root};

fn with(scenario: Scenario, script: &str, parameters: &[(&str, f64)]) -> Scenario {
    let script = root().join(format!("scripts/policies/{script}.wasm"));
    let scenario = scenario.with(&["--set", &format!("policy.script={}", script.display())]);
    parameters.iter().fold(scenario, |scenario, (name, value)| {
        scenario.with(&["--set", &format!("policy.parameters.{name}={value}")])
    })
}

fn machine(name: &str) -> PathBuf {
    root().join("examples/machines").join(name)
}

/// The highest of `column` on each of `lines`.
fn highest(done: &Done, column: &str, lines: &[f64]) -> Vec<f64> {
    let of = done.column("line");
    let values = done.column(column);
    lines
        .iter()
        .map(|line| {
            let own = values.iter().zip(&of).filter(|(_, of)| *of == line);
            own.fold(0.0, |most: f64, (value, _)| most.max(value.abs()))
        })
        .collect()
}

fn near(one: f64, other: f64) -> bool {
    (one - other).abs() < 1e-6 * other
}

#[test]
fn a_cut_that_goes_down_goes_slowly_where_there_is_material() {
    let program = "G10 L2 P1 Z-20\nG0 Z10\nF1200\nG1 Z1\nZ-4\nX20\nX30 Z-9\nX60 Z-8\nG0 Z10\nM2\n";
    let parameters = [("plunge_mm_per_min", 240.0), ("surface_mm", 0.0)];
    let done = with(Scenario::text(program), "gentle-plunge", &parameters).run();
    done.assert_within_limits();
    let feeds = highest(&done, "feed_mm_s", &[4.0, 5.0, 6.0, 7.0, 8.0]);
    let ramp = 4.0 * 5.0_f64.sqrt();
    for (line, (feed, asked)) in feeds.iter().zip([20.0, 4.0, 20.0, ramp, 20.0]).enumerate() {
        // The sample at which two lines meet is of both.
        let off = (feed / asked - 1.0).abs();
        assert!(off < 0.05, "line {}: {feed} of {asked}", line + 4);
    }
}

#[test]
fn the_program_says_what_it_is_made_of() {
    let program = "F3000\nG1 X20\n(material: STEEL, 40 mm thick)\nG1 Y20\n#<_material> = 1 G1 X0\n\
                   G1 Y0 ; material=stainless\nM2\n";
    let done = with(Scenario::text(program), "material-feed", &[]).run();
    // The oracle knows no named parameters.
    done.assert_driven("", &["governed_samples"]);
    let feeds = highest(&done, "feed_mm_s", &[2.0, 4.0, 5.0, 6.0]);
    for (feed, asked) in feeds.iter().zip([3000.0, 1200.0, 2400.0, 800.0]) {
        assert!(near(*feed, asked / 60.0), "{feeds:?}");
    }
    let slip = program.replace("STEEL", "STEAL");
    let done = with(Scenario::text(&slip), "material-feed", &[]).run();
    assert!(
        done.errors().contains(
            "the comment states material = \"STEAL\", which is not a number, nor one of aluminium"
        ),
        "{}",
        done.errors()
    );
    assert!(near(highest(&done, "feed_mm_s", &[4.0])[0], 50.0));
    // Without somebody who watches a comment is a comment.
    let plain = Scenario::text(&slip).run();
    assert!(!plain.errors().contains("material"), "{}", plain.errors());
}

#[test]
fn the_feed_follows_a_sensor() {
    let cut = || {
        let scenario = Scenario::of(&root().join("examples/programs/force-step.ngc"));
        let set = [
            "driver.analog=[\"spindle_temperature_c\", \"depth_mm\"]",
            "feed_strategy.options.mode=observe",
        ];
        let set: Vec<&str> = set.iter().flat_map(|key| ["--set", key]).collect();
        scenario.on(&machine("force-step.toml")).with(&set)
    };
    let parameters = [("warm_c", 0.02), ("hot_c", 0.08), ("lowest_ratio", 0.5)];
    let done = with(cut(), "warm-spindle", &parameters).run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    let (feeds, depths) = (done.column("feed_mm_s"), done.column("sig_depth_mm"));
    let mean_at = |depth: f64| {
        let (count, sum) = feeds
            .iter()
            .zip(&depths)
            .filter(|(_, at)| **at == depth)
            .fold((0.0, 0.0), |(count, sum), (feed, _)| {
                (count + 1.0, sum + feed)
            });
        sum / count
    };
    let (air, shallow, deep) = (mean_at(0.0), mean_at(2.0), mean_at(4.0));
    assert!(
        air > 1.2 * shallow && shallow > 1.05 * deep && deep > 0.49 * 2.5,
        "{air} {shallow} {deep}"
    );
    let policy = done.summary()["policy"].clone();
    assert_eq!(policy["traps"], 0, "{policy}");
    // A machine whose sensor has another name is refused before anything moves.
    let other = with(
        Scenario::of(&root().join("examples/programs/force-step.ngc"))
            .on(&machine("force-step.toml")),
        "warm-spindle",
        &[],
    )
    .run();
    assert_eq!(other.status(), 1);
    assert!(
        other.errors().contains(
            "it looks at the signal \"spindle_temperature_c\", which this machine has not; the nearest is"
        ),
        "{}",
        other.errors()
    );
}

#[test]
fn a_small_radius_is_driven_more_exactly_than_a_large_one() {
    // A circle of 1.5 mm in chords that turn by 20° each.
    let corner = |index: u32| {
        let angle = f64::from(index) * std::f64::consts::PI / 9.0;
        format!(
            "X{:.4} Y{:.4}\n",
            1.5 * angle.sin(),
            1.5 - 1.5 * angle.cos()
        )
    };
    let chords: String = (1..=18).map(corner).collect();
    let program = format!("F3000 G64\nG1 {chords}M2\n");
    let smooth = || Scenario::text(&program).on(&machine("mill-3axis-smooth.toml"));
    let coarse = smooth().run();
    coarse.assert_within_tolerance();
    let parameters = [
        ("share_of_radius", 0.002),
        ("finest_um", 2.0),
        ("coarsest_um", 10.0),
    ];
    let fine = with(smooth(), "curvature-tolerance", &parameters).run();
    fine.assert_within_tolerance();
    let deviation = |done: &Done| done.number("max_path_deviation_mm");
    assert!(
        deviation(&fine) <= 0.003 && deviation(&coarse) > 0.005,
        "{} and {}",
        deviation(&fine),
        deviation(&coarse)
    );
    assert!(fine.number("motion_time_s") > coarse.number("motion_time_s"));
}

#[test]
fn the_feed_yields_to_the_axis_that_lags() {
    let cut = || {
        Scenario::text("F6000\nG1 X200\nG1 Y60\nG1 X0\nM2\n")
            .on(&machine("force-demo.toml"))
            .with(&["--set", "feed_strategy.options.mode=observe"])
    };
    let plain = cut().run();
    assert_eq!(plain.status(), 0, "{}", plain.errors());
    let parameters = [("axis_error_um", 400.0)];
    let done = with(cut(), "keep-contour", &parameters).run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    let lag = |done: &Done| {
        let (command, actual) = (done.column("x_cmd_mm"), done.column("x_fb_mm"));
        let mut lags: Vec<f64> = command
            .iter()
            .zip(&actual)
            .map(|(command, actual)| (command - actual).abs())
            .collect();
        lags.sort_by(f64::total_cmp);
        lags[lags.len() * 95 / 100]
    };
    assert!(lag(&plain) > 1.0, "{}", lag(&plain));
    assert!(lag(&done) < 0.6, "{}", lag(&done));
}

#[test]
fn an_arm_goes_slowly_where_it_is_nearly_stretched() {
    let program = "G0 X0\nF6000\nG1 X10\nX50\nX90\nM2\n";
    // 100 and 60 mm: stretched at 160 mm from the shoulder, which stands at X-60 Y0.
    let parameters = [
        ("upper_arm_mm", 100.0),
        ("forearm_mm", 60.0),
        ("shoulder_x_mm", -60.0),
        ("joint_deg_per_s", 30.0),
    ];
    let mill = || Scenario::text(program).on(&machine("mill-3axis.toml"));
    let done = with(mill(), "arm-reach", &parameters).run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    let feeds = highest(&done, "feed_mm_s", &[4.0, 5.0]);
    let turns = |reach: f64| {
        let cos = (reach * reach - 100.0 * 100.0 - 60.0 * 60.0) / (2.0 * 100.0 * 60.0);
        let determinant = 100.0 * 60.0 * (1.0 - cos * cos).sqrt();
        let squares = reach * reach + 60.0 * 60.0;
        let least = 0.5 * (squares - (squares * squares - 4.0 * determinant * determinant).sqrt());
        least.sqrt() * 30.0_f64.to_radians()
    };
    // The farther end of each line is the slowest.
    for (line, (feed, reach)) in feeds.iter().zip([110.0, 150.0]).enumerate() {
        let asked = turns(reach);
        assert!(
            near(*feed, asked) || (feed / asked - 1.0).abs() < 0.02,
            "line {}: {feed} of {asked}",
            line + 4
        );
    }
    let policy = done.summary()["policy"].clone();
    assert_eq!(policy["traps"], 0, "{policy}");
}
