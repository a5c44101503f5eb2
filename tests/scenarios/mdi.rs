//! Manual input: lines from where the machine stands.

use std::io::Write;
use std::path::Path;
use std::process::{Child, Command, Output};

use tempfile::TempDir;

use crate::harness::{judge_trace, mill, operator_command};
use crate::operator::{Running, is_held, is_moving};

fn command(folder: &Path, arguments: &[&str]) -> Command {
    operator_command("mdi", folder, &mill(), arguments)
}

struct Said {
    folder: TempDir,
    output: Output,
}

impl Said {
    /// Positions, a line each.
    fn positions(&self) -> Vec<String> {
        String::from_utf8_lossy(&self.output.stdout)
            .lines()
            .map(str::to_string)
            .collect()
    }

    fn errors(&self) -> String {
        String::from_utf8_lossy(&self.output.stderr).into_owned()
    }

    /// The trace, judged as that of `program`.
    fn assert_drives(&self, program: &str) {
        let path = self.folder.path().join("p.ngc");
        std::fs::write(&path, program).unwrap();
        let verdict = judge_trace(
            &self.folder.path().join("trace.csv"),
            &path,
            &mill(),
            |_| (),
        );
        assert!(verdict.passed(), "{verdict}");
    }
}

fn say(lines: &str, arguments: &[&str]) -> Said {
    let folder = TempDir::new().unwrap();
    let mut child = command(folder.path(), arguments).spawn().unwrap();
    child
        .stdin
        .take()
        .unwrap()
        .write_all(lines.as_bytes())
        .unwrap();
    Said {
        output: child.wait_with_output().unwrap(),
        folder,
    }
}

const VIRTUAL: [&str; 2] = ["--clock", "virtual"];

#[test]
fn each_line_starts_where_the_machine_stands_and_ends_at_rest() {
    let lines = "G0 X10\nG1 Y5 F600\nG91 X-2 Y1\n#1=4\nG90 G1 X#1\nG92 X0\nG1 X1\n";
    let said = say(lines, &VIRTUAL);
    assert_eq!(said.output.status.code(), Some(0), "{}", said.errors());
    let ends = [
        "x_mm 10.0000  y_mm 0.0000",
        "x_mm 10.0000  y_mm 5.0000",
        "x_mm 8.0000  y_mm 6.0000",
    ];
    let more = [
        "x_mm 8.0000",
        "x_mm 4.0000  y_mm 6.0000",
        "x_mm 4.0000",
        "x_mm 5.0000  y_mm 6.0000",
    ];
    let positions = said.positions();
    assert_eq!(positions.len(), 7);
    for (position, end) in positions.iter().zip(ends.iter().chain(&more)) {
        assert!(position.starts_with(end), "{position}: {end}");
    }
    // The machine rests after each line, as a program in exact stop does.
    said.assert_drives("G0 X10\nG1 Y5 F600\nG1 X8 Y6\n\nG1 X4\n\nG1 X5\nM2\n");
}

#[test]
fn a_refused_line_moves_nothing_and_changes_nothing() {
    let said = say("G0 X10\nG91 G1 Y5\nG91 X9999\nG0 X20\n", &VIRTUAL);
    assert_eq!(said.output.status.code(), Some(1));
    let errors = said.errors();
    assert!(
        errors.contains("input:2:") && errors.contains("input:3:5") && errors.contains("travel"),
        "{errors}"
    );
    // Had G91 of a refused line stayed, X would be 30.
    assert_eq!(said.positions().len(), 2);
    assert!(said.positions()[1].starts_with("x_mm 20.0000  y_mm 0.0000"));
    said.assert_drives("G0 X10\n\n\nG0 X20\nM2\n");
}

#[test]
fn the_end_of_a_program_is_not_the_end_of_the_session() {
    let said = say("G0 X1\nM2\nG0 X2\nM30\nG0 X3\n", &VIRTUAL);
    assert!(
        said.positions().last().unwrap().starts_with("x_mm 3.0000"),
        "{}",
        said.errors()
    );
}

/// `quit` was read as G-code: "no function is called UIT".
#[test]
fn quit_and_exit_end_the_session_and_what_follows_is_nobodys_line() {
    for word in ["quit", "EXIT", "  Quit "] {
        let said = say(&format!("G0 X1\n{word}\nG0 X2\n"), &VIRTUAL);
        assert_eq!(
            (said.output.status.code(), said.errors().as_str()),
            (Some(0), ""),
            "{word}"
        );
        assert_eq!(said.positions().len(), 1, "{word}");
    }
    let fails = [
        "--clock",
        "virtual",
        "--set",
        "faults.wrap=[{kind=\"fail\",at_call=500}]",
    ];
    let said = say("G91\nG1 X50 F600\nquit\n!reset\nG0 Y2\n", &fails);
    assert_eq!(
        (said.output.status.code(), said.positions().len()),
        (Some(3), 1),
        "{}",
        said.errors()
    );
}

#[test]
fn a_fault_is_left_with_reset_from_where_the_machine_stands() {
    let fails = [
        "--clock",
        "virtual",
        "--set",
        "faults.wrap=[{kind=\"fail\",at_call=500}]",
    ];
    let said = say("G91\nG1 X50 F600\nG0 X1\n!reset\nG0 Y2\n", &fails);
    assert_eq!(said.output.status.code(), Some(1), "{}", said.errors());
    assert!(
        said.errors().contains("!reset goes on"),
        "{}",
        said.errors()
    );
    assert!(said.errors().contains("the machine is in fault"));
    let last = said.positions().pop().unwrap();
    // Stopped on the way to X50, then 2 mm in Y: G91 has outlived the fault.
    let x: f64 = last.split_whitespace().nth(1).unwrap().parse().unwrap();
    assert!(
        (1.0..10.0).contains(&x) && last.contains("y_mm 2.0000"),
        "{last}"
    );
    let unreset = say("G1 X50 F600\nG0 X1\n", &fails);
    assert_eq!(unreset.output.status.code(), Some(3));
}

