//! Sixteen clients at 50 Hz and a scope of every fine period, in a process of their own as they are on computers of their own, keep
//! nobody waiting who asks, and cost no fine period. On a quiet computer alone:
//!
//! `TANDEM_QUIET=1 cargo test --release -p tandem-session --test controller onlookers -- --nocapture`, seven minutes;
//! `TANDEM_PAIRS=200` looks closer.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tandem_rig::Random;
use tandem_session::controller::NoPersistence;

use crate::doors::{Client, NEVER, with_controller};
use crate::support::machine;
use crate::watched::{SIGNALS, chords};

/// As many as a door has places for.
const CLIENTS: usize = 16;
const RATE_HZ: f64 = 50.0;
/// Pairs of a program with nobody and one with everybody looking on, each of five seconds.
const PAIRS: usize = 40;
/// Chords of a program.
const CHORDS: i32 = 600;
/// What everybody may cost: how long a status takes at the 99th of a hundred, and periods that were missed.
const MAX_RATIO: f64 = 1.1;
/// The chance of an increase without a cause that is still taken for one with a cause.
const CHANCE: f64 = 0.025;
/// Exchanges within pairs that are tried.
const EXCHANGES: usize = 20_000;

/// Comes and looks when it is told `watch`, leaves when it is told `rest` and says how many lines each client was told. It reads
/// twenty-five times a second whatever is there, so that it costs this computer next to nothing.
const ONLOOKERS: &str = r#"
import json, os, select, socket, sys, time
# A computer of its own would take nothing of the processors of this one: an idle task gives way at once.
os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
path, clients, rate_hz, signals = sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), json.loads(sys.argv[4])

def come(number):
    door = socket.socket(socket.AF_UNIX)
    door.connect(path)
    says = {"id": 0, "request": "subscribe", "rate_hz": rate_hz}
    if number == 0:
        says = {"id": 0, "request": "scope", "signals": signals, "every": 1}, {**says, "id": 1}
    else:
        says = says,
    try:
        door.sendall("".join(json.dumps(one) + "\n" for one in says).encode())
        lines = door.makefile("rb", buffering=0)
        while b'"id":%d' % (len(says) - 1) not in (line := lines.readline()):
            if b'"error"' in line or not line:
                raise ConnectionError
    except ConnectionError:
        # Those who have just left have not been seen to leave yet.
        time.sleep(0.01)
        return come(number)
    door.setblocking(False)
    return [door, 0, 0]

there = []
while True:
    ready = select.select([sys.stdin], [], [], 0.04 if there else None)[0]
    for one in there:
        try:
            told = one[0].recv(1 << 18)
        except BlockingIOError:
            continue
        one[1] += told.count(b'"event":"status"')
        one[2] += told.count(b'"event":"scope"')
    if not ready:
        continue
    word = sys.stdin.readline().strip()
    if word == "watch":
        there = [come(number) for number in range(clients)]
        print("[]", flush=True)
    elif word == "rest":
        for one in there:
            one[0].close()
        print(json.dumps([one[1:] for one in there]), flush=True)
        there = []
    else:
        break
"#;

/// The process of those who look on. It is there all the time, whether they look or not.
struct Onlookers {
    child: Child,
    tells: ChildStdin,
    says: BufReader<ChildStdout>,
}

impl Onlookers {
    fn of(socket: &Path) -> Self {
        let mut child = Command::new("python3")
            .args(["-c", ONLOOKERS])
            .arg(socket)
            .args([CLIENTS.to_string(), RATE_HZ.to_string()])
            .arg(json!(SIGNALS).to_string())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("python3 looks on");
        let (tells, says) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
        Self {
            child,
            tells,
            says: BufReader::new(says),
        }
    }

    /// Tells them, and has their answer: of each client the status lines and the frames of the scope that it has seen.
    fn tell(&mut self, word: &str) -> Vec<[u64; 2]> {
        writeln!(self.tells, "{word}").unwrap();
        let mut answer = String::new();
        self.says.read_line(&mut answer).unwrap();
        serde_json::from_str(&answer).unwrap()
    }
}

