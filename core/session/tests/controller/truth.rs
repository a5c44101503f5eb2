//! What is shown and kept is what is: history, alarms, journal, and what a job changes, as the path reaches it; a driver that
//! was lost is attached again.

use std::path::Path;

use serde_json::{Value, json};
use tandem_machine::Machine;
use tandem_rig::Random;
use tandem_session::controller::NoPersistence;
use tandem_state::{Change, Outcome, Owner, Store};

use crate::scale::from_environment;
use crate::support::{Kept, Says, Told, examples, machine, machine_with};

/// Two seconds, then #500, then two seconds.
const WRITES: &str = "G21 G90 F1200\nG1 X40\n#500 = 7\nG10 L2 P2 X5\nG1 Y40\nM2\n";

/// A client that loads the program above and starts it.
fn starts_writes() -> Says {
    let mut says = Says::new();
    says.ask(
        1000,
        "load",
        json!({ "text": WRITES, "name": "writes.ngc" }),
    );
    says.ask(10, "start", json!({}));
    says
}

#[test]
fn what_a_job_writes_is_kept_when_the_path_reaches_it() {
    let kept = Kept::default();
    let mut says = starts_writes();
    let before = says.ask(1000, "status", json!({}));
    let behind = says.ask(2000, "status", json!({}));
    says.ask(10, "emergency-stop", json!({}));
    says.ask(3000, "status", json!({}));
    let told = Told::by(
        &machine("mill-3axis.toml"),
        says,
        |_| (),
        Box::new(kept.clone()),
    );
    assert_eq!(
        (&told.ok(before)["state"], &told.ok(behind)["state"]),
        (&json!("running"), &json!("running"))
    );
    let changes = kept.1.lock().unwrap();
    let is_written = |change: &Change| matches!(change, Change::Program(of) if of.parameters.get(&500) == Some(&7.0) && of.origins[1][0] == 5.0);
    let written = changes.iter().position(is_written).unwrap();
    let ended = changes
        .iter()
        .position(|change| matches!(change, Change::JobEnded { .. }))
        .unwrap();
    assert!(
        written < ended,
        "{written} {ended}: while the job is driven, not at its end"
    );

    // Stopped on the first line it is never written.
    let kept = Kept::default();
    let mut says = starts_writes();
    says.ask(1000, "abort", json!({}));
    says.ask(3000, "status", json!({}));
    Told::by(
        &machine("mill-3axis.toml"),
        says,
        |_| (),
        Box::new(kept.clone()),
    );
    assert!(!kept.1.lock().unwrap().iter().any(is_written));
}

/// Stopped in the middle of a line, and long after it: nothing is fed.
#[test]
fn behind_an_emergency_stop_the_feed_is_none() {
    let mut says = Says::new();
    says.ask(1000, "mdi", json!({ "line": "G1 X40 F1200" }));
    let moves = says.ask(1000, "status", json!({}));
    says.ask(1, "emergency-stop", json!({}));
    let after = [2, 100, 3000].map(|ticks| says.ask(ticks, "status", json!({})));
    let told = Told::by(
        &machine("mill-3axis.toml"),
        says,
        |_| (),
        Box::new(NoPersistence),
    );
    let feed = |id: u64| told.ok(id)["feed_mm_per_min"].as_f64().unwrap();
    assert!((feed(moves) - 1200.0).abs() < 1e-6, "{}", feed(moves));
    assert_eq!(after.map(feed), [0.0; 3]);
}

#[test]
fn behind_the_end_of_a_program_what_it_wrote_lasts_and_modes_are_as_at_the_start() {
    let part = "G20 G91 G18 G55 F20\nM3 S500 M8\nG1 X1\n#500 = 7\nG92 X0\nG10 L2 P2 Y25.4\nM2\n";
    let mut says = Says::new();
    says.ask(1000, "set-tool", json!({ "number": 2, "z_mm": 30.0 }));
    says.ask(10, "load", json!({ "text": part }));
    says.ask(10, "start", json!({}));
    let after = says.ask(9000, "status", json!({}));
    // The parameter and the coordinate system are those of the next line.
    let line = says.ask(10, "mdi", json!({ "line": "G0 Z[0 - #500]" }));
    let there = says.ask(3000, "status", json!({}));
    let told = Told::by(
        &machine("mill-3axis.toml"),
        says,
        |_| (),
        Box::new(NoPersistence),
    );
    let status = told.ok(after);
    assert_eq!(told.jobs()[0], ("program".to_string(), "done".to_string()));
    let modal = status["modal"].to_string();
    for word in ["G17", "G21", "G90", "G94", "G64", "M5"] {
        assert!(modal.contains(word), "{word}: {modal}");
    }
    assert_eq!(
        (
            &status["system"],
            &status["spindle_rpm"],
            &status["coolant"]
        ),
        (&json!("G55"), &json!(0.0), &json!("off"))
    );
    assert!(
        (status["g92"]["x_mm"].as_f64().unwrap() - 25.4).abs() < 1e-9,
        "{status}"
    );
    assert!(
        (status["work_position"]["x_mm"].as_f64().unwrap()).abs() < 1e-9,
        "{status}"
    );
    told.ok(line);
    assert_eq!(told.ok(there)["position"]["z_mm"], -7.0);
}

