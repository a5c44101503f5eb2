//! Files of a run that cannot be written to their end: said at once, and the motion does what the machine file says.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use tandem_gcode::Program;
use tandem_host::{Clock, Registry, Run, RunObserver, Switches, Timed};
use tandem_machine::Machine;
use tandem_recorder::Summary;
use tandem_rings::Sample;
use tempfile::TempDir;

use crate::harness::{mill, root};

/// Most that a file may hold in [`limited`], in the blocks of 512 or 1024 bytes of the shell that is there.
const MAX_BLOCKS: u32 = 60;

/// What a run left.
struct Ran {
    status: i32,
    said: String,
    errors: String,
    folder: TempDir,
}

impl Ran {
    fn of(output: &Output, folder: TempDir) -> Self {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        Self {
            status: output.status.code().unwrap(),
            said: text(&output.stdout),
            errors: text(&output.stderr),
            folder,
        }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn summary(&self) -> Value {
        let text = std::fs::read_to_string(self.at("summary.json"));
        serde_json::from_str(&text.unwrap_or_else(|_| panic!("no summary: {}", self.errors)))
            .unwrap()
    }

    /// What was written of the file stays, and it has not taken its name.
    fn assert_part_stays(&self, name: &str) {
        let part = self.at(&format!("{name}.part"));
        assert!(
            std::fs::metadata(&part).is_ok_and(|part| part.len() > 10_000),
            "{}",
            self.errors
        );
        assert!(!self.at(name).exists());
        assert!(
            self.errors
                .contains(&format!("what is written stays in {}", part.display())),
            "{}",
            self.errors
        );
    }
}

/// Runs an example where no file may grow beyond [`MAX_BLOCKS`].
fn limited(program: &str, files: &[(&str, &str)], arguments: &[&str]) -> Ran {
    let folder = TempDir::new().unwrap();
    let mut command = Command::new("sh");
    // A signal that is ignored stays ignored behind exec: the write fails instead.
    command.args([
        "-c",
        &format!("trap '' XFSZ; ulimit -f {MAX_BLOCKS}; exec \"$@\""),
        "sh",
    ]);
    command
        .arg(env!("CARGO_BIN_EXE_tandem"))
        .arg("run")
        .arg(example(program))
        .arg("--machine")
        .arg(mill());
    command
        .arg("--summary")
        .arg(folder.path().join("summary.json"));
    for (option, name) in files {
        command.arg(option).arg(folder.path().join(name));
    }
    let output = command
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    Ran::of(&output, folder)
}

fn example(program: &str) -> PathBuf {
    root().join("examples/programs").join(program)
}

/// It was silent to the end, then exit status 1, no outcome, no summary, and the trace was deleted.
#[test]
fn a_full_disk_is_said_at_once_and_the_motion_goes_on() {
    for (program, option, name, what) in [
        ("square.ngc", "--trace", "trace.csv", "trace"),
        ("spiral.ngc", "--trace", "trace.ttr", "trace"),
        ("spiral.ngc", "--blocks", "blocks.csv", "blocks"),
    ] {
        let ran = limited(program, &[(option, name)], &[]);
        assert_eq!(ran.status, 3, "{}", ran.errors);
        assert!(
            ran.errors.contains(&format!("error: {what}: ")),
            "{}",
            ran.errors
        );
        assert!(
            ran.errors
                .contains("it cannot be written any further, from "),
            "{}",
            ran.errors
        );
        assert!(
            ran.errors.contains("the motion goes on without that file"),
            "{}",
            ran.errors
        );
        assert_eq!(
            ran.errors.matches("cannot be written").count(),
            1,
            "once: {}",
            ran.errors
        );
        ran.assert_part_stays(name);
        assert!(
            ran.said.contains(&format!("{name}.part, not complete")),
            "{}",
            ran.said
        );
        let summary = ran.summary();
        assert_eq!(
            (&summary["fault"], &summary["record_errors"][0]["what"]),
            (&Value::Null, &Value::from(what))
        );
        let whole = limited(program, &[], &[]);
        assert_eq!(
            (whole.status, &whole.summary()["samples"]),
            (0, &summary["samples"]),
            "driven to its end"
        );
    }
}

#[test]
fn a_full_disk_holds_the_motion_where_the_machine_file_asks_for_it() {
    let ran = limited(
        "square.ngc",
        &[("--trace", "trace.csv")],
        &["--set", "recorder.on_error=hold"],
    );
    assert_eq!(ran.status, 3, "{}", ran.errors);
    ran.assert_part_stays("trace.csv");
    let summary = ran.summary();
    let fault = summary["fault"].as_str().unwrap();
    assert!(fault.starts_with("recorder: trace: "), "{fault}");
    let stop = &summary["stops"][0];
    assert_eq!(
        (&stop["cause"], &stop["rest"]),
        (&"soft fault".into(), &true.into()),
        "on the path: {stop}"
    );
    let failed_at = summary["record_errors"][0]["tick"].as_u64().unwrap();
    assert!(
        stop["tick"].as_u64().unwrap() <= failed_at + 16,
        "within two rough periods of tick {failed_at}: {stop}"
    );
}

/// Also what is written behind the motion, and the summary itself.
#[test]
fn every_file_that_cannot_be_written_gives_an_outcome_and_status_3() {
    let folder = TempDir::new().unwrap();
    let summary = folder.path().join("summary.json");
    for (option, what) in [
        ("--trace", "trace"),
        ("--blocks", "blocks"),
        ("--report", "report"),
        ("--summary", "summary"),
    ] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tandem"));
        command
            .arg("run")
            .arg(example("square.ngc"))
            .arg("--machine")
            .arg(mill())
            .args([option, "/dev/full"]);
        if option != "--summary" {
            command.arg("--summary").arg(&summary);
        }
        let output = command.stdin(Stdio::null()).output().unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let (said, errors) = (text(&output.stdout), text(&output.stderr));
        assert_eq!(output.status.code(), Some(3), "{errors}");
        assert!(
            errors.contains(&format!(
                "error: {what}: /dev/full: it cannot be written any further"
            )),
            "{errors}"
        );
        assert!(
            said.contains("5 blocks, 80.000 mm") && said.contains(&format!("{what}: not complete")),
            "{said}"
        );
        if option != "--summary" {
            let read: Value =
                serde_json::from_str(&std::fs::read_to_string(&summary).unwrap()).unwrap();
            assert_eq!(read["record_errors"][0]["what"], what);
        }
    }
}

