//! A process that writes is killed at random instants: what it was told is on disk is there, and nothing is half-written.
//!
//! `STATE_KILLS=1000` kills more often, `STATE_SEED=17` at other instants; both are printed.

mod common;

use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use common::{all_say, axes, owner, recorded, said};
use tandem_rig::Random;
use tandem_state::{Driven, Store};

const CHILD: &str = "STATE_CHILD";

fn open(path: &Path) -> Store {
    Store::open(path, owner(&axes())).unwrap()
}

/// What the killed process does: writes without end, and says what is on disk. Does nothing as a test of its own.
#[test]
fn child() {
    let Some(path) = std::env::var_os(CHILD) else {
        return;
    };
    let store = open(Path::new(&path));
    let first = said(store.load()).unwrap();
    let recorder = store.recorder();
    let mut out = std::io::stdout();
    for n in first + 1.. {
        // What is only recorded comes before what is committed behind it.
        recorder.record(recorded(n)).unwrap();
        recorder.driven(Driven {
            job: n,
            hash: "h".into(),
            line: 1,
            epoch: n,
        });
        store.commit(all_say(n)).unwrap();
        // The parent has gone: the test has failed.
        if writeln!(out, "on disk {n}")
            .and_then(|()| out.flush())
            .is_err()
        {
            return;
        }
    }
}

#[test]
fn a_killed_process_has_lost_nothing_acknowledged_and_torn_nothing() {
    let number = |name| {
        std::env::var(name)
            .ok()
            .and_then(|text| text.parse::<u64>().ok())
    };
    let (kills, seed) = (
        number("STATE_KILLS").unwrap_or(100),
        number("STATE_SEED").unwrap_or(1),
    );
    let mut random = Random::new(seed);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mill.sqlite");
    let (mut acknowledged, mut longest) = (0, Duration::ZERO);
    for kill in 0..kills {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command
            .args(["--exact", "child", "--nocapture"])
            .env(CHILD, &path)
            .stdout(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap());
        // Some die while they open the file, most in the stream.
        if kill % 8 != 0 {
            let mut line = String::new();
            while !line.contains("on disk") {
                line.clear();
                assert!(
                    lines.read_line(&mut line).unwrap() > 0,
                    "kill {kill}, seed {seed}: the child ended by itself"
                );
            }
            acknowledged = last_number(&line).unwrap();
        }
        std::thread::sleep(Duration::from_micros(random.below(30_000)));
        child.kill().unwrap();
        child.wait().unwrap();
        let mut rest = String::new();
        lines.read_to_string(&mut rest).unwrap();
        acknowledged = rest
            .lines()
            .rev()
            .find_map(last_number)
            .unwrap_or(acknowledged);

        let before = Instant::now();
        let store = open(&path);
        longest = longest.max(before.elapsed());
        let state = store.load();
        let whole =
            said(state).unwrap_or_else(|| panic!("kill {kill}, seed {seed}: torn: {state:?}"));
        // The write that nobody was told of any more may be there.
        assert!(
            whole == acknowledged || whole == acknowledged + 1,
            "kill {kill}, seed {seed}: {acknowledged} was on disk, now it is {whole}"
        );
        let recorded = state.parameters.get(&100).copied().unwrap_or(0.0) as u64;
        assert!(
            recorded >= whole,
            "kill {kill}, seed {seed}: {recorded} was recorded before {whole}"
        );
        acknowledged = whole;
    }
    println!("{kills} kills, seed {seed}: {acknowledged} writes, opened again within {longest:?}");
    assert!(acknowledged > kills, "the stream was a stream");
}

fn last_number(line: &str) -> Option<u64> {
    line.split_once("on disk ")?.1.trim().parse().ok()
}
