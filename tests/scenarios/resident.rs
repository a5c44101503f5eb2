//! The resident controller drives what `tandem run` drives.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::harness::root;

fn of_kind(folder: &str, extension: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(root().join(folder)).unwrap();
    let mut all: Vec<_> = entries
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == extension))
        .collect();
    all.sort();
    all
}

fn tandem(arguments: &[&std::ffi::OsStr]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tandem"))
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

/// Loads and starts a program of the folder on a controller; what its jobs left.
fn serve(machine: &Path, program: &Path, folder: &Path) -> (Output, PathBuf) {
    let name = program.file_name().unwrap().to_str().unwrap();
    let says = [
        (100, json!({ "id": 1, "request": "lease", "how": "take" })),
        (3000, json!({ "id": 2, "request": "load", "path": name })),
        (3010, json!({ "id": 3, "request": "start" })),
    ];
    let line = |(tick, say): &(u64, Value)| json!({ "tick": tick, "say": say }).to_string() + "\n";
    let requests = folder.join("requests.jsonl");
    std::fs::write(&requests, says.iter().map(line).collect::<String>()).unwrap();
    let record = folder.join("record");
    let output = tandem(&[
        "serve".as_ref(),
        "--clock".as_ref(),
        "virtual".as_ref(),
        "--machine".as_ref(),
        machine.as_ref(),
        "--programs".as_ref(),
        program.parent().unwrap().as_ref(),
        "--requests".as_ref(),
        requests.as_ref(),
        "--record".as_ref(),
        record.as_ref(),
    ]);
    (output, record.join("000001-program/trace.csv"))
}

/// Time, line, what was commanded, feed and the rest, without what the drives have read back.
fn commands(trace: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(trace).unwrap();
    let head: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let read_back = |at: usize| head[at].contains("_fb_") || head[at].starts_with("sig_");
    let row = |line: &str| {
        let cells = line.split(',').enumerate();
        let kept = cells.filter(|(at, _)| !read_back(*at));
        kept.map(|(_, cell)| cell).collect::<Vec<_>>().join(",")
    };
    text.lines().map(row).collect()
}

/// Every example program on every example machine that takes it: the same commands in every sample, bit for bit. Drives that have
/// been on for longer read back something else, to the noise of their encoders; where a feed strategy listens to that, the
/// commands follow it, and nothing is compared.
#[test]
fn the_controller_drives_every_example_as_run_does() {
    let mut same = 0;
    for machine in of_kind("examples/machines", "toml") {
        // Models of axes lie there too, which machine files include.
        let Ok(read) = tandem_machine::Machine::read(&machine, &[]) else {
            continue;
        };
        if read.feed_strategy.is_some() {
            continue;
        }
        for program in of_kind("examples/programs", "ngc") {
            let folder = TempDir::new().unwrap();
            let trace = folder.path().join("trace.csv");
            let run = tandem(&[
                "run".as_ref(),
                program.as_ref(),
                "--machine".as_ref(),
                machine.as_ref(),
                "--clock".as_ref(),
                "virtual".as_ref(),
                "--trace".as_ref(),
                trace.as_ref(),
            ]);
            if !run.status.success() {
                continue;
            }
            let (output, recorded) = serve(&machine, &program, folder.path());
            let place = format!("{} on {}", program.display(), machine.display());
            let told = String::from_utf8_lossy(&output.stdout);
            assert!(output.status.success(), "{place}: {told}");
            // A machine that is to be homed says so, where run trusts what simulated drives know.
            if told.contains("\"home\\\" homes it") {
                continue;
            }
            assert!(recorded.exists(), "{place}: {told}");
            let (expected, found) = (commands(&trace), commands(&recorded));
            let differs = expected.iter().zip(&found).position(|(a, b)| a != b);
            if let Some(row) = differs {
                panic!(
                    "{place}: row {row}: {} instead of {}",
                    found[row], expected[row]
                );
            }
            assert_eq!(expected.len(), found.len(), "{place}");
            same += 1;
        }
    }
    assert!(same >= 40, "{same} programs on machines");
}
