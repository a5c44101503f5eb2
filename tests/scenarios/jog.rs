//! Jogging: by lines of a pipe on the virtual clock, over a socket in real time, with keys on a terminal.

use std::io::Write;
use std::path::Path;
use std::process::{ChildStdin, Command, Stdio};

use serde_json::Value;
use tandem_oracle::{Check, Machine, Options, Trace, judge};

use crate::harness::{mill, operator_command, root};
use crate::keys::shell;
use crate::operator::{Running, is_held, is_moving};

/// Acceleration of the linear axes, mm/s².
const ACCELERATION_MM_PER_S2: f64 = 1000.0;
const PERIOD_S: f64 = 0.001;

fn command(folder: &Path, machine: &Path, arguments: &[&str]) -> Command {
    operator_command("jog", folder, machine, arguments)
}

/// What was said, and driven.
struct Said {
    status: i32,
    positions: Vec<String>,
    errors: String,
    trace: Trace,
}

impl Said {
    /// The last position that was told, mm or deg.
    fn last(&self) -> Vec<f64> {
        let words = self
            .positions
            .last()
            .expect("a position")
            .split_whitespace();
        words
            .skip(1)
            .step_by(2)
            .map(|word| word.parse().unwrap())
            .collect()
    }

    /// Positions of an axis, sample by sample.
    fn column(&self, axis: usize) -> Vec<f64> {
        self.trace
            .rows
            .iter()
            .map(|row| row.command[axis])
            .collect()
    }
}

/// Says `lines` on the virtual clock. Every sample keeps every limit, whatever was said.
fn say_on(machine: &Path, lines: &str, arguments: &[&str]) -> Said {
    let run = Running::start_with("", |folder| {
        let mut child = command(folder, machine, &["--clock", "virtual"])
            .args(arguments)
            .spawn()
            .unwrap();
        child
            .stdin
            .take()
            .unwrap()
            .write_all(lines.as_bytes())
            .unwrap();
        child
    });
    let (output, run) = run.finish();
    let words = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let trace = within_limits(machine, &run.at("trace.csv"));
    Said {
        status: output.status.code().unwrap(),
        positions: words(&output.stdout).lines().map(str::to_string).collect(),
        errors: words(&output.stderr),
        trace,
    }
}

fn say(lines: &str) -> Said {
    say_on(&mill(), lines, &[])
}

/// The trace, judged: travel, velocity and acceleration of every sample; a jog makes no velocity steps.
fn within_limits(machine: &Path, trace: &Path) -> Trace {
    let (machine, trace) = (Machine::read(machine).unwrap(), Trace::read(trace).unwrap());
    let mut options = Options::only(&[
        Check::Period,
        Check::Travel,
        Check::Velocity,
        Check::Acceleration,
    ]);
    (
        options.speed_difference_mm_per_s,
        options.speed_difference_deg_per_s,
    ) = (Some(0.0), Some(0.0));
    let verdict = judge(&trace, "M2\n", &machine, &options);
    assert!(verdict.passed(), "{verdict}");
    trace
}

/// The first and the last sample that has moved.
fn moved(positions: &[f64]) -> (usize, usize) {
    let changes = |i: &usize| positions[*i] != positions[*i - 1];
    let mut all = (1..positions.len()).filter(changes);
    let first = all.next().expect("motion");
    (first, all.next_back().unwrap_or(first))
}

#[test]
fn steps_add_up_exactly() {
    let lines = "x+0.1 600\n".repeat(10) + &"z-0.001 60\n".repeat(3);
    let said = say(&lines);
    assert_eq!(
        (said.status, said.positions.len()),
        (0, 13),
        "{}",
        said.errors
    );
    let (x, z) = (said.column(0), said.column(2));
    assert!((x.last().unwrap() - 1.0).abs() < 1e-9 && (z.last().unwrap() + 0.003).abs() < 1e-9);
    assert!(said.positions[4].starts_with("x_mm 0.5000  y_mm 0.0000"));
}

