//! Probes on simulated surfaces: what is found, where the machine stops, and what happens where nothing is touched.

use crate::harness::{Done, Scenario, root};

/// Acceleration of every axis of the mill, mm/s².
const ACCELERATION_MM_PER_S2: f64 = 1000.0;
const PERIOD_S: f64 = 0.001;
/// A table 5.3 mm below zero.
const TABLE: &str = "{input=3,joint=2,below_mm=-5.3}";

/// A run on the mill with a probe on input 3 and these simulated surfaces.
fn probing(program: &str, surfaces: &str, options: &str) -> Scenario {
    let options = format!("driver.options={{switches=[{surfaces}]{options}}}");
    Scenario::text(program).with(&["--set", "probe.input=3", "--set", &options])
}

fn end_mm(done: &Done, axis: &str) -> f64 {
    done.summary()["end_position_mm"][axis].as_f64().unwrap()
}

/// The greatest depth that a probe at this feed may reach behind the edge: one period until it is seen, one until the
/// stop begins, then v²/2a.
fn overtravel_mm(feed_mm_per_s: f64) -> f64 {
    feed_mm_per_s * 2.0 * PERIOD_S + feed_mm_per_s.powi(2) / (2.0 * ACCELERATION_MM_PER_S2) + 1e-6
}

