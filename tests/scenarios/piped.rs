//! `tandem run -`: lines of a pipe are driven as they come.

use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Output, Stdio};

use tempfile::TempDir;

use crate::harness::{Scenario, judge_trace, mill, root};
use crate::operator::{Running, command};

fn piped(folder: &Path, machine: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tandem"));
    command
        .current_dir(folder)
        .args(["run", "-", "--machine"])
        .arg(machine)
        .args(["--trace", "trace.csv", "--summary", "summary.json"])
        .args(["--blocks", "blocks.csv"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

struct Piped {
    folder: TempDir,
    output: Output,
}

impl Piped {
    fn of(bytes: &[u8]) -> Self {
        Self::on(&mill(), bytes)
    }

    fn on(machine: &Path, bytes: &[u8]) -> Self {
        let folder = TempDir::new().unwrap();
        let mut child = piped(folder.path(), machine).spawn().unwrap();
        // A run that has ended early closes the pipe.
        let _ = child.stdin.take().unwrap().write_all(bytes);
        let output = child.wait_with_output().unwrap();
        Self { folder, output }
    }

    fn errors(&self) -> String {
        String::from_utf8_lossy(&self.output.stderr).into_owned()
    }

    fn file(&self, name: &str) -> String {
        std::fs::read_to_string(self.folder.path().join(name)).unwrap()
    }

    fn end(&self) -> [f64; 3] {
        let summary: serde_json::Value = serde_json::from_str(&self.file("summary.json")).unwrap();
        ["x", "y", "z"].map(|axis| summary["end_position_mm"][axis].as_f64().unwrap())
    }
}

/// What is written to it is driven while it is still open.
struct Open {
    pipe: ChildStdin,
    child: Child,
    folder: TempDir,
}

impl Open {
    fn begin() -> Self {
        let folder = TempDir::new().unwrap();
        let mut child = piped(folder.path(), &mill()).spawn().unwrap();
        let pipe = child.stdin.take().unwrap();
        Self {
            pipe,
            child,
            folder,
        }
    }
}

#[test]
fn a_pipe_is_driven_as_the_file_would_be() {
    for name in ["serpentine.ngc", "spiral.ngc"] {
        let program = root().join("examples/programs").join(name);
        let file = Scenario::of(&program).run();
        let pipe = Piped::of(&std::fs::read(&program).unwrap());
        assert_eq!(pipe.output.status.code(), Some(0), "{}", pipe.errors());
        for of in ["trace.csv", "blocks.csv"] {
            let same = pipe.file(of) == std::fs::read_to_string(file.file(of)).unwrap();
            assert!(same, "{name}: {of} is another one");
        }
        let said = String::from_utf8_lossy(&pipe.output.stdout);
        assert!(said.starts_with("standard input: "), "{said}");
    }
}

#[test]
fn the_end_of_a_program_ends_the_run_though_the_pipe_is_open() {
    for text in ["F600 G1 X5\nM2\n", "%\nF600 G1 X5\n%\n"] {
        let mut open = Open::begin();
        open.pipe.write_all(text.as_bytes()).unwrap();
        open.pipe.flush().unwrap();
        assert_eq!(open.child.wait().unwrap().code(), Some(0), "{text}");
        let text = std::fs::read_to_string(open.folder.path().join("summary.json")).unwrap();
        assert!(text.contains("\"x\": 5.0"), "{text}");
    }
}

#[test]
fn a_line_that_is_wrong_ends_the_run_behind_those_before_it() {
    let pipe = Piped::of(b"G1 X10 F600\nX20\nX999\nX0\n");
    assert_eq!(pipe.output.status.code(), Some(3), "{}", pipe.errors());
    assert!(
        pipe.errors()
            .contains("input:3:1: error: X would reach 999 mm"),
        "{}",
        pipe.errors()
    );
    assert_eq!(pipe.end(), [20.0, 0.0, 0.0]);
    let truncated = Piped::of(b"%\nG1 X10 F600\n");
    assert_eq!(truncated.output.status.code(), Some(3));
    assert!(truncated.errors().contains("the program is truncated"));
}

#[test]
fn what_a_pipe_may_hold_besides_lines() {
    let long = [b"(".to_vec(), vec![b'x'; 100_000], b")\nG1 X30\n".to_vec()].concat();
    let text = [
        b"(\xe4\xff latin)\r\nG1 X10 F600\r\n\n; \x80\nX20\n".as_slice(),
        &long,
    ]
    .concat();
    let pipe = Piped::of(&text);
    assert_eq!(pipe.output.status.code(), Some(3));
    assert!(pipe.errors().contains("input:6:1"), "{}", pipe.errors());
    assert_eq!(pipe.end(), [20.0, 0.0, 0.0]);
    // What has no end needs no memory: a run that is refused at its first line reads no further than a pipe holds.
    let zeros = Piped::of(&vec![0; 1 << 20]);
    assert_eq!(zeros.output.status.code(), Some(3), "{}", zeros.errors());
}

#[test]
fn a_probe_a_dwell_and_an_input_are_answered_before_what_follows() {
    let machine = root().join("examples/machines/mill-probe.toml");
    let text =
        "G0 X-20\nF600 G38.2 Z-20\n#31=#5063\nG4 P0.1\nM66 P9 L3 Q0.2\nG0 Z[#31 + 5]\nG0 X#5399\n";
    let pipe = Piped::on(&machine, text.as_bytes());
    assert_eq!(pipe.output.status.code(), Some(0), "{}", pipe.errors());
    let [x, _, z] = pipe.end();
    assert_eq!(x, -1.0, "the input did not answer in time");
    assert!((z - (5.0 - 5.3)).abs() < 1e-6, "{z}");
}

/// Real time: the machine stands at the end of the first lines until more come, and goes on from there on the path.
#[test]
fn a_pipe_that_stalls_leaves_the_machine_at_rest_at_the_end_of_its_last_line() {
    const FIRST: &str = "G21 G90 F3000\nG1 X5\nX10 Y3\nX15\n";
    const MORE: &str = "X20 Y0\nX30\nM2\n";
    let mut run = Running::start_with(&format!("{FIRST}{MORE}"), |folder| {
        let mut streamed = command(folder, &[]);
        let arguments: Vec<_> = streamed.get_args().map(ToOwned::to_owned).collect();
        streamed = Command::new(env!("CARGO_BIN_EXE_tandem"));
        streamed
            .current_dir(folder)
            .args(arguments.iter().map(|argument| {
                if argument == "p.ngc" {
                    "-".as_ref()
                } else {
                    argument.as_os_str()
                }
            }))
            .stdin(Stdio::piped())
            .stderr(Stdio::piped());
        streamed.spawn().unwrap()
    });
    let mut pipe = run.child().stdin.take().unwrap();
    let mut client = run.connect();
    pipe.write_all(FIRST.as_bytes()).unwrap();
    client.wait("at the end of the first lines", |status| {
        status["position"]["x_mm"] == 15.0 && status["feed_mm_per_min"] == 0.0
    });
    pipe.write_all(MORE.as_bytes()).unwrap();
    let mut told = String::new();
    let status = run.child().wait().unwrap();
    run.child()
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut told)
        .unwrap();
    assert_eq!(status.code(), Some(0), "{told}");
    drop(pipe);
    let verdict = judge_trace(&run.at("trace.csv"), &run.at("p.ngc"), &mill(), |_| ());
    assert!(verdict.passed(), "{verdict}");
}
