//! A controller on the virtual clock: what clients ask by ticks, and what they are told.

mod doors;
mod every_state;
mod homing;
mod onlookers;
mod page;
mod queued;
mod scale;
mod seeing;
mod stopped;
mod support;
mod tokens;
mod truth;
mod watched;

use serde_json::{Value, json};
use tandem_gcode::Program;
use tandem_host::{Clock, Run, Switches};
use tandem_machine::Machine;
use tandem_session::controller::{ControllerState, NoPersistence, requests};

use support::{Kept, Says, Told, examples, machine, registry};

const PART: &str = "G21 G90 G54 F1200\n#100 = 1\nM3 S1000\nG1 X40\nG91 #100 = 2\nG1 Y30\nG10 L2 P2 X77\nG1 X-40\nG1 Y-30\nM2\n";

/// A drive stays in its fault until somebody says "reset", which reaches it: to ask for the drives alone enables nothing.
#[test]
fn a_drive_that_faults_is_reset_by_its_word_and_by_no_other() {
    for (joint, name, tick) in [(0, "X", 700), (1, "Y", 931), (2, "Z", 1203)] {
        let faults = format!("[{{joint={joint},tick={tick},code=29200,text=\"brake chopper\"}}]");
        let set = ("driver.options.faults".to_string(), faults);
        let machine = Machine::read(&examples().join("mill-3axis.toml"), &[set]).unwrap();
        let mut says = Says::new();
        let line = says.ask(100, "mdi", json!({ "line": "G90 G1 X90 Y60 Z-30 F1500" }));
        let faulted = says.ask(3000, "status", json!({}));
        let enable = says.ask(10, "enable", json!({}));
        let refused = says.ask(1000, "mdi", json!({ "line": "G90 G0 X1" }));
        let reset = says.ask(10, "reset", json!({}));
        let back = says.ask(3000, "mdi", json!({ "line": "G90 G0 X10 Y5 Z-1" }));
        let done = says.ask(8000, "status", json!({}));
        let disable = says.ask(10, "disable", json!({}));
        says.ask(1000, "status", json!({}));
        let told = Told::by(&machine, says, |_| (), Box::new(NoPersistence));
        for id in [line, reset, back, disable] {
            told.ok(id);
        }
        let fault = told.ok(faulted)["fault"].to_string();
        assert!(
            fault.contains("brake chopper") && fault.contains(name),
            "{fault}"
        );
        for id in [enable, refused] {
            let why = told.why(id);
            assert!(why.contains("reset"), "{name}: {why}");
        }
        let done = told.ok(done);
        assert_eq!(done["state"], "ready", "{done}");
        for (axis, expected) in [("x_mm", 10.0), ("y_mm", 5.0), ("z_mm", -1.0)] {
            let at = done["position"][axis].as_f64().unwrap();
            assert!((at - expected).abs() < 1e-9, "{axis}: {at}");
        }
    }
}