/// An axis without a brake sinks while its drive has let go: where it stands is asked of the drive.
#[test]
fn behind_letting_go_the_drives_say_where_they_stand() {
    let machine = machine_with(
        "mill-3axis.toml",
        &[("driver.options.sag_mm_per_s", "[0, 0, -5]")],
    );
    let mut says = Says::new();
    let line = says.ask(1000, "mdi", json!({ "line": "G0 X10 Z20" }));
    let before = says.ask(3000, "status", json!({}));
    says.ask(10, "disable", json!({}));
    let enable = says.ask(2000, "enable", json!({}));
    let after = says.ask(2000, "status", json!({}));
    says.ask(10, "mdi", json!({ "line": "G91 G0 Z1" }));
    let moved = says.ask(2000, "status", json!({}));
    let told = Told::by(&machine, says, |_| (), Box::new(NoPersistence));
    for id in [line, enable] {
        told.ok(id);
    }
    let z = |id: u64| told.ok(id)["position"]["z_mm"].as_f64().unwrap();
    assert_eq!(
        (z(before), &told.ok(after)["position"]["x_mm"]),
        (20.0, &json!(10.0))
    );
    assert!(z(after) < 15.0, "{}", z(after));
    assert!(
        (z(moved) - z(after) - 1.0).abs() < 1e-9,
        "{} {}",
        z(moved),
        z(after)
    );
}

fn open(path: &Path, machine: &Machine) -> Store {
    let mut store = Store::open(path, Owner::of(machine)).unwrap();
    store.fill(machine).unwrap();
    store
}

#[test]
fn history_alarms_and_the_line_that_was_driven_outlive_the_process() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mill.sqlite");
    let machine = machine("mill-3axis.toml");
    let mut says = Says::new();
    let load = says.ask(
        1000,
        "load",
        json!({ "text": WRITES, "name": "writes.ngc" }),
    );
    says.ask(10, "start", json!({}));
    says.ask(6000, "mdi", json!({ "line": "G1 X0 F600" }));
    says.ask(500, "emergency-stop", json!({}));
    let alarms = says.ask(3000, "alarms", json!({}));
    let status = says.ask(1, "status", json!({}));
    let told = Told::by(&machine, says, |_| (), Box::new(open(&path, &machine)));
    let alarms = &told.ok(alarms)["alarms"];
    assert_eq!(
        (&alarms[0]["code"], alarms.as_array().unwrap().len()),
        (&json!("emergency-stop"), 1)
    );
    assert_eq!(told.ok(status)["alarms"], *alarms);
    let hash = told.ok(load)["hash"].as_str().unwrap();

    let store = open(&path, &machine);
    let jobs = store.jobs(10).unwrap();
    let ends: Vec<_> = jobs
        .iter()
        .map(|job| (job.program.as_str(), job.end.as_ref().unwrap().outcome))
        .collect();
    assert_eq!(
        ends,
        [
            ("lines by hand", Outcome::EmergencyStop),
            ("writes.ngc", Outcome::Done)
        ]
    );
    assert_eq!((jobs[1].hash.as_str(), jobs[0].hash.as_str()), (hash, ""));
    let motion_s = jobs[1].end.as_ref().unwrap().motion_s;
    assert!((motion_s - 4.04).abs() < 0.1, "{motion_s}");
    let of_limits: f64 = jobs[1].end.as_ref().unwrap().limited_by_s.values().sum();
    assert!(of_limits > 3.0, "{of_limits}");
    let driven = store.load().driven.clone().unwrap();
    assert_eq!((driven.job, driven.line), (jobs[0].id, 1));
    assert!(store.load().last_position.is_some());

    // The next process shows them, and an acknowledgement is on disk before its answer.
    let mut says = Says::new();
    let history = says.ask(1000, "history", json!({ "count": 1 }));
    let wrong = says.ask(10, "acknowledge", json!({ "alarm": 99 }));
    let acknowledge = says.ask(10, "acknowledge", json!({}));
    let none = says.ask(10, "alarms", json!({}));
    says.ask(10, "mdi", json!({ "line": "G1 X1 F600" }));
    let next = says.ask(1000, "history", json!({}));
    let told = Told::by(&machine, says, |_| (), Box::new(store));
    let history = told.ok(history);
    assert_eq!(history["jobs"][0]["outcome"], "emergency-stop");
    assert_eq!(history["jobs"].as_array().unwrap().len(), 1);
    assert_eq!(history["driven_before"]["line"], 1);
    assert!(told.why(wrong).contains("no alarm 99"));
    assert_eq!(
        told.ok(acknowledge)["acknowledged"]
            .as_array()
            .unwrap()
            .len(),
        1
    );
    assert_eq!(told.ok(none)["alarms"], json!([]));
    let numbers: Vec<u64> = told.ok(next)["jobs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|job| job["number"].as_u64().unwrap())
        .collect();
    assert_eq!(numbers, [3, 2, 1], "numbers go on");
    let alarms = open(&path, &machine).alarms(10).unwrap();
    assert!(alarms[0].acknowledged_unix_ms.is_some());
}