/// The trace has filled the disk, and the summary is to lie on the same one: its room was taken before.
#[test]
fn the_summary_is_written_where_the_trace_has_filled_the_disk() {
    let folder = TempDir::new().unwrap();
    let disk = folder.path().join("disk");
    std::fs::create_dir(&disk).unwrap();
    let script = "mount -t tmpfs -o size=100k tmpfs \"$1\" || exit 77; disk=$1; out=$2; shift 2
        \"$@\" --trace \"$disk/t.csv\" --summary \"$disk/s.json\"; status=$?
        ls \"$disk\" > \"$out/ls\"; cp \"$disk/s.json\" \"$out/s.json\"; exit $status";
    let mut command = Command::new("unshare");
    command
        .args([
            "--user",
            "--map-root-user",
            "--mount",
            "sh",
            "-c",
            script,
            "sh",
        ])
        .arg(&disk)
        .arg(folder.path());
    command
        .arg(env!("CARGO_BIN_EXE_tandem"))
        .arg("run")
        .arg(example("square.ngc"))
        .arg("--machine")
        .arg(mill());
    let output = command.stdin(Stdio::null()).output();
    let Some(output) = output.ok().filter(|output| output.status.code() == Some(3)) else {
        println!("skipped: this computer lets nobody mount a small disk");
        return;
    };
    let files = std::fs::read_to_string(folder.path().join("ls")).unwrap();
    assert_eq!(
        files.lines().collect::<Vec<_>>(),
        ["s.json", "t.csv.part"],
        "{output:?}"
    );
    let summary: Value =
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("s.json")).unwrap())
            .unwrap();
    assert_eq!(summary["record_errors"][0]["what"], "trace");
}

/// Says at a tick that a file cannot be written any further; somebody is there, or nobody.
struct Failing {
    at: u64,
    attended: bool,
    last: Sample,
    notes: Vec<String>,
}

