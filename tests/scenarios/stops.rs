//! What each stop took, as the summary says it.

use serde_json::Value;

use crate::harness::{Done, Scenario};

const LINE: &str = "G21 G90\nF5000\nG1 X100\nM2\n";
/// Speed on the line, mm/s, and the axis's limit, mm/s².
const SPEED: f64 = 5000.0 / 60.0;
const ACCELERATION: f64 = 1000.0;

fn stops(done: &Done) -> Vec<Value> {
    let summary = done.summary();
    let stops = summary["stops"].as_array().unwrap().clone();
    assert_eq!(summary["stop_count"], stops.len());
    stops
}

/// One stop at `tick` for `cause`, slower from the first sample on, in v/a and v²/2a, within one period.
fn assert_fastest(stop: &Value, tick: u64, cause: &str) {
    assert_eq!(
        (&stop["tick"], &stop["line"], &stop["cause"]),
        (&tick.into(), &3.into(), &cause.into())
    );
    assert_eq!(
        (&stop["reaction_periods"], &stop["rest"]),
        (&1.into(), &true.into()),
        "{stop}"
    );
    let number = |key: &str| stop[key].as_f64().unwrap();
    assert!(
        (number("time_s") - SPEED / ACCELERATION).abs() <= 1e-3,
        "{stop}"
    );
    assert!(
        (number("distance_mm") - SPEED * SPEED / (2.0 * ACCELERATION)).abs() <= SPEED * 1e-3,
        "{stop}"
    );
}

#[test]
fn hold_abort_and_emergency_stop_on_a_line() {
    let held = Scenario::text(LINE)
        .commands("500,hold\n900,resume\n")
        .run();
    let [hold] = &stops(&held)[..] else {
        panic!("{}", held.summary()["stops"])
    };
    assert_fastest(hold, 500, "hold");
    let printed = String::from_utf8_lossy(&held.output.stdout).into_owned();
    let words =
        "stops 1, the longest: hold at tick 500, line 3: slower from the first sample, 0.08";
    assert!(printed.contains(words), "{printed}");
    for (command, cause) in [("abort", "abort"), ("emergency-stop", "fault")] {
        let done = Scenario::text(LINE)
            .commands(&format!("500,{command}\n"))
            .run();
        assert_fastest(&stops(&done)[0], 500, cause);
    }
}

#[test]
fn starvation_and_defects_too() {
    let starved = Scenario::text(LINE).commands("300,stall-rough,100\n").run();
    starved.assert_within_limits();
    let [stop] = &stops(&starved)[..] else {
        panic!("{}", starved.summary()["stops"])
    };
    assert_fastest(stop, stop["tick"].as_u64().unwrap(), "starvation");
    // The exchange of tick 500 fails: the sample behind it is the first that there could be.
    let failed = Scenario::text(LINE)
        .with(&["--set", "faults.wrap=[{kind=\"fail\",from_tick=500}]"])
        .run();
    assert_fastest(&stops(&failed)[0], 501, "fault");
}

#[test]
fn stops_at_rest_take_no_time_and_a_hold_that_ends_early_says_so() {
    let text = "G21 G90\nF3000\nG1 X10\nM0\nG1 X20\nM2\n";
    let paused = Scenario::text(text).with(&["--pause"]).typing("\n").run();
    let [stop] = &stops(&paused)[..] else {
        panic!("{}", paused.summary()["stops"])
    };
    assert_eq!(
        (&stop["cause"], &stop["reaction_periods"]),
        (&"program stop".into(), &Value::Null)
    );
    assert_eq!(
        (stop["time_s"].as_f64(), stop["distance_mm"].as_f64()),
        (Some(0.0), Some(0.0))
    );
    let tapped = Scenario::text(LINE)
        .commands("500,hold\n510,resume\n")
        .run();
    let stop = &stops(&tapped)[0];
    assert_eq!(
        (&stop["rest"], stop["time_s"].as_f64()),
        (&false.into(), Some(0.01))
    );
}
