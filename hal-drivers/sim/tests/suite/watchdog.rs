//! The drives' heartbeat: a host that falls silent is noticed within the watchdog time, and the joints ramp to rest.

use tandem_sdk::{AxisVector, Driver, DriverContext, Feedback, JointState, Setpoint};
use tandem_sim::{Options, SimulatedDrives, WATCHDOG_FAULT};

const PERIOD_S: f64 = 0.001;
const SPEED_MM_PER_S: f64 = 50.0;

fn running(options: &str) -> Box<dyn Driver> {
    let mut driver = tandem_sim::PLUGIN.driver(options).unwrap();
    driver.open(&DriverContext::new(1, PERIOD_S)).unwrap();
    driver.start().unwrap();
    driver
}

/// The setpoint of `tick` on a line at constant velocity.
fn at(tick: u64) -> Setpoint {
    let position = AxisVector::from_slice(&[tick as f64 * PERIOD_S * SPEED_MM_PER_S]);
    Setpoint {
        enable: 1,
        tick,
        position,
        velocity: AxisVector::from_slice(&[SPEED_MM_PER_S]),
        ..Setpoint::default()
    }
}

fn exchange(driver: &mut dyn Driver, setpoint: &Setpoint) -> Feedback {
    let mut feedback = Feedback::default();
    driver.exchange(setpoint, &mut feedback).unwrap();
    feedback
}

fn up_to(driver: &mut dyn Driver, tick: u64) -> Feedback {
    (0..=tick).map(|t| exchange(driver, &at(t))).last().unwrap()
}

fn assert_close(value: f64, expected: f64) {
    assert!(
        (value - expected).abs() < 1e-9,
        "{value} instead of {expected}"
    );
}

#[test]
fn exchanges_that_never_came_are_lived_through() {
    for (lost, trips) in [(1, false), (5, false), (6, true), (40, true)] {
        let mut driver = running("quick_stop_deceleration_mm_per_s2 = 5000");
        up_to(&mut *driver, 100);
        let feedback = exchange(&mut *driver, &at(101 + lost));
        assert_eq!(feedback.state[0] == JointState::Fault, trips, "{lost} lost");
        assert_eq!(
            feedback.fault_code[0],
            if trips { WATCHDOG_FAULT } else { 0 }
        );
        if !trips {
            assert_eq!(
                feedback.position[0],
                at(101 + lost).position[0],
                "{lost} lost: in step again"
            );
        }
    }
}

#[test]
fn a_silent_host_is_noticed_within_the_watchdog_time_and_the_ramp_is_the_quick_stop() {
    let mut driver = running("watchdog_periods = 3\nquick_stop_deceleration_mm_per_s2 = 2000");
    let moving = up_to(&mut *driver, 100);
    for period in 1..=3 {
        let feedback = exchange(&mut *driver, &at(100));
        assert_eq!(
            (feedback.state[0], feedback.speed[0]),
            (JointState::Enabled, SPEED_MM_PER_S),
            "silence {period}"
        );
    }
    let first = exchange(&mut *driver, &at(100));
    assert_eq!(
        (first.state[0], first.fault_code[0]),
        (JointState::Fault, WATCHDOG_FAULT)
    );
    assert_close(first.speed[0], SPEED_MM_PER_S - 2.0);
    let rest = (0..24)
        .map(|_| exchange(&mut *driver, &at(100)))
        .last()
        .unwrap();
    let stopping_mm = SPEED_MM_PER_S * SPEED_MM_PER_S / (2.0 * 2000.0);
    assert_close(
        rest.position[0] - moving.position[0],
        3.0 * PERIOD_S * SPEED_MM_PER_S + stopping_mm,
    );
    assert_eq!(rest.speed[0], 0.0);
}

