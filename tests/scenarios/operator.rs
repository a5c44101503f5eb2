//! The operator's sockets and keys, on a program that moves in real time. Nothing here is timed: states are waited for.

use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::fs::MetadataExt;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use serde_json::Value;
use tempfile::TempDir;

use crate::harness::{judge_trace, mill};

/// About half a minute of X to and fro.
pub const LONG: &str = "G21 G90\nF600\nG1 X50\nG1 X0\nG1 X50\nG1 X0\nG1 X50\nG1 X0\nM2\n";
/// Looks at the status before a state that does not come is a failure.
const PATIENCE: u32 = 6000;

/// A run in the background with a socket.
pub struct Running {
    folder: TempDir,
    child: Option<Child>,
}

impl Running {
    fn start(program: &str, arguments: &[&str]) -> Self {
        Self::start_with(program, |folder| {
            command(folder, arguments).spawn().unwrap()
        })
    }

    pub fn start_with(program: &str, spawn: impl FnOnce(&Path) -> Child) -> Self {
        let folder = TempDir::new().unwrap();
        std::fs::write(folder.path().join("p.ngc"), program).unwrap();
        let child = spawn(folder.path());
        Self {
            folder,
            child: Some(child),
        }
    }

    pub fn child(&mut self) -> &mut Child {
        self.child.as_mut().unwrap()
    }

