//! Running the `tandem` binary and judging its trace.

use std::ffi::OsStr;
use std::io::{Seek, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use serde_json::Value;
use tandem_oracle::{Machine, Options, Trace, Verdict, judge};
use tandem_rig::record_case;
use tempfile::TempDir;

/// The folder of the workspace.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .canonicalize()
        .unwrap()
}

/// The machine that every example runs on.
pub fn mill() -> PathBuf {
    root().join("examples/machines/mill-3axis.toml")
}

/// A run in the making.
pub struct Scenario {
    folder: TempDir,
    program: PathBuf,
    machine: PathBuf,
    arguments: Vec<String>,
    input: &'static str,
}

/// What is not counted either where nobody asked for less than the plan.
pub const UNDISTURBED: [&str; 3] = ["governed_samples", "jerk_relaxed_samples", "starvations"];

/// What a run left.
pub struct Done {
    pub output: Output,
    folder: TempDir,
    program: PathBuf,
    machine: PathBuf,
}

impl Scenario {
    /// Runs the file `program` on the mill.
    pub fn of(program: &Path) -> Self {
        Self {
            folder: TempDir::new().unwrap(),
            program: program.to_owned(),
            machine: mill(),
            arguments: vec![],
            input: "",
        }
    }

    /// Runs the program text on the mill.
    pub fn text(program: &str) -> Self {
        let mut this = Self::of(Path::new(""));
        this.program = this.folder.path().join("program.ngc");
        std::fs::write(&this.program, program).unwrap();
        this
    }

    /// On another machine.
    pub fn on(mut self, machine: &Path) -> Self {
        machine.clone_into(&mut self.machine);
        self
    }

    /// With further arguments.
    pub fn with(mut self, arguments: &[&str]) -> Self {
        self.arguments
            .extend(arguments.iter().map(|a| (*a).to_string()));
        self
    }

    /// With something typed on standard input.
    pub fn typing(mut self, input: &'static str) -> Self {
        self.input = input;
        self
    }

    /// With operator commands, a line each.
    pub fn commands(self, lines: &str) -> Self {
        let path = self.folder.path().join("commands.csv");
        std::fs::write(&path, lines).unwrap();
        let path = path.to_string_lossy().into_owned();
        self.with(&["--commands", &path])
    }

    /// With the file of what is switched.
    pub fn events(self) -> Self {
        let path = self
            .folder
            .path()
            .join("events.csv")
            .to_string_lossy()
            .into_owned();
        self.with(&["--events", &path])
    }

    /// Runs it.
    pub fn run(self) -> Done {
        self.record();
        let at = |name: &str| self.folder.path().join(name);
        let output = Command::new(env!("CARGO_BIN_EXE_tandem"))
            .arg("run")
            .arg(&self.program)
            .arg("--machine")
            .arg(&self.machine)
            .args(["--trace".as_ref(), at("trace.csv").as_os_str()])
            .args(["--summary".as_ref(), at("summary.json").as_os_str()])
            .args(["--blocks".as_ref(), at("blocks.csv").as_os_str()])
            .args(&self.arguments)
            .stdin(typed(self.input))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .and_then(wait)
            .unwrap();
        Done {
            output,
            folder: self.folder,
            program: self.program,
            machine: self.machine,
        }
    }

    /// Keeps the case for the comparison of two builds, where one is asked for.
    fn record(&self) {
        let arguments = [
            OsStr::new("run"),
            self.program.as_os_str(),
            OsStr::new("--machine"),
            self.machine.as_os_str(),
        ];
        record_case(
            arguments
                .into_iter()
                .chain(self.arguments.iter().map(OsStr::new)),
            self.input,
        );
    }
}

/// Standard input that gives `text` and then ends.
fn typed(text: &str) -> Stdio {
    let mut file = tempfile::tempfile().unwrap();
    file.write_all(text.as_bytes()).unwrap();
    file.rewind().unwrap();
    file.into()
}

