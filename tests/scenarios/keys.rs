//! Keys on a terminal, which `script` of util-linux makes. What they do is seen at the socket.

use std::io::Write;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};

use rustix::process::{Pid, Signal, kill_process};

use crate::operator::{Client, LONG, Running, command, is_held, is_moving};

/// A run on a terminal of its own; `None` where there is no `script`.
fn on_a_terminal(arguments: &[&str]) -> Option<(Running, ChildStdin, Client<UnixStream>)> {
    if Command::new("script")
        .arg("--version")
        .stdout(Stdio::null())
        .status()
        .is_err()
    {
        println!("skipped: there is no script(1) to make a terminal with");
        return None;
    }
    let mut run = Running::start_with(LONG, |folder| spawn(folder, arguments));
    let keys = run.child().stdin.take().unwrap();
    let mut client = run.connect();
    client.wait("moving", is_moving);
    Some((run, keys, client))
}

/// The run in a shell that writes down the terminal's settings before and after, and the run's process.
fn spawn(folder: &Path, arguments: &[&str]) -> Child {
    shell(folder, &command(folder, arguments))
}

/// The same for any command.
pub fn shell(folder: &Path, run: &Command) -> Child {
    let quoted = |word: &std::ffi::OsStr| format!("'{}'", word.to_str().unwrap());
    let words: Vec<String> = std::iter::once(run.get_program())
        .chain(run.get_args())
        .map(quoted)
        .collect();
    let inner = format!("echo $$ > pid; exec {}", words.join(" ")).replace('\'', "\"");
    let outer = format!("stty -a > before; sh -c '{inner}'; echo $? > status; stty -a > after");
    let mut script = Command::new("script");
    script
        .current_dir(folder)
        .args(["-q", "-c", &outer, "/dev/null"])
        .env("SHELL", "/bin/sh");
    script
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn press(keys: &mut ChildStdin, key: &str) {
    keys.write_all(key.as_bytes()).unwrap();
    keys.flush().unwrap();
}

/// The run has ended with `status`, and its terminal is as it was.
fn assert_left_well(run: Running, keys: ChildStdin, status: &str) -> String {
    let (output, run) = run.finish();
    drop(keys);
    let read = |name: &str| std::fs::read_to_string(run.at(name)).unwrap();
    assert_eq!(read("status").trim(), status);
    assert_eq!(read("before"), read("after"));
    assert!(
        read("before").contains(" icanon") && read("before").contains(" echo "),
        "{}",
        read("before")
    );
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn every_key_does_what_it_says() {
    let Some((run, mut keys, mut client)) = on_a_terminal(&[]) else {
        return;
    };
    press(&mut keys, " ");
    client.wait("held", is_held);
    press(&mut keys, " ");
    client.wait("moving", is_moving);
    press(&mut keys, "++");
    client.wait("at 120 %", |s| s["feed_override"] == 1.2);
    press(&mut keys, "-");
    client.wait("at 110 %", |s| s["feed_override"] == 1.1);
    press(&mut keys, "o");
    client.wait("with the optional stop", |s| s["optional_stop"] == true);
    press(&mut keys, "s");
    client.wait("block by block", |s| s["single_block"] == true);
    press(&mut keys, "s");
    client.wait("through", |s| s["single_block"] == false);
    client.wait("long enough to see its progress", |s| {
        s["tick"].as_u64().unwrap() > 500
    });
    press(&mut keys, "q");
    assert!(client.hear()["ended"]["stopped"].is_string());
    let said = assert_left_well(run, keys, "3");
    for words in [
        "feed hold",
        "resume",
        "feed override 120 %",
        "optional stop on",
        "abort",
        "running",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
}

#[test]
fn e_is_an_emergency_stop() {
    let Some((run, mut keys, mut client)) = on_a_terminal(&[]) else {
        return;
    };
    press(&mut keys, "e");
    assert!(
        client.hear()["ended"]["fault"]
            .as_str()
            .unwrap()
            .contains("emergency stop")
    );
    assert_left_well(run, keys, "3");
}

#[test]
fn ctrl_c_aborts() {
    let Some((run, mut keys, mut client)) = on_a_terminal(&[]) else {
        return;
    };
    press(&mut keys, "\x03");
    assert!(client.hear()["ended"]["stopped"].is_string());
    assert_left_well(run, keys, "3");
}

#[test]
fn a_signal_stops_on_the_path_and_gives_the_terminal_back() {
    let Some((run, keys, mut client)) = on_a_terminal(&[]) else {
        return;
    };
    let pid = std::fs::read_to_string(run.at("pid"))
        .unwrap()
        .trim()
        .parse()
        .unwrap();
    kill_process(Pid::from_raw(pid).unwrap(), Signal::TERM).unwrap();
    assert!(client.hear()["ended"]["stopped"].is_string());
    assert_left_well(run, keys, "3");
}