/// The driver of the machine fails for good at one of its exchanges, as one does whose bus is gone.
fn vanishing(name: &str, at_call: u32) -> Machine {
    machine_with(
        name,
        &[(
            "faults.wrap",
            &format!("[{{kind = \"fail\", at_call = {at_call}}}]"),
        )],
    )
}

#[test]
fn a_driver_that_was_lost_is_attached_again_by_a_reset() {
    let mut says = Says::new();
    let line = says.ask(1000, "mdi", json!({ "line": "G1 X40 F600" }));
    let lost = says.ask(3500, "status", json!({}));
    let refused = says.ask(10, "mdi", json!({ "line": "G1 X1" }));
    let reset = says.ask(10, "reset", json!({}));
    let back = says.ask(100, "status", json!({}));
    let again = says.ask(10, "mdi", json!({ "line": "G1 X0 F1200" }));
    let there = says.ask(2600, "status", json!({}));
    // The new attachment counts its own exchanges, and is lost as the first one was.
    says.ask(10, "mdi", json!({ "line": "G1 X40 F600" }));
    let lost_again = says.ask(2500, "status", json!({}));
    let told = Told::by(
        &vanishing("mill-3axis.toml", 4000),
        says,
        |_| (),
        Box::new(NoPersistence),
    );
    told.ok(line);
    let at = |id: u64| told.ok(id)["position"]["x_mm"].as_f64().unwrap();
    assert_eq!(told.ok(lost)["state"], "fault");
    let fault = told.ok(lost)["fault"].as_str().unwrap();
    assert!(fault.contains("the exchange failed"), "{fault}");
    assert!(told.why(refused).contains("\"reset\" takes it back"));
    told.ok(reset);
    assert_eq!(told.ok(back)["state"], "ready");
    assert!(
        at(back) > 20.0 && at(back) < 40.0 && at(back) == at(lost),
        "{} {}",
        at(back),
        at(lost)
    );
    told.ok(again);
    assert_eq!(
        (told.ok(there)["state"].as_str(), at(there)),
        (Some("ready"), 0.0)
    );
    assert_eq!(told.ok(lost_again)["state"], "fault");
    let raised = told.events("alarm");
    assert_eq!(raised.len(), 2, "{raised:?}");
}

#[test]
fn homing_is_asked_again_where_the_drives_were_lost_and_not_behind_an_emergency_stop() {
    let not_homed = |told: &Told, id: u64| told.ok(id)["not_homed"].clone();
    let mut says = Says::new();
    let first = says.ask(1000, "status", json!({}));
    says.ask(10, "home", json!({}));
    let homed = says.ask(90_000, "status", json!({}));
    says.ask(10, "emergency-stop", json!({}));
    says.ask(1000, "reset", json!({}));
    let stopped = says.ask(1000, "status", json!({}));
    let told = Told::by(
        &machine("mill-homing.toml"),
        says,
        |_| (),
        Box::new(NoPersistence),
    );
    let all: Value = not_homed(&told, first);
    assert!(!all.as_array().unwrap().is_empty());
    assert_eq!(not_homed(&told, homed), json!([]));
    assert_eq!(
        not_homed(&told, stopped),
        json!([]),
        "the drives have counted on"
    );

    let mut says = Says::new();
    says.ask(1000, "home", json!({}));
    let homed = says.ask(90_000, "status", json!({}));
    let lost = says.ask(10_000, "status", json!({}));
    says.ask(10, "reset", json!({}));
    let back = says.ask(1000, "status", json!({}));
    let told = Told::by(
        &vanishing("mill-homing.toml", 95_000),
        says,
        |_| (),
        Box::new(NoPersistence),
    );
    assert_eq!(not_homed(&told, homed), json!([]));
    assert_eq!(told.ok(lost)["state"], "fault");
    assert_eq!(
        (told.ok(back)["state"].as_str(), not_homed(&told, back)),
        (Some("homing-needed"), all)
    );
}

