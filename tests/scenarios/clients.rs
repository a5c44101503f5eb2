//! The commands as clients of a controller that runs in another process, on the wall clock. Nothing here is timed.

use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::harness::{mill, root};
use crate::operator::LONG;

/// Looks before a state that does not come is a failure.
const PATIENCE: u32 = 6000;
const LOOK: Duration = Duration::from_millis(5);

/// A controller in a folder of its own.
pub struct Served {
    folder: TempDir,
    pub child: Child,
}

impl Served {
    fn start() -> Self {
        Self::of(&mill())
    }

    fn of(machine: &Path) -> Self {
        Self::with(TempDir::new().unwrap(), machine, &["--no-state"], |_| ())
    }

    /// One in `folder`, perhaps of a controller before it, which is ready for work.
    pub fn with(
        folder: TempDir,
        machine: &Path,
        arguments: &[&str],
        more: impl FnOnce(&mut Command),
    ) -> Self {
        let log = File::create(folder.path().join("log")).unwrap();
        let mut command = tandem(folder.path());
        command
            .arg("serve")
            .arg("--machine")
            .arg(machine)
            .args(["--listen", "s"])
            .args(arguments)
            // How late a busy computer wakes the loop is not what is asked here.
            .args(["--set", "loops.max_missed_periods=1000000"])
            .args(["--set", "loops.max_missed_share=1"])
            .stderr(log);
        more(&mut command);
        let child = command.spawn().unwrap();
        let this = Self { folder, child };
        this.wait("ready", |status| {
            status["state"] == "ready" || status["state"] == "homing-needed"
        });
        this
    }

    /// Kills the process as nothing can prevent; its folder.
    pub fn kill(mut self) -> TempDir {
        // It may have ended by itself.
        let _ = self.child.kill();
        self.child.wait().unwrap();
        // What is dropped is an empty folder, and a process that has ended.
        std::mem::replace(&mut self.folder, TempDir::new().unwrap())
    }

    /// Asks one after the other, over a connection that then closes; what was answered to each.
    pub fn ask(&self, requests: &[Value]) -> Vec<Value> {
        let mut lines = BufReader::new(UnixStream::connect(self.at("s")).unwrap());
        let ask = |(id, request): (u64, &Value)| {
            let mut request = request.clone();
            request["id"] = json!(id);
            writeln!(lines.get_mut(), "{request}").unwrap();
            loop {
                let mut line = String::new();
                lines.read_line(&mut line).unwrap();
                let told: Value = serde_json::from_str(&line).unwrap_or_default();
                assert!(!line.is_empty(), "{request}: the controller is gone");
                if told["id"] == id && told.get("event").is_none() {
                    assert!(told.get("ok").is_some(), "{request}: {told}");
                    return told["ok"].clone();
                }
            }
        };
        (1..).zip(requests).map(ask).collect()
    }

    pub fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn status(&self) -> Option<Value> {
        let stream = UnixStream::connect(self.at("s")).ok()?;
        let mut reader = BufReader::new(stream);
        let mut line = String::new();
        reader.read_line(&mut line).ok()?;
        let asked = json!({ "id": 1, "request": "status" });
        writeln!(reader.get_mut(), "{asked}").ok()?;
        line.clear();
        reader.read_line(&mut line).ok()?;
        Some(serde_json::from_str::<Value>(&line).ok()?["ok"].clone())
    }

    pub fn wait(&self, what: &str, is: impl Fn(&Value) -> bool) -> Value {
        for _ in 0..PATIENCE {
            if let Some(status) = self.status().filter(|status| is(status)) {
                return status;
            }
            thread::sleep(LOOK);
        }
        let log = std::fs::read_to_string(self.at("log")).unwrap_or_default();
        panic!("it is never {what}: {:?}\n{log}", self.status());
    }

    /// A command as a client of it.
    fn client(&self, arguments: &[&str]) -> Command {
        let mut client = tandem(self.folder.path());
        client
            .args(arguments)
            .args(["--connect", "s"])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        client
    }

