//! A client is told to stop before the controller has begun to drive: what it was about to ask for is not driven. The controller
//! is played by the test, so that each signal comes between two of its answers.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};
use serde_json::{Value, json};

/// What does not come within this never comes; nothing else depends on it.
const NEVER: Duration = Duration::from_mins(1);

struct Played {
    client: Child,
    lines: BufReader<UnixStream>,
}

impl Played {
    /// The client's next request; none where it has hung up.
    fn hear(&mut self) -> Option<Value> {
        let mut line = String::new();
        let count = self.lines.read_line(&mut line).unwrap();
        (count > 0).then(|| serde_json::from_str(&line).unwrap())
    }

    fn say(&mut self, line: &Value) {
        writeln!(self.lines.get_mut(), "{line}").unwrap();
    }

    fn grant(&mut self, asked: &Value) {
        let status = json!({ "state": "ready", "block_delete": false, "optional_stop": false });
        self.say(&json!({ "id": asked["id"], "ok": status }));
    }

    /// As a controller refuses that drives nothing.
    fn refuse(&mut self, asked: &Value) {
        let error = json!({ "what": "refused", "why": "nothing is driven", "state": "ready" });
        self.say(&json!({ "id": asked["id"], "error": error }));
    }

    /// Grants everything before the request `name`, which is the answer.
    fn grant_until(&mut self, name: &str) -> Value {
        loop {
            let asked = self.hear().unwrap();
            if asked["request"] == name {
                return asked;
            }
            self.grant(&asked);
        }
    }

    fn interrupt(&self) {
        kill_process(Pid::from_child(&self.client), Signal::INT).unwrap();
    }
}

/// What a client does that runs a program: its exit status, and what it says.
fn run_with(play: impl FnOnce(&mut Played)) -> (Option<i32>, String) {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("s");
    fs::write(folder.path().join("p.ngc"), "G1 X50 F600\nM2\n").unwrap();
    let door = UnixListener::bind(&socket).unwrap();
    let client = Command::new(env!("CARGO_BIN_EXE_tandem"))
        .args(["run", "p.ngc", "--connect", "s"])
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let (stream, _) = door.accept().unwrap();
    stream.set_read_timeout(Some(NEVER)).unwrap();
    let lines = BufReader::new(stream);
    let mut played = Played { client, lines };
    played.say(&json!({ "tandem": { "protocol": 2 } }));
    play(&mut played);
    drop(played.lines);
    let output = played.client.wait_with_output().unwrap();
    (
        output.status.code(),
        String::from_utf8_lossy(&output.stderr).into_owned(),
    )
}

#[test]
fn a_stop_while_a_program_is_loaded_keeps_it_from_being_started() {
    let (status, said) = run_with(|played| {
        let load = played.grant_until("load");
        played.interrupt();
        let abort = played.hear().unwrap();
        assert_eq!(abort["request"], "abort");
        played.refuse(&abort);
        played.grant(&load);
        while let Some(asked) = played.hear() {
            assert_ne!(asked["request"], "start");
            played.grant(&asked);
        }
    });
    assert_eq!(status, Some(3), "{said}");
    assert!(said.contains("nothing was begun"), "{said}");
}

/// The controller has refused the stop when the start reached it: the stop comes once more.
#[test]
fn a_stop_that_overtakes_the_start_is_said_once_more_behind_it() {
    let (status, said) = run_with(|played| {
        let start = played.grant_until("start");
        played.interrupt();
        let early = played.hear().unwrap();
        assert_eq!(early["request"], "abort");
        played.refuse(&early);
        played.grant(&start);
        let behind = played.hear().unwrap();
        assert_eq!(behind["request"], "abort");
        played.grant(&behind);
        let job =
            json!({ "job": "program", "outcome": "aborted", "stopped": "stopped by the operator" });
        played.say(&json!({ "event": "job", "job": job, "summary": {}, "position": {} }));
        while let Some(asked) = played.hear() {
            played.grant(&asked);
        }
    });
    assert_eq!(status, Some(3), "{said}");
    assert!(said.contains("stopped by the operator"), "{said}");
}
