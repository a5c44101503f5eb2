//! Every line that was judged is told once that it is driven, or that it is not going to be, whatever becomes of the machine.

use serde_json::{Value, json};
use tandem_machine::Machine;
use tandem_session::controller::{NoPersistence, ScriptLine};

use crate::support::{Says, Told, machine, machine_with};

/// What becomes of three lines, and what is asked meanwhile.
struct Case {
    what: &'static str,
    machine: Machine,
    /// The lines, one in a period; the first takes two seconds.
    lines: &'static [&'static str],
    /// What is said so many periods behind the last of them.
    then: &'static [(u64, &'static str)],
    /// For each line whether it is driven.
    driven: &'static [bool],
}

const LINES: &[&str] = &["G1 X40 F1200", "G1 Y40", "G10 L2 P1 X5", "G1 X10"];
const NONE: &[bool] = &[false; 4];

fn mill() -> Machine {
    machine("mill-3axis.toml")
}

fn cases() -> Vec<Case> {
    let case = |what, then, driven| Case {
        what,
        machine: mill(),
        lines: LINES,
        then,
        driven,
    };
    let on = |what, key, value| Case {
        machine: machine_with("mill-3axis.toml", &[(key, value)]),
        ..case(what, &[], NONE)
    };
    vec![
        case("nothing happens", &[], &[true; 4]),
        case("an abort on the first", &[(1000, "abort")], NONE),
        case(
            "an abort on the second",
            &[(3000, "abort")],
            &[true, false, false, false],
        ),
        case(
            "a hold, then an abort",
            &[(500, "hold"), (1000, "abort")],
            NONE,
        ),
        case("an emergency stop", &[(500, "emergency-stop")], NONE),
        case(
            "an emergency stop of a machine that is held",
            &[(500, "hold"), (1000, "emergency-stop")],
            NONE,
        ),
        case(
            "a reset behind an emergency stop",
            &[(500, "emergency-stop"), (2000, "reset")],
            NONE,
        ),
        on(
            "a drive that faults",
            "driver.options.faults",
            "[{joint=1,tick=1503,code=29200,text=\"brake chopper\"}]",
        ),
        on(
            "a driver that fails",
            "faults.wrap",
            "[{kind = \"fail\", at_call = 1600}]",
        ),
        Case {
            lines: &["G1 X40 F1200"],
            ..case("an abort before it has begun", &[(0, "abort")], &[false])
        },
        Case {
            lines: &["G1 X40 F1200"],
            ..case(
                "an emergency stop before it has begun",
                &[(0, "emergency-stop")],
                &[false],
            )
        },
        Case {
            lines: &["M0", "G1 X40 F1200"],
            ..case("an abort at M0", &[(1000, "abort")], &[false; 2])
        },
        Case {
            lines: &["G1 X10 F1200", "M2", "G1 X20 F1200", "G1 X30 F600"],
            ..case("an end of a program between them", &[], &[true; 4])
        },
        Case {
            lines: &["G90", "G10 L2 P1 X5", "(nothing)"],
            ..case("lines that drive nothing", &[], &[true; 3])
        },
        Case {
            machine: machine("mill-probe.toml"),
            lines: &["G38.2 X20 Y20 F1200"],
            ..case("a probe that finds nothing", &[], &[false])
        },
    ]
}

#[test]
fn every_queued_line_is_told_once_whether_it_is_driven() {
    for case in cases() {
        let mut says = Says::new();
        says.tick = 1000;
        let ask = |line: &&str| json!({ "line": line });
        let ids: Vec<_> = case
            .lines
            .iter()
            .map(|line| says.ask(1, "mdi", ask(line)))
            .collect();
        for (ticks, request) in case.then {
            says.ask(*ticks, request, json!({}));
        }
        says.ask(12_000, "status", json!({}));
        let told = Told::by(&case.machine, says, |_| (), Box::new(NoPersistence));
        let what = case.what;
        for (id, driven) in ids.iter().zip(case.driven) {
            assert_eq!(told.ok(*id)["judged"], true, "{what}");
            assert_eq!(told_of(&told, *id), [*driven], "{what}: line {id}");
        }
    }
}

/// Whether the line `id` is driven, as often as that was told.
fn told_of(told: &Told, id: u64) -> Vec<bool> {
    let events = told.0.iter().map(|told| &told["told"]);
    let of_it = events.filter(|told| told["id"] == id);
    let word = |told: &Value| match told["event"].as_str() {
        Some("driven") => Some(true),
        Some("not-driven") => Some(false),
        _ => None,
    };
    of_it.filter_map(word).collect()
}

/// A line that is refused is told so and nothing else; those before it and behind it are driven.
#[test]
fn a_refused_line_is_no_queued_line() {
    let mut says = Says::new();
    let ids = ["G1 X40 F1200", "G1 X4000", "G1 Y10"]
        .map(|line| says.ask(1000, "mdi", json!({ "line": line })));
    says.ask(5000, "status", json!({}));
    let told = Told::by(&mill(), says, |_| (), Box::new(NoPersistence));
    assert!(told.why(ids[1]).contains("travel"), "{}", told.why(ids[1]));
    assert_eq!(
        ids.map(|id| told_of(&told, id)),
        [vec![true], vec![], vec![true]]
    );
}

