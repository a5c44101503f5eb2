//! `tandem tune` and `tandem batch`: what is found, that it does not depend on the computer, and what workers that are killed leave.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::thread::sleep;
use std::time::Duration;

use crate::harness::root;

const TOLERANCE: &str = "motion.path_tolerance_mm=0.002..0.05";
const SHARE: &str = "planner.options.tolerance_share=0.5..0.99";
const KEEP: &str = "max_path_deviation_mm<=0.015";

fn machine() -> PathBuf {
    root().join("examples/machines/mill-3axis-smooth.toml")
}

fn program(name: &str) -> String {
    root()
        .join(format!("examples/programs/{name}.ngc"))
        .display()
        .to_string()
}

fn tandem(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tandem"))
        .args(arguments)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// `tandem tune` of the corners in `folder`.
fn tune(folder: &Path, arguments: &[&str]) -> Output {
    let (machine, program) = (machine(), program("corners"));
    let of_all = [
        "tune",
        "--machine",
        machine.to_str().unwrap(),
        "--programs",
        &program,
        "--folder",
        folder.to_str().unwrap(),
    ];
    tandem(&[&of_all, arguments].concat())
}

/// `tandem batch submit` of a program in `folder`.
fn submit(folder: &Path, name: &str, arguments: &[&str]) {
    let (machine, program) = (machine(), program(name));
    let of_all = [
        "batch",
        "submit",
        folder.to_str().unwrap(),
        "--machine",
        machine.to_str().unwrap(),
        "--programs",
        &program,
    ];
    let submitted = tandem(&[&of_all, arguments].concat());
    assert!(submitted.status.success(), "{}", text(&submitted.stderr));
}

/// `tandem batch collect` of `folder` into a table.
fn collect_into(table: &Path, folder: &Path) {
    let collected = tandem(&[
        "batch",
        "collect",
        folder.to_str().unwrap(),
        "--sqlite",
        table.to_str().unwrap(),
    ]);
    assert!(collected.status.success(), "{}", text(&collected.stderr));
}

/// The lines but those that name files.
fn found(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let all = text(&output.stdout);
    let lines = all
        .lines()
        .filter(|line| !line.starts_with("report:") && !line.starts_with("settings:"));
    lines.collect::<Vec<_>>().join("\n")
}

/// The results in a folder, and whatever else is left among them.
fn results(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    tandem_rig::files(&folder.join("results"))
}

/// Rows of a table of results by the names of its columns.
fn rows(csv: &Path) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(csv).unwrap();
    reader.deserialize().map(Result::unwrap).collect()
}

#[test]
fn tune_finds_what_a_grid_of_400_has_as_its_best_within_one_percent_in_60_settings() {
    let folder = tempfile::tempdir().unwrap();
    let (grid, own) = (folder.path().join("grid"), folder.path().join("own"));
    let (tolerance, share) = (format!("{TOLERANCE}:20"), format!("{SHARE}:20"));
    submit(
        &grid,
        "corners",
        &["--local", "--vary", &tolerance, "--vary", &share],
    );
    let rows = rows(&grid.join("results.csv"));
    assert_eq!(rows.len(), 400);
    let number = |row: &BTreeMap<String, String>, key: &str| row[key].parse::<f64>().unwrap();
    let kept = rows
        .iter()
        .filter(|row| number(row, "max_path_deviation_mm") <= 0.015);
    let times: Vec<f64> = kept.map(|row| number(row, "motion_time_s")).collect();
    let best_s = times.iter().copied().fold(f64::INFINITY, f64::min);
    // Else there is nothing to be found.
    let slowest_s = times.iter().copied().fold(0.0, f64::max);
    assert!(
        times.len() > 50 && times.len() < 400 && slowest_s > 1.03 * best_s,
        "{} {best_s} {slowest_s}",
        times.len()
    );
    for seed in ["1", "2", "3"] {
        let apply = folder.path().join("tuned.toml");
        let output = tune(
            &own.join(seed),
            &[
                "--vary",
                TOLERANCE,
                "--vary",
                SHARE,
                "--keep",
                KEEP,
                "--budget",
                "60",
                "--seed",
                seed,
                "--apply",
                apply.to_str().unwrap(),
            ],
        );
        let tried: u32 = found(&output).split(' ').next().unwrap().parse().unwrap();
        assert!(tried <= 60, "{}", found(&output));
        let summary = folder.path().join("summary.json");
        let run = tandem(&[
            "run",
            &program("corners"),
            "--machine",
            apply.to_str().unwrap(),
            "--summary",
            summary.to_str().unwrap(),
        ]);
        assert!(run.status.success(), "{}", text(&run.stderr));
        let summary: serde_json::Value =
            serde_json::from_slice(&fs::read(&summary).unwrap()).unwrap();
        let time_s = summary["motion_time_s"].as_f64().unwrap();
        assert!(summary["max_path_deviation_mm"].as_f64().unwrap() <= 0.015);
        assert!(
            time_s <= 1.01 * best_s,
            "seed {seed}: {time_s} s, the grid has {best_s} s"
        );
        assert!(
            found(&output).contains(&format!("time {time_s:.3} s")),
            "{}",
            found(&output)
        );
    }
}

