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

/// The program by a run of its own.
fn run(machine: &Path, program: &Path, trace: &Path) -> Output {
    tandem(&[
        "run".as_ref(),
        program.as_ref(),
        "--machine".as_ref(),
        machine.as_ref(),
        "--clock".as_ref(),
        "virtual".as_ref(),
        "--trace".as_ref(),
        trace.as_ref(),
    ])
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
    let read_back = |name: &&str| name.contains("_fb_") || name.starts_with("sig_");
    let kept: Vec<bool> = head.iter().map(|name| !read_back(name)).collect();
    let row = |line: &str| {
        let cells = line.split(',').zip(&kept);
        let kept = cells.filter(|(_, kept)| **kept);
        kept.map(|(cell, _)| cell).collect::<Vec<_>>().join(",")
    };
    text.lines().map(row).collect()
}

/// The same commands in every row.
fn assert_same(ours: &Path, theirs: &Path, place: &str) {
    let (expected, found) = (commands(ours), commands(theirs));
    let differs = expected.iter().zip(&found).position(|(a, b)| a != b);
    if let Some(row) = differs {
        panic!(
            "{place}: row {row}: {} instead of {}",
            found[row], expected[row]
        );
    }
    assert_eq!(expected.len(), found.len(), "{place}");
}

/// Every example program on some of the example machines that take it, and on all of them where `TANDEM_EVERY` is set: the same
/// commands in every sample, bit for bit. Where a feed strategy listens to the drives, the commands follow what those read back;
/// that is compared below.
#[test]
fn the_controller_drives_every_example_as_run_does() {
    let is_long = std::env::var_os("TANDEM_EVERY").is_some();
    let one_of = if is_long { 1 } else { 4 };
    let mut same = 0;
    for (nth_machine, machine) in of_kind("examples/machines", "toml").into_iter().enumerate() {
        // Models of axes lie there too, which machine files include.
        let Ok(read) = tandem_machine::Machine::read(&machine, &[]) else {
            continue;
        };
        if read.feed_strategy.is_some() {
            continue;
        }
        for (nth, program) in of_kind("examples/programs", "ngc").into_iter().enumerate() {
            if (nth + nth_machine) % one_of != 0 {
                continue;
            }
            let folder = TempDir::new().unwrap();
            let trace = folder.path().join("trace.csv");
            let run = run(&machine, &program, &trace);
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
            assert_same(&trace, &recorded, &place);
            same += 1;
        }
    }
    assert!(same * one_of >= 36, "{same} programs on machines");
}

/// What a feed strategy asks for differs by nothing but the noise of the currents: drives that have been on for longer are further
/// on in it. Without noise the controller drives what run does, bit for bit, and with it something else.
#[test]
fn a_feed_strategy_hears_the_same_of_the_drives_but_for_their_noise() {
    let folder = TempDir::new().unwrap();
    for part in [
        "force-demo.toml",
        "force-demo-x.toml",
        "force-demo-y.toml",
        "force-step.toml",
    ] {
        let text = std::fs::read_to_string(root().join("examples/machines").join(part)).unwrap();
        let quiet = text.replace("current_noise_ma = 5", "current_noise_ma = 0");
        assert_eq!(quiet != text, part == "force-demo.toml", "{part}");
        std::fs::write(folder.path().join(part), quiet).unwrap();
    }
    let quiet = folder.path().join("force-step.toml");
    let noisy = root().join("examples/machines/force-step.toml");
    let program = root().join("examples/programs/force-step.ngc");
    for machine in [&quiet, &noisy] {
        let own = TempDir::new().unwrap();
        let trace = own.path().join("trace.csv");
        let run = run(machine, &program, &trace);
        let said = String::from_utf8_lossy(&run.stderr);
        assert!(run.status.success(), "{said}");
        let (output, recorded) = serve(machine, &program, own.path());
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stdout)
        );
        if machine == &quiet {
            assert_same(&trace, &recorded, "without noise");
        } else {
            assert_ne!(
                commands(&trace),
                commands(&recorded),
                "the strategy listens"
            );
        }
    }
}