#[test]
fn quit_and_exit_end_the_session_and_what_follows_is_nobodys_line() {
    for word in ["quit", "exit"] {
        let said = say(&format!("x+0.1 600\n{word}\nx+0.1 600\n"));
        assert_eq!(
            (said.status, said.positions.len(), said.errors.as_str()),
            (0, 1, ""),
            "{word}"
        );
        assert!(
            (said.column(0).last().unwrap() - 0.1).abs() < 1e-9,
            "{word}"
        );
    }
}

#[test]
fn a_late_keep_alive_stops_after_its_time_and_the_way_to_rest() {
    for (feed_mm_per_min, keep_alive_ms) in
        [(600.0, 200), (6000.0, 200), (6000.0, 50), (3000.0, 120)]
    {
        let set = format!("operator.jog_keep_alive_ms={keep_alive_ms}");
        let said = say_on(
            &mill(),
            &format!("x+ {feed_mm_per_min}\nwait 1\nwhere\n"),
            &["--set", &set],
        );
        assert_eq!(said.status, 0, "{}", said.errors);
        assert!(
            said.errors.contains("x stopped: the keep-alive was late"),
            "{}",
            said.errors
        );
        let x = said.column(0);
        // It begins to move after it was asked for.
        let (first, last) = moved(&x);
        let speed = x
            .windows(2)
            .map(|pair| pair[1] - pair[0])
            .fold(0.0, f64::max)
            / PERIOD_S;
        let stop_periods = (speed / ACCELERATION_MM_PER_S2 / PERIOD_S).ceil() as usize;
        assert!(
            last - first <= keep_alive_ms + stop_periods + 1,
            "{feed_mm_per_min}: last motion in period {last}"
        );
        assert!(
            last - first + 50 > keep_alive_ms + stop_periods,
            "{feed_mm_per_min}: it has moved at all, until {last}"
        );
    }
}

#[test]
fn repeated_lines_keep_it_alive_until_the_word_stop() {
    let said = say(&("x+ 600\nwait 0.15\n".repeat(10) + "stop\nwhere\n"));
    assert_eq!((said.status, said.errors.as_str()), (0, ""), "not late");
    let x = said.column(0);
    let (first, last) = moved(&x);
    // One motion: 1.5 s, the lines take effect a rough period late at most each, and the way to rest.
    assert!((1400..=1620).contains(&(last - first)), "{first} to {last}");
    let speeds: Vec<f64> = x
        .windows(2)
        .map(|pair| (pair[1] - pair[0]) / PERIOD_S)
        .collect();
    assert!(
        speeds[first + 20..last - 20]
            .iter()
            .all(|speed| (speed - 10.0).abs() < 1e-6),
        "no pause on the way"
    );
}

#[test]
fn the_travel_ends_a_jog_exactly_and_a_step_beyond_is_refused() {
    let on = "x- 15000\nwait 0.1\n";
    let said = say(&(on.repeat(14) + "wait 0.5\nx+0.5 600\nx-1 600\nx-0.5 600\nwhere\n"));
    assert_eq!(said.status, 1, "{}", said.errors);
    assert!(
        said.errors.contains("x is at its travel limit, -250 mm"),
        "{}",
        said.errors
    );
    assert!(
        said.errors.contains("stands at its travel limit"),
        "the key is still held: {}",
        said.errors
    );
    assert!(
        said.errors
            .contains(":1: error: x would reach -250.5 mm, beyond its travel"),
        "{}",
        said.errors
    );
    assert_eq!(
        (
            said.last()[0],
            said.column(0).iter().copied().fold(0.0, f64::min)
        ),
        (-250.0, -250.0)
    );
    assert!(said.column(0).contains(&-249.5));
}

#[test]
fn the_other_direction_stops_first_and_starts_from_there() {
    let said = say(
        "x+ 6000\nwait 0.15\nx- 6000\nwait 0.15\nx- 6000\nwait 0.15\ny+ 6000\nwait 0.18\ny+ 1000\nwait 0.15\nstop\nx+0.25 600\n",
    );
    assert_eq!(
        (said.status, said.positions.len()),
        (0, 5),
        "{}: {:?}",
        said.errors,
        said.positions
    );
    let x = said.column(0);
    let peak = x.iter().copied().fold(0.0, f64::max);
    assert!(peak > 8.0 && peak < 16.0, "{peak}");
    let x_of = |line: &String| {
        line.split_whitespace()
            .nth(1)
            .unwrap()
            .parse::<f64>()
            .unwrap()
    };
    assert!(
        (x_of(&said.positions[0]) - peak).abs() < 1e-4 && x_of(&said.positions[1]) < peak - 1.0
    );
    assert!(
        (x_of(&said.positions[4]) - x_of(&said.positions[1]) - 0.25).abs() < 1.1e-4,
        "{:?}",
        said.positions
    );
}