#[test]
fn the_same_seed_finds_the_same_on_any_number_of_threads_and_after_a_kill() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "--vary",
        TOLERANCE,
        "--vary",
        "planner.options.rounds=1,2,3",
        "--budget",
        "25",
    ];
    let of = |name: &str, more: &[&str]| {
        tune(&folder.path().join(name), &[&arguments[..], more].concat())
    };
    let one = found(&of("one", &["--threads", "1"]));
    assert_eq!(one, found(&of("two", &["--threads", "2"])));
    let killed = folder.path().join("killed");
    let (machine, corners) = (machine(), program("corners"));
    let done = || fs::read_dir(killed.join("results")).map_or(0, Iterator::count);
    // A job is given up at whose simulation the process has ended three times.
    for _ in 0..2 {
        let before = done();
        let mut child = Command::new(env!("CARGO_BIN_EXE_tandem"))
            .args([
                "tune",
                "--machine",
                machine.to_str().unwrap(),
                "--programs",
                &corners,
                "--folder",
                killed.to_str().unwrap(),
            ])
            .args(arguments)
            .stdout(std::process::Stdio::null())
            .spawn()
            .unwrap();
        while done() == before && child.try_wait().unwrap().is_none() {
            sleep(Duration::from_millis(10));
        }
        child.kill().unwrap();
        child.wait().unwrap();
    }
    // As one of them may have left it.
    fs::create_dir_all(killed.join("results")).unwrap();
    fs::write(killed.join("results/.tmpHalf"), "{").unwrap();
    assert_eq!(one, found(&of("killed", &[])));
    assert_eq!(results(&folder.path().join("one")), results(&killed));
    let page = fs::read_to_string(killed.join("report.html")).unwrap();
    for part in [
        "What each parameter does",
        "planner.options.rounds",
        "The path at",
        "chosen",
        "as it is",
    ] {
        assert!(page.contains(part), "{part} is not on the page");
    }
}

