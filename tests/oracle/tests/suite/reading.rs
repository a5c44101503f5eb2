//! Files: the trace by column name, the machine with its includes, and the command.

use crate::common;

use std::{fmt::Write, fs, path::Path, process::Command};

use common::{MACHINE, Profile, at, polyline, verdict};
use tandem_oracle::{Check, Kind, Machine, Options, Outcome, Position, Trace, judge};

const PROGRAM: &str = "G1 X20 F3000\nM2\n";

fn run() -> Vec<Position> {
    Profile::rest_to_rest(50.0, 20.0, 990.0)
        .samples(polyline(vec![at(0.0, 0.0, 0.0), at(20.0, 0.0, 0.0)]))
}

/// Columns in another order than the host writes them, with some that are not known.
fn csv(samples: &[Position]) -> String {
    let mut text = String::from(
        "sigma,line,sig_load,a_cmd_deg,z_cmd_mm,y_cmd_mm,x_cmd_mm,x_fb_mm,t_s,state\n",
    );
    for (tick, [x, y, z, a, ..]) in samples.iter().enumerate() {
        let t_s = tick as f64 * common::PERIOD_S;
        writeln!(
            text,
            "1,1,NaN,{a:.17e},{z:.17e},{y:.17e},{x:.17e},0,{t_s:.17e},run"
        )
        .expect("a string takes all");
    }
    text
}

fn read(text: &str) -> Result<Trace, String> {
    Trace::from_reader(text.as_bytes(), "run.csv").map_err(|error| error.to_string())
}

#[test]
fn a_trace_is_read_by_column_name_to_the_last_bit() {
    let samples = run();
    let trace = read(&csv(&samples)).expect("the trace reads");
    assert_eq!(trace.axes, [3, 2, 1, 0]);
    assert_eq!(
        trace.rows.iter().map(|row| row.command).collect::<Vec<_>>(),
        samples
    );
    assert!(trace.rows.iter().all(|row| row.line == 1));
    let verdict = judge(
        &trace,
        PROGRAM,
        &common::smooth_machine(),
        &Options::default(),
    );
    common::assert_passes(&verdict);
}

#[test]
fn feedback_that_is_no_number_is_found() {
    let text = csv(&run()).replacen(",0,", ",inf,", 1);
    let verdict = judge(
        &read(&text).expect("reads"),
        PROGRAM,
        &common::smooth_machine(),
        &Options::default(),
    );
    assert_eq!(verdict.kinds(), [Kind::NotFinite]);
}

#[test]
fn errors_name_file_line_and_cause() {
    assert_eq!(
        read("line,x_cmd_mm\n"),
        Err("run.csv:1: no column `t_s`".into())
    );
    assert_eq!(
        read("t_s,line\n"),
        Err("run.csv:1: no column `<axis>_cmd_mm` or `<axis>_cmd_deg`".into())
    );
    assert_eq!(
        read("t_s,line,x_cmd_mm,x_cmd_mm\n"),
        Err("run.csv:1: two command columns for axis X".into())
    );
    let broken = "t_s,line,x_cmd_mm\n0,1,0\n0.001,1,fast\n";
    assert_eq!(
        read(broken),
        Err("run.csv:3: column `x_cmd_mm`: `fast` is no number".into())
    );
    assert!(read("t_s,line,x_cmd_mm\n0,1\n").is_err_and(|error| error.starts_with("run.csv:2: ")));
}

#[test]
fn a_machine_error_names_its_key() {
    let machine = |from: &str, to: &str| {
        Machine::from_toml(&MACHINE.replacen(from, to, 1), "m.toml")
            .map_err(|error| error.to_string())
    };
    let error = |from, to| machine(from, to).expect_err("refused");
    assert_eq!(
        error("fine_period_ms = 1", ""),
        "m.toml: loops.fine_period_ms: missing"
    );
    assert_eq!(
        error("-250, 250", "250, -250"),
        "m.toml: axes.x.travel_mm: not two numbers in ascending order"
    );
    assert_eq!(
        error("max_feed_mm_per_min", "max_fed"),
        "m.toml: axes.x.max_feed_mm_per_min: missing"
    );
    assert_eq!(
        error("path_tolerance_mm = 0.01", "path_tolerance_mm = \"a\""),
        "m.toml: motion.path_tolerance_mm: no finite number"
    );
    assert!(error("[loops]", "[loops").starts_with("m.toml:3: "));
}

