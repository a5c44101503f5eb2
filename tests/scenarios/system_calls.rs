//! What the fine thread asks of the kernel while it runs.

use std::process::{Command, Stdio};

use tempfile::TempDir;

use crate::harness::{mill, root};

/// What the thread asks between its first and its last deadline: the sleep, and nothing else.
///
/// The clock is read without a call. A computer without that ability would show `clock_gettime`, and this test says so.
#[test]
fn the_fine_thread_only_sleeps() {
    let folder = TempDir::new().unwrap();
    let log = folder.path().join("calls");
    let strace = Command::new("strace")
        .args(["-f", "-ff", "-o"])
        .arg(&log)
        .arg(env!("CARGO_BIN_EXE_tandem"))
        .arg("run")
        .arg(root().join("examples/programs/square.ngc"))
        .arg("--machine")
        .arg(mill())
        .args([
            "--clock",
            "wall",
            "--set",
            "loops.max_missed_periods=1000000",
            "--set",
            "loops.max_missed_share=1",
        ])
        .stdin(Stdio::null())
        .output();
    let Ok(output) = strace else {
        println!("skipped: there is no strace here");
        return;
    };
    let logs = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| std::fs::read_to_string(entry.unwrap().path()).unwrap());
    let Some(fine) = logs.into_iter().find(|calls| sleeps(calls) > 100) else {
        assert!(
            !output.status.success(),
            "no thread slept with absolute deadlines"
        );
        println!(
            "skipped: strace may not trace here: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        return;
    };
    let lines: Vec<&str> = fine.lines().collect();
    let first = lines.iter().position(|line| is_sleep(line)).unwrap();
    let last = lines.iter().rposition(|line| is_sleep(line)).unwrap();
    let others: Vec<_> = lines[first..=last]
        .iter()
        .filter(|line| !is_sleep(line))
        .collect();
    assert!(
        others.is_empty(),
        "{} other calls: {:?}",
        others.len(),
        &others[..others.len().min(10)]
    );
}

fn is_sleep(line: &str) -> bool {
    line.starts_with("clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME")
}

fn sleeps(calls: &str) -> usize {
    calls.lines().filter(|line| is_sleep(line)).count()
}
