//! The simulated drives through the driver contract, made by the plugin's factory as a host does.

use std::f64::consts::TAU;

use tandem_sdk::{AxisVector, Driver, DriverContext, Feedback, JointState, Setpoint};

const PERIOD_S: f64 = 0.001;

fn make(options: &str) -> Box<dyn Driver> {
    tandem_sim::PLUGIN.driver(options).unwrap()
}

fn running(options: &str) -> Box<dyn Driver> {
    let mut driver = make(options);
    let mut context = DriverContext::new(3, PERIOD_S);
    context.start_position = AxisVector::from_slice(&[1.0, 2.0, 3.0]);
    driver.open(&context).unwrap();
    driver.start().unwrap();
    driver
}

fn setpoint(position: &[f64], velocity: &[f64]) -> Setpoint {
    let position = AxisVector::from_slice(position);
    Setpoint {
        enable: 1,
        position,
        velocity: AxisVector::from_slice(velocity),
        ..Setpoint::default()
    }
}

fn exchange(driver: &mut dyn Driver, setpoint: &Setpoint) -> Feedback {
    let mut feedback = Feedback::default();
    driver.exchange(setpoint, &mut feedback).unwrap();
    feedback
}

#[test]
fn ideal_drives_answer_the_setpoint_in_the_same_exchange() {
    let mut driver = running("");
    assert_eq!(driver.describe().simulated, 1);
    let asked = setpoint(&[1.5, -2.0, 3.25], &[500.0, -4000.0, 250.0]);
    let feedback = exchange(&mut *driver, &asked);
    assert_eq!(
        (feedback.position, feedback.speed),
        (asked.position, asked.velocity)
    );
    assert_eq!(feedback.current_a, AxisVector::ZERO);
    assert_eq!(
        feedback.state[..4],
        [
            JointState::Enabled,
            JointState::Enabled,
            JointState::Enabled,
            JointState::Disabled
        ]
    );
}

#[test]
fn disabled_drives_stay_where_they_are() {
    let mut driver = running("");
    let feedback = exchange(
        &mut *driver,
        &Setpoint {
            enable: 0,
            ..setpoint(&[9.0, 9.0, 9.0], &[])
        },
    );
    assert_eq!(feedback.position, AxisVector::from_slice(&[1.0, 2.0, 3.0]));
    assert_eq!(feedback.state, [JointState::Disabled; 8]);
}

#[test]
fn second_order_drives_lag_settle_and_draw_current() {
    let mut driver =
        running("model = \"second-order\"\nnatural_frequency_hz = 30\ndamping_ratio = 0.7");
    let speed = 100.0;
    let at = |tick: i32| {
        setpoint(
            &[1.0 + f64::from(tick) * PERIOD_S * speed, 2.0, 3.0],
            &[speed],
        )
    };
    let first = exchange(&mut *driver, &at(0));
    assert_eq!((first.position[0], first.speed[0]), (1.0, 0.0));
    let second = exchange(&mut *driver, &at(1));
    let current =
        tandem_sim::CURRENT_A_PER_MM_PER_S2 * (second.speed[0] - first.speed[0]) / PERIOD_S;
    assert!(current > 0.0 && (second.current_a[0] - current).abs() < 1e-12);
    let cruising = (2..=500)
        .map(|tick| exchange(&mut *driver, &at(tick)))
        .last()
        .unwrap();
    let lag = at(500).position[0] - cruising.position[0];
    assert!(
        (lag - speed * 2.0 * 0.7 / (TAU * 30.0)).abs() < 1e-9,
        "following error {lag}"
    );
    assert!(cruising.current_a[0].abs() < 1e-6);
    let settled = (0..500)
        .map(|_| exchange(&mut *driver, &at(500)))
        .last()
        .unwrap();
    assert!(
        (settled.position[0] - at(500).position[0]).abs() < 1e-9 && settled.speed[0].abs() < 1e-6
    );
}

#[test]
fn quick_stop_ramps_down_and_lasts_until_released() {
    for model in ["ideal", "second-order"] {
        let mut driver = running(&format!(
            "model = \"{model}\"\nquick_stop_deceleration_mm_per_s2 = 2000\nnatural_frequency_hz = 300"
        ));
        let at = |tick: i32| setpoint(&[1.0 + f64::from(tick) * 0.05, 2.0, 3.0], &[50.0]);
        let moving = (0..100)
            .map(|tick| exchange(&mut *driver, &at(tick)))
            .last()
            .unwrap();
        driver.quick_stop();
        let braking = exchange(&mut *driver, &at(100));
        assert!(
            (braking.speed[0] - (moving.speed[0] - 2.0)).abs() < 1e-9,
            "{model}: 2000 mm/s² over 1 ms"
        );
        assert_eq!(braking.state[0], JointState::QuickStop);
        let rest = (101..140)
            .map(|tick| exchange(&mut *driver, &at(tick)))
            .last()
            .unwrap();
        let distance = rest.position[0] - moving.position[0];
        assert!(
            (distance - 50.0 * 50.0 / 4000.0).abs() < 1e-3,
            "{model}: stopped after {distance} mm"
        );
        assert_eq!((rest.speed[0], rest.state[0]), (0.0, JointState::Disabled));
        let here = [rest.position[0], 2.0, 3.0];
        exchange(
            &mut *driver,
            &Setpoint {
                reset: 1,
                ..setpoint(&here, &[])
            },
        );
        let back = exchange(&mut *driver, &setpoint(&here, &[]));
        assert_eq!(back.state[0], JointState::Enabled, "{model}");
    }
}

