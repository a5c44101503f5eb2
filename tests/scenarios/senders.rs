//! Senders as people install them drive the simulated machine of `tandem serve` through a terminal. Where one is not installed
//! (`tests/senders/install` does that) its test says so and is skipped.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process, kill_process_group};
use serde_json::Value;

use crate::harness::{judge_trace, mill};

/// Lines that each sender streams, where `TANDEM_SENDER_LINES` names no other number: a quarter of a minute of motion.
const LINES: usize = 2000;
/// Lines of a program that is broken off: some seconds of motion.
const SOME_LINES: usize = 800;
/// How soon a sender is to have found the machine ready, s.
const CONNECTED_WITHIN_S: f64 = 3.0;
/// Longest time that a sender may take, s, on a computer that is busy otherwise.
const PATIENCE_S: u64 = 300;

fn root() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    root.canonicalize().unwrap()
}

/// The folder of the senders, where `what` of them is installed there.
fn senders(what: &str) -> Option<PathBuf> {
    let named = std::env::var_os("TANDEM_SENDERS").map(PathBuf::from);
    let folder = named.unwrap_or_else(|| root().join("target/senders"));
    let there = folder.join(what).exists();
    if !there {
        let shown = folder.display();
        println!("skipped: {what} is not in {shown}: tests/senders/install puts it there");
    }
    there.then_some(folder)
}

fn lines() -> usize {
    let named = std::env::var("TANDEM_SENDER_LINES");
    named.map_or(LINES, |number| number.parse().unwrap())
}

fn tandem() -> Command {
    Command::new(env!("CARGO_BIN_EXE_tandem"))
}

/// A controller of a simulated mill, with a terminal for senders.
struct Serving {
    child: Child,
    folder: tempfile::TempDir,
}

impl Serving {
    fn begin() -> Self {
        Self::with(&[])
    }

    fn with(arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let machine = root().join("examples/machines/mill-3axis.toml");
        let child = tandem()
            .args(["serve", "--no-state", "--machine"])
            .arg(machine)
            .arg("--listen")
            .arg(folder.path().join("socket"))
            .arg("--grbl-pty")
            .arg(folder.path().join("ttyTandem"))
            .arg("--record")
            .arg(folder.path().join("jobs"))
            // A busy computer misses periods; what is asked here is what the sender and the machine agree upon.
            .args(["--set", "loops.max_missed_periods=100000"])
            .args(["--set", "loops.max_missed_share=1"])
            .args(arguments)
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let this = Self { child, folder };
        let begun = Instant::now();
        while !this.terminal().exists() || !this.folder.path().join("socket").exists() {
            assert!(
                begun.elapsed() < Duration::from_mins(1),
                "it does not serve"
            );
            thread::sleep(Duration::from_millis(20));
        }
        this
    }

    /// The first status that `is` what is waited for.
    fn wait(&self, what: &str, is: impl Fn(&Value) -> bool) -> Value {
        let begun = Instant::now();
        loop {
            let status = self.ask("status");
            if is(&status) {
                return status;
            }
            assert!(
                begun.elapsed() < Duration::from_secs(PATIENCE_S),
                "never {what}: {status}"
            );
            thread::sleep(Duration::from_millis(20));
        }
    }

    fn terminal(&self) -> PathBuf {
        self.folder.path().join("ttyTandem")
    }

    /// The file of a program with so many lines of motion.
    fn program(&self, lines: usize) -> PathBuf {
        let path = self.folder.path().join("program.nc");
        fs::write(&path, program(lines)).unwrap();
        path
    }

    fn ask(&self, request: &str) -> Value {
        let output = tandem()
            .arg("ask")
            .arg("--connect")
            .arg(self.folder.path().join("socket"))
            .arg(request)
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let answer: Value = serde_json::from_str(text.trim()).unwrap_or_else(|e| {
            panic!(
                "{request}: {e}: {text}{}",
                String::from_utf8_lossy(&output.stderr)
            )
        });
        answer.get("ok").cloned().unwrap_or(answer)
    }

