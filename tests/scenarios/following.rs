//! The following error as a fault, and the driver's own words in one.

use crate::bench::{Bench, passed};
use crate::harness::{Done, Scenario, root};
use tandem_fine::FaultKind;
use tandem_rings::MachineState;

const LAGGING: &str = "driver.options={model = \"second-order\", natural_frequency_hz = 20}";

fn run(settings: &[&str]) -> Done {
    let arguments: Vec<&str> = settings
        .iter()
        .flat_map(|setting| ["--set", *setting])
        .collect();
    Scenario::of(&root().join("examples/programs/square.ngc"))
        .with(&arguments)
        .run()
}

/// Distances between command and feedback of an axis, mm.
fn errors_mm(done: &Done, axis: &str) -> Vec<f64> {
    let (command, feedback) = (
        done.column(&format!("{axis}_cmd_mm")),
        done.column(&format!("{axis}_fb_mm")),
    );
    command
        .iter()
        .zip(feedback)
        .map(|(command, feedback)| (command - feedback).abs())
        .collect()
}

#[test]
fn drives_that_lag_too_far_behind_are_a_fault_in_that_period() {
    let free = run(&[LAGGING]);
    let errors_mm = errors_mm(&free, "y");
    let worst_mm = errors_mm
        .iter()
        .fold(0.0, |most: f64, error| most.max(*error));
    assert!(worst_mm > 0.1, "{worst_mm} mm is no lag to speak of");
    for share in [0.2, 0.5, 0.9] {
        let limit_mm = worst_mm * share;
        let done = run(&[
            LAGGING,
            &format!("axes.y.max_following_error_mm={limit_mm}"),
        ]);
        assert_eq!(done.status(), 3);
        let tick = errors_mm
            .iter()
            .position(|error| *error > limit_mm)
            .unwrap();
        let words = format!(
            "fault: driver sim: axis Y is {:.6} mm away from its command, limit {limit_mm:.6} mm (line 7, tick {tick},",
            errors_mm[tick]
        );
        assert!(
            done.errors().contains(&words),
            "{words:?} is not in {}",
            done.errors()
        );
        assert_eq!(done.cells("state").last().unwrap(), "fault");
        let verdict = done.judge(|options| {
            options.ends_early = true;
            options.path_until_s = Some(tick as f64 * 1e-3);
        });
        assert!(verdict.passed(), "{verdict}");
    }
}

#[test]
fn drives_that_keep_the_limit_run_as_without_one() {
    let (free, done) = (
        run(&[LAGGING]),
        run(&[LAGGING, "axes.x.max_following_error_mm=25"]),
    );
    done.assert_within_limits();
    assert_eq!(done.cells("x_cmd_mm"), free.cells("x_cmd_mm"));
    run(&["axes.x.max_following_error_mm=0.000001"]).assert_within_limits();
}

#[test]
fn a_frozen_joint_is_found_by_its_following_error_at_every_place() {
    let bench = Bench::of(&root().join("tests/fixtures/programs/every-tick.ngc"));
    let limits = ["x", "y", "z"].map(|axis| format!("axes.{axis}.max_following_error_mm"));
    let mut found = 0;
    for tick in (1..1400).step_by(13) {
        let wrap = format!("[{{kind = \"freeze\", from_tick = {tick}, joint = 0}}]");
        let mut settings: Vec<(&str, &str)> =
            limits.iter().map(|key| (key.as_str(), "0.2")).collect();
        settings.push(("faults.wrap", &wrap));
        let ran = bench.run_with("", &settings);
        let Some(fault) = ran.outcome.fault else {
            continue;
        };
        assert!(
            matches!(fault.kind, FaultKind::Following { joint: 0, error_mm, limit_mm: 0.2 } if error_mm > 0.2)
        );
        ran.expect_rest_in(MachineState::Fault).unwrap();
        passed(&bench.judge(&ran, |options| {
            options.ends_early = true;
            options.path_until_s = Some(fault.tick as f64 * 1e-3);
        }))
        .unwrap();
        found += 1;
    }
    assert!(found > 90, "{found}");
}

#[test]
fn the_fault_repeats_what_the_driver_said() {
    let done = run(&["faults.wrap=[{kind = \"fail\", from_tick = 100}]"]);
    let words = "fault: driver sim: the exchange failed: failed on purpose, by [faults] (line 6, tick 100, 0.100 s)";
    assert!(done.errors().contains(words), "{}", done.errors());
}