#[test]
fn parameters_of_the_policy_script_are_set_where_it_knows_them_and_last() {
    let script = examples().join("../../scripts/policies/corner-time-constant.wasm");
    let script = script.to_str().unwrap();
    let keys = [
        ("policy.script", script),
        ("policy.parameters.corner_error_um", "20"),
    ];
    let machine = machine_with("mill-3axis.toml", &keys);
    let kept = Kept::default();
    let mut says = Says::new();
    let name = "corner_error_um";
    let first = says.ask(100, "policy-parameters", json!({}));
    let set = says.ask(
        10,
        "set-policy-parameter",
        json!({ "name": name, "value": 30.0 }),
    );
    let unknown = says.ask(
        100,
        "set-policy-parameter",
        json!({ "name": "nonsense", "value": 1.0 }),
    );
    let last = says.ask(100, "policy-parameters", json!({}));
    let told = Told::by(&machine, says, |_| (), Box::new(kept.clone()));
    assert_eq!(told.ok(first)["parameters"], json!({ name: 20.0 }));
    let declared = told.ok(first)["declared"].as_array().unwrap();
    let of = declared.iter().find(|of| of["name"] == name).unwrap();
    let bound = |key: &str| of[key].as_f64().unwrap();
    assert!(
        bound("lowest") <= 20.0 && bound("highest") >= 30.0 && !of["description"].is_null(),
        "{of}"
    );
    told.ok(set);
    assert!(
        told.why(unknown).contains("nonsense"),
        "{}",
        told.why(unknown)
    );
    assert_eq!(told.ok(last)["parameters"], json!({ name: 30.0 }));
    let is_kept = |change: &Change| matches!(change, Change::PolicyParameter { value: 30.0, .. });
    assert_eq!(
        kept.1
            .lock()
            .unwrap()
            .iter()
            .filter(|change| is_kept(change))
            .count(),
        1
    );
}

/// Who reads `at_rest` reads a place where the machine stays, whatever has stopped it: not while it slows down, nor as long as what
/// is shown is older than the rest.
#[test]
fn a_machine_that_is_said_to_rest_stays_where_it_is_shown() {
    let seed = from_environment("TANDEM_SEED", 1.0) as u64;
    let mut random = Random::new(seed);
    let stops = [
        ("hold", json!({})),
        ("abort", json!({})),
        ("emergency-stop", json!({})),
        ("jog", json!({ "stop": true })),
    ];
    for (stop, with) in stops {
        // Every other stop comes before the host has seen much of the motion.
        for soon in [false, true, false, true, false, true] {
            let mut says = Says::new();
            if stop == "jog" {
                let jog = json!({ "axis": "x", "distance_mm": 90.0, "feed_mm_per_min": 6000.0 });
                says.ask(1000, "jog", jog);
            } else {
                says.ask(1000, "mdi", json!({ "line": "G1 X90 F6000" }));
            }
            let after = if soon {
                2 + random.below(20)
            } else {
                200 + random.below(300)
            };
            says.ask(after, stop, with.clone());
            let asked: Vec<_> = (0..300).map(|_| says.ask(1, "status", json!({}))).collect();
            let mill = machine("mill-3axis.toml");
            let told = Told::by(&mill, says, |_| (), Box::new(NoPersistence));
            let shown: Vec<_> = asked
                .iter()
                .map(|id| told.ok(*id))
                .map(|status| {
                    let place = status["position"]["x_mm"].as_f64().unwrap();
                    (status["at_rest"] == true, place)
                })
                .collect();
            let rest = shown.iter().position(|(rests, _)| *rests).unwrap();
            // 100 mm/s are gone after a tenth of a second.
            assert!(
                soon || (90..150).contains(&rest),
                "{stop}, TANDEM_SEED={seed}: {rest}"
            );
            let place = shown[rest];
            let moved = shown[rest..].iter().find(|seen| **seen != place);
            assert_eq!(
                moved, None,
                "{stop}, TANDEM_SEED={seed}: it rests at {place:?}"
            );
            let held = told.events("state").into_iter();
            let held = held.filter(|told| told["state"] == "held");
            let words: Vec<_> = held.map(|told| told["at_rest"] == true).collect();
            let expected: &[bool] = if stop == "hold" { &[false, true] } else { &[] };
            // A motion that has hardly begun may rest before anybody is told that it slows down.
            assert_eq!(words.last(), expected.last(), "{stop}");
            assert!(soon || words == expected, "{stop}: {words:?}");
        }
    }
}

