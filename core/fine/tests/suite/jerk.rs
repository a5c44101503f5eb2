//! The governor under a jerk limit: holds, resumes and overrides on plans that keep velocity, acceleration and jerk.

use crate::smooth;

use std::f64::consts::TAU;

use proptest::prelude::*;
use smooth::{LIMITS, Machine, PERIOD_S, Plan, profile};

/// A straight line in X and Y with limits used to 0.99.
fn line() -> Plan {
    let pieces = profile(
        120.0,
        80.0,
        0.99 * LIMITS.acceleration / 0.8,
        0.99 * LIMITS.jerk / 0.8,
    );
    Plan::new(pieces, 80.0, |s| [0.8 * s, 0.6 * s])
}

/// One and a half turns on a circle, with `share` of the limits along the path.
fn circle(radius_mm: f64, feed: f64, share: f64) -> Plan {
    let pieces = profile(
        1.5 * TAU * radius_mm,
        feed,
        share * LIMITS.acceleration,
        share * LIMITS.jerk,
    );
    Plan::new(pieces, feed, move |s| {
        [
            radius_mm * (s / radius_mm).cos() - radius_mm,
            radius_mm * (s / radius_mm).sin(),
        ]
    })
}

/// A line in X that uses the limits to 0.999, as planners aim at.
fn line_at_the_limits() -> Plan {
    let pieces = profile(60.0, 60.0, 0.999 * LIMITS.acceleration, 0.999 * LIMITS.jerk);
    Plan::new(pieces, 60.0, |s| [s, 0.0])
}

#[test]
fn a_hold_at_every_tick_of_a_plan_at_the_limits_keeps_them() {
    let plan = line_at_the_limits();
    let unheld = Machine::new(&plan).run_to_end().speeds();
    let ticks = (plan.duration_s() / PERIOD_S) as u64;
    for tick in 1..ticks {
        hold_at(&plan, &unheld, tick, &format!("hold at {tick}"));
    }
}

fn plans() -> [(&'static str, Plan); 3] {
    [
        ("line", line()),
        ("large circle", circle(20.0, 60.0, 0.5)),
        ("small circle", circle(3.0, 25.0, 0.6)),
    ]
}

#[test]
fn a_plan_that_keeps_its_limits_is_driven_as_it_is() {
    for (name, plan) in plans() {
        let done = Machine::new(&plan).run_to_end();
        done.assert_kept(name);
        assert_eq!((done.governed, done.relaxed), (0, 0));
    }
}

#[test]
fn a_hold_on_a_line_at_constant_speed_takes_the_shortest_time() {
    let plan = line();
    let mut machine = Machine::new(&plan);
    machine.run((plan.duration_s() / 2.0 / PERIOD_S) as u64);
    machine.hold(true);
    let stop_s = machine.run_to_standstill() as f64 * PERIOD_S;
    let (a, j) = (LIMITS.acceleration / 0.8, LIMITS.jerk / 0.8);
    let shortest_s = 80.0 / a + a / j;
    println!("{stop_s:.3} s, shortest {shortest_s:.4} s");
    // The last sample moves, the next one shows that it rests.
    assert!(
        stop_s < 1.02 * shortest_s + 2.0 * PERIOD_S,
        "{stop_s} {shortest_s}"
    );
}

/// A hold at `tick`, a rest, and on to the end.
fn hold_at(plan: &Plan, unheld: &[f64], tick: u64, what: &str) {
    let mut machine = Machine::new(plan);
    machine.run(tick);
    let last = machine.speeds().len();
    machine.hold(true);
    machine.run_to_standstill();
    machine.run(5);
    let held = machine.speeds();
    // The next sample is slower than without the hold, unless the plan eases off or brakes there by itself.
    let eases = unheld[last + 1] - unheld[last] < unheld[last] - unheld[last - 1] - 1e-9;
    let constant = unheld[last + 1] <= unheld[last];
    assert!(
        held[last] < unheld[last] || eases || constant && unheld[last] < unheld[last - 1],
        "{what}: {} {}",
        held[last],
        unheld[last]
    );
    machine.hold(false);
    let done = machine.run_to_end();
    done.assert_kept(what);
    assert_eq!(done.relaxed, 0, "{what}");
}

#[test]
fn a_hold_at_every_tick_keeps_every_limit() {
    for (name, plan) in plans() {
        let unheld = Machine::new(&plan).run_to_end().speeds();
        let ticks = (plan.duration_s() / PERIOD_S) as u64;
        for tick in 1..ticks {
            hold_at(&plan, &unheld, tick, &format!("{name}: hold at {tick}"));
        }
    }
}

#[test]
fn an_emergency_stop_ramps_out_within_the_limits() {
    for (name, plan) in plans() {
        let ticks = (plan.duration_s() / PERIOD_S) as u64;
        for tick in (1..ticks).step_by(7) {
            let mut machine = Machine::new(&plan);
            machine.run(tick);
            let done = machine.emergency_stop();
            done.assert_limits(&format!("{name}: stop at {tick}"));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]
    #[test]
    fn overrides_and_holds_at_random_ticks_keep_every_limit(
        which in 0..3usize,
        steps in proptest::collection::vec((1..180u64, 0.0..1.3f64), 1..12),
    ) {
        let (name, plan) = &plans()[which];
        let mut machine = Machine::new(plan);
        for &(ticks, ratio) in &steps {
            machine.run(ticks);
            // Above 1 stands for a hold that is taken back in the next step.
            machine.hold(ratio > 1.0);
            machine.ratio(ratio.min(1.0));
            if machine.is_at_end() {
                break;
            }
        }
        machine.hold(false);
        machine.ratio(1.0);
        let done = machine.run_to_end();
        done.assert_kept(name);
        prop_assert_eq!(done.relaxed, 0);
    }

    #[test]
    fn a_lower_ratio_is_kept_once_it_is_reached(which in 0..3usize, ratio in 0.05..0.95f64, tick in 20..900u64) {
        let (name, plan) = &plans()[which];
        let mut machine = Machine::new(plan);
        machine.run(tick);
        machine.ratio(ratio);
        machine.run(250);
        let from = machine.speeds().len();
        let done = machine.run_to_end();
        let over = done.speeds()[from..].iter().fold(0.0, |most: f64, v| most.max(*v)) / (ratio * plan.feed());
        prop_assert!(over < 1.005, "{name}: {over} times the feed asked for");
    }
}