fn least(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

#[test]
fn a_touched_plane_is_found_to_the_last_digit() {
    let program = "G21 G90\nG0 X-4\nG38.2 Z-20 F1500\nG1 X[0 - #5063] Y[10 * #5070]\nM2\n";
    let done = probing(program, TABLE, "").run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    assert!(
        (end_mm(&done, "x") - 5.3).abs() < 1e-6,
        "{}",
        end_mm(&done, "x")
    );
    assert_eq!(end_mm(&done, "y"), 10.0);
    let depth_mm = -5.3 - least(&done.column("z_cmd_mm"));
    assert!(
        depth_mm > 0.0 && depth_mm <= overtravel_mm(25.0),
        "{depth_mm}"
    );
    done.assert_driven("", &["governed_samples"]);
}

#[test]
fn without_latches_the_plane_is_found_within_a_period_of_travel() {
    let program = "G21 G90\nG38.2 Z-20 F1500\nG1 X[0 - #5063]\nM2\n";
    let done = probing(program, TABLE, ",latches=false").run();
    let late_mm = end_mm(&done, "x") - 5.3;
    assert!(
        (0.0..=25.0 * PERIOD_S + 1e-9).contains(&late_mm),
        "{late_mm}"
    );
}

#[test]
fn servos_that_lag_are_measured_where_they_are() {
    let program = "G21 G90\nG38.2 Z-20 F1500\nG4 P0.5\nG1 X[0 - #5063]\nM2\n";
    let done = probing(program, TABLE, ",model='second-order'").run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    assert!(
        (end_mm(&done, "x") - 5.3).abs() < 1e-6,
        "{}",
        end_mm(&done, "x")
    );
}

#[test]
fn the_oracle_follows_a_probe_to_where_it_rests() {
    let program =
        "G21 G90\nG0 X2\nG38.2 Z-20 F900\nG91 G0 Z2\nG90 G1 X20 Y5 F3000\nG38.3 X60\nG0 Z0\nM2\n";
    let surfaces = format!("{TABLE},{{input=3,low_mm=[30,0,-6],high_mm=[40,10,6]}}");
    let done = probing(program, &surfaces, "").run();
    done.assert_within_limits();
    let x = done.column("x_cmd_mm");
    let rest_mm = x.last().unwrap() - 30.0;
    assert!(rest_mm > 0.0 && rest_mm <= overtravel_mm(50.0), "{rest_mm}");
}

#[test]
fn a_miss_is_a_fault_or_is_not() {
    let table = "{input=3,joint=2,below_mm=-50}";
    let must = probing("G21 G90\nG1 X1 F600\nG38.2 Z-20\nG0 X5\nM2\n", table, "").run();
    assert_eq!(must.status(), 3);
    assert!(
        must.errors()
            .contains("line 3: input 3 was not tripped before the motion ended"),
        "{}",
        must.errors()
    );
    assert_eq!(
        (end_mm(&must, "x"), end_mm(&must, "z")),
        (1.0, -20.0),
        "nothing moves after the miss"
    );
    for word in ["G38.3", "G31"] {
        let program = format!("G21 G90\n{word} Z-20 F600\nG1 X[#5070 + 3] Y[#5063 + 1]\nM2\n");
        let may = probing(&program, table, "").run();
        assert_eq!(may.status(), 0, "{}", may.errors());
        assert_eq!(
            (end_mm(&may, "x"), end_mm(&may, "y"), end_mm(&may, "z")),
            (3.0, -19.0, -20.0)
        );
    }
}

#[test]
fn a_probe_that_touches_already_does_not_push_on() {
    let done = probing("G21 G90\nG1 Z-6 F600\nG38.2 Z-20\nM2\n", TABLE, "").run();
    assert_eq!(done.status(), 3);
    assert!(
        done.errors()
            .contains("line 3: input 3 was already tripped when the motion began"),
        "{}",
        done.errors()
    );
    assert!(least(&done.column("z_cmd_mm")) > -6.01);
}

#[test]
fn a_probe_lets_go_where_the_surface_ends() {
    let program = "G21 G90\nG0 Z-8\nG38.4 Z10 F600\nG1 X[#5063 + 10]\nM2\n";
    let done = probing(program, TABLE, "").run();
    assert!((end_mm(&done, "x") - 4.7).abs() < 1e-6, "{}", done.errors());
    let stuck = probing(program, "{input=3,joint=2,below_mm=50}", "").run();
    assert!(
        stuck
            .errors()
            .contains("line 3: input 3 was not released before the motion ended"),
        "{}",
        stuck.errors()
    );
    let inverted = probing(program, TABLE, "")
        .with(&["--set", "probe.invert=true"])
        .run();
    assert!(
        inverted
            .errors()
            .contains("line 3: input 3 was already tripped"),
        "{}",
        inverted.errors()
    );
}

#[test]
fn the_usual_program_of_two_touches_makes_the_surface_zero() {
    let program = "G21 G90 G54\nG0 X3\nG38.2 Z-20 F1500\nG91 G38.4 Z5 F600\nG1 Z0.5\nG38.2 Z-2 F60\nG90\n\
                   G10 L20 P1 Z[#5422 - #5063]\nG0 Z10\nG1 X#5070 Z0 F600\nM2\n";
    let done = probing(program, TABLE, ",seed=3").run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    assert!(
        (end_mm(&done, "z") + 5.3).abs() < 1e-6,
        "{}",
        end_mm(&done, "z")
    );
    let bounce = TABLE.replace('}', ",bounce_periods=4}");
    for seed in 1..8 {
        let done = probing(program, &bounce, &format!(",seed={seed}")).run();
        assert!(
            (end_mm(&done, "z") + 5.3).abs() < 1e-6,
            "seed {seed}: {}",
            done.errors()
        );
    }
}

#[test]
fn the_centre_of_a_bore_is_found() {
    let bore = "{input=3,bore={centre_mm=[21.25,-8.5],radius_mm=12}}";
    let program = "G21 G90\nG0 X18 Y-6\nG38.2 X50 F600\n#1=#5061\nG0 X18\nG38.2 X-50\n#1=[[#1 + #5061] / 2]\nG0 X#1\n\
                   G38.2 Y50\n#2=#5062\nG0 Y-6\nG38.2 Y-50\n#3=[#2 - #5062]\n#2=[[#2 + #5062] / 2]\nG0 Y#2\nG0 Z#3\nM2\n";
    let done = probing(program, bore, "").run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    let found = ["x", "y", "z"].map(|axis| end_mm(&done, axis));
    for (value, expected) in found.into_iter().zip([21.25, -8.5, 24.0]) {
        assert!((value - expected).abs() < 1e-6, "{found:?}");
    }
}

#[test]
fn a_hold_waits_in_the_middle_of_a_probe_and_an_abort_ends_it() {
    let program = "G21 G90\nG38.2 Z-20 F600\nG1 X[0 - #5063]\nM2\n";
    let free = probing(program, TABLE, "").run();
    let held = probing(program, TABLE, "")
        .commands("200,hold\n700,resume\n")
        .run();
    assert_eq!(held.status(), 0, "{}", held.errors());
    assert!((end_mm(&held, "x") - end_mm(&free, "x")).abs() < 1e-6);
    assert!(held.number("samples") > free.number("samples") + 400.0);
    let aborted = probing("G21 G90\nG38.2 Z-20 F600\nG0 X5\nM2\n", TABLE, "")
        .commands("200,abort\n")
        .run();
    assert_eq!(aborted.status(), 3);
    assert!(
        aborted
            .errors()
            .contains("stopped by the operator at line 2"),
        "{}",
        aborted.errors()
    );
    let verdict = aborted.judge(|options| options.ends_early = true);
    assert!(verdict.passed(), "{verdict}");
}

#[test]
fn a_line_that_cannot_be_driven_after_all_stops_the_run_there() {
    let program = "G21 G90\nG38.2 Z-20 F600\nG1 X[#5063 * 100]\nM2\n";
    let done = probing(program, TABLE, "").run();
    assert_eq!(done.status(), 3);
    assert!(
        done.errors()
            .contains("3:4: error: X would reach -530 mm, beyond its travel"),
        "{}",
        done.errors()
    );
    assert_eq!(end_mm(&done, "x"), 0.0);
}

#[test]
fn a_machine_without_a_probe_refuses() {
    let done = Scenario::text("G21 G90\nG38.2 Z-20 F600\nM2\n").run();
    assert_eq!(done.status(), 1);
    assert!(
        done.errors()
            .contains("2:1: error: G38.2: this machine has no probe: its file has no [probe]")
    );
}

#[test]
fn the_examples_find_what_the_machine_file_says() {
    let run = |name: &str| {
        let program = root().join("examples/probing").join(name);
        let done = Scenario::of(&program)
            .on(&root().join("examples/machines/mill-probe.toml"))
            .run();
        assert_eq!(done.status(), 0, "{}", done.errors());
        done
    };
    let z_mm = end_mm(&run("surface.ngc"), "z");
    assert!((z_mm - (10.0 - 5.3)).abs() < 1e-6, "{z_mm}");
    let bore = run("bore.ngc");
    let [x, y] = ["x", "y"].map(|axis| end_mm(&bore, axis));
    assert!(
        (x - 21.25).abs() < 1e-6 && (y + 8.5).abs() < 1e-6,
        "({x}, {y})"
    );
}