#[test]
fn included_files_come_first() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    fs::write(path("base.toml"), MACHINE).expect("written");
    let own = "include = [\"base.toml\"]\n[axes.x]\nstart_mm = 3\n[axes.a]\nstart_deg = 90\n[planner]\nplugin = \"mine\"\n";
    fs::write(path("machine.toml"), own).expect("written");
    let machine = Machine::read(&path("machine.toml")).expect("reads");
    assert_eq!(
        (
            machine.planner.as_str(),
            machine.start()[0],
            machine.start()[3]
        ),
        ("mine", 3.0, 90.0)
    );
    assert_eq!(machine.axes[0].max_feed_mm_per_s, 250.0);
    assert_eq!(
        (machine.axes[3].rotary, machine.axes[3].max_feed_mm_per_s),
        (true, 120.0)
    );
    fs::write(path("loop.toml"), "include = [\"loop.toml\"]").expect("written");
    assert!(Machine::read(&path("loop.toml")).is_err());
}

#[test]
fn axes_that_do_not_match_are_not_judged() {
    let samples = run();
    let judged = |axes: &[usize]| {
        let trace = Trace::from_samples(axes, common::PERIOD_S, &samples);
        judge(
            &trace,
            PROGRAM,
            &common::smooth_machine(),
            &Options::only(&[Check::Travel]),
        )
        .outcome
    };
    assert_eq!(
        judged(&[0, 1, 2]),
        Outcome::NotJudged {
            reason: "the trace has no axis A".into()
        }
    );
    assert_eq!(
        judged(&[0, 1, 2, 3, 4]),
        Outcome::NotJudged {
            reason: "the machine has no axis B".into()
        }
    );
    assert_eq!(
        verdict(&[], PROGRAM).outcome,
        Outcome::NotJudged {
            reason: "the trace has no rows".into()
        }
    );
}

#[test]
fn the_command_says_by_its_exit_status() {
    let folder = tempfile::tempdir().expect("a folder");
    let write =
        |name: &str, text: &str| fs::write(folder.path().join(name), text).expect("written");
    write("good.csv", &csv(&run()));
    write("bad.csv", &csv(&run()[..200]));
    write("broken.csv", "t_s\n");
    write("part.ngc", PROGRAM);
    write("strange.ngc", "G5 X20\n");
    write("machine.toml", MACHINE);
    let status = |arguments: &[&str]| oracle(folder.path(), arguments);
    let (code, text) = status(&["good.csv", "part.ngc", "machine.toml"]);
    assert_eq!((code, text.starts_with("PASS\n")), (0, true), "{text}");
    let (code, text) = status(&["bad.csv", "part.ngc", "machine.toml"]);
    assert_eq!((code, text.starts_with("FAIL: ")), (1, true), "{text}");
    assert_eq!(
        status(&["bad.csv", "part.ngc", "machine.toml", "--ends-early"]).0,
        1
    );
    assert_eq!(
        status(&[
            "good.csv",
            "part.ngc",
            "machine.toml",
            "--fine-period-ms",
            "2"
        ])
        .0,
        1
    );
    assert_eq!(
        status(&[
            "good.csv",
            "part.ngc",
            "machine.toml",
            "--speed-difference-mm-per-min",
            "0"
        ])
        .0,
        0
    );
    assert_eq!(
        status(&["good.csv", "part.ngc", "machine.toml", "--order", "3"]).0,
        3
    );
    assert_eq!(status(&["good.csv", "strange.ngc", "machine.toml"]).0, 3);
    assert_eq!(status(&["broken.csv", "part.ngc", "machine.toml"]).0, 3);
    assert_eq!(status(&["absent.csv", "part.ngc", "machine.toml"]).0, 2);
    assert_eq!(status(&["good.csv", "part.ngc"]).0, 2);
}

fn oracle(folder: &Path, arguments: &[&str]) -> (i32, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_oracle"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("runs");
    (
        output.status.code().expect("an exit status"),
        String::from_utf8_lossy(&output.stdout).into_owned(),
    )
}