/// Waits for a run; one that never ends is ended, so that a defect shows as a failure and not as a full disk.
fn wait(mut child: Child) -> std::io::Result<Output> {
    for _ in 0..PATIENCE {
        if child.try_wait()?.is_some() {
            return child.wait_with_output();
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill()?;
    child.wait_with_output()
}

/// How often [`wait`] looks, 2 ms apart at least: a busy computer takes a minute for what takes seconds elsewhere.
const PATIENCE: u32 = 150_000;

impl Done {
    /// Exit status.
    pub fn status(&self) -> i32 {
        self.output
            .status
            .code()
            .expect("the run was ended: it went on for minutes")
    }

    /// What was printed to standard error.
    pub fn errors(&self) -> String {
        String::from_utf8_lossy(&self.output.stderr).into_owned()
    }

    /// A file that the run may have written.
    pub fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The summary.
    pub fn summary(&self) -> Value {
        let text = std::fs::read_to_string(self.file("summary.json"));
        serde_json::from_str(&text.unwrap_or_else(|_| panic!("no summary: {}", self.errors())))
            .unwrap()
    }

    /// A number of the summary.
    pub fn number(&self, key: &str) -> f64 {
        self.summary()[key].as_f64().unwrap()
    }

    /// A column of the trace.
    pub fn column(&self, name: &str) -> Vec<f64> {
        self.cells(name)
            .iter()
            .map(|cell| cell.parse().unwrap())
            .collect()
    }

    /// A column of the trace as text.
    pub fn cells(&self, name: &str) -> Vec<String> {
        column(&self.file("trace.csv"), name)
    }

    /// A column of the blocks file as text.
    pub fn block_cells(&self, name: &str) -> Vec<String> {
        column(&self.file("blocks.csv"), name)
    }

    /// The oracle's verdict with the machine's own options, changed by `adjust`.
    pub fn judge(&self, adjust: impl FnOnce(&mut Options)) -> Verdict {
        judge_trace(
            &self.file("trace.csv"),
            &self.program,
            &self.machine,
            adjust,
        )
    }

    /// Exit status 0, nothing beyond a limit and no stop by the guard; and nothing in the counters `also`. `what` says which run it
    /// was.
    pub fn assert_driven(&self, what: &str, also: &[&str]) {
        assert_eq!(self.status(), 0, "{what}: {}", self.errors());
        for count in ["limit_violations", "guard_stops"].iter().chain(also) {
            assert_eq!(self.number(count), 0.0, "{what}: {count}");
        }
    }

    /// *Within limits* as the design defines it: exit 0, all blocks, end reached, nothing stopped or governed, and the
    /// oracle passes. The path is exact: samples on it, corners cut by no more than a chord between two samples.
    pub fn assert_within_limits(&self) -> Verdict {
        self.assert_driven(
            "",
            &["governed_samples", "jerk_relaxed_samples", "lost_samples"],
        );
        let chord_mm = self.fastest_mm_per_s() * self.number("fine_period_s") / 2.0;
        let verdict = self.judge(|options| {
            options.sample_tolerance_mm = Some(2e-6);
            options.vertex_tolerance_mm = Some(chord_mm.max(1e-6));
        });
        assert!(verdict.passed(), "{}\n{verdict}", self.program.display());
        verdict
    }

    /// The same of a planner that rounds corners within the tolerance in force and lets two blocks overlap.
    pub fn assert_within_tolerance(&self) -> Verdict {
        self.assert_driven(
            "",
            &["governed_samples", "jerk_relaxed_samples", "lost_samples"],
        );
        let verdict = self.judge(overlapping);
        assert!(verdict.passed(), "{}\n{verdict}", self.program.display());
        verdict
    }

    fn fastest_mm_per_s(&self) -> f64 {
        self.column("feed_mm_s").into_iter().fold(0.0, f64::max)
    }
}

/// For a planner of continuous velocity with overlaps of at most 0.2 s, whatever planner the machine file names.
pub fn overlapping(options: &mut Options) {
    (
        options.speed_difference_mm_per_s,
        options.speed_difference_deg_per_s,
    ) = (Some(0.0), Some(0.0));
    options.feed_window_s = Some(0.2);
}

/// The oracle's verdict on a trace file.
pub fn judge_trace(
    trace: &Path,
    program: &Path,
    machine: &Path,
    adjust: impl FnOnce(&mut Options),
) -> Verdict {
    let machine = Machine::read(machine).unwrap();
    let trace = Trace::read(trace).unwrap();
    let mut options = Options::for_machine(&machine);
    adjust(&mut options);
    judge(
        &trace,
        &std::fs::read_to_string(program).unwrap(),
        &machine,
        &options,
    )
}

/// A column of a CSV file as text.
fn column(file: &Path, name: &str) -> Vec<String> {
    let mut reader = csv::Reader::from_path(file).unwrap();
    let headers = reader.headers().unwrap();
    let index = headers.iter().position(|h| h == name).unwrap();
    reader
        .records()
        .map(|row| row.unwrap()[index].to_string())
        .collect()
}

/// The share of the time in motion in which `limit` binds, as the report `html` says it, percent.
pub fn percent_binding(html: &str, limit: &str) -> f64 {
    let after = html
        .split("what binds, of the time in motion<td>")
        .nth(1)
        .unwrap();
    let shares = after.split('<').next().unwrap();
    let share = shares
        .split(", ")
        .find_map(|word| word.strip_prefix(limit))
        .unwrap_or_else(|| panic!("{shares}"));
    share.trim_end_matches('%').trim().parse().unwrap()
}

/// The command that takes lines of the operator: `tandem jog` or `tandem mdi` in `folder`, with a trace and pipes on all sides.
pub fn operator_command(name: &str, folder: &Path, machine: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tandem"));
    command
        .current_dir(folder)
        .args([name, "--trace", "trace.csv", "--machine"])
        .arg(machine)
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}