/// Cells of the last row of a trace, by their names.
fn last(said: &Said, names: [&str; 3]) -> [String; 3] {
    let mut reader = csv::Reader::from_path(said.folder.path().join("trace.csv")).unwrap();
    let heads = reader.headers().unwrap().clone();
    let row = reader.records().last().unwrap().unwrap();
    names.map(|name| row[heads.iter().position(|head| head == name).unwrap()].to_string())
}

/// A clamp opened with the reset of a fault, and M3 behind one was taken for a spindle that turns already.
#[test]
fn what_a_fault_leaves_on_stays_on_in_the_next_run_and_what_it_switched_off_is_switched_on_anew() {
    let fails = [
        "--clock",
        "virtual",
        "--set",
        "faults.wrap=[{kind=\"fail\",at_call=500}]",
    ];
    let clamp = ["--set", "outputs.clamp={output=7,on_fault=\"keep\"}"];
    let before = "G91\nM64 P7\nM64 P3\nM3 S1000\nM8\nG1 X50 F600\n!reset\n";
    let columns = ["outputs", "coolant", "spindle_set_rpm"];
    let run = |behind: &str| {
        let said = say(
            &(before.to_string() + behind),
            &[&fails[..], &clamp[..]].concat(),
        );
        assert!(
            said.errors().contains("!reset goes on"),
            "{}",
            said.errors()
        );
        let [outputs, coolant, rpm] = last(&said, columns);
        (outputs, coolant, rpm.parse::<f64>().unwrap().round())
    };
    assert_eq!(run("G0 Y2\n"), ("0x80".to_string(), "off".to_string(), 0.0));
    // The session's end switches off what runs, behind the last sample.
    assert_eq!(
        run("M3 S1000\nM8\nM64 P3\nG0 Y2\n"),
        ("0x88".to_string(), "flood".to_string(), 1000.0)
    );
    assert_eq!(
        run("M65 P7\nG0 Y2\n"),
        ("0x0".to_string(), "off".to_string(), 0.0)
    );
}

/// In real time with a socket, typed to bit by bit.
fn live() -> (Running, std::process::ChildStdin) {
    let start = |folder: &Path| -> Child {
        let lenient = [
            "--set",
            "loops.max_missed_periods=1000000",
            "--set",
            "loops.max_missed_share=1",
            "--listen",
            "s",
        ];
        command(folder, &lenient).spawn().unwrap()
    };
    let mut run = Running::start_with("", start);
    let keys = run.child().stdin.take().unwrap();
    (run, keys)
}

#[test]
fn a_line_can_be_held_and_aborted_and_the_next_one_goes_on() {
    let (run, mut keys) = live();
    let mut client = run.connect();
    client.say(r#"{"lease":"take"}"#);
    client.hear();
    writeln!(keys, "G1 X50 F600").unwrap();
    client.wait("moving", is_moving);
    client.command("hold");
    client.wait("held", is_held);
    client.command("resume");
    client.wait("moving", is_moving);
    client.command("abort");
    let rest = client.wait("at rest", |s| {
        s["state"] == "standstill" && s["feed_mm_per_min"] == 0.0
    });
    // The position that is told follows a rough period behind.
    let settled =
        |s: &serde_json::Value| s["tick"].as_u64() > rest["tick"].as_u64().map(|tick| tick + 200);
    let rest = client.wait("settled", settled);
    let x = rest["position"]["x_mm"].as_f64().unwrap();
    assert!(x > 0.0 && x < 50.0, "{x}");
    writeln!(keys, "G91 G0 X-0.5").unwrap();
    client.wait("half a millimetre back", |s| {
        (s["position"]["x_mm"].as_f64().unwrap() - x + 0.5).abs() < 1e-6
    });
    drop(keys);
    let (output, _) = run.finish();
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert_eq!(String::from_utf8_lossy(&output.stdout).lines().count(), 2);
}

/// The client's word does what the typed one does, and is refused where there is nothing to take back.
#[test]
fn a_client_takes_back_the_fault_that_a_session_stands_in() {
    let (session, mut typed) = live();
    let mut client = session.connect();
    assert!(client.ask("{\"lease\":\"take\"}")["ok"].is_object());
    let refused = client.ask("{\"command\":\"reset\"}").to_string();
    assert!(refused.contains("there is no fault to reset"), "{refused}");
    writeln!(typed, "G1 X200 F600").unwrap();
    client.wait("it moves", is_moving);
    assert!(
        client
            .ask("{\"command\":\"reset\"}")
            .to_string()
            .contains("there is no fault to reset")
    );
    client.command("emergency-stop");
    client.wait("it stands in fault", |status| {
        status["fault"].is_string() && status["state"] == "fault"
    });
    assert!(client.ask("{\"command\":\"reset\"}")["ok"].is_object());
    // The session opens its sockets anew.
    assert!(client.hear()["ended"]["fault"].is_string());
    while !client.hear().is_null() {}
    let mut client = session.connect();
    writeln!(typed, "G1 X200 F600").unwrap();
    client.wait("it moves again", is_moving);
    client.command("abort");
    drop(typed);
}