#[test]
fn workers_that_are_killed_lose_nothing_and_record_nothing_twice() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, shared) = (folder.path().join("whole"), folder.path().join("shared"));
    let varied = ["--vary", "motion.path_tolerance_mm=0.005..0.05:60"];
    submit(&whole, "square", &[&varied[..], &["--local"]].concat());
    submit(&shared, "square", &varied);
    let status = |to: &Path| tandem(&["batch", "status", to.to_str().unwrap()]);
    assert_eq!(status(&shared).status.code(), Some(3));
    let worker = |part: &str| {
        let shard = ["--shard", part, "--threads", "1"];
        let mut command = Command::new(env!("CARGO_BIN_EXE_tandem"));
        command
            .args(["batch", "worker", shared.to_str().unwrap()])
            .args(shard)
            .stdout(std::process::Stdio::null());
        command.spawn().unwrap()
    };
    // Two workers, the first of them killed again and again, and one more that is at the same jobs.
    let mut others = [worker("1/2"), worker("0/2")];
    let mut killed = 0;
    loop {
        let mut child = worker("0/2");
        // Longer each time: a job whose process ends three times is given up, and a busy computer takes its time for one.
        sleep(Duration::from_millis(250 << killed.min(4)));
        if child.try_wait().unwrap().is_some() {
            break;
        }
        child.kill().unwrap();
        child.wait().unwrap();
        killed += 1;
        if killed == 2 {
            others[1].kill().unwrap();
        }
    }
    for other in &mut others {
        other.wait().unwrap();
    }
    assert!(
        tandem(&["batch", "worker", shared.to_str().unwrap()])
            .status
            .success()
    );
    assert!(status(&shared).status.success());
    let (expected, found) = (results(&whole), results(&shared));
    assert_eq!(expected.len(), 60);
    assert_eq!(expected, found);
    collect_into(&folder.path().join("r.sqlite"), &shared);
    assert_eq!(
        fs::read(whole.join("results.csv")).unwrap(),
        fs::read(shared.join("results.csv")).unwrap()
    );
    assert!(
        fs::read(folder.path().join("r.sqlite"))
            .unwrap()
            .starts_with(b"SQLite format 3")
    );
}

/// What `script` prints when Python runs it with `arguments`; none where it cannot import what it needs.
fn python(script: &str, arguments: &[&str]) -> Option<String> {
    let mut command = Command::new("python3");
    let output = command.args(["-c", script]).args(arguments).output();
    let output = output.ok()?;
    let said = text(&output.stderr);
    if said.contains("ModuleNotFoundError") {
        return None;
    }
    assert!(output.status.success(), "{said}");
    Some(text(&output.stdout))
}

/// The query of docs/batch.md, as `DuckDB` answers it, and a like one of `SQLite`, beside what the rows say.
#[test]
fn duckdb_and_sqlite_read_the_table() {
    let folder = tempfile::tempdir().unwrap();
    let own = folder.path().join("own");
    let corners = program("corners");
    submit(
        &own,
        "corners",
        &[
            "--vary",
            "motion.path_tolerance_mm=0.005,0.0125,0.02",
            "--local",
        ],
    );
    let (csv, sqlite) = (own.join("results.csv"), own.join("results.sqlite"));
    collect_into(&sqlite, &own);
    let rows = rows(&csv);
    let number = |row: &BTreeMap<String, String>, key: &str| row[key].parse::<f64>().unwrap();
    let kept = rows
        .iter()
        .filter(|row| number(row, "max_path_deviation_mm") <= 0.015);
    let (time_s, tolerance_mm) = kept
        .map(|row| {
            (
                number(row, "motion_time_s"),
                number(row, "motion.path_tolerance_mm"),
            )
        })
        .reduce(|a, b| if b.0 < a.0 { b } else { a })
        .expect("a setting keeps the limit");
    // Else the limit would decide nothing.
    assert_eq!((rows.len(), tolerance_mm), (3, 0.0125));
    let page = fs::read_to_string(root().join("docs/batch.md")).unwrap();
    let (_, query) = page.split_once("```sql\n").unwrap();
    let (query, _) = query.split_once("```").unwrap();
    assert!(query.contains("'target/shop/results.csv'"));
    let query = query.replace("target/shop/results.csv", csv.to_str().unwrap());
    let answers = "import duckdb, sys\nfor row in duckdb.sql(sys.argv[1]).fetchall(): print(*row)";
    match python(answers, &[&query]) {
        Some(answer) => assert_eq!(answer, format!("{corners} {tolerance_mm:?} {time_s:?}\n")),
        None => println!("skipped: python3 has no duckdb"),
    }
    // What varied is compared as a number there, too.
    let query = "SELECT min(motion_time_s), typeof(\"motion.path_tolerance_mm\") FROM results \
                 WHERE ended = 'done' AND \"motion.path_tolerance_mm\" < 0.0126";
    let answers = "import sqlite3, sys\n\
                   for row in sqlite3.connect(sys.argv[1]).execute(sys.argv[2]): print(*row)";
    match python(answers, &[sqlite.to_str().unwrap(), query]) {
        Some(answer) => assert_eq!(answer, format!("{time_s:?} real\n")),
        None => println!("skipped: there is no python3 with sqlite3"),
    }
}