/// An abort that is acknowledged ends the job, in whichever of its last periods it comes, and nothing is on behind it.
#[test]
fn an_abort_in_any_of_the_last_periods_is_one() {
    let mill = machine("mill-3axis.toml");
    let part = "G21 G90 M3 S1000\nG1 X10 F3000\nM2\n";
    let mut random = Random::from_the_clock();
    let mut before_its_end = 0;
    for by_hand in [true, false] {
        for late in (random.below(8)..160).step_by(8) {
            let mut says = Says::new();
            if by_hand {
                says.ask(1000, "mdi", json!({ "line": "M3 S1000" }));
                says.ask(3000, "mdi", json!({ "line": "G1 X10 F3000" }));
            } else {
                says.ask(1000, "load", json!({ "text": part }));
                says.ask(3000, "start", json!({}));
            }
            let abort = says.ask(150 + late, "abort", json!({}));
            let after = says.ask(2000, "status", json!({}));
            let told = Told::by(&mill, says, |_| (), Box::new(NoPersistence));
            let acknowledged = told.answer(abort).get("ok").is_some();
            let (_, outcome) = told.jobs().pop().unwrap();
            let (expected, is_on) = if acknowledged {
                ("aborted", false)
            } else {
                ("done", by_hand)
            };
            assert_eq!(outcome, expected, "{late}");
            let rpm = told.ok(after)["spindle_rpm"].as_f64().unwrap();
            assert_eq!(rpm > 0.0, is_on, "{late}");
            before_its_end += usize::from(acknowledged);
        }
    }
    assert!((10..39).contains(&before_its_end), "{before_its_end}");
}

/// The end of a program switches spindle and coolant off, also where lines by hand had turned them on and it does not know of them.
#[test]
fn behind_the_end_of_a_program_nothing_turns() {
    let mut says = Says::new();
    says.ask(1000, "mdi", json!({ "line": "M3 S1000 M8" }));
    says.ask(
        2000,
        "load",
        json!({ "text": "G21 G90 F3000\nG1 X1\nM2\n" }),
    );
    let before = says.ask(100, "status", json!({}));
    says.ask(10, "start", json!({}));
    let after = says.ask(2000, "status", json!({}));
    says.ask(10, "mdi", json!({ "line": "M3 S1000" }));
    let part = "G21 G90 F3000\nG1 X5\nM5\nG1 X90\nM2\n";
    says.ask(2000, "load", json!({ "text": part }));
    says.ask(10, "start", json!({}));
    let stopped = says.ask(1000, "status", json!({}));
    says.ask(9000, "mdi", json!({ "line": "M3 S1000" }));
    let again = says.ask(2000, "status", json!({}));
    let told = Told::by(
        &machine("mill-3axis.toml"),
        says,
        |_| (),
        Box::new(NoPersistence),
    );
    let seen = |id| {
        let status = told.ok(id);
        let rpm = status["spindle_rpm"].as_f64().unwrap().round();
        let modal = status["modal"].to_string();
        (rpm, status["coolant"].clone(), modal.contains("M3"))
    };
    assert_eq!(seen(before), (1000.0, json!("flood"), true));
    assert_eq!(seen(after), (0.0, json!("off"), false));
    assert_eq!(seen(stopped).0, 0.0, "M5 of the program");
    assert_eq!(told.ok(stopped)["state"], "running");
    assert_eq!(seen(again).0, 1000.0);
    let outcomes: Vec<_> = told
        .jobs()
        .into_iter()
        .map(|(_, outcome)| outcome)
        .collect();
    assert!(
        outcomes.iter().all(|outcome| outcome == "done"),
        "{outcomes:?}"
    );
}
