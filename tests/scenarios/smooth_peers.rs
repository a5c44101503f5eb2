//! The planner inside the tolerance beside the others, on the programs and cases that all are compared on.

use std::fmt::Write;

use tandem_oracle::Check;

use crate::harness::{Done, Scenario, UNDISTURBED, root};

/// Times of others on the same tool paths, s, measured once (docs/smooth-planner.md): the first two leave the acceleration
/// limit at corners, the third has no jerk limit.
const PEERS: [(&str, [f64; 4]); 5] = [
    ("grbl 1.1, 100 blocks", [1.260, 2.638, 27.50, 20.04]),
    ("Klipper, equal junction rule", [1.265, 2.656, 27.59, 20.17]),
    ("LinuxCNC, trapezoidal", [1.291, 2.715, 28.08, 21.18]),
    ("LinuxCNC, S-curve", LINUXCNC_S_CURVE_S),
    (
        "best known with jerk, not streaming",
        [1.382, 2.758, 28.63, 20.27],
    ),
];
const LINUXCNC_S_CURVE_S: [f64; 4] = [1.454, 6.78, 202.6, 393.6];
const PROGRAMS: [&str; 4] = ["square", "serpentine", "raster", "spiral"];

fn drive(program: &str, machine: &str, planner: &str) -> Done {
    let program = root().join(format!("examples/programs/{program}.ngc"));
    let plugin = format!("planner.plugin={planner}");
    let done = Scenario::of(&program)
        .on(&root().join("examples/machines").join(machine))
        .with(&["--set", &plugin])
        .run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    done
}

fn most(done: &Done, peaks: &str) -> f64 {
    let axes = done.summary()[peaks].as_object().unwrap().clone();
    axes.values()
        .filter_map(serde_json::Value::as_f64)
        .fold(0.0, f64::max)
}

/// The row of a planner; gives its times, s.
fn row(planner: &str, machine: &str) -> [f64; 4] {
    let (mut times, mut peaks) = ([0.0; 4], [0.0f64; 3]);
    for (time, program) in times.iter_mut().zip(PROGRAMS) {
        let done = drive(program, machine, planner);
        *time = done.number("motion_time_s");
        let off_um = 1e3 * done.number("max_path_deviation_mm");
        let now = [
            most(&done, "max_acceleration_mm_s2"),
            most(&done, "max_jerk_mm_s3"),
            off_um,
        ];
        peaks = std::array::from_fn(|i| peaks[i].max(now[i]));
    }
    let [acceleration, jerk, off_um] = peaks;
    println!(
        "{planner:36} {times:8.3?} s, {acceleration:6.0} mm/s², {jerk:9.0} mm/s³, {off_um:.1} µm off"
    );
    times
}

#[test]
fn the_same_programs_through_the_other_planners() {
    for (name, times) in PEERS {
        println!("{name:36} {times:8.3?} s");
    }
    let smooth = row("smooth", "mill-3axis-smooth.toml");
    let nurbs = row("nurbs", "mill-3axis-smooth.toml");
    row("look-ahead", "mill-3axis.toml");
    let overlap = row("block-overlap", "mill-3axis.toml");
    for (n, time_s) in smooth.into_iter().enumerate() {
        let program = PROGRAMS[n];
        assert!(
            time_s < LINUXCNC_S_CURVE_S[n] && time_s < nurbs[n],
            "{program}: slower than others that keep jerk"
        );
        // What the jerk limit costs beside the same tolerance without one.
        assert!(
            time_s < 1.12 * overlap[n],
            "{program}: {time_s} s, {} s without a jerk limit",
            overlap[n]
        );
    }
}

/// A case of straight lines as a part program.
fn case(name: &str) -> String {
    let path = root().join(format!("tests/fixtures/cases/smooth_{name}.json"));
    let case: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let feed = 60.0 * case["limits"]["feed"].as_f64().unwrap();
    let mut text = format!("G21 G90 G94 G17 G64 P0.01\nF{feed}\n");
    for point in &case["points"].as_array().unwrap()[1..] {
        let [x, y, z] = [0, 1, 2].map(|i| point[i].as_f64().unwrap());
        writeln!(text, "G1 X{x:.9} Y{y:.9} Z{z:.9}").unwrap();
    }
    text + "M2\n"
}

#[test]
fn cases_are_driven_near_the_best_time_within_limits() {
    for (name, max_s) in [("corner90", 1.375), ("zigzag", 1.40), ("arcline", 1.065)] {
        let machine = root().join("examples/machines/mill-3axis-smooth.toml");
        let done = Scenario::text(&case(name)).on(&machine).run();
        done.assert_driven(name, &UNDISTURBED);
        let verdict = done.judge(|options| {
            options.checks.push(Check::Jerk);
            options.feed_window_s = Some(0.0);
        });
        assert!(verdict.passed(), "{name}: {verdict}");
        let feeds = done.column("feed_mm_s");
        let stops = feeds[1..feeds.len() - 2]
            .iter()
            .filter(|feed| **feed == 0.0)
            .count();
        println!("{name}: {:.3} s", done.number("motion_time_s"));
        assert!(
            done.number("motion_time_s") <= max_s && stops == 0,
            "{name}: {stops} stops"
        );
    }
}