#[test]
fn a_day_at_the_machine_in_one_process() {
    let (machine, kept) = (machine("mill-homing.toml"), Kept::default());
    let mut says = Says::new();
    let early = says.ask(2000, "mdi", json!({ "line": "G0 X1" }));
    let home = says.ask(100, "home", json!({}));
    let jog = says.ask(
        90_000,
        "jog",
        json!({ "axis": "x", "distance_mm": 5.0, "feed_mm_per_min": 3000.0 }),
    );
    let touch_off = says.ask(3000, "touch-off", json!({ "x_mm": 0.0, "y_mm": 0.0 }));
    let line = says.ask(10, "mdi", json!({ "line": "G0 X10 Y5" }));
    let load = says.ask(4000, "load", json!({ "text": PART, "name": "part.ngc" }));
    let start = says.ask(10, "start", json!({}));
    let hold = says.ask(1000, "hold", json!({}));
    let held = says.ask(1000, "status", json!({}));
    let resume = says.ask(10, "resume", json!({}));
    // On the second line of motion: G91 and #100 are true, the offset of G55 is not yet.
    let abort = says.ask(1500, "abort", json!({}));
    let aborted = says.ask(3000, "status", json!({}));
    let again = says.ask(10, "start", json!({}));
    let stop = says.ask(500, "emergency-stop", json!({}));
    let stopped = says.ask(3000, "status", json!({}));
    let refused = says.ask(10, "start", json!({}));
    let reset = says.ask(10, "reset", json!({}));
    let back = says.ask(3000, "mdi", json!({ "line": "G90 G0 X0 Y0" }));
    let last = says.ask(6000, "start", json!({}));
    let done = says.ask(30_000, "status", json!({}));
    let disable = says.ask(10, "disable", json!({}));
    let end = says.ask(1000, "status", json!({}));
    let told = Told::by(&machine, says, |_| (), Box::new(kept.clone()));

    assert!(
        told.why(early).contains("\"home\" homes it"),
        "{}",
        told.why(early)
    );
    for id in [
        home, jog, touch_off, line, load, start, hold, resume, abort, again, stop, reset, back,
        last, disable,
    ] {
        told.ok(id);
    }
    assert_eq!(told.ok(held)["state"], "held");
    let aborted = told.ok(aborted);
    assert_eq!(
        (&aborted["state"], &aborted["spindle_rpm"]),
        (&json!("ready"), &json!(0.0))
    );
    let modal = aborted["modal"].to_string();
    assert!(modal.contains("G91") && modal.contains("M5"), "{modal}");
    let at = |status: &Value, axis: &str| status["work_position"][axis].as_f64().unwrap();
    assert!(
        (at(aborted, "x_mm") - 40.0).abs() < 1e-9
            && at(aborted, "y_mm") > 5.0
            && at(aborted, "y_mm") < 35.0
    );
    assert_eq!(told.ok(stopped)["state"], "emergency-stop");
    assert!(told.why(refused).contains("\"reset\" takes it back"));
    let done = told.ok(done);
    assert_eq!(
        (done["state"].as_str(), done["not_homed"].to_string()),
        (Some("ready"), "[]".to_string())
    );
    assert!(
        at(done, "x_mm").abs() < 1e-9 && at(done, "y_mm").abs() < 1e-9,
        "{done}"
    );
    assert_eq!(told.ok(end)["state"], "disabled");
    let jobs: Vec<_> = told.jobs();
    let expected = [
        ("home", "done"),
        ("jog", "done"),
        ("mdi", "done"),
        ("program", "aborted"),
        ("program", "emergency-stop"),
        ("mdi", "done"),
        ("program", "done"),
    ];
    assert_eq!(
        jobs,
        expected.map(|(job, outcome)| (job.to_string(), outcome.to_string()))
    );
    for state in [
        "homing-needed",
        "running",
        "ready",
        "manual",
        "mdi",
        "held",
        "stopping",
        "emergency-stop",
        "disabled",
    ] {
        assert!(
            told.states().contains(&state),
            "{state}: {:?}",
            told.states()
        );
    }
    // What the path had reached by the abort is kept, what it had not is not; the last run has come to its end.
    let kept = kept.0.lock().unwrap();
    let parameters: Vec<_> = kept
        .iter()
        .map(|persistent| persistent.parameters.get(&100).copied())
        .collect();
    let after_abort = kept
        .iter()
        .find(|persistent| persistent.parameters.get(&100) == Some(&2.0))
        .unwrap();
    assert_eq!(after_abort.origins[1][0], 0.0, "{parameters:?}");
    assert_eq!(kept.last().unwrap().origins[1][0], 77.0);
}

