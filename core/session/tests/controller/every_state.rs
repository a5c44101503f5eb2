//! Every request in every state, as the table has it: the machine is really brought into the state, then asked.

use serde_json::{Value, json};
use tandem_session::controller::{ControllerState, NoPersistence, WORDS, judge};

use crate::support::{Says, Told, machine, machine_with};

/// Two lines that take seconds.
const LONG: &str = "G21 G90 F600\nG1 X40\nG1 Y40\nM2\n";

/// What brings a machine into `state`, and the machine.
fn into(state: ControllerState) -> (tandem_machine::Machine, bool, Says) {
    let mut says = Says::new();
    says.ask(900, "load", json!({ "text": LONG, "name": "long.ngc" }));
    let mill = || machine("mill-3axis.toml");
    let (mut is_enabled, mut on) = (true, mill());
    match state {
        ControllerState::Ready => _ = says.ask(100, "status", json!({})),
        ControllerState::Disabled => is_enabled = false,
        ControllerState::EmergencyStop => _ = says.ask(100, "emergency-stop", json!({})),
        ControllerState::HomingNeeded => on = machine("mill-homing.toml"),
        ControllerState::Manual => {
            let jog = json!({ "axis": "x", "distance_mm": 50.0, "feed_mm_per_min": 600.0 });
            says.ask(100, "jog", jog);
        }
        ControllerState::Mdi => _ = says.ask(100, "mdi", json!({ "line": "G1 X40 F600" })),
        ControllerState::Running => _ = says.ask(100, "start", json!({})),
        ControllerState::Held => {
            says.ask(100, "start", json!({}));
            says.ask(1000, "hold", json!({}));
        }
        ControllerState::Stopping => {
            says.ask(100, "start", json!({}));
            says.ask(1000, "abort", json!({}));
        }
        ControllerState::Fault => {
            on = machine_with(
                "mill-3axis.toml",
                &[("faults.wrap", "[{kind = \"fail\", at_call = 1100}]")],
            );
        }
    }
    // Where it is brought to rest it is asked at once.
    says.tick += if state == ControllerState::Stopping {
        2
    } else {
        1000
    };
    (on, is_enabled, says)
}

/// The request as a client sends it that wants it done.
fn example(word: &str) -> (&str, Value) {
    let with = match word {
        "subscribe" => json!({ "rate_hz": 0 }),
        "scope" | "capture" => json!({ "signals": ["sigma"] }),
        "lease" => json!({ "how": "take" }),
        "role" => json!({ "as": "operate" }),
        "jog-stop" => return ("jog", json!({ "stop": true })),
        "load" | "check" => json!({ "text": "M2\n" }),
        "upload" => json!({ "name": "x.ngc", "text": "M2\n" }),
        "feed-override" | "rapid-override" => json!({ "ratio": 0.5 }),
        "single-block" | "optional-stop" | "block-delete" => json!({ "on": false }),
        "mdi" => json!({ "line": "G1 X1 F600" }),
        "jog" => json!({ "axis": "x", "distance_mm": 1.0, "feed_mm_per_min": 600.0 }),
        "touch-off" | "set-offset" => json!({ "x_mm": 1.0 }),
        "set-tool" => json!({ "number": 1 }),
        "set-parameter" => json!({ "number": 500, "value": 1.0 }),
        "set-policy-parameter" => json!({ "name": "x", "value": 1.0 }),
        _ => json!({}),
    };
    (word, with)
}

#[test]
fn every_request_in_every_state_is_done_or_refused_as_the_table_says() {
    let mut asked = 0;
    for state in ControllerState::ALL {
        for word in WORDS {
            let (on, is_enabled, mut says) = into(state);
            let before = says.ask(0, "status", json!({}));
            let (request, with) = example(word.name);
            let id = says.ask(0, request, with);
            says.ask(5000, "status", json!({}));
            let enable = |options: &mut tandem_session::controller::Options| {
                options.enable = is_enabled;
            };
            let told = Told::by(&on, says, enable, Box::new(NoPersistence));
            let place = format!("{} in {}", word.name, state.name());
            assert_eq!(told.ok(before)["state"], state.name(), "{place}");
            let answer = told.answer(id);
            let why = answer["error"]["why"].as_str();
            if let Err(reason) = judge(state, word.name) {
                assert_eq!(why, Some(reason), "{place}");
            } else {
                // It may lack what it needs: a program, a folder, a switch to home on. That is no matter of the state.
                let of_state = why.filter(|why| {
                    let reasons = ControllerState::ALL.map(|other| judge(other, word.name).err());
                    reasons.contains(&Some(*why))
                });
                assert_eq!(of_state, None, "{place}");
            }
            asked += 1;
        }
    }
    assert_eq!(asked, ControllerState::ALL.len() * WORDS.len());
}