/// What was stopped before it began never moves: a line, a jog, a program that is still being checked, homing.
#[test]
fn a_stop_overtakes_what_is_about_to_begin() {
    let jog = json!({ "axis": "x", "distance_mm": 5.0, "feed_mm_per_min": 3000.0 });
    for (request, with) in [
        ("mdi", json!({ "line": "G0 X5" })),
        ("jog", jog),
        ("start", json!({})),
        ("home", json!({})),
    ] {
        for stop in ["abort", "emergency-stop"] {
            let mut says = Says::new();
            says.ask(900, "load", json!({ "text": "G21 G90\nG0 X5\nM2\n" }));
            let begins = says.ask(100, request, with.clone());
            let stopped = says.ask(0, stop, json!({}));
            let after = says.ask(3000, "status", json!({}));
            let on = machine_with(
                "mill-homing.toml",
                &[
                    ("machine.require_homing", "false"),
                    ("driver.options.unknown_start_mm", "0"),
                ],
            );
            let told = Told::by(&on, says, |_| (), Box::new(NoPersistence));
            told.ok(stopped);
            told.answer(begins);
            let status = told.ok(after);
            let place = format!("{stop} behind {request}: {status}");
            assert_eq!(status["position"]["x_mm"], 0.0, "{place}");
            let state = ["emergency-stop", "ready"][usize::from(stop == "abort")];
            assert_eq!(status["state"], state, "{place}");
        }
    }
}

/// Drives that are to be enabled stay without torque where an emergency stop comes behind the request, whether they have begun to or not.
#[test]
fn an_emergency_stop_behind_a_reset_or_an_enabling_is_in_force() {
    let slow = machine_with(
        "mill-3axis.toml",
        &[("driver.options.enable_s", "[0.2, 0.2, 0.2]")],
    );
    for request in ["reset", "enable"] {
        for later in [0, 1, 8, 50] {
            let mut says = Says::new();
            let before = ["emergency-stop", "disable"][usize::from(request == "enable")];
            says.ask(900, before, json!({}));
            let begins = says.ask(1000, request, json!({}));
            let stop = says.ask(later, "emergency-stop", json!({}));
            let after = says.ask(2000, "status", json!({}));
            // Taken back behind it, the machine is ready.
            says.ask(10, "reset", json!({}));
            let back = says.ask(2000, "status", json!({}));
            let told = Told::by(&slow, says, |_| (), Box::new(NoPersistence));
            told.ok(stop);
            let place = format!("{later} periods behind {request}");
            assert!(told.answer(begins).get("error").is_some(), "{place}");
            assert_eq!(told.ok(after)["state"], "emergency-stop", "{place}");
            assert_eq!(told.ok(back)["state"], "ready", "{place}");
        }
    }
}

/// While drives let go, and behind it, an emergency stop is one: what was asked for is answered, and a reset takes it back.
#[test]
fn an_emergency_stop_while_drives_let_go_is_in_force() {
    let slow = machine_with(
        "mill-3axis.toml",
        &[("driver.options.brake_s", "[0.2, 0.2, 0.2]")],
    );
    for later in [0, 1, 8, 50, 150, 1000] {
        let mut says = Says::new();
        let disable = says.ask(900, "disable", json!({}));
        let stop = says.ask(later, "emergency-stop", json!({}));
        let after = says.ask(2000, "status", json!({}));
        says.ask(10, "reset", json!({}));
        let back = says.ask(2000, "status", json!({}));
        let told = Told::by(&slow, says, |_| (), Box::new(NoPersistence));
        told.ok(stop);
        told.answer(disable);
        assert_eq!(
            told.ok(after)["state"],
            "emergency-stop",
            "{later} periods behind"
        );
        assert_eq!(told.ok(back)["state"], "ready", "{later} periods behind");
    }
}

/// Whenever a step is asked for while the one before is driven, ends or has ended, it is driven too.
#[test]
fn a_jog_that_is_asked_for_in_any_period_of_the_one_before_is_driven() {
    let jog = || json!({ "axis": "x", "distance_mm": 0.1, "feed_mm_per_min": 3000.0 });
    let mut says = Says::new();
    let mut shown = vec![];
    for apart in 0..160 {
        says.ask(400, "jog", jog());
        says.ask(apart, "jog", jog());
        shown.push((apart, says.ask(400, "status", json!({}))));
    }
    let told = Told::by(&mill(), says, |_| (), Box::new(NoPersistence));
    let mut jobs = 0;
    for ((apart, id), steps) in shown.into_iter().zip((2..).step_by(2)) {
        let x_mm = told.ok(id)["position"]["x_mm"].as_f64().unwrap();
        let expected_mm = f64::from(steps) * 0.1;
        assert!(
            (x_mm - expected_mm).abs() < 1e-9,
            "{apart} periods behind: {x_mm} of {expected_mm} mm"
        );
        jobs += 1;
    }
    let own = told.jobs().len();
    assert!(
        own > jobs && own < 2 * jobs,
        "some join the job before, others do not: {own} of {jobs}"
    );
}

/// The controller ends while lines wait.
#[test]
fn lines_that_wait_at_the_end_are_told() {
    let line = |tick: u64, id: u64, words: &str| ScriptLine {
        tick,
        client: 1,
        line: json!({ "id": id, "request": "mdi", "line": words }).to_string(),
    };
    let mut says = Says::new();
    says.lines.push(line(1000, 20, "G1 X40 F1200"));
    says.lines.push(line(1001, 21, "G1 Y40"));
    let registry = crate::support::registry();
    let options = tandem_session::controller::Options::of_script(says.lines);
    let mill = mill();
    let controller = tandem_session::controller::Controller::open(
        &mill,
        &registry,
        options,
        Box::new(NoPersistence),
    )
    .unwrap();
    let end = controller.ender();
    let mut told = Told(vec![]);
    controller
        .run(&mut |said| {
            let said: Value = serde_json::from_str(said).unwrap_or_default();
            if said["told"]["id"] == 21 {
                end();
            }
            told.0.push(said);
        })
        .unwrap();
    assert_eq!([20, 21].map(|id| told_of(&told, id)), [[false], [false]]);
}