#[test]
fn lines_that_come_in_time_are_planned_through() {
    let machine = machine("mill-3axis.toml");
    let chord = |nth: usize| {
        let angle = nth as f64 / 400.0 * std::f64::consts::TAU;
        format!(
            "G1 X{:.4} Y{:.4} F3000",
            20.0 * angle.cos() - 20.0,
            20.0 * angle.sin()
        )
    };
    let text = (1..=400).map(|nth| chord(nth) + "\n").collect::<String>();
    let run = Run::prepare(
        machine.clone(),
        &registry(),
        Program::spool("circle.ngc", text.as_bytes()).unwrap(),
        Switches::default(),
    );
    let alone_s = run
        .unwrap()
        .drive(Clock::Virtual, &[], &mut ())
        .unwrap()
        .summary
        .motion_time_s;
    // A sender that sends all at once; and one with a line in 4 ms, where a chord takes 6 ms: it is some tenths of a second ahead
    // only after a while.
    for (every_ticks, most) in [(0, 1.05), (4, 1.15)] {
        let mut says = Says::new();
        says.ask(1000, "status", json!({}));
        let ids: Vec<_> = (1..=400)
            .map(|nth| says.ask(every_ticks, "mdi", json!({ "line": chord(nth) })))
            .collect();
        says.ask(20_000, "status", json!({}));
        let told = Told::by(&machine, says, |_| (), Box::new(NoPersistence));
        for id in &ids {
            _ = told.ok(*id);
        }
        let events = told.0.iter().filter(|told| told["told"]["event"] == "job");
        let jobs: Vec<f64> = events
            .map(|told| told["told"]["job"]["time_s"].as_f64().unwrap())
            .collect();
        assert_eq!(jobs.len(), 1, "one job: {jobs:?}");
        let ratio = jobs[0] / alone_s;
        assert!(
            ratio <= most,
            "a line in {every_ticks} ms: {ratio} of the program's time"
        );
        let driven = told
            .0
            .iter()
            .filter(|told| told["told"]["event"] == "driven")
            .count();
        assert_eq!(driven, 400, "each line is told when it is driven");
    }
}

#[test]
fn a_sender_that_stalls_stops_the_machine_on_the_path_and_goes_on_from_there() {
    let machine = machine("mill-3axis.toml");
    let mut says = Says::new();
    says.ask(1000, "status", json!({}));
    let mut ids = vec![];
    for stall_ticks in [4, 3000, 4, 4, 2500] {
        let x = (ids.len() + 1) * 10;
        ids.push(says.ask(
            stall_ticks,
            "mdi",
            json!({ "line": format!("G1 X{x} F3000") }),
        ));
    }
    let end = says.ask(3000, "status", json!({}));
    let told = Told::by(&machine, says, |_| (), Box::new(NoPersistence));
    for id in &ids {
        _ = told.ok(*id);
    }
    assert_eq!(told.ok(end)["position"]["x_mm"], 50.0);
    assert!(
        told.jobs().iter().all(|(_, outcome)| outcome == "done") && told.jobs().len() == 3,
        "{:?}",
        told.jobs()
    );
}

/// Every request is asked in states that the machine is really in, without what it needs: each has one answer, and none moves
/// the machine or ends the controller.
#[test]
fn every_request_has_one_answer_in_real_states() {
    for (name, enable) in [
        ("mill-3axis.toml", false),
        ("mill-homing.toml", true),
        ("mill-3axis.toml", true),
    ] {
        let mut says = Says::new();
        says.ask(2000, "status", json!({}));
        let moves = ["emergency-stop", "reset", "enable", "disable", "home"];
        let ids: Vec<_> = requests()
            .filter(|request| !moves.contains(request))
            .map(|request| {
                says.ask(
                    10,
                    if request == "jog-stop" {
                        "jog"
                    } else {
                        request
                    },
                    json!({}),
                )
            })
            .collect();
        let end = says.ask(100, "status", json!({}));
        let told = Told::by(
            &machine(name),
            says,
            |options| options.enable = enable,
            Box::new(NoPersistence),
        );
        for id in &ids {
            _ = told.answer(*id);
        }
        let state = match (name, enable) {
            (_, false) => ControllerState::Disabled,
            ("mill-homing.toml", _) => ControllerState::HomingNeeded,
            _ => ControllerState::Ready,
        };
        assert_eq!(told.ok(end)["state"], state.name());
    }
}