#[test]
fn rotary_axes_turn_by_degrees() {
    let four_axes = root().join("examples/machines/mill-4axis.toml");
    let said = say_on(
        &four_axes,
        "a+90 3600\na-0.5 360\na+ 7201\na+ 7200\nwait 1\nwhere\n",
        &[],
    );
    assert!(
        said.errors
            .contains("a feed of 7201 deg/min is above the highest of a, 7200 deg/min"),
        "{}",
        said.errors
    );
    assert!(
        said.positions[0].ends_with("a_deg 90.0000")
            && said.positions[1].ends_with("a_deg 89.5000")
    );
    let reached = said.last()[3];
    // 120 deg/s for at most 0.2 s.
    assert!(reached > 89.5 + 5.0 && reached < 89.5 + 25.0, "{reached}");
}

#[test]
fn what_is_refused_moves_nothing_and_says_what_where_why() {
    let said =
        say("x+ 15001\n  x+1000 600\nq+ 600\nx+\nhop\nwait\n!reset\nfeed-override 7\nwhere\n");
    assert_eq!(said.status, 1);
    for words in [
        "input:1:1: error: a feed of 15001 mm/min is above the highest of x, 15000 mm/min",
        "input:2:3: error: x would reach 1000 mm, beyond its travel of -250 mm to 250 mm",
        "input:3:1: error: the machine has no axis q; it has x, y, z",
        "input:4:1: error: a jog needs a feed",
        "input:5:1: error: \"hop\" is no jog",
        "input:6:1: error: wait needs a time",
        "input:7:1: error: there is no fault to reset",
        "input:8:1: error: a feed override of 7 is above motion.max_feed_ratio",
    ] {
        assert!(said.errors.contains(words), "{words}: {}", said.errors);
    }
    assert_eq!(said.last(), [0.0, 0.0, 0.0]);
}

#[test]
fn hold_and_override_act_on_jogs() {
    let said = say(
        "feed-override 0.5\nx+1 600\nhold\nx+ 600\nwait 0.4\nwhere\nresume\nfeed-override 1\ny+1 600\n",
    );
    assert_eq!(said.status, 0, "{}", said.errors);
    let fastest =
        |column: Vec<f64>| column.windows(2).map(|p| p[1] - p[0]).fold(0.0, f64::max) / PERIOD_S;
    assert!(
        (fastest(said.column(0)) - 5.0).abs() < 1e-6,
        "at half the feed"
    );
    assert!((fastest(said.column(1)) - 10.0).abs() < 1e-6);
    // What was asked for under the hold has gone with its keep-alive.
    assert_eq!(said.last(), [1.0, 1.0, 0.0]);
}

#[test]
fn a_fault_is_left_with_reset_from_where_the_machine_stands() {
    let said = say(
        "x+ 6000\nwait 0.1\nemergency-stop\nwait 0.1\nx+1 600\n!reset\nwhere\ny+2 600\nwait 65\ny-1 600\n",
    );
    assert_eq!(said.status, 1, "{}", said.errors);
    assert!(
        said.errors.contains("emergency stop") && said.errors.contains("!reset goes on"),
        "{}",
        said.errors
    );
    assert!(
        said.errors
            .contains("input:5:1: error: the machine is in fault"),
        "{}",
        said.errors
    );
    let (x, y) = (said.last()[0], said.last()[1]);
    assert!(x > 5.0 && x < 15.0 && y == 1.0, "{x} {y}");
    let unreset = say("x+ 6000\nwait 0.1\nemergency-stop\n");
    assert_eq!(unreset.status, 3);
}

