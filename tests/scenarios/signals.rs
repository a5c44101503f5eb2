//! Signals in the middle of motion: none of those that can be caught ends the process before the machine stands.

use std::process::Command;

use crate::operator::{LONG, Running, command, is_moving};

/// Those whose default is to end the process, with the first and the last of the real-time signals.
const STOPS: [&str; 15] = [
    "INT", "TERM", "HUP", "QUIT", "USR1", "USR2", "ALRM", "VTALRM", "PROF", "XCPU", "IO", "PWR",
    "STKFLT", "34", "64",
];
const IGNORED: [&str; 5] = ["TSTP", "TTIN", "TTOU", "PIPE", "XFSZ"];

fn send(run: &mut Running, signal: &str) {
    let pid = run.child().id().to_string();
    let sent = Command::new("bash")
        .args(["-c", &format!("kill -{signal} {pid}")])
        .status()
        .unwrap();
    assert!(sent.success(), "{signal}");
}

fn start() -> Running {
    Running::start_with(LONG, |folder| command(folder, &[]).spawn().unwrap())
}

#[test]
fn every_signal_that_would_end_the_process_stops_the_machine_on_the_path() {
    // A few at a time: each run waits for motion, and computers have few processors.
    for signals in STOPS.chunks(5) {
        let runs: Vec<_> = signals.iter().map(|signal| (signal, start())).collect();
        for (signal, mut run) in runs {
            let mut client = run.connect();
            client.wait("moving", is_moving);
            send(&mut run, signal);
            let last = client.hear();
            assert!(
                last["ended"]["stopped"].is_string() && last["ended"]["fault"].is_null(),
                "{signal}: {last}"
            );
            let (output, run) = run.finish();
            assert_eq!(output.status.code(), Some(3), "{signal}");
            run.assert_sound();
        }
    }
}

#[test]
fn signals_that_would_put_the_process_to_sleep_change_nothing() {
    let mut run = start();
    let mut client = run.connect();
    let before = client.wait("moving", is_moving)["tick"].as_u64().unwrap();
    for signal in IGNORED {
        send(&mut run, signal);
    }
    client.wait("moving on", |status| {
        is_moving(status) && status["tick"].as_u64().unwrap() > before + 200
    });
    client.command("emergency-stop");
    run.finish();
}
