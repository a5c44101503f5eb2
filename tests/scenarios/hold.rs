//! Feed hold: in the next period, on the path, within limits.

use crate::harness::{Done, Scenario, root};
use crate::replay::some_of;

fn held(program: &str, tick: usize, until: usize) -> Done {
    let path = root().join("examples/programs").join(program);
    Scenario::of(&path)
        .commands(&format!("{tick},hold\n{until},resume\n"))
        .run()
}

/// Within limits although σ was asked to be below 1.
fn assert_held_within_limits(done: &Done) {
    done.assert_within_limits();
}

#[test]
fn hold_anywhere_stops_and_goes_on_within_limits() {
    for (program, step, until) in [
        ("square.ngc", 13, 3000),
        ("serpentine.ngc", 89, 6000),
        ("two-step-arcs.ngc", 97, 6000),
    ] {
        let free = Scenario::of(&root().join("examples/programs").join(program)).run();
        let free_feed = free.column("feed_mm_s");
        for tick in some_of(3, program, (5..free_feed.len() - 5).step_by(step)) {
            let done = held(program, tick, until);
            assert_held_within_limits(&done);
            assert_slows_at_once(&done, &free_feed, tick, until);
        }
    }
}

/// From the hold on never faster than the run that was not held, at rest in the end, and then on to the end.
fn assert_slows_at_once(done: &Done, free_feed: &[f64], tick: usize, until: usize) {
    let feed = done.column("feed_mm_s");
    for (index, free) in free_feed.iter().enumerate().skip(tick).take(40) {
        // The held run is later on the path: where the plan brakes it is compared with where the other one was.
        let free = free.max(free_feed[index - 1]);
        assert!(
            feed[index] <= free * (1.0 + 1e-9) + 1e-9,
            "hold at {tick}: sample {index} {} above {free}",
            feed[index]
        );
    }
    let stopped = feed[tick..until]
        .iter()
        .position(|f| *f == 0.0)
        .unwrap_or_else(|| panic!("hold at {tick} never stops"));
    assert!(
        feed[tick + stopped..until].iter().all(|f| *f == 0.0),
        "hold at {tick} creeps"
    );
    assert_eq!(done.cells("state")[until - 1], "holding");
    assert!(feed.len() > until);
}

#[test]
fn a_hold_on_a_line_takes_v_over_a() {
    let done = Scenario::text("G21 G90\nF5000\nG1 X100\nM2\n")
        .commands("500,hold\n900,resume\n")
        .run();
    assert_held_within_limits(&done);
    let feed = done.column("feed_mm_s");
    let speed = feed[499];
    assert!((speed - 5000.0 / 60.0).abs() < 1e-9);
    assert!(feed[500] < speed, "the first sample of the hold is slower");
    let periods = feed[500..].iter().position(|f| *f == 0.0).unwrap();
    let ideal = speed / 1000.0 * 1000.0;
    assert!(
        (periods as f64 - ideal).abs() <= 1.0,
        "{periods} periods instead of {ideal}"
    );
}

#[test]
fn an_emergency_stop_leaves_the_path_at_the_axis_limits() {
    let program = root().join("examples/programs/serpentine.ngc");
    for tick in (10u32..3000).step_by(371) {
        let done = Scenario::of(&program)
            .commands(&format!("{tick},emergency-stop\n"))
            .run();
        assert_eq!(done.status(), 3);
        assert!(
            done.errors().contains("emergency stop"),
            "{}",
            done.errors()
        );
        let verdict = done.judge(|options| {
            options.ends_early = true;
            options.path_until_s = Some((f64::from(tick) - 1.0) * 1e-3);
        });
        assert!(verdict.passed(), "stop at {tick}\n{verdict}");
        let x = done.column("x_cmd_mm");
        assert_eq!(x[x.len() - 1], x[x.len() - 2], "at rest in the end");
    }
}

#[test]
fn an_abort_rests_on_the_path_and_is_no_fault() {
    for program in ["square.ngc", "serpentine.ngc", "two-step-arcs.ngc"] {
        let program = root().join("examples/programs").join(program);
        for tick in (0..3000).step_by(307) {
            let done = Scenario::of(&program)
                .commands(&format!("{tick},abort\n"))
                .run();
            if tick as f64 > done.number("samples") {
                continue;
            }
            assert_aborted(&done, tick);
        }
    }
}

/// Exit status 3 with the line, standstill on the path, limits kept, no fault, nothing moved afterwards.
fn assert_aborted(done: &Done, tick: usize) {
    assert_eq!(done.status(), 3, "{}", done.errors());
    let words = match done.column("line").pop() {
        Some(line) => format!("stopped by the operator at line {line}"),
        // The joints did not hold yet, so nothing was driven.
        None => "stopped by the operator before the first line".to_owned(),
    };
    assert!(
        done.errors().contains(&words),
        "{words:?} is not in {}",
        done.errors()
    );
    assert_eq!(done.summary()["stopped"], words.as_str());
    assert!(done.summary()["fault"].is_null());
    let states = done.cells("state");
    if states.is_empty() {
        return;
    }
    assert_eq!(states.last().unwrap(), "standstill", "abort at {tick}");
    assert!(
        states
            .iter()
            .all(|state| state != "fault" && state != "stopping"),
        "abort at {tick}"
    );
    let verdict = done.judge(|options| {
        options.ends_early = true;
        options.sample_tolerance_mm = Some(2e-6);
    });
    assert!(verdict.passed(), "abort at {tick}\n{verdict}");
}

#[test]
fn an_abort_while_held_or_starved_ends_the_run_too() {
    let program = root().join("examples/programs/serpentine.ngc");
    for before in ["300,hold", "300,stall-rough,60"] {
        let done = Scenario::of(&program)
            .commands(&format!("{before}\n600,abort\n"))
            .run();
        assert_aborted(&done, 600);
    }
}