    fn run(&self, arguments: &[&str], input: &str) -> Output {
        typed(self.client(arguments), input)
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        // It may be gone already, as a test wants it.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn tandem(folder: &Path) -> Command {
    let mut tandem = Command::new(env!("CARGO_BIN_EXE_tandem"));
    tandem
        .current_dir(folder)
        .env_remove("RUNTIME_DIRECTORY")
        .env("XDG_RUNTIME_DIR", folder)
        .env("XDG_STATE_HOME", folder)
        .stdin(Stdio::null());
    tandem
}

fn typed(mut command: Command, input: &str) -> Output {
    let mut child = command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // It may end before it has read everything.
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
    child.wait_with_output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The same words as the one-shot command, the same exit status, and the machine stands where that one's would.
#[test]
fn lines_are_driven_and_refused_as_by_the_one_shot_command() {
    let lines = "G0 X10\nG1 Y5 F60000\nG1 X\nG0 X9999\nG91 G0 X1 (on)\nG0 Z-3\nquit\nG0 X50\n";
    let served = Served::start();
    let there = served.run(&["mdi"], lines);
    let mut alone = tandem(served.folder.path());
    alone
        .args(["mdi", "--clock", "virtual", "--machine"])
        .arg(mill());
    let alone = typed(alone, lines);
    assert_eq!(there.status.code(), Some(1));
    assert_eq!(there.status.code(), alone.status.code());
    assert_eq!(text(&there.stderr), text(&alone.stderr));
    assert_eq!(
        text(&there.stdout).lines().last(),
        text(&alone.stdout).lines().last()
    );
    let place = served.status().unwrap()["position"].clone();
    assert_eq!(place, json!({ "x_mm": 11.0, "y_mm": 5.0, "z_mm": -3.0 }));
}

/// What one command sets, the next one finds; a command that is over holds nothing up.
#[test]
fn what_one_client_sets_the_next_one_finds() {
    let served = Served::start();
    let set = served.run(&["mdi"], "G0 X4\nG10 L20 P0 X1\n#500=7\n");
    assert_eq!(set.status.code(), Some(0), "{}", text(&set.stderr));
    let used = served.run(&["mdi"], "G0 X#500\n");
    assert_eq!(
        text(&used.stdout),
        "x_mm 10.0000  y_mm 0.0000  z_mm 0.0000\n"
    );
    std::fs::write(served.at("p.ngc"), "G0 X0\nG1 Y2 F3000\nM2\n").unwrap();
    let run = served.run(&["run", "p.ngc"], "");
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    assert_eq!(served.status().unwrap()["position"]["x_mm"], 3.0);
}

#[test]
fn a_probe_in_a_pipe_holds_back_the_lines_behind_it() {
    let served = Served::of(&root().join("examples/machines/mill-probe.toml"));
    let probed = served.run(&["mdi"], "G0 X-30\nG38.3 Z-30 F600\n#1=#5063\nG0 Z#1\n");
    assert_eq!(probed.status.code(), Some(0), "{}", text(&probed.stderr));
    let said = text(&probed.stdout);
    assert!(said.lines().count() >= 2, "{said}");
    let standing = served.status().unwrap()["position"]["z_mm"]
        .as_f64()
        .unwrap();
    assert!(standing < 0.0 && standing > -30.0, "{standing}");
}

#[test]
fn jogs_are_lines_as_ever() {
    let served = Served::start();
    let lines = "x+1 600\nwhere\nfoo\ny- 60000\nx+9999 600\ny- 600\nwait 0.5\nstop\nfeed-override 0.5\nquit\nx+1 600\n";
    let jogged = served.run(&["jog"], lines);
    assert_eq!(jogged.status.code(), Some(1));
    let (out, err) = (text(&jogged.stdout), text(&jogged.stderr));
    assert_eq!(
        out.lines().next(),
        Some("x_mm 1.0000  y_mm 0.0000  z_mm 0.0000"),
        "{out}"
    );
    for refused in [
        "input:3:1: error: \"foo\" is no jog",
        "input:4:1: error: a feed of 60000 mm/min is above the highest of y, 15000 mm/min",
        "input:5:1: error: x would reach 10000 mm, beyond its travel",
    ] {
        assert!(err.contains(refused), "{refused}: {err}");
    }
    let status = served.wait("at rest", |status| {
        status["state"] == "ready" && status["feed_override"] == 0.5
    });
    let y = status["position"]["y_mm"].as_f64().unwrap();
    assert!(
        status["position"]["x_mm"] == 1.0 && y < 0.0 && y > -50.0,
        "{status}"
    );
}

#[test]
fn a_program_is_run_with_the_words_of_the_one_shot_command() {
    let served = Served::start();
    let program = root().join("examples/programs/square.ngc");
    let program = program.to_str().unwrap();
    let there = served.run(&["run", program, "--summary", "s.json"], "");
    assert_eq!(there.status.code(), Some(0), "{}", text(&there.stderr));
    let mut alone = tandem(served.folder.path());
    alone.args(["run", program, "--machine"]).arg(mill());
    let alone = typed(alone, "");
    // How long it takes on a busy computer is not what is asked here.
    let begins = |output: &Output| {
        let said = text(&output.stdout);
        let (blocks, _) = said.split_once(" in ").unwrap();
        (
            blocks.to_string(),
            said.contains("limit violations 0, guard stops 0"),
            said.contains("\nlargest jerk, which is only reported: "),
        )
    };
    assert_eq!(begins(&there), begins(&alone));
    assert!(begins(&there).1 && begins(&there).2);
    let summary = std::fs::read(served.at("s.json")).unwrap();
    let summary: Value = serde_json::from_slice(&summary).unwrap();
    assert!(
        summary["blocks"] == 5 && summary["guard_stops"] == 0,
        "{summary}"
    );

    std::fs::write(served.at("bad.ngc"), "G1 X1 F600\nG1 X\n").unwrap();
    let refused = served.run(&["run", "bad.ngc"], "");
    assert_eq!(refused.status.code(), Some(1));
    assert!(text(&refused.stderr).contains("bad.ngc:2:4: error: X has no value"));
}

/// Ctrl-C stops what the client drives, on the path; the controller stays, and takes the next job.
#[test]
fn a_signal_aborts_the_job_and_the_controller_stays() {
    let served = Served::start();
    std::fs::write(served.at("p.ngc"), LONG).unwrap();
    let run = served.client(&["run", "p.ngc"]).spawn().unwrap();
    served.wait("moving", |status| {
        status["position"]["x_mm"].as_f64().is_some_and(|x| x > 0.5)
    });
    kill_process(Pid::from_child(&run), Signal::INT).unwrap();
    let run = run.wait_with_output().unwrap();
    assert_eq!(run.status.code(), Some(3));
    let said = text(&run.stderr);
    assert!(
        said.contains("abort: stopping on the path") && said.contains("stopped by the operator"),
        "{said}"
    );
    let rest = served.wait("at rest", |status| status["state"] == "ready");
    assert_eq!(rest["position"]["y_mm"], 0.0);
    let next = served.run(&["mdi"], "G0 X0\n");
    assert_eq!(
        text(&next.stdout),
        "x_mm 0.0000  y_mm 0.0000  z_mm 0.0000\n"
    );
}

#[test]
fn a_controller_that_vanishes_is_said() {
    let mut served = Served::start();
    std::fs::write(served.at("p.ngc"), LONG).unwrap();
    let run = served.client(&["run", "p.ngc"]).spawn().unwrap();
    served.wait("moving", |status| {
        status["position"]["x_mm"].as_f64().is_some_and(|x| x > 0.5)
    });
    served.child.kill().unwrap();
    let run = run.wait_with_output().unwrap();
    assert_eq!(run.status.code(), Some(3));
    let said = text(&run.stderr);
    assert!(said.contains("the controller"), "{said}");
    let nobody = served.run(&["mdi"], "G0 X0\n");
    assert_eq!(nobody.status.code(), Some(1));
    assert!(text(&nobody.stderr).contains("tandem serve says where its socket is"));
}

#[test]
fn what_is_the_controllers_matter_is_refused_as_a_wrong_command_line() {
    let folder = TempDir::new().unwrap();
    for arguments in [
        &["run", "p.ngc", "--set", "guard.mode=count"][..],
        &["run", "p.ngc", "--clock", "virtual"],
        &["run", "p.ngc", "--commands", "c.csv"],
        &["run", "p.ngc", "--trace", "t.csv"],
        &["run", "p.ngc", "--machine", "m.toml"],
        &["mdi", "--set", "guard.mode=count"],
        &["mdi", "--clock", "virtual"],
        &["jog", "--trace", "t.csv"],
        &["home", "--clock", "wall"],
    ] {
        let mut client = tandem(folder.path());
        client.args(arguments).args(["--connect", "s"]);
        let refused = typed(client, "");
        assert_eq!(refused.status.code(), Some(2), "{arguments:?}");
        let why = format!(
            "{} does not go with --connect",
            arguments[arguments.len() - 2]
        );
        assert!(text(&refused.stderr).contains(&why), "{arguments:?}");
    }
}

#[test]
fn the_only_controller_is_found_and_of_several_one_is_to_be_named() {
    let served = Served::start();
    let folder = TempDir::new().unwrap();
    let status = || {
        let mut status = tandem(folder.path());
        status.arg("status");
        typed(status, "")
    };
    let none = status();
    assert_eq!(none.status.code(), Some(1));
    let why = text(&none.stderr);
    assert!(
        why.contains("no controller answers") && why.contains("tandem serve starts one"),
        "{why}"
    );
    std::os::unix::fs::symlink(served.at("s"), folder.path().join("tandem-link.socket")).unwrap();
    assert_eq!(status().status.code(), Some(1), "a link is no socket");
    std::fs::remove_file(folder.path().join("tandem-link.socket")).unwrap();
    std::fs::hard_link(served.at("s"), folder.path().join("tandem-a.socket")).unwrap();
    let one = status();
    assert_eq!(one.status.code(), Some(0), "{}", text(&one.stderr));
    assert!(text(&one.stdout).starts_with("ready  machine X0.000"));
    std::fs::hard_link(served.at("s"), folder.path().join("tandem-b.socket")).unwrap();
    let several = status();
    assert_eq!(several.status.code(), Some(1));
    assert!(text(&several.stderr).contains("several controllers are there"));
}