    /// What is asked of every sender: the program's end to the bit, nothing beyond a limit, its time.
    fn judge(&self) {
        let begun = Instant::now();
        let status = loop {
            let status = self.ask("status");
            if status["state"] == "ready" || begun.elapsed() > Duration::from_secs(20) {
                break status;
            }
            thread::sleep(Duration::from_millis(100));
        };
        assert_eq!(status["state"], "ready", "{status}");
        assert!(is_at_end(&status), "{status}");
        for counter in ["guard_stops", "limit_violations"] {
            assert_eq!(status["counters"][counter], 0, "{status}");
        }
        let history = self.ask("history");
        let jobs = history["jobs"].as_array().unwrap();
        assert!(jobs.iter().all(|job| job["outcome"] == "done"), "{history}");
        let times_s: Vec<f64> = jobs
            .iter()
            .map(|job| job["time_s"].as_f64().unwrap())
            .collect();
        let (took_s, alone_s) = (times_s.iter().sum::<f64>(), self.alone_s());
        println!(
            "motion {took_s:.2} s, a run {alone_s:.2} s, {} jobs",
            jobs.len()
        );
        assert!(took_s >= alone_s * 0.99, "{history}");
        // Jobs are more than one only where this computer was too busy to hand lines on in time: none of them is the program.
        if jobs.len() == 1 {
            // How soon a sender hands its lines on is this computer's affair: its time is judged where somebody asked for it.
            assert!(!is_timed() || took_s <= alone_s * 1.05, "{history}");
            self.judge_samples();
        } else {
            println!(
                "skipped: the computer was too busy for one job, whose samples would be judged"
            );
        }
    }

    /// The oracle's verdict on the only job.
    fn judge_samples(&self) {
        let trace = self.folder.path().join("jobs/000001-mdi/trace.csv");
        let program = self.folder.path().join("program.nc");
        let verdict = judge_trace(&trace, &program, &mill(), |_| ());
        assert!(verdict.passed(), "{verdict}");
    }

