//! As much as a day brings: lines without end with faults between them, and an operator who does anything at any time. Memory
//! stays as it is.
//!
//! `TANDEM_LINES=100000` and `TANDEM_HOURS=24` ask for as much as that, one test at a time: then memory is judged to 5 MB.
//! `TANDEM_SEED=n` asks for another operator.

use std::time::Instant;

use serde_json::{Value, json};
use tandem_rig::Random;
use tandem_session::controller::{Controller, NoPersistence, Options, ScriptLine};

use crate::support::{machine, registry};

/// What grows with the process, bytes; no number of another process has it.
fn resident_bytes() -> u64 {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap();
    let pages: u64 = text.split(' ').nth(1).unwrap().parse().unwrap();
    pages * 4096
}

/// Growth of the process that is no leak, bytes. Without being asked for as much as a day brings, tests beside this one take memory too.
fn max_growth_bytes(asked_by: &str) -> i64 {
    if std::env::var_os(asked_by).is_some() {
        5_000_000
    } else {
        100_000_000
    }
}

pub fn from_environment(name: &str, default: f64) -> f64 {
    std::env::var(name).map_or(default, |text| text.parse().unwrap())
}

/// Drives what `script` says; how many were told each word, and by how much the memory grew from a fifth of it on.
fn drive(name: &str, script: Vec<ScriptLine>) -> (std::collections::BTreeMap<String, u64>, i64) {
    let last = script.last().unwrap().tick;
    let registry = registry();
    let asked = Options::of_script(script);
    let controller =
        Controller::open(&machine(name), &registry, asked, Box::new(NoPersistence)).unwrap();
    let (mut counts, mut at_first, mut now) = (std::collections::BTreeMap::new(), None, 0);
    controller
        .run(&mut |line| {
            let Ok(told) = serde_json::from_str::<Value>(line) else {
                return;
            };
            now = told["tick"].as_u64().unwrap_or(now);
            if at_first.is_none() && now > last / 5 {
                at_first = Some(resident_bytes());
            }
            if told["client"] == 0 {
                // The answer to what enables the drives at the start.
                return;
            }
            let told = &told["told"];
            let word = match told["event"].as_str() {
                Some("job") => told["job"]["outcome"].as_str().unwrap(),
                Some(event) => event,
                None if told.get("ok").is_some() => "ok",
                None => "error",
            };
            *counts.entry(word.to_string()).or_insert(0) += 1;
        })
        .unwrap();
    let grown = resident_bytes().cast_signed() - at_first.unwrap().cast_signed();
    (counts, grown)
}

fn say(script: &mut Vec<ScriptLine>, tick: u64, request: &str, mut with: Value) {
    (with["id"], with["request"]) = (json!(script.len() + 1), json!(request));
    script.push(ScriptLine {
        tick,
        client: 1,
        line: with.to_string(),
    });
}

#[test]
fn lines_without_end_with_faults_and_resets_between_them_need_no_memory() {
    let lines = from_environment("TANDEM_LINES", 10_000.0) as u64;
    let mut script = vec![];
    say(&mut script, 100, "lease", json!({ "how": "take" }));
    let mut tick = 1000;
    for line in 0..lines {
        // A circle in chords of half a millimetre at 100 mm/s, over and over.
        let angle = line as f64 * 0.02;
        let (x, y) = (25.0 * angle.cos() - 25.0, 25.0 * angle.sin());
        say(
            &mut script,
            tick,
            "mdi",
            json!({ "line": format!("G1 X{x:.4} Y{y:.4} F6000") }),
        );
        tick += 20;
        if (line + 1).is_multiple_of(lines / 100) {
            say(&mut script, tick, "emergency-stop", json!({}));
            say(&mut script, tick + 1000, "reset", json!({}));
            tick += 2000;
        }
    }
    let started = Instant::now();
    let (counts, grown) = drive("mill-3axis.toml", script);
    println!(
        "{lines} lines in {:.1} s: {counts:?}, {grown} bytes",
        started.elapsed().as_secs_f64()
    );
    assert_eq!(counts["emergency-stop"], 100, "{counts:?}");
    let (driven, lost) = (
        counts["driven"],
        counts.get("not-driven").copied().unwrap_or(0),
    );
    assert_eq!(
        driven + lost,
        lines,
        "each line is told what became of it: {counts:?}"
    );
    assert!(driven > lines / 2, "{counts:?}");
    assert!(grown < max_growth_bytes("TANDEM_LINES"), "{grown} bytes");
}

#[test]
fn an_operator_who_does_anything_at_any_time_breaks_nothing() {
    let hours = from_environment("TANDEM_HOURS", 0.5);
    let seed = from_environment("TANDEM_SEED", 7.0) as u64;
    let mut random = Random::new(seed);
    let last = (hours * 3.6e6) as u64;
    let mut script = vec![];
    say(&mut script, 100, "lease", json!({ "how": "take" }));
    let (mut tick, mut asked) = (1000, 1);
    while tick < last {
        let most = random.pick(&[50, 8000, 8000]);
        tick += random.below(most);
        let (request, with) = anything(&mut random);
        say(&mut script, tick, request, with);
        asked += 1;
    }
    // Nothing is held for ever.
    for request in ["resume", "abort", "status"] {
        tick += 5000;
        say(&mut script, tick, request, json!({}));
        asked += 1;
    }
    let started = Instant::now();
    let (counts, grown) = drive("mill-3axis.toml", script);
    println!(
        "seed {seed}: {hours} h, {asked} requests in {:.1} s: {counts:?}, {grown} bytes",
        started.elapsed().as_secs_f64()
    );
    assert_eq!(
        counts["ok"] + counts["error"],
        asked,
        "one answer each: {counts:?}"
    );
    for outcome in ["done", "aborted", "emergency-stop"] {
        assert!(counts.contains_key(outcome), "{outcome}: {counts:?}");
    }
    assert!(!counts.contains_key("fault"), "{counts:?}");
    assert!(grown < max_growth_bytes("TANDEM_HOURS"), "{grown} bytes");
}

/// What somebody might ask, more often what goes on than what stops.
fn anything(random: &mut Random) -> (&'static str, Value) {
    let place = |random: &mut Random| (random.between(-60.0, 60.0), random.between(-60.0, 60.0));
    let (x, y) = place(random);
    let part =
        "G21 G90 F3000\nG1 X10\n#100 = 1\nG2 X20 Y-10 J-10\nG1 X0 Y0\nM3 S500\nG4 P0.2\nM5\nM2\n";
    let axis = random.pick(&["x", "y", "z"]);
    match random.below(24) {
        0..=7 => (
            "mdi",
            json!({ "line": format!("G90 G1 X{x:.3} Y{y:.3} F4000") }),
        ),
        8 => ("mdi", json!({ "line": "G91 G0 Z-1" })),
        9..=10 => ("load", json!({ "text": part, "name": "part.ngc" })),
        11..=13 => ("start", json!({})),
        14 => ("hold", json!({})),
        15..=16 => ("resume", json!({})),
        17 => ("abort", json!({})),
        18 => (
            "jog",
            json!({ "axis": axis, "distance_mm": x / 10.0, "feed_mm_per_min": 2000.0 }),
        ),
        19 => (
            "feed-override",
            json!({ "ratio": random.between(0.2, 1.0) }),
        ),
        20 => ("touch-off", json!({ "x_mm": x / 10.0, "y_mm": y / 10.0 })),
        21 => ("emergency-stop", json!({})),
        22 => ("reset", json!({})),
        _ => ("status", json!({})),
    }
}