    pub fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn connect(&self) -> Client<UnixStream> {
        for _ in 0..PATIENCE {
            if let Ok(stream) = UnixStream::connect(self.at("s")) {
                return Client::new(stream.try_clone().unwrap(), stream);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        panic!("nobody listens");
    }

    pub fn finish(mut self) -> (Output, Self) {
        let output = self.child.take().unwrap().wait_with_output().unwrap();
        (output, self)
    }

    fn summary(&self) -> Value {
        serde_json::from_str(&std::fs::read_to_string(self.at("summary.json")).unwrap()).unwrap()
    }

    /// The trace is within limits and on the path, to where it was ended.
    pub fn assert_sound(&self) {
        let verdict = judge_trace(
            &self.at("trace.csv"),
            &self.at("p.ngc"),
            &mill(),
            |options| options.ends_early = true,
        );
        assert!(verdict.passed(), "{verdict}");
        for count in [
            "limit_violations",
            "guard_stops",
            "governed_samples",
            "lost_samples",
        ] {
            assert_eq!(self.summary()[count], 0, "{count}");
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(mut child) = self.child.take() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// `tandem run` of `p.ngc` in `folder`, on the wall clock where no other is asked for; lenient with a
/// computer that is busy with other tests.
pub fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tandem"));
    command
        .current_dir(folder)
        .args(["run", "p.ngc", "--listen", "s", "--machine"])
        .arg(mill());
    command.args([
        "--set",
        "loops.max_missed_periods=1000000",
        "--set",
        "loops.max_missed_share=1",
        "--set",
        "motion.max_feed_ratio=2",
    ]);
    if !arguments.contains(&"--clock") {
        command.args(["--clock", "wall"]);
    }
    command
        .args(["--trace", "trace.csv", "--summary", "summary.json"])
        .args(arguments);
    command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

pub struct Client<S: Read> {
    lines: BufReader<S>,
    stream: S,
}

impl<S: Read + Write> Client<S> {
    fn new(reader: S, stream: S) -> Self {
        Self {
            lines: BufReader::new(reader),
            stream,
        }
    }

    pub fn say(&mut self, line: &str) {
        writeln!(self.stream, "{line}").unwrap();
    }

    /// The next line; null where the connection is closed.
    pub fn hear(&mut self) -> Value {
        let mut line = String::new();
        self.lines.read_line(&mut line).unwrap();
        if line.is_empty() {
            Value::Null
        } else {
            serde_json::from_str(&line).unwrap()
        }
    }

    pub fn ask(&mut self, line: &str) -> Value {
        self.say(line);
        self.hear()
    }

    pub fn command(&mut self, name: &str) -> Value {
        self.ask(&format!("{{\"command\":\"{name}\"}}"))
    }

    /// The first status that `is` what is waited for.
    pub fn wait(&mut self, what: &str, is: impl Fn(&Value) -> bool) -> Value {
        for _ in 0..PATIENCE {
            let status = self.ask(r#"{"status":{}}"#)["ok"]["status"].clone();
            if is(&status) {
                return status;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        panic!("never {what}");
    }
}

pub fn is_moving(status: &Value) -> bool {
    status["state"] == "running" && status["feed_mm_per_min"].as_f64().unwrap() > 100.0
}

pub fn is_held(status: &Value) -> bool {
    status["state"] == "holding" && status["at_rest"] == true
}

#[test]
fn hold_resume_override_and_emergency_stop_over_the_socket() {
    let run = Running::start(LONG, &[]);
    let mut client = run.connect();
    assert_eq!(
        std::fs::metadata(run.at("s")).unwrap().mode() & 0o777,
        0o600
    );
    client.ask(r#"{"lease":"take"}"#);
    client.wait("moving", is_moving);
    assert_eq!(client.command("hold")["ok"]["command"], "hold");
    let held = client.wait("held", is_held);
    assert_eq!(held["hold"], true);
    let still = client.ask(r#"{"status":{}}"#)["ok"]["status"].clone();
    assert_eq!(held["position"], still["position"]);
    assert!(client.command("resume")["ok"].is_object());
    client.wait("moving again", is_moving);
    assert!(client.ask(r#"{"command":"feed-override","value":0.5}"#)["ok"].is_object());
    client.wait("at half the feed", |s| {
        (s["feed_mm_per_min"].as_f64().unwrap() - 300.0).abs() < 1.0
    });
    assert!(
        client.ask(r#"{"command":"feed-override","value":3}"#)["error"]["why"]
            .as_str()
            .unwrap()
            .contains("max_feed")
    );
    assert!(client.command("emergency-stop")["ok"].is_object());
    let last = client.hear();
    assert!(
        last["ended"]["fault"]
            .as_str()
            .unwrap()
            .contains("emergency stop"),
        "{last}"
    );
    assert_eq!(
        (last["status"]["state"].clone(), client.hear()),
        ("fault".into(), Value::Null)
    );
    let (output, run) = run.finish();
    assert_eq!(output.status.code(), Some(3));
    assert!(!run.at("s").exists(), "the socket goes with the run");
    let states = std::fs::read_to_string(run.at("trace.csv")).unwrap();
    assert!(states.contains("holding") && states.contains("stopping"));
    assert_eq!(run.summary()["guard_stops"], 0);
}

#[test]
fn one_client_commands_and_every_client_may_stop() {
    let run = Running::start(LONG, &[]);
    let (mut a, mut b) = (run.connect(), run.connect());
    assert!(a.ask(r#"{"lease":"take"}"#)["ok"].is_object());
    assert_eq!(b.ask(r#"{"lease":"take"}"#)["error"]["what"], "refused");
    assert!(
        b.command("abort")["error"]["why"]
            .as_str()
            .unwrap()
            .contains("lease")
    );
    b.wait("moving", is_moving);
    assert!(b.command("hold")["ok"].is_object());
    b.wait("held", is_held);
    assert_eq!(b.command("resume")["error"]["what"], "refused");
    // Who hangs cannot keep it, nor can it know that it has lost it before it looks.
    assert!(b.ask(r#"{"lease":"take-over"}"#)["ok"].is_object());
    assert!(b.command("resume")["ok"].is_object());
    assert_eq!(a.hear()["lease"]["asked_by"], 2);
    assert_eq!(a.hear()["lease"]["lost_to"], 2);
    assert!(a.ask(r#"{"lease":"take-over"}"#)["ok"].is_object());
    assert_eq!(b.hear()["lease"]["lost_to"], 1);
    b.command("hold");
    b.wait("held", is_held);
    // The lease ends with its connection.
    drop(a);
    b.wait("the lease", |_| true);
    let taken = (0..PATIENCE).any(|_| {
        std::thread::sleep(Duration::from_millis(5));
        b.ask(r#"{"lease":"take"}"#)["ok"].is_object()
    });
    assert!(taken);
    b.command("resume");
    b.wait("moving", is_moving);
    b.command("abort");
    assert!(
        b.hear()["ended"]["stopped"]
            .as_str()
            .unwrap()
            .contains("operator")
    );
    let (output, run) = run.finish();
    assert_eq!(output.status.code(), Some(3));
    run.assert_sound();
}

#[test]
fn a_malformed_line_closes_its_connection_and_no_other() {
    let run = Running::start(LONG, &[]);
    let (mut good, mut bad, mut long) = (run.connect(), run.connect(), run.connect());
    let answer = bad.ask("hold it!");
    assert_eq!(answer["error"]["what"], "malformed line");
    assert_eq!(answer["error"]["where"], "line 1: column 1");
    assert!(answer["error"]["why"].is_string());
    assert_eq!(bad.hear(), Value::Null);
    long.say(&"x".repeat(5000));
    assert!(
        long.hear()["error"]["why"]
            .as_str()
            .unwrap()
            .contains("longer than 4096")
    );
    assert_eq!(long.hear(), Value::Null);
    good.wait("moving", is_moving);
    good.command("emergency-stop");
    run.finish();
}

#[test]
fn the_seventeenth_client_is_turned_away() {
    let run = Running::start(LONG, &[]);
    let mut clients: Vec<_> = (0..16).map(|_| run.connect()).collect();
    for client in &mut clients {
        assert!(client.ask(r#"{"status":{}}"#)["ok"].is_object());
    }
    assert!(
        run.connect().hear()["error"]["why"]
            .as_str()
            .unwrap()
            .contains("16 clients")
    );
    clients[0].command("emergency-stop");
    run.finish();
}

#[test]
fn a_slow_client_loses_telemetry_and_never_the_machines_time() {
    let run = Running::start(LONG, &[]);
    let (mut slow, mut quick) = (run.connect(), run.connect());
    slow.ask(r#"{"subscribe":{"rate_hz":100}}"#);
    // It does not read; how much the system keeps for it is the system's business.
    quick.ask(r#"{"lease":"take"}"#);
    let start = quick.wait("moving", is_moving)["tick"].as_u64().unwrap();
    quick.wait("much later", |s| s["tick"].as_u64().unwrap() > start + 4000);
    let lost = (0..PATIENCE)
        .map(|_| slow.hear()["lost"].as_u64().unwrap())
        .find(|lost| *lost > 0);
    assert!(lost.is_some_and(|lost| lost > 10), "{lost:?}");
    assert!(slow.hear()["status"]["position"]["x_mm"].is_number());
    quick.command("abort");
    let (_, run) = run.finish();
    run.assert_sound();
}

#[test]
fn a_program_stop_waits_for_a_client_and_for_nobody_else() {
    let program = "G21 G90\nF600\nG1 X5\nM0\nG1 X6\nM2\n";
    let run = Running::start(program, &[]);
    let mut client = run.connect();
    client.ask(r#"{"lease":"take"}"#);
    let stopped = client.wait("at M0", |s| s["waits_on_line"] == 4);
    assert!((stopped["position"]["x_mm"].as_f64().unwrap() - 5.0).abs() < 1e-9);
    client.command("resume");
    let last = client.hear();
    assert!(last["ended"]["fault"].is_null(), "{last}");
    assert_eq!(last["status"]["position"]["x_mm"], 6.0);
    assert_eq!(run.finish().0.status.code(), Some(0));
    let (output, _) = Running::start(program, &[]).finish();
    assert_eq!(output.status.code(), Some(0));
    assert!(String::from_utf8_lossy(&output.stderr).contains("line 4: no operator is there"));
}

#[test]
fn on_the_virtual_clock_a_hold_waits_for_its_operator() {
    let program = format!(
        "G21 G90\nF600\nG1 X1\nM0\n{}M2\n",
        "G1 X200\nG1 X0\n".repeat(15)
    );
    let run = Running::start(&program, &["--clock", "virtual", "--pause"]);
    let mut client = run.connect();
    client.ask(r#"{"lease":"take"}"#);
    client.wait("at M0", |s| s["waits_on_line"] == 4);
    client.command("resume");
    client.command("hold");
    client.wait("held", is_held);
    client.command("resume");
    client.wait("moving", |s| s["state"] == "running");
    client.command("abort");
    let (output, run) = run.finish();
    assert_eq!(output.status.code(), Some(3));
    assert!(run.summary()["stopped"].is_string());
}

#[test]
fn over_tcp_the_token_comes_first() {
    use std::net::TcpStream;
    let run = Running::start(
        LONG,
        &["--listen-tcp", "127.0.0.1:0", "--token-file", "token"],
    );
    let mut unix = run.connect();
    // The port is said on standard error, behind the path of the socket.
    let mut run = run;
    let errors = run.child.as_mut().unwrap().stderr.take().unwrap();
    let mut said = BufReader::new(errors).lines().map(Result::unwrap);
    let address = said
        .find_map(|line| {
            line.strip_prefix("operators: 127")
                .map(|port| format!("127{port}"))
        })
        .unwrap();
    let connect = || {
        TcpStream::connect(&address)
            .map(|s| Client::new(s.try_clone().unwrap(), s))
            .unwrap()
    };
    assert_eq!(
        std::fs::metadata(run.at("token")).unwrap().mode() & 0o777,
        0o600
    );
    let token = std::fs::read_to_string(run.at("token")).unwrap();
    let mut stranger = connect();
    assert!(
        stranger.command("emergency-stop")["error"]["why"]
            .as_str()
            .unwrap()
            .contains("token")
    );
    assert_eq!(stranger.hear(), Value::Null);
    let mut client = connect();
    assert!(client.ask(&format!("{{\"token\":\"{}\"}}", token.trim()))["ok"].is_object());
    assert!(client.ask(r#"{"lease":"take"}"#)["ok"].is_object());
    unix.wait("moving", is_moving);
    assert!(client.command("abort")["ok"].is_object());
    assert!(client.hear()["ended"]["stopped"].is_string());
    run.finish();
}

#[test]
fn addresses_of_other_computers_and_files_in_the_way_are_refused() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("p.ngc"), "G21\nM2\n").unwrap();
    let refused = |arguments: &[&str]| {
        let output = command(folder.path(), arguments).output().unwrap();
        (
            output.status.code(),
            String::from_utf8_lossy(&output.stderr).into_owned(),
        )
    };
    let (status, words) = refused(&["--listen-tcp", "0.0.0.0:0", "--token-file", "t"]);
    assert!(
        status == Some(1) && words.contains("this computer alone"),
        "{words}"
    );
    assert_eq!(
        refused(&["--listen-tcp", "127.0.0.1:0"]).0,
        Some(2),
        "a token file is needed"
    );
    std::fs::write(folder.path().join("s"), "a file").unwrap();
    let (status, words) = refused(&[]);
    assert!(status == Some(1) && words.contains("no socket"), "{words}");
    assert_eq!(
        std::fs::read_to_string(folder.path().join("s")).unwrap(),
        "a file"
    );
}
