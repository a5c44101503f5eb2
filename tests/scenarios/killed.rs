//! The process of the controller, killed as nothing can prevent, at random instants under a stream of writes: what was acknowledged
//! is there when it is started again, and nothing is half-written.
//!
//! `TANDEM_KILLS=1000` kills so often, `TANDEM_SEED=n` at other instants. Where `TANDEM_QUIET` says that nothing else runs here, it is
//! to be ready again within a second.

use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::Mutex;
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tandem_rig::Random;
use tandem_state::Reader;
use tempfile::TempDir;

use crate::clients::Served;
use crate::harness::mill;

const STATE: [&str; 2] = ["--state", "state.sqlite"];

/// How far each kind of write has come: what was asked for last, and what of it was acknowledged.
#[derive(Clone, Copy, Debug, Default)]
struct Progress {
    asked: [u64; 3],
    acknowledged: [u64; 3],
}

/// A client that asks one request after the other.
struct Asker(BufReader<UnixStream>, u64);

impl Asker {
    fn come(socket: &Path) -> Option<Self> {
        let mut this = Self(BufReader::new(UnixStream::connect(socket).ok()?), 0);
        this.ask(&json!({ "request": "lease", "how": "take" }))?;
        Some(this)
    }

    /// What was answered; none where the controller is gone.
    fn ask(&mut self, request: &Value) -> Option<Value> {
        self.1 += 1;
        let mut said = request.clone();
        said["id"] = json!(self.1);
        writeln!(self.0.get_mut(), "{said}").ok()?;
        loop {
            let mut line = String::new();
            self.0
                .read_line(&mut line)
                .ok()
                .filter(|count| *count > 0)?;
            // The last line of one that is killed may be half a line.
            let told: Value = serde_json::from_str(&line).ok()?;
            if told["id"] == self.1 && told.get("event").is_none() {
                assert!(told.get("ok").is_some(), "{request}: {told}");
                return Some(told["ok"].clone());
            }
        }
    }
}

/// Writes the same number as a parameter, an offset and a tool, and the next one, until the controller is gone.
fn write_without_end(socket: &Path, first: u64, progress: &Mutex<Progress>) -> Option<()> {
    let mut asker = Asker::come(socket)?;
    for n in first.. {
        let um = n as f64 * 1e-3;
        let all = [
            json!({ "request": "set-parameter", "number": 600, "value": n }),
            json!({ "request": "set-offset", "system": "G55", "x_mm": um }),
            json!({ "request": "set-tool", "number": 3, "diameter_mm": um }),
        ];
        for (kind, request) in all.iter().enumerate() {
            progress.lock().unwrap().asked[kind] = n;
            asker.ask(request)?;
            progress.lock().unwrap().acknowledged[kind] = n;
        }
    }
    Some(())
}

/// A program that writes all the time: the same number as a parameter and an offset, before each of its moves.
fn program() -> String {
    let line = |n: u32| {
        let um = f64::from(n) * 1e-3;
        format!(
            "#500 = {n}\nG10 L2 P3 X{um:.3}\nG1 Z{}\n",
            f64::from(n % 2) * 0.5
        )
    };
    let lines: String = (1..=2000).map(line).collect();
    format!("G21 G90 F6000\n{lines}M2\n")
}

/// Thousandths of a millimetre.
fn um(mm: f64) -> u64 {
    (mm * 1e3).round() as u64
}

#[test]
fn a_controller_that_is_killed_has_lost_nothing_acknowledged_and_torn_nothing() {
    let number = |name: &str| -> Option<u64> {
        let text = std::env::var(name).ok()?;
        Some(text.parse().unwrap())
    };
    let Some(kills) = number("TANDEM_KILLS") else {
        println!("skipped: TANDEM_KILLS=1000 kills it so often");
        return;
    };
    let seed = number("TANDEM_SEED").unwrap_or(1);
    let mut random = Random::new(seed);
    let mut folder = TempDir::new().unwrap();
    let (mut written, mut longest) = (0, Duration::ZERO);
    let mut progress = Progress::default();
    for kill in 0..kills {
        let place = format!("kill {kill}, TANDEM_SEED={seed}");
        let began = Instant::now();
        let served = Served::with(folder, &mill(), &STATE, |_| ());
        longest = longest.max(began.elapsed());
        let socket = served.at("s");
        let patience = Duration::from_micros(random.below(60_000));
        let drives = kill % 3 == 2;
        if drives {
            let mut asker = Asker::come(&socket).unwrap();
            let load = json!({ "request": "load", "text": program(), "name": "writes.ngc" });
            for request in [load, json!({ "request": "start" })] {
                asker.ask(&request).unwrap();
            }
            thread::sleep(patience * 4);
            folder = served.kill();
        } else {
            let shared = Mutex::new(progress);
            let first = progress.asked[0] + 1;
            folder = thread::scope(|scope| {
                let writer = scope.spawn(|| write_without_end(&socket, first, &shared));
                // Some are killed before the first write, most in the stream.
                thread::sleep(patience);
                let folder = served.kill();
                assert_eq!(writer.join().unwrap(), None, "{place}");
                folder
            });
            progress = shared.into_inner().unwrap();
        }
        let state = Reader::open(&folder.path().join(STATE[1]))
            .unwrap()
            .state()
            .unwrap();
        let parameter =
            |number: usize| state.parameters.get(&number).copied().unwrap_or(0.0) as u64;
        let diameter_mm = state.tools.get(&3).map_or(0.0, |tool| tool.diameter_mm);
        let found = [
            parameter(600),
            um(state.offsets.origins[1][0]),
            um(diameter_mm),
        ];
        for (kind, found) in found.iter().enumerate() {
            // The write that nobody was told of any more may be there.
            let may_be = [progress.acknowledged[kind], progress.asked[kind]];
            assert!(may_be.contains(found), "{place}: {found} of {progress:?}");
        }
        // What the path reaches at once is kept at once.
        assert_eq!(parameter(500), um(state.offsets.origins[2][0]), "{place}");
        written += u64::from(drives && parameter(500) > 0);
        progress.acknowledged = found;
    }
    println!(
        "{kills} kills, TANDEM_SEED={seed}: {} writes of each kind, {written} times by a program; ready within {longest:?}",
        progress.asked[0]
    );
    assert!(progress.asked[0] > 0, "nothing was written");
    // A disk that is busy otherwise may write nothing in the few instants that some kills leave.
    assert!(
        kills < 100 || written > 0,
        "no program has written anything"
    );
    let is_quiet = std::env::var_os("TANDEM_QUIET").is_some();
    assert!(
        !is_quiet || longest <= Duration::from_secs(1),
        "{longest:?}"
    );
}