#[test]
fn a_machine_that_asks_for_homing_is_jogged_behind_it() {
    let machine = root().join("examples/machines/mill-homing.toml");
    let folder = tempfile::TempDir::new().unwrap();
    let refused = command(folder.path(), &machine, &["--clock", "virtual"])
        .stdin(Stdio::null())
        .output()
        .unwrap();
    assert_eq!(refused.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("machine.require_homing"));
    let mut child = command(folder.path(), &machine, &["--clock", "virtual", "--home"])
        .spawn()
        .unwrap();
    child
        .stdin
        .take()
        .unwrap()
        .write_all(b"where\nx-1 600\nx+0.25 600\n")
        .unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let x: Vec<f64> = said
        .lines()
        .map(|line| line.split_whitespace().nth(1).unwrap().parse().unwrap())
        .collect();
    assert_eq!(x, [x[0], x[0] - 1.0, x[0] - 0.75], "{said}");
}

/// In real time with a socket.
fn live(arguments: &[&str]) -> (Running, ChildStdin) {
    let mut run = Running::start_with("", |folder| {
        let lenient = [
            "--set",
            "loops.max_missed_periods=1000000",
            "--set",
            "loops.max_missed_share=1",
            "--listen",
            "s",
        ];
        command(folder, &mill(), &lenient)
            .args(arguments)
            .spawn()
            .unwrap()
    });
    let input = run.child().stdin.take().unwrap();
    (run, input)
}

fn x_mm(status: &Value) -> f64 {
    status["position"]["x_mm"].as_f64().unwrap()
}