    fn alone_s(&self) -> f64 {
        let summary = self.folder.path().join("summary.json");
        let status = tandem()
            .arg("run")
            .arg(self.folder.path().join("program.nc"))
            .arg("--machine")
            .arg(root().join("examples/machines/mill-3axis.toml"))
            .arg("--summary")
            .arg(&summary)
            .stdout(Stdio::null())
            .status()
            .unwrap();
        assert!(status.success());
        let summary: Value = serde_json::from_slice(&fs::read(summary).unwrap()).unwrap();
        summary["motion_time_s"].as_f64().unwrap()
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Whether the machine stands where the program ends, to the bit.
fn is_at_end(status: &Value) -> bool {
    let place = &status["position"];
    place["x_mm"].as_f64() == Some(-1.5) && place["y_mm"].as_f64() == Some(2.25)
}

/// A spiral in short chords, and a place at its end that has few digits.
fn program(lines: usize) -> String {
    let mut text = String::from("G21 G90 G94\nG0 X0 Y0\nF3000\n");
    for nth in 1..=lines {
        let angle = nth as f64 * 0.05;
        let radius = 3.0 + nth as f64 * 0.0008;
        // A string takes whatever is written to it.
        let _ = writeln!(
            text,
            "G1 X{:.3} Y{:.3}",
            radius * angle.cos(),
            radius * angle.sin()
        );
    }
    text.push_str("G0 X-1.5 Y2.25\n");
    text
}

fn drive(command: &mut Command) -> Output {
    let mut child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if begun.elapsed() > Duration::from_secs(PATIENCE_S) {
            child.kill().unwrap();
        }
        thread::sleep(Duration::from_millis(50));
    }
    child.wait_with_output().unwrap()
}

fn assert_done(output: &Output) {
    let shown =
        [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
    println!("{}", shown[0]);
    assert!(output.status.success(), "{}{}", shown[0], shown[1]);
    let after = shown[0].split_once("connected after ");
    let after_s = after.and_then(|(_, rest)| rest.split_once(" s")?.0.parse::<f64>().ok());
    let after_s = after_s.unwrap_or_else(|| panic!("{}{}", shown[0], shown[1]));
    assert!(
        !is_timed() || after_s <= CONNECTED_WITHIN_S,
        "connected after {after_s} s"
    );
}

/// Whether times are judged: where somebody has asked for so many lines, nothing else runs.
fn is_timed() -> bool {
    std::env::var_os("TANDEM_SENDER_LINES").is_some()
}

fn is_quiet() -> bool {
    std::env::var_os("TANDEM_QUIET").is_some()
}

/// Has the sender that is installed as `sender` stream the program, as `script` in the language of `command` tells it.
fn script_drives(sender: &str, command: &str, script: &str) {
    let Some(folder) = senders(sender) else {
        return;
    };
    let serving = Serving::begin();
    let output = drive(
        Command::new(command)
            .arg(root().join("tests/senders").join(script))
            .arg(&folder)
            .arg(serving.terminal())
            .arg(serving.program(lines())),
    );
    assert_done(&output);
    serving.judge();
}

#[test]
fn grbl_streamer_drives_the_machine() {
    script_drives("py/grbl_streamer", "python3", "grbl_streamer.py");
}

#[test]
fn cncjs_drives_the_machine() {
    script_drives("node_modules/cncjs", "node", "cncjs.js");
}

fn moves(status: &Value) -> bool {
    status["state"] == "mdi" && status["position"]["x_mm"] != 0.0
}

fn rests(status: &Value) -> bool {
    status["state"] == "ready"
}

/// Whether the machine stands at the end of a line of the program, to the bit.
fn is_at_end_of_a_line(status: &Value) -> bool {
    let place = ["x_mm", "y_mm"].map(|axis| status["position"][axis].as_f64().unwrap());
    let text = program(SOME_LINES);
    let end = |line: &str| -> Option<[f64; 2]> {
        let (_, place) = line.split_once(" X")?;
        let (x, y) = place.split_once(" Y")?;
        Some([x.parse().ok()?, y.parse().ok()?])
    };
    text.lines().filter_map(end).any(|end| end == place)
}

/// A sender that the system stops goes on where it was; one that is killed leaves the machine at rest on the path, and to whoever
/// comes next.
#[test]
fn a_sender_that_is_stopped_or_killed_leaves_the_machine_at_the_end_of_a_line() {
    let Some(folder) = senders("py/grbl_streamer") else {
        return;
    };
    let serving = Serving::begin();
    let program = serving.program(SOME_LINES);
    let script = || {
        let mut script = Command::new("python3");
        script
            .arg(root().join("tests/senders/grbl_streamer.py"))
            .arg(&folder)
            .arg(serving.terminal())
            .arg(&program);
        script
    };
    let begin = || {
        script()
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap()
    };

    let mut killed = begin();
    serving.wait("moved", moves);
    killed.kill().unwrap();
    killed.wait().unwrap();
    let rest = serving.wait("at rest", rests);
    assert!(is_at_end_of_a_line(&rest), "{rest}");

    let mut stopped = begin();
    serving.wait("moved", |status| {
        moves(status) && status["position"] != rest["position"]
    });
    let pid = Pid::from_child(&stopped);
    kill_process(pid, Signal::STOP).unwrap();
    let rest = serving.wait("at rest", rests);
    assert!(is_at_end_of_a_line(&rest), "{rest}");
    assert_eq!(
        serving.ask("status")["position"],
        rest["position"],
        "it stays there"
    );
    kill_process(pid, Signal::CONT).unwrap();
    assert!(stopped.wait().unwrap().success());
    let end = serving.wait("at rest", rests);
    assert!(is_at_end(&end), "{end}");

    assert_done(&drive(&mut script()));
    let end = serving.wait("at rest", rests);
    assert!(is_at_end(&end), "{end}");
    let history = serving.ask("history");
    let jobs = history["jobs"].as_array().unwrap();
    assert!(jobs.iter().all(|job| job["outcome"] == "done"), "{history}");
}

/// A door for senders, opened by hand.
struct Door<S> {
    stream: S,
    heard: String,
}

impl<S: Read + Write> Door<S> {
    fn new(stream: S) -> Self {
        Self {
            stream,
            heard: String::new(),
        }
    }

    fn say(&mut self, bytes: &[u8]) {
        self.stream.write_all(bytes).unwrap();
    }

    /// The next line that is not empty.
    fn hear(&mut self) -> String {
        loop {
            if let Some(end) = self.heard.find('\n') {
                let line: String = self.heard.drain(..=end).collect();
                if !line.trim().is_empty() {
                    return line.trim().to_string();
                }
                continue;
            }
            let mut bytes = [0; 1000];
            let count = self.stream.read(&mut bytes).unwrap();
            assert!(count > 0, "the door was closed");
            self.heard += &String::from_utf8_lossy(&bytes[..count]);
        }
    }

    fn hear_until(&mut self, word: &str) -> Vec<String> {
        let mut lines = vec![];
        while !lines
            .last()
            .is_some_and(|line: &String| line.starts_with(word))
        {
            lines.push(self.hear());
        }
        lines
    }
}

fn open(terminal: &Path) -> Door<File> {
    Door::new(
        File::options()
            .read(true)
            .write(true)
            .open(terminal)
            .unwrap(),
    )
}

/// What a sender that was killed has said of a line is no beginning of what the next one says.
#[test]
fn half_a_line_goes_with_the_sender_that_said_it() {
    let serving = Serving::begin();
    let mut first = open(&serving.terminal());
    first.hear_until("Grbl");
    first.say(b"G1 X5 F6000\nG1 X1");
    first.hear_until("ok");
    drop(first);
    let rest = serving.wait("at rest", |status| {
        rests(status) && status["position"]["x_mm"] == 5.0
    });
    let mut second = open(&serving.terminal());
    second.hear_until("Grbl");
    second.say(b"\n?");
    let told = second.hear_until("ok");
    assert!(
        told.len() == 2 && told[0].starts_with("<Idle|MPos:5.000,"),
        "{told:?}"
    );
    assert_eq!(serving.ask("status")["position"], rest["position"]);
}

#[test]
fn whoever_comes_by_another_door_is_told_the_name_of_the_one_that_drives() {
    let port = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let serving = Serving::with(&["--grbl-tcp", &port.to_string()]);
    let mut first = open(&serving.terminal());
    first.hear_until("Grbl");
    first.say(b"G1 X200 F600\n");
    first.hear_until("ok");
    let mut second = Door::new(TcpStream::connect(port).unwrap());
    second.hear_until("Grbl");
    second.say(b"G0 X0\n");
    let told = second.hear_until("error");
    let holder = format!(
        "[MSG:the sender at {} (client ",
        serving.terminal().display()
    );
    assert!(
        told[0].starts_with(&holder) && told[0].ends_with("holds the machine]"),
        "{told:?}"
    );
    assert_eq!(told[1], "error:9");
    // Stops are free for all; a question is answered while the line of the other blocks, as often as it is asked.
    second.say(b"!");
    serving.wait("held", |status| status["state"] == "held");
    for _ in 0..50 {
        second.say(b"?");
        assert!(second.hear().starts_with("<Hold:0|"));
    }
    first.say(b"\x18");
    first.hear_until("Grbl");
    serving.wait("at rest", rests);
    // The first has nothing more to do: the machine is the next one's, once it takes its own hold back.
    second.say(b"~");
    let begun = Instant::now();
    loop {
        second.say(b"G0 X1\n");
        let told = loop {
            let line = second.hear();
            if line == "ok" || line.starts_with("error") {
                break line;
            }
        };
        if told == "ok" {
            break;
        }
        assert!(
            begun.elapsed() < Duration::from_secs(PATIENCE_S),
            "it is never let go"
        );
        thread::sleep(Duration::from_millis(100));
    }
    serving.wait("there", |status| {
        rests(status) && status["position"]["x_mm"] == 1.0
    });
}

/// How long each of so many questions waits for its report, µs.
fn waits_us(door: &mut Door<TcpStream>, questions: usize) -> Vec<f64> {
    let ask = |_| {
        thread::sleep(Duration::from_millis(3));
        let began = Instant::now();
        door.say(b"?");
        assert!(door.hear().starts_with('<'));
        began.elapsed().as_secs_f64() * 1e6
    };
    (0..questions).map(ask).collect()
}

fn quantile(mut all: Vec<f64>, share: f64) -> f64 {
    all.sort_by(f64::total_cmp);
    all[(all.len() as f64 * share) as usize]
}

/// A question is answered by who serves senders, in the same time whether lines are driven or not: measured in turn, so that what else
/// the computer does counts for both. The time itself is judged on a quiet computer alone.
#[test]
fn a_question_is_answered_as_soon_while_lines_are_driven_as_at_rest() {
    let rounds = if is_quiet() { 10 } else { 2 };
    let port = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let serving = Serving::with(&["--grbl-tcp", &port.to_string()]);
    let mut driver = open(&serving.terminal());
    driver.hear_until("Grbl");
    let stream = TcpStream::connect(port).unwrap();
    stream.set_nodelay(true).unwrap();
    let mut asker = Door::new(stream);
    asker.hear_until("Grbl");
    let (mut at_rest_us, mut driving_us) = (vec![], vec![]);
    for _ in 0..rounds {
        at_rest_us.extend(waits_us(&mut asker, 60));
        // They are driven for a second or so, and come to rest where they began.
        for line in program(60).lines() {
            driver.say(line.as_bytes());
            driver.say(b"\n");
            driver.hear_until("ok");
        }
        driving_us.extend(waits_us(&mut asker, 60));
        serving.wait("at rest", rests);
    }
    let all = [at_rest_us, driving_us];
    let [at_rest_us, driving_us] = all.map(|all| [0.5, 0.99].map(|at| quantile(all.clone(), at)));
    println!(
        "a report takes {at_rest_us:.0?} µs at rest and {driving_us:.0?} µs while lines are driven (p50, p99)"
    );
    assert!(!is_quiet() || driving_us[0] <= 1.5 * at_rest_us[0]);
}

/// What bCNC has to find in its file: else it asks whether it may look for a newer one. It does not heed its option for the port.
fn settings_of_bcnc(terminal: &Path) -> String {
    let port = terminal.display();
    format!(
        "[bCNC]\nlastcheck = 1\ncheckinterval = 0\n\
         [Connection]\nopenserial = 1\nport = {port}\nbaud = 115200\ncontroller = GRBL1\n"
    )
}

#[test]
fn bcnc_drives_the_machine() {
    for command in ["bCNC", "xvfb-run"] {
        if Command::new(command).arg("--help").output().is_err() {
            println!("skipped: {command} is not installed: tests/senders/install does that");
            return;
        }
    }
    let serving = Serving::begin();
    let program = serving.program(lines());
    let settings = settings_of_bcnc(&serving.terminal());
    fs::write(serving.folder.path().join(".bCNC"), settings).unwrap();
    let mut sender = Command::new("xvfb-run")
        .args(["-a", "bCNC", "--run"])
        .arg(&program)
        .env("HOME", serving.folder.path())
        // Debian's packages go with Debian's Python.
        .env("PATH", "/usr/bin:/bin")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .process_group(0)
        .spawn()
        .unwrap();
    // It stays when its program is over: what the machine has done says when that is.
    let begun = Instant::now();
    loop {
        thread::sleep(Duration::from_millis(500));
        let status = serving.ask("status");
        if is_at_end(&status) && status["state"] == "ready" {
            break;
        }
        assert!(sender.try_wait().unwrap().is_none(), "it has ended early");
        assert!(
            begun.elapsed() < Duration::from_secs(PATIENCE_S),
            "{status}"
        );
    }
    // Its hold and its reset behind the job are to leave the machine where it is.
    thread::sleep(Duration::from_secs(3));
    serving.judge();
    // xvfb-run leaves what it has started behind where it alone is ended.
    kill_process_group(Pid::from_child(&sender), Signal::TERM).unwrap();
    let _ = sender.wait();
}
