//! Homing on simulated switches: where the axes end, what they keep on the way, and what a broken switch says.

use std::path::Path;
use std::process::{Command, Output};

use tandem_oracle::{Check, Machine, Options, Trace, judge};
use tempfile::TempDir;

use crate::harness::{Scenario, root};

/// The switches of `examples/machines/mill-homing.toml` for `driver.options`, and a plate at Z -5.3 on input 3.
const SWITCHES: &str = "{input=10,joint=0,below_mm=-252,bounce_periods=5},\
                        {input=11,joint=1,above_mm=-251.25,bounce_periods=5},\
                        {input=12,joint=2,above_mm=101.5,bounce_periods=5},{input=3,joint=2,below_mm=-5.3}";

fn machine() -> std::path::PathBuf {
    root().join("examples/machines/mill-homing.toml")
}

/// `tandem home` with these arguments.
fn home(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tandem"));
    command
        .arg("home")
        .arg("--machine")
        .arg(machine())
        .args(arguments)
        .output()
        .unwrap()
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Velocity and acceleration of every sample, in the coordinates of the drives.
fn assert_limits_kept(trace: &Path) {
    let machine = Machine::read(&root().join("examples/machines/mill-3axis.toml")).unwrap();
    let mut options = Options::for_machine(&machine);
    options.checks = [Check::Velocity, Check::Acceleration].into_iter().collect();
    let verdict = judge(&Trace::read(trace).unwrap(), "", &machine, &options);
    assert!(verdict.passed(), "{verdict}");
}

#[test]
fn axes_go_home_one_after_the_other_within_limits() {
    let folder = TempDir::new().unwrap();
    for seed in 1..=12 {
        let trace = folder.path().join("home.csv");
        let seed = format!("driver.options.seed={seed}");
        let output = home(&["--set", &seed, "--trace", &trace.to_string_lossy()]);
        assert!(output.status.success(), "{seed}: {}", errors(&output));
        assert_limits_kept(&trace);
        let said = errors(&output);
        let order: Vec<_> = said.lines().map(|line| &line[..8]).collect();
        assert_eq!(
            order,
            [
                "homing z", "homing z", "homing x", "homing x", "homing y", "homing y"
            ],
            "{said}"
        );
    }
}

#[test]
fn a_homed_machine_stands_where_it_says() {
    // Wherever the axes really stood, the plate is found at -5.3 and the program ends at home.
    let program = "G21 G90\nG38.2 Z-20 F600\nG1 X[0 - #5063]\nG0 Z0\nM2\n";
    for seed in [1, 2, 3, 77] {
        let options =
            format!("driver.options={{unknown_start_mm=40,seed={seed},switches=[{SWITCHES}]}}");
        let done = Scenario::text(program)
            .on(&machine())
            .with(&["--home", "--set", &options, "--set", "probe.input=3"])
            .run();
        assert_eq!(done.status(), 0, "seed {seed}: {}", done.errors());
        let x_mm = done.summary()["end_position_mm"]["x"].as_f64().unwrap();
        assert!((x_mm - 5.3).abs() < 1e-6, "seed {seed}: {x_mm}");
        assert_eq!(
            done.column("z_cmd_mm")[0],
            0.0,
            "the record begins at rest, at home"
        );
        assert_eq!(done.number("limit_violations"), 0.0);
    }
}

#[test]
fn a_program_behind_homing_is_judged_as_any() {
    let done = Scenario::text("G21 G90\nG1 X10 Y5 F3000\nG2 X20 Y5 I5\nM2\n")
        .on(&machine())
        .with(&["--home"])
        .run();
    done.assert_within_limits();
    assert_eq!(done.summary()["blocks"], 3);
}

#[test]
fn a_machine_that_asks_for_homing_refuses_a_program_without() {
    let done = Scenario::text("G21 G90\nG1 X10 F600\nM2\n")
        .on(&machine())
        .run();
    assert_eq!(done.status(), 1);
    assert!(
        done.errors()
            .contains("machine.require_homing: the axes of this machine are to be homed first")
    );
    let done = Scenario::text("G21 G90\nG1 X10 F600\nM2\n")
        .with(&["--home"])
        .run();
    assert_eq!(done.status(), 1);
    assert!(
        done.errors()
            .contains("no axis has a [homing.<axis>] table"),
        "{}",
        done.errors()
    );
}

#[test]
fn an_axis_that_stands_on_its_switch_leaves_it_first() {
    let on_it = "driver.options={switches=[{input=10,joint=0,below_mm=-200,bounce_periods=5}]}";
    let folder = TempDir::new().unwrap();
    let trace = folder
        .path()
        .join("home.csv")
        .to_string_lossy()
        .into_owned();
    let set = [
        "--axis",
        "x",
        "--set",
        on_it,
        "--set",
        "axes.x.start_mm=-230",
        "--set",
        "homing.x.switch_mm=-201",
    ];
    let output = home(&[&set[..], &["--trace", &trace]].concat());
    assert!(output.status.success(), "{}", errors(&output));
    assert!(
        errors(&output).contains("the axis stood -1.000000 mm off"),
        "{}",
        errors(&output)
    );
    assert_limits_kept(Path::new(&trace));
}

#[test]
fn a_broken_switch_is_named_with_its_axis() {
    let with = |switch: &str| {
        let options = format!("driver.options={{switches=[{switch}]}}");
        let output = home(&["--axis", "x", "--set", &options]);
        assert_eq!(output.status.code(), Some(3));
        errors(&output)
    };
    let dead = with("{input=10,joint=0,below_mm=-9999}");
    assert!(
        dead.contains("homing x: the switch on input 10 did not trip within 553.000 mm"),
        "{dead}"
    );
    let stuck = with("{input=10,joint=0,below_mm=9999}");
    assert!(
        stuck.contains(
            "homing x: the switch on input 10 is on and was not released within 553.000 mm"
        ),
        "{stuck}"
    );
    let fast = home(&["--axis", "x", "--set", "homing.x.search_mm_per_min=-15000"]);
    let said = errors(&fast);
    assert!(
        said.contains("homing x: the switch on input 10 is still on 3.000 mm behind its edge"),
        "{said}"
    );
}

#[test]
fn a_hold_and_an_abort_act_during_homing() {
    let program = "G21 G90\nG1 X10 F3000\nM2\n";
    let free = Scenario::text(program)
        .on(&machine())
        .with(&["--home"])
        .run();
    let held = Scenario::text(program)
        .on(&machine())
        .with(&["--home"])
        .commands("500,hold\n900,resume\n")
        .run();
    assert_eq!(held.status(), 0, "{}", held.errors());
    assert_eq!(
        free.column("x_cmd_mm"),
        held.column("x_cmd_mm"),
        "the record begins at home"
    );
    let aborted = Scenario::text(program)
        .on(&machine())
        .with(&["--home"])
        .commands("500,abort\n")
        .run();
    assert_eq!(aborted.status(), 3, "{}", aborted.errors());
    assert!(
        aborted.errors().contains("stopped by the operator"),
        "{}",
        aborted.errors()
    );
}

#[test]
fn only_the_axis_asked_for_moves() {
    let output = home(&["--axis", "y"]);
    assert_eq!(errors(&output).lines().count(), 2, "{}", errors(&output));
    assert_eq!(home(&["--axis", "c"]).status.code(), Some(1));
}

#[test]
fn manual_input_begins_at_home() {
    use std::io::Write;
    let options = format!("driver.options={{unknown_start_mm=40,seed=9,switches=[{SWITCHES}]}}");
    let mdi = |home: &[&str], lines: &[u8]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tandem"));
        command
            .args(["mdi", "--clock", "virtual", "--machine"])
            .arg(machine())
            .args(home);
        command.args(["--set", "probe.input=3", "--set", &options]);
        let pipes = command
            .stdin(std::process::Stdio::piped())
            .stdout(std::process::Stdio::piped());
        let mut child = pipes.stderr(std::process::Stdio::piped()).spawn().unwrap();
        // A refused session closes its input: that is what is to be seen.
        let _ = child.stdin.take().unwrap().write_all(lines);
        child.wait_with_output().unwrap()
    };
    let homed = mdi(&["--home"], b"G38.2 Z-20 F600\nG0 X[0-#5063]\n");
    let said = String::from_utf8_lossy(&homed.stdout).into_owned();
    assert!(
        homed.status.success() && said.contains("x_mm 5.3000  y_mm 0.0000"),
        "{said}{}",
        errors(&homed)
    );
    // A fault: the axes home again, from where the drives stand.
    let again = mdi(
        &["--home"],
        b"G0 X50 Y-20\nG38.2 Z-2 F600\n!reset\nG38.2 Z-20 F600\nG0 X[0-#5063]\n",
    );
    let said = String::from_utf8_lossy(&again.stdout).into_owned();
    assert!(
        said.ends_with("x_mm 5.3000  y_mm 0.0000  z_mm -5.3600\n"),
        "{said}{}",
        errors(&again)
    );
    assert_eq!(mdi(&[], b"G0 X1\n").status.code(), Some(1));
}