#[test]
fn the_fault_lasts_until_it_is_reset() {
    let mut driver = running("watchdog_periods = 1");
    up_to(&mut *driver, 10);
    assert_eq!(exchange(&mut *driver, &at(20)).state[0], JointState::Fault);
    let off = Setpoint {
        enable: 0,
        ..at(21)
    };
    assert_eq!(
        exchange(&mut *driver, &off).state[0],
        JointState::Fault,
        "not by letting go"
    );
    assert_eq!(
        exchange(&mut *driver, &at(22)).state[0],
        JointState::Fault,
        "not by talking again"
    );
    let reset = exchange(&mut *driver, &Setpoint { reset: 1, ..at(23) });
    assert_eq!(
        (reset.state[0], reset.fault_code[0]),
        (JointState::Enabled, 0)
    );
    assert_eq!(exchange(&mut *driver, &at(24)).position, at(24).position);
}

#[test]
fn waiting_and_standing_disabled_are_no_silence() {
    let mut driver = running("watchdog_periods = 1");
    let waiting = (0..100)
        .map(|_| exchange(&mut *driver, &at(0)))
        .last()
        .unwrap();
    assert_eq!(
        waiting.state[0],
        JointState::Enabled,
        "tick 0 is repeated while the queue fills"
    );
    exchange(&mut *driver, &at(1));
    let off = Setpoint {
        enable: 0,
        velocity: AxisVector::ZERO,
        ..at(2)
    };
    let disabled = (0..100)
        .map(|_| exchange(&mut *driver, &off))
        .last()
        .unwrap();
    assert_eq!(disabled.state[0], JointState::Disabled);
}

#[test]
fn zero_turns_it_off() {
    let mut driver = running("watchdog_periods = 0");
    up_to(&mut *driver, 10);
    let silent = (0..2000)
        .map(|_| exchange(&mut *driver, &at(10)))
        .last()
        .unwrap();
    assert_eq!(silent.state[0], JointState::Enabled);
}

#[test]
fn drives_with_a_lag_coast_on_as_if_the_line_went_on() {
    let options = "model = \"second-order\"\nnatural_frequency_hz = 30";
    let (mut heard, mut missed) = (running(options), running(options));
    up_to(&mut *heard, 300);
    up_to(&mut *missed, 300);
    (301..305).for_each(|tick| _ = exchange(&mut *heard, &at(tick)));
    let (heard, missed) = (
        exchange(&mut *heard, &at(305)),
        exchange(&mut *missed, &at(305)),
    );
    assert_close(missed.position[0], heard.position[0]);
    assert_close(missed.speed[0], heard.speed[0]);
}

#[test]
fn a_host_that_is_gone_is_noticed_by_the_drives_own_clock_and_they_stop_without_it() {
    let text = "watchdog_periods = 3\nquick_stop_deceleration_mm_per_s2 = 2000";
    let mut drives = SimulatedDrives::new(Options::parse(text).unwrap());
    drives.open(&DriverContext::new(1, PERIOD_S)).unwrap();
    drives.start().unwrap();
    let moving = up_to(&mut drives, 100);
    // From here on there is no host: nobody exchanges, nobody calls a quick stop.
    for period in 1..=3 {
        let feedback = drives.pass();
        assert_eq!(
            (feedback.state[0], feedback.speed[0]),
            (JointState::Enabled, SPEED_MM_PER_S),
            "period {period}"
        );
    }
    let first = drives.pass();
    assert_eq!(
        (first.state[0], first.fault_code[0]),
        (JointState::Fault, WATCHDOG_FAULT)
    );
    assert_close(first.speed[0], SPEED_MM_PER_S - 2.0);
    let rest = (0..40).map(|_| drives.pass()).last().unwrap();
    let stopping_mm = SPEED_MM_PER_S * SPEED_MM_PER_S / (2.0 * 2000.0);
    assert_close(
        rest.position[0] - moving.position[0],
        3.0 * PERIOD_S * SPEED_MM_PER_S + stopping_mm,
    );
    assert_eq!(rest.speed[0], 0.0);
    // A new host finds the fault, and the joint where it stands.
    let back = exchange(&mut drives, &at(150));
    assert_eq!(
        (back.state[0], back.position[0]),
        (JointState::Fault, rest.position[0])
    );
    assert_eq!(
        exchange(
            &mut drives,
            &Setpoint {
                reset: 1,
                ..at(151)
            }
        )
        .state[0],
        JointState::Enabled
    );
}
