//! Behind trouble of any kind the machine is reset, and works again: one process, one bus, as under `tandem serve`.

use serde_json::{Value, json};
use tandem_rig::Random;
use tandem_session::controller::{Controller, NoPersistence, Options, ScriptLine};

use crate::ethercat::{fault, machine, seeds, table};
use crate::registry;

/// The trouble lasts so long, ms: by then the machine has come to rest in its fault.
const LASTS: &str = "ms = 60.0";

/// What happens, how long, and the words of its fault.
const TROUBLES: [(&str, &str, &str); 18] = [
    ("kind = \"lost-reply\"", LASTS, "no frame comes back"),
    ("kind = \"lost-request\"", LASTS, "no frame comes back"),
    (
        "kind = \"late\", by_us = 9000.0",
        LASTS,
        "no frame comes back",
    ),
    (
        "kind = \"corrupt\", byte = 20, mask = 255",
        LASTS,
        "no frame comes back",
    ),
    ("kind = \"cut\"", LASTS, "no frame comes back"),
    (
        "kind = \"cut\", behind = 0",
        LASTS,
        "device 1: the working counter",
    ),
    (
        "kind = \"cut\", behind = 1",
        LASTS,
        "device 2: the working counter",
    ),
    (
        "kind = \"cut\", behind = 2",
        LASTS,
        "device 3: the working counter",
    ),
    (
        "kind = \"deaf\", device = 1",
        LASTS,
        "device 1: the working counter",
    ),
    (
        "kind = \"deaf\", device = 3",
        LASTS,
        "device 3: the working counter",
    ),
    (
        "kind = \"drive-fault\", device = 2, code = 0x7305",
        "",
        "fault 0x7305 (device 2: encoder 1)",
    ),
    (
        "kind = \"al-error\", device = 0, state = \"safe-op\", code = 0x1a",
        "",
        "device 0: it left OP: 001A",
    ),
    (
        "kind = \"al-error\", device = 1, state = \"safe-op\", code = 0x1b",
        "",
        "device 1: it left OP: 001B",
    ),
    (
        "kind = \"al-error\", device = 2, state = \"pre-op\", code = 0x2c",
        "",
        "device 2: it left OP: 002C",
    ),
    (
        "kind = \"al-error\", device = 1, state = \"init\", code = 0x32",
        "",
        "device 1: it left OP: 0032",
    ),
    (
        "kind = \"disables-itself\", device = 0",
        "",
        "device 0: it let go",
    ),
    (
        "kind = \"torque-off\", device = 1",
        LASTS,
        "device 1: it let go",
    ),
    ("kind = \"power-cycle\", device = 1", "", "device 1: "),
];

/// What a controller tells about a script.
fn told(text: &str, lines: Vec<ScriptLine>) -> Vec<Value> {
    let registry = registry();
    let machine = machine(text);
    let options = Options::of_script(lines);
    let controller =
        Controller::open(&machine, &registry, options, Box::new(NoPersistence)).unwrap();
    let mut told = vec![];
    controller
        .run(&mut |line| told.extend(serde_json::from_str::<Value>(line).ok()))
        .unwrap();
    told
}

#[test]
fn behind_trouble_of_any_kind_a_reset_brings_the_machine_back_and_it_drives_on() {
    for seed in 0..seeds() {
        let mut random = Random::new(seed + 900);
        for (what, lasts, words) in TROUBLES {
            let cycle = 600 + random.below(100);
            let case = format!("seed {seed}: {what} in frame {cycle}");
            // Homed where they stand, so that what was lost can be homed again.
            let homing = "[homing.x]\nsequence = 1\ndrive_method = 35\n[homing.y]\nsequence = 1\ndrive_method = 35\n\
                          [homing.z]\nsequence = 1\ndrive_method = 35\n";
            let text = table(
                seed,
                &(fault(&format!("cycle = {cycle}"), lasts, what) + homing),
                "",
            );
            // A drive that is homed where it stands counts from 0 there.
            let far = i32::MAX - 500;
            let text = text
                .replace(&format!("zero_counts = {far}"), "zero_counts = 0")
                .replace(
                    &format!("position_counts = {far}.0"),
                    "position_counts = 0.0",
                );
            let mut lines = vec![];
            let mut ask = |tick: u64, request: &str, mut with: Value| {
                (with["id"], with["request"]) = (json!(lines.len() + 1), json!(request));
                lines.push(ScriptLine {
                    tick,
                    client: 1,
                    line: with.to_string(),
                });
                lines.len()
            };
            ask(50, "lease", json!({ "how": "take" }));
            ask(300, "mdi", json!({ "line": "G1 X40 Y-30 Z20 F1500" }));
            let stopped = ask(1000, "status", json!({}));
            for n in 0..12 {
                ask(1105 + 15 * n, "reset", json!({}));
            }
            ask(1300, "home", json!({}));
            ask(1700, "mdi", json!({ "line": "G91 G1 X3 Y-2 Z1 F3000" }));
            let back = ask(2700, "status", json!({}));
            let told = told(&text, lines);
            let status = |id: usize| {
                let answer = told
                    .iter()
                    .find(|line| line["told"]["id"] == id && line["told"].get("ok").is_some());
                &answer.unwrap_or_else(|| panic!("{case}: {id}: {told:#?}"))["told"]["ok"]
            };
            assert_eq!(status(stopped)["state"], "fault", "{case}");
            let why = status(stopped)["fault"].as_str().unwrap_or_default();
            assert!(why.contains(words), "{case}: {why}");
            assert_eq!(status(back)["state"], "ready", "{case}: {}", status(back));
            let jobs = told.iter().filter(|line| line["told"]["event"] == "job");
            let last = jobs.map(|line| &line["told"]["job"]).next_back().unwrap();
            assert_eq!(
                (&last["job"], &last["outcome"]),
                (&json!("mdi"), &json!("done")),
                "{case}"
            );
        }
    }
}