/// Z runs into something 10 mm before its switch.
#[test]
fn an_axis_that_something_stops_is_pushed_with_the_torque_that_homing_may_have() {
    let folder = TempDir::new().unwrap();
    let options = "driver.options={hard_stops=[{joint=2,above_mm=91.5}],switches=[{input=12,joint=2,above_mm=101.5}]}";
    // How far Z was told to be beyond where it stood, mm, before its drive gave up.
    let pushed = |limit: &[&str]| {
        let trace = folder.path().join("home.csv");
        let own = [
            "--axis",
            "z",
            "--set",
            options,
            "--set",
            "axes.z.max_following_error_mm=50",
            "--trace",
        ];
        let output = home(&[&own[..], &[&*trace.to_string_lossy()], limit].concat());
        let expected = "the drive of axis Z reports fault 2 (more torque than it may have: something is in its way)";
        assert!(
            output.status.code() == Some(3) && errors(&output).contains(expected),
            "{}",
            errors(&output)
        );
        let mut reader = csv::Reader::from_path(&trace).unwrap();
        let heads = reader.headers().unwrap().clone();
        let at = |name: &str| heads.iter().position(|head| head == name).unwrap();
        let (command, feedback, state) = (at("z_cmd_mm"), at("z_fb_mm"), at("state"));
        let number = |cell: &str| cell.parse::<f64>().unwrap();
        let rows = reader
            .records()
            .map(Result::unwrap)
            .filter(|row| &row[state] == "running");
        rows.map(|row| number(&row[command]) - number(&row[feedback]))
            .fold(0.0, f64::max)
    };
    // Rated torque for a millimetre; 1800 mm/min are 0.03 mm a period.
    for (limit, max_mm) in [("20", 0.2), ("75", 0.75)] {
        let pushed_mm = pushed(&["--set", &format!("homing.z.max_torque_percent={limit}")]);
        assert!(
            (max_mm - 0.03..=max_mm + 0.031).contains(&pushed_mm),
            "{limit} %: {pushed_mm}"
        );
    }
    assert!(pushed(&[]) > 2.9, "three times the rated torque");
    let refused = home(&["--set", "homing.z.max_torque_percent=301"]);
    assert!(
        errors(&refused).contains("max_torque_percent: must be at most 300, not 301"),
        "{}",
        errors(&refused)
    );
}