#[test]
fn another_build_that_gives_other_results_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let own = folder.path().join("own");
    submit(&own, "corners", &["--local"]);
    let (name, bytes) = results(&own).into_iter().next().unwrap();
    let other = text(&bytes).replace("\"binary\":\"", "\"binary\":\"0");
    let copy = own.join("results").join(format!("0{name}"));
    fs::write(&copy, &other).unwrap();
    let collect = || tandem(&["batch", "collect", own.to_str().unwrap()]);
    assert_eq!(
        collect().status.code(),
        Some(0),
        "the same numbers of another build are no difference"
    );
    fs::write(&copy, other.replacen("\"blocks\":", "\"blocks\":1", 1)).unwrap();
    let told = collect();
    assert_eq!(told.status.code(), Some(3));
    assert!(
        text(&told.stderr).contains("other results from other builds"),
        "{}",
        text(&told.stderr)
    );
    assert_eq!(rows(&own.join("results.csv"))[0]["builds_differ"], "1");
}

#[test]
fn what_cannot_be_tuned_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |arguments: &[&str], words: &str| {
        let output = tune(folder.path(), arguments);
        let said = text(&output.stderr);
        assert!(
            matches!(output.status.code(), Some(1 | 2)) && said.contains(words),
            "{arguments:?}: {said}"
        );
    };
    refused(&["--vary", "planner.options.rounds=3..1"], "not below");
    refused(
        &[
            "--vary",
            "planner.options.rounds=1,2",
            "--objective",
            "motion_tim_s",
            "--budget",
            "5",
        ],
        "did you mean motion_time_s?",
    );
    refused(
        &[
            "--vary",
            "planner.options.rounds=1,2",
            "--keep",
            "max_torque<=x",
        ],
        "no number",
    );
    refused(
        &[
            "--vary",
            "motion.path_tolerance_mm=0.1,0.2",
            "--budget",
            "3",
            "--set",
            "planner.plugin=none",
        ],
        "none of the settings could be driven",
    );
    refused(
        &["--vary", "motion.path_tolerence_mm=0.1,0.2"],
        "did you mean `motion.path_tolerance_mm`?",
    );
    refused(
        &["--vary", "planner.options.round=1,2", "--budget", "4"],
        "none of the settings could be driven",
    );
    let missing = tandem(&[
        "tune",
        "--machine",
        machine().to_str().unwrap(),
        "--programs",
        "no-such-*.ngc",
        "--vary",
        "planner.options.rounds=1,2",
    ]);
    assert_eq!(missing.status.code(), Some(1));
    assert!(text(&missing.stderr).contains("no file has such a name"));
    let empty = tandem(&[
        "batch",
        "worker",
        folder.path().join("nothing").to_str().unwrap(),
    ]);
    assert_eq!(empty.status.code(), Some(1));
    if cfg!(not(feature = "nats")) {
        let place = folder.path().to_str().unwrap();
        let at_a_server = tandem(&["batch", "status", place, "--nats", "127.0.0.1:4222"]);
        assert_eq!(at_a_server.status.code(), Some(1));
        assert!(text(&at_a_server.stderr).contains("build it with the feature nats"));
    }
}