#[test]
fn over_the_socket_whoever_holds_the_lease_jogs_and_everybody_stops() {
    // Long, so that a busy computer keeps it alive.
    let (run, input) = live(&["--set", "operator.jog_keep_alive_ms=60000"]);
    let (mut a, mut b) = (run.connect(), run.connect());
    let step = r#"{"jog":{"axis":"x","distance_mm":0.1,"feed_mm_per_min":600}}"#;
    let on = r#"{"jog":{"axis":"x","feed_mm_per_min":600,"direction":1}}"#;
    assert!(
        a.ask(step)["error"]["why"]
            .as_str()
            .unwrap()
            .contains("it needs the control lease")
    );
    a.ask(r#"{"lease":"take"}"#);
    for _ in 0..10 {
        assert_eq!(a.ask(step)["ok"]["jog"]["axis"], "x");
    }
    let at_one = a.wait("at 1", |s| {
        (x_mm(s) - 1.0).abs() < 1e-9 && s["feed_mm_per_min"] == 0.0
    });
    assert_eq!(at_one["fault"], Value::Null);
    assert!(
        b.ask(on)["error"]["why"]
            .as_str()
            .unwrap()
            .contains("client 1 holds it")
    );
    a.ask(on);
    a.wait("moving", is_moving);
    b.command("hold");
    a.wait("held", is_held);
    a.command("resume");
    a.wait("moving", is_moving);
    assert_eq!(b.ask(r#"{"jog":{"stop":true}}"#)["ok"]["jog"], "stop");
    let stands = |s: &Value| s["state"] == "standstill";
    a.wait("at rest", stands);
    // The other direction, and back by an abort.
    a.ask(&on.replace('1', "-1"));
    a.wait("moving", is_moving);
    a.command("abort");
    let rest = a.wait("at rest", stands);
    // The rest is told a rough period later; then it is known where a step would end.
    a.wait("settled", |s| {
        s["tick"].as_u64() > rest["tick"].as_u64().map(|tick| tick + 200)
    });
    for (request, why) in [
        (
            r#"{"jog":{"axis":"x","distance_mm":1000,"feed_mm_per_min":600}}"#,
            "beyond its travel",
        ),
        (
            r#"{"jog":{"axis":"x","distance_mm":1,"feed_mm_per_min":16000}}"#,
            "above the highest of x",
        ),
        (
            r#"{"jog":{"axis":"x","distance_deg":1,"feed_deg_per_min":600}}"#,
            "x is a linear axis",
        ),
    ] {
        let error = a.ask(request)["error"].clone();
        assert_eq!(
            (
                error["what"].as_str(),
                error["where"].as_str().unwrap().contains("\"jog\"")
            ),
            (Some("refused"), true)
        );
        assert!(error["why"].as_str().unwrap().contains(why), "{error}");
    }
    drop(input);
    assert!(a.hear()["ended"]["stopped"].is_null());
    let (output, run) = run.finish();
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    within_limits(&mill(), &run.at("trace.csv"));
}

#[test]
fn a_client_that_falls_silent_or_goes_away_stops_the_machine() {
    let (run, input) = live(&[]);
    let mut client = run.connect();
    client.ask(r#"{"lease":"take"}"#);
    client.say(r#"{"jog":{"axis":"y","feed_mm_per_min":600,"direction":1}}"#);
    client.hear();
    drop(client);
    let mut other = run.connect();
    let y_mm = |s: &Value| s["position"]["y_mm"].as_f64().unwrap();
    let rest = other.wait("stopped", |s| s["state"] == "standstill" && y_mm(s) > 0.0);
    assert!(y_mm(&rest) < 10.0, "nobody had it go on");
    drop(input);
    let (output, _) = run.finish();
    assert!(String::from_utf8_lossy(&output.stderr).contains("y stopped: the keep-alive was late"));
}

#[test]
fn jogs_are_refused_where_a_program_runs() {
    let run = Running::start_with(crate::operator::LONG, |folder| {
        crate::operator::command(folder, &[]).spawn().unwrap()
    });
    let mut client = run.connect();
    client.ask(r#"{"lease":"take"}"#);
    let answer = client.ask(r#"{"jog":{"axis":"x","distance_mm":0.1,"feed_mm_per_min":600}}"#);
    assert!(
        answer["error"]["why"]
            .as_str()
            .unwrap()
            .contains("tandem jog does"),
        "{answer}"
    );
    client.command("abort");
    run.finish();
}

#[test]
fn keys_jog_and_the_terminal_is_as_it_was() {
    let lenient = [
        "--set",
        "loops.max_missed_periods=1000000",
        "--set",
        "loops.max_missed_share=1",
        "--set",
        "operator.jog_keep_alive_ms=60000",
        "--listen",
        "s",
    ];
    let start = |folder: &Path| shell(folder, &command(folder, &mill(), &lenient));
    if Command::new("script")
        .arg("--version")
        .stdout(Stdio::null())
        .status()
        .is_err()
    {
        println!("skipped: there is no script(1) to make a terminal with");
        return;
    }
    let mut run = Running::start_with("", start);
    let mut keys = run.child().stdin.take().unwrap();
    let mut press = |key: &str| {
        keys.write_all(key.as_bytes())
            .and_then(|()| keys.flush())
            .unwrap();
    };
    let mut client = run.connect();
    client.wait("enabled", |s| s["state"] == "standstill");
    press("4x");
    client.wait("at 1", |s| (x_mm(s) - 1.0).abs() < 1e-9);
    press("3X\x1b[D");
    client.wait("at 0.8", |s| (x_mm(s) - 0.8).abs() < 1e-9);
    press("0\x1b[C");
    client.wait("moving", is_moving);
    press(" ");
    client.wait("held", is_held);
    press(" ");
    client.wait("moving", is_moving);
    press("k");
    client.wait("stopped", |s| s["state"] == "standstill");
    press("e");
    // The session stands in the fault, and its clients are told so, until it is taken back. Only behind the words of the fault is
    // a key an answer to them.
    client.say(r#"{"subscribe":{"rate_hz":50}}"#);
    let ended = (0..1000).find_map(|_| {
        press("r");
        client.hear()["ended"]["fault"].as_str().map(str::to_string)
    });
    assert!(ended.expect("never").contains("emergency stop"));
    drop(client);
    let mut client = run.connect();
    client.wait("enabled", |s| s["state"] == "standstill");
    press("q");
    let (output, run) = run.finish();
    let read = |name: &str| std::fs::read_to_string(run.at(name)).unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(
        (read("status").trim(), read("before") == read("after")),
        ("0", true),
        "{said}"
    );
    assert!(
        said.contains("steps of 1 mm or deg") && said.contains("r goes on from here"),
        "{said}"
    );
}