impl RunObserver for Failing {
    fn note(&mut self, note: &str) {
        self.notes.push(note.to_string());
    }

    fn is_attended(&self) -> bool {
        self.attended
    }

    fn broken_record(&mut self) -> Option<String> {
        let broken = self.last.tick >= self.at;
        self.at = if broken { u64::MAX } else { self.at };
        broken.then(|| "trace: no room".to_string())
    }

    fn sample(&mut self, sample: &Sample, _deviation_mm: f64, _signals: &[f64]) {
        self.last = *sample;
    }
}

fn failing(attended: bool, mode: &str, commands: &[&str]) -> (Summary, Failing) {
    let mut registry = Registry::default();
    for plugin in [tandem_sim::PLUGIN, tandem_look_ahead::PLUGIN] {
        registry.register(plugin).unwrap();
    }
    let settings = [("recorder.on_error".to_string(), mode.to_string())];
    let machine = Machine::read(&mill(), &settings).unwrap();
    let program = Program::open(Path::new(&example("square.ngc"))).unwrap();
    let run = Run::prepare(machine, &registry, program, Switches::default()).unwrap();
    let mut observer = Failing {
        at: 300,
        attended,
        last: Sample::default(),
        notes: vec![],
    };
    let commands: Vec<_> = commands
        .iter()
        .map(|line| Timed::parse(line).unwrap())
        .collect();
    let summary = run
        .drive(Clock::Virtual, &commands, &mut observer)
        .unwrap()
        .summary;
    (summary, observer)
}

/// With an operator the hold is one like any other: a resume goes on to the end of the program.
#[test]
fn an_operator_resumes_a_hold_for_a_file_that_cannot_be_written() {
    let (whole, _) = failing(false, "continue", &[]);
    let (summary, observer) = failing(true, "hold", &["700,resume"]);
    assert_eq!(summary.fault, None);
    assert_eq!(summary.end_position_mm, whole.end_position_mm);
    assert_eq!(
        (summary.stops[0].cause, summary.stops[0].rest),
        ("hold", true)
    );
    assert!(
        observer
            .notes
            .iter()
            .any(|note| note.contains("a resume goes on without that file")),
        "{:?}",
        observer.notes
    );
    let (alone, _) = failing(false, "hold", &["700,resume"]);
    assert_eq!(alone.stops[0].cause, "soft fault");
    assert!(alone.fault.unwrap().contains("recorder: trace: no room"));
}

/// `--trace -` made a file called `-`.
#[test]
fn a_file_called_minus_is_standard_output() {
    let folder = TempDir::new().unwrap();
    let run = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tandem"));
        command
            .arg("run")
            .arg(example("square.ngc"))
            .arg("--machine")
            .arg(mill())
            .args(arguments);
        command
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .output()
            .unwrap()
    };
    let named = run(&["--trace", "named.csv"]);
    let piped = run(&["--trace", "-"]);
    assert_eq!(
        (named.status.code(), piped.status.code()),
        (Some(0), Some(0))
    );
    assert!(
        piped.stdout == std::fs::read(folder.path().join("named.csv")).unwrap(),
        "the trace and nothing else"
    );
    assert!(
        String::from_utf8_lossy(&piped.stderr).contains("5 blocks, 80.000 mm"),
        "the outcome"
    );
    assert!(!folder.path().join("-").exists() && !folder.path().join("-.part").exists());
    let summary: Value = serde_json::from_slice(&run(&["--summary", "-"]).stdout).unwrap();
    assert_eq!(summary["blocks"], 5);
    let both = run(&["--summary", "-", "--trace", "-"]);
    assert_eq!(both.status.code(), Some(1), "one of them");
    let mut mdi = Command::new(env!("CARGO_BIN_EXE_tandem"));
    mdi.arg("mdi")
        .arg("--machine")
        .arg(mill())
        .args(["--trace", "-"])
        .current_dir(folder.path());
    let refused = mdi.stdin(Stdio::null()).output().unwrap();
    assert_eq!(refused.status.code(), Some(2));
    assert!(
        String::from_utf8_lossy(&refused.stderr)
            .contains("standard output carries other text here")
    );
}