#[test]
fn letting_go_in_motion_runs_out() {
    let mut driver = running("");
    exchange(&mut *driver, &setpoint(&[1.0, 2.0, 3.0], &[0.0, 100.0]));
    let off = Setpoint {
        enable: 0,
        ..Setpoint::default()
    };
    let rest = (0..21)
        .map(|_| exchange(&mut *driver, &off))
        .last()
        .unwrap();
    assert!(
        (rest.position[1] - 3.0).abs() < 1e-9,
        "100²/(2·5000) mm further, not {}",
        rest.position[1]
    );
    assert_eq!(rest.speed[1], 0.0);
}

#[test]
fn switches_are_inputs_and_any_of_them_sets_one() {
    let switch = |joint: u32, above: f64| {
        format!("[[switches]]\ninput = 5\njoint = {joint}\nabove_mm = {above:?}\n")
    };
    let mut driver = running(&(switch(0, 12.5) + &switch(1, 50.0)));
    let mut inputs = |x: f64, y: f64| exchange(&mut *driver, &setpoint(&[x, y, 0.0], &[])).inputs;
    assert_eq!(inputs(12.5, 0.0), 0, "at the plane is not above it");
    assert_eq!(inputs(12.500_001, 0.0), 1 << 5);
    assert_eq!(inputs(0.0, 51.0), 1 << 5);
    assert_eq!(inputs(0.0, 0.0), 0);
}

#[test]
fn spindle_follows_with_its_time_constant() {
    let mut driver = running("spindle_time_constant_s = 0.1");
    let on = Setpoint {
        spindle_rad_per_s: 200.0,
        ..setpoint(&[1.0, 2.0, 3.0], &[])
    };
    let later = (0..100)
        .map(|_| exchange(&mut *driver, &on))
        .last()
        .unwrap();
    assert!((later.spindle_rad_per_s - 200.0 * (1.0 - (-1.0_f64).exp())).abs() < 1e-9);
    assert!((later.spindle_angle_rad - 200.0 * 0.1 * (-1.0_f64).exp()).abs() < 1e-9);
}

#[test]
fn calls_out_of_order_are_refused_with_the_state() {
    let mut driver = make("");
    let refused = |driver: &mut dyn Driver| {
        driver
            .exchange(&Setpoint::default(), &mut Feedback::default())
            .unwrap_err()
            .to_string()
    };
    driver.quick_stop(); // harmless in any state
    assert!(refused(&mut *driver).contains("closed"));
    assert!(driver.start().unwrap_err().to_string().contains("closed"));
    driver.open(&DriverContext::new(2, PERIOD_S)).unwrap();
    assert!(refused(&mut *driver).contains("not started"));
    assert!(
        driver
            .open(&DriverContext::new(2, PERIOD_S))
            .unwrap_err()
            .to_string()
            .contains("already opened")
    );
    driver.start().unwrap();
    assert!(driver.start().unwrap_err().to_string().contains("running"));
    exchange(&mut *driver, &Setpoint::default());
    driver.stop().unwrap();
    assert!(refused(&mut *driver).contains("stopped"));
    driver.open(&DriverContext::new(2, PERIOD_S)).unwrap();
    driver.start().unwrap();
    assert_eq!(
        exchange(&mut *driver, &Setpoint::default()).state[0],
        JointState::Disabled,
        "no quick stop is left over"
    );
}

#[test]
fn a_machine_that_does_not_fit_is_refused() {
    let refusal = |options: &str, context: DriverContext| {
        make(options).open(&context).unwrap_err().to_string()
    };
    assert!(refusal("", DriverContext::new(0, PERIOD_S)).contains("joints"));
    assert!(refusal("", DriverContext::new(9, PERIOD_S)).contains("not 9"));
    assert!(refusal("", DriverContext::new(3, 0.0)).contains("fine period"));
    let plane = "[[switches]]\ninput = 0\njoint = 3\nabove_mm = 1";
    assert!(refusal(plane, DriverContext::new(3, PERIOD_S)).contains("joint = 3"));
}

#[test]
fn setpoints_that_are_no_numbers_are_refused_and_do_no_harm() {
    let mut driver = running("model = \"second-order\"");
    let bad = setpoint(&[f64::NAN, 0.0, 0.0], &[]);
    assert!(
        driver
            .exchange(&bad, &mut Feedback::default())
            .unwrap_err()
            .to_string()
            .contains("finite")
    );
    let feedback = exchange(&mut *driver, &setpoint(&[1.0, 2.0, 3.0], &[]));
    assert_eq!(feedback.position, AxisVector::from_slice(&[1.0, 2.0, 3.0]));
}