impl Drop for Onlookers {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// What one program was like.
struct Round {
    /// How long each status took, µs.
    took_us: Vec<f64>,
    /// How often periods were missed, however many in a row: as often as a status had more of them than the one before.
    stalls: f64,
    /// What became of it.
    summary: Value,
}

impl Round {
    /// Asks for the status all the time while the program is driven.
    fn drive<S: Read + Write>(operator: &mut Client<S>) -> Self {
        operator.aside.clear();
        operator.ok("start", json!({}));
        let missed = |status: &Value| status["counters"]["missed_periods"].as_u64().unwrap();
        let mut before = missed(&operator.ok("status", json!({})));
        let (mut took_us, mut stalls) = (vec![], 0.0);
        loop {
            let began = Instant::now();
            let status = operator.ok("status", json!({}));
            took_us.push(began.elapsed().as_secs_f64() * 1e6);
            let now = missed(&status);
            stalls += f64::from(u8::from(now > before));
            before = now;
            if let Some(told) = operator.aside.iter().find(|told| told["event"] == "job") {
                assert_eq!(told["job"]["outcome"], "done", "{told}");
                return Self {
                    took_us,
                    stalls,
                    summary: told["summary"].clone(),
                };
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    fn missed(&self) -> f64 {
        self.summary["missed_periods"].as_f64().unwrap()
    }
}

fn share_of(mut all: Vec<f64>, share: f64) -> f64 {
    all.sort_by(f64::total_cmp);
    all[(all.len() as f64 * share) as usize]
}

/// How many times more periods were missed by the second of each pair than by the first; how large that is by chance in one case of
/// [`CHANCE`], where the two of a pair do not differ; and how often chance alone makes it as large as it is.
///
/// Where looking on costs nothing, each of the two programs of a pair might as well have been the other: every way to exchange them is
/// as likely as what was seen. That holds whatever the computer does by itself, such as stalls of fifty periods in a row, which make a
/// bare ratio of such small counts say little.
fn compared(pairs: &[[f64; 2]]) -> (f64, f64, f64) {
    let ratio = |exchanges: &mut dyn FnMut() -> bool| {
        let sums = pairs.iter().fold([0.0, 0.0], |sums, pair| {
            let [first, second] = if exchanges() {
                [pair[1], pair[0]]
            } else {
                *pair
            };
            [sums[0] + first, sums[1] + second]
        });
        // A period more on both sides: none at all is no infinite increase.
        (sums[1] + 1.0) / (sums[0] + 1.0)
    };
    let seen = ratio(&mut || false);
    let mut random = Random::new(1);
    let mut toss = || random.below(2) == 1;
    let by_chance: Vec<f64> = (0..EXCHANGES).map(|_| ratio(&mut toss)).collect();
    let as_large = by_chance.iter().filter(|ratio| **ratio >= seen).count();
    let noticed = share_of(by_chance, 1.0 - CHANCE);
    (seen, noticed, as_large as f64 / EXCHANGES as f64)
}

#[test]
fn an_increase_in_most_pairs_is_noticed_and_a_few_stalls_are_not_taken_for_one() {
    let base = |nth: usize| [3.0, 0.0, 1.0, 5.0][nth % 4];
    let doubled: Vec<_> = (0..PAIRS)
        .map(|nth| [base(nth), 2.0 * base(nth) + 1.0])
        .collect();
    let (seen, noticed, chance) = compared(&doubled);
    assert!(
        seen > noticed && noticed < 1.5 && chance < 0.001,
        "{seen} {noticed} {chance}"
    );
    let stalled: Vec<_> = (0..PAIRS)
        .map(|nth| {
            [
                base(nth),
                base(nth + 1) + if nth % 20 == 7 { 30.0 } else { 0.0 },
            ]
        })
        .collect();
    let (seen, _, chance) = compared(&stalled);
    assert!(seen > MAX_RATIO && chance > CHANCE, "{seen} {chance}");
}

#[test]
fn sixteen_clients_at_50_hz_keep_nobody_waiting_who_asks() {
    if std::env::var_os("TANDEM_QUIET").is_none() {
        println!("skipped: TANDEM_QUIET=1 says that nothing else runs here");
        return;
    }
    let pairs = std::env::var("TANDEM_PAIRS").map_or(PAIRS, |count| count.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let token = folder.path().join("token");
    let mut rounds: [Vec<Round>; 2] = [vec![], vec![]];
    with_controller(
        &machine("mill-3axis.toml"),
        Box::new(NoPersistence),
        |options| {
            options.listen.tcp = Some("127.0.0.1:0".parse().unwrap());
            options.listen.token_file = Some(token.clone());
        },
        |socket, address| {
            // The operator comes by the other door: the sixteen have all places of this one.
            let stream = TcpStream::connect(address.unwrap()).unwrap();
            stream.set_nodelay(true).unwrap();
            stream.set_read_timeout(Some(NEVER)).unwrap();
            let mut operator = Client::over(stream);
            let token = std::fs::read_to_string(&token).unwrap();
            operator.say("token", json!({ "token": token.trim() }));
            assert_eq!(operator.hear()["tandem"]["role"], "set-up");
            operator.ok("lease", json!({ "how": "take" }));
            operator.until_state("ready");
            operator.ok(
                "load",
                json!({ "text": chords(CHORDS), "name": "circles.ngc" }),
            );
            let mut onlookers = Onlookers::of(socket);
            for round in 0..2 * pairs {
                // Alone, watched, watched, alone: what grows with time counts for both.
                let is_watched = [false, true, true, false][round % 4];
                if is_watched {
                    onlookers.tell("watch");
                }
                let driven = Round::drive(&mut operator);
                let seen = onlookers.tell("rest");
                assert_eq!(seen.len(), if is_watched { CLIENTS } else { 0 });
                let periods = driven.summary["samples"].as_f64().unwrap();
                for (number, [statuses, frames]) in seen.into_iter().enumerate() {
                    let least = periods * 1e-3 * RATE_HZ * 0.8;
                    assert!(
                        statuses as f64 > least,
                        "client {number}: {statuses} in {periods} ms"
                    );
                    assert_eq!(frames > 0, number == 0);
                }
                rounds[usize::from(is_watched)].push(driven);
                operator.until_state("ready");
            }
        },
    );
    let [alone, watched] = &rounds;
    let told = |what: &str, of: &dyn Fn(&[Round]) -> f64| {
        let [alone, watched] = [of(alone), of(watched)];
        println!(
            "{what}: {alone:.1} alone, {watched:.1} watched, {:.3}",
            watched / alone
        );
        watched / alone
    };
    let took = told("a status at p99, µs", &|rounds| {
        share_of(
            rounds
                .iter()
                .flat_map(|round| round.took_us.clone())
                .collect(),
            0.99,
        )
    });
    told("periods", &|rounds| {
        rounds
            .iter()
            .map(|round| round.summary["samples"].as_f64().unwrap())
            .sum()
    });
    let costs = |what: &str, of: &dyn Fn(&Round) -> f64| {
        told(what, &|rounds| rounds.iter().map(of).sum());
        let pairs: Vec<_> = alone
            .iter()
            .zip(watched)
            .map(|(alone, watched)| [of(alone), of(watched)])
            .collect();
        let (seen, noticed, chance) = compared(&pairs);
        println!(
            "  as large by chance alone in {:.1} % of cases; above {noticed:.2} it would be in less than {:.1} %",
            100.0 * chance,
            100.0 * CHANCE
        );
        seen > MAX_RATIO && chance <= CHANCE
    };
    let more_periods = costs("periods missed", &Round::missed);
    let more_stalls = costs("times that periods were missed", &|round| round.stalls);
    assert!(took <= MAX_RATIO, "a status waits for those who look on");
    assert!(
        !more_periods && !more_stalls,
        "those who look on cost fine periods"
    );
}
