//! What the simulated drives can be asked to be, each of it as real drives are: seen through the driver contract.

use tandem_sdk::{
    Arm, Attached, AxisVector, Driver, DriverContext, Feedback, JointState, Setpoint,
};

const PERIOD_S: f64 = 0.001;

/// A driver and where the host has its joints.
struct Bench {
    driver: Box<dyn Driver>,
    attached: Attached,
    setpoint: Setpoint,
    feedback: Feedback,
}

impl Bench {
    fn new(options: &str) -> Self {
        Self::on(options, false)
    }

    fn on(options: &str, real_time: bool) -> Self {
        let mut driver = tandem_sim::PLUGIN.driver(options).unwrap();
        let mut context = DriverContext::new(3, PERIOD_S);
        context.real_time = u32::from(real_time);
        context.start_position = AxisVector::from_slice(&[1.0, 2.0, 3.0]);
        driver.open(&context).unwrap();
        let attached = driver.start().unwrap();
        let setpoint = Setpoint {
            position: attached.position,
            ..Setpoint::default()
        };
        Self {
            driver,
            attached,
            setpoint,
            feedback: Feedback {
                position: attached.position,
                ..Feedback::default()
            },
        }
    }

    /// One period as the host makes it: joints that are not enabled are told to be where they stand.
    fn period(&mut self) -> &Feedback {
        self.setpoint.tick += 1;
        for joint in (0..3).filter(|joint| self.feedback.state[*joint] != JointState::Enabled) {
            self.setpoint.position[joint] = self.feedback.position[joint];
        }
        self.driver
            .exchange(&self.setpoint, &mut self.feedback)
            .unwrap();
        self.setpoint.reset = 0;
        &self.feedback
    }

    /// Periods until all joints are in `state`.
    fn until(&mut self, state: JointState) -> usize {
        (1..5000)
            .find(|_| self.period().state[..3] == [state; 3])
            .expect("it takes seconds")
    }

    fn enable(&mut self) -> usize {
        self.setpoint.enable = 1;
        self.until(JointState::Enabled)
    }
}

#[test]
fn torque_and_brakes_take_their_time_and_the_description_says_so() {
    let mut bench = Bench::new("enable_s = [0.1, 0.2]\nbrake_s = [0.05]");
    let described = bench.driver.describe();
    assert!(described.enable_s >= 0.25 && described.disable_s >= 0.05 && described.disable_s < 2.0);
    assert_eq!(bench.enable(), 251, "the slowest drive and its brake");
    bench.setpoint.enable = 0;
    assert_eq!(bench.until(JointState::Disabled), 51);
    assert!(Bench::new("").driver.describe().enable_s >= 1.0);
}

#[test]
fn a_joint_without_torque_and_brake_sinks_until_it_is_held() {
    let mut bench = Bench::new(
        "enable_s = [0.1, 0.1, 0.1]\nbrake_s = [0.05, 0.05, 0]\nsag_mm_per_s = [0, 0, -10]",
    );
    (0..100).for_each(|_| _ = bench.period());
    assert!(
        (bench.feedback.position[2] - 2.0).abs() < 1e-9,
        "{}",
        bench.feedback.position[2]
    );
    bench.enable();
    let held = bench.feedback.position[2];
    assert!(
        (held - 1.0).abs() < 0.02,
        "{held}: it sank while the torque came up"
    );
    (0..3000).for_each(|_| _ = bench.period());
    assert_eq!(bench.feedback.position[2], held, "and no further");
    let mut braked = Bench::new("brake_s = [0.05]\nsag_mm_per_s = [-10, -10, -10]");
    (0..1000).for_each(|_| _ = braked.period());
    assert_eq!(braked.feedback.position.0[..3], [1.0, 2.0, 3.0]);
}

#[test]
fn encoders_count_from_where_the_joints_stand_or_know() {
    let blind = Bench::new("encoder = \"incremental\"\nstart_mm = [37.5, -3]");
    assert_eq!(
        (
            blind.attached.known,
            blind.attached.homed,
            blind.attached.position
        ),
        (0, 0, AxisVector::ZERO)
    );
    let known = Bench::new("start_mm = [37.5, -3]");
    assert_eq!(
        (
            known.attached.known & 7,
            known.attached.position.0[..3].to_vec()
        ),
        (7, vec![37.5, -3.0, 3.0])
    );
    // The switch is where it is, whatever the encoder says.
    let switch = "[[switches]]\ninput = 1\njoint = 0\nabove_mm = 37\n";
    for encoder in ["absolute", "incremental"] {
        let mut bench = Bench::new(&format!(
            "encoder = \"{encoder}\"\nstart_mm = [37.5]\n{switch}"
        ));
        assert_eq!(bench.period().inputs, 2, "{encoder}");
    }
}

#[test]
fn what_is_read_is_noisy_and_in_counts_and_holding_is_no_jump() {
    let mut bench =
        Bench::new("encoder_count_mm = 0.001\nencoder_noise_mm = 0.002\nstart_mm = [37.5003]");
    bench.enable();
    let told = bench.setpoint.position[0];
    let mut seen = std::collections::BTreeSet::new();
    for _ in 0..200 {
        let at = bench.period().position[0];
        assert!(
            (at - told).abs() < 0.02 && (at * 1000.0 - (at * 1000.0).round()).abs() < 1e-6,
            "{at}"
        );
        seen.insert((at * 1000.0).round() as i64);
    }
    assert!(seen.len() > 3);
}

#[test]
fn a_fault_has_its_code_and_its_words_and_stays_until_it_is_reset() {
    let text = "[[faults]]\njoint = 1\ntick = 20\ncode = 0x7210\ntext = \"brake chopper\"";
    for again in 0..3 {
        let mut bench = Bench::new(text);
        bench.enable();
        while bench.setpoint.tick < 20 {
            bench.period();
        }
        assert_eq!(
            (bench.feedback.state[1], bench.feedback.fault_code[1]),
            (JointState::Fault, 0x7210),
            "{again}"
        );
        assert_eq!(bench.feedback.state[0], JointState::Enabled);
        assert_eq!(bench.driver.explain(0, 0x7210).as_str(), "brake chopper");
        for enable in [0, 1, 0, 1] {
            bench.setpoint.enable = enable;
            assert_eq!(bench.period().state[1], JointState::Fault);
        }
        // It stays where the driver is stopped and started again: the same power-on.
        bench.driver.stop().unwrap();
        let attached = bench.driver.start().unwrap();
        assert_eq!(
            (attached.state[1], attached.fault_code[1]),
            (JointState::Fault, 0x7210)
        );
        bench.setpoint.reset = 1;
        bench.setpoint.tick = 0;
        assert_eq!(bench.enable(), 1);
    }
}

#[test]
fn a_drive_may_stand_in_fault_when_it_is_attached_and_one_may_fall_out_of_the_bus() {
    let bench = Bench::new("[[faults]]\njoint = 2\nexchange = 0\ncode = 5");
    assert_eq!(
        (bench.attached.state[2], bench.attached.fault_code[2]),
        (JointState::Fault, 5)
    );
    let mut bench = Bench::new("[[faults]]\njoint = 0\nexchange = 10\nlost = true");
    bench.enable();
    (1..9).for_each(|_| _ = bench.period());
    let (at, state) = (bench.feedback.position[0], bench.feedback.state[0]);
    assert_eq!(state, JointState::Enabled);
    for age in 1..100 {
        bench.setpoint.position[1] += 0.01;
        let feedback = bench.period();
        assert_eq!(
            (
                feedback.state[0],
                feedback.age_periods[0],
                feedback.position[0]
            ),
            (JointState::Lost, age, at)
        );
        assert_eq!(
            (feedback.state[1], feedback.age_periods[1]),
            (JointState::Enabled, 0)
        );
    }
}

#[test]
fn lost_frames_age_what_is_told_and_beyond_the_patience_all_joints_are_lost() {
    let mut bench =
        Bench::new("patience_periods = 4\nlost_frames = { ticks = [50, 100], periods = 4 }");
    bench.enable();
    while bench.setpoint.tick < 200 {
        let tick = bench.setpoint.tick + 1;
        bench.setpoint.velocity[0] = 10.0;
        bench.setpoint.position[0] += 0.01;
        let aim = bench.setpoint.position[0];
        let feedback = bench.period();
        let since = [50, 100]
            .into_iter()
            .find(|from| (*from..from + 4).contains(&tick));
        let age = since.map_or(0, |from| tick - from + 1);
        assert_eq!(
            (
                u64::from(feedback.age_periods[0]),
                u64::from(feedback.input_age_periods[5])
            ),
            (age, age),
            "{tick}"
        );
        assert_eq!(feedback.state[0], JointState::Enabled);
        assert!(
            (feedback.position[0] - (aim - 0.01 * age as f64)).abs() < 1e-9,
            "{tick}"
        );
    }
    let mut bench = Bench::new("patience_periods = 4\nlost_frames = { ticks = [50], periods = 5 }");
    bench.enable();
    while bench.setpoint.tick < 54 {
        bench.period();
    }
    assert_eq!(bench.feedback.state[..3], [JointState::Lost; 3]);
    assert_eq!(
        bench.period().state[..3],
        [JointState::Lost; 3],
        "frames come again, and nobody has reset it"
    );
    bench.setpoint.reset = 1;
    assert_eq!(bench.enable(), 1);
}

/// The host sends a reset for one period: the driver sees to it that the drives hear it.
#[test]
fn a_reset_whose_frame_is_lost_comes_with_the_next_one() {
    let fault = "[[faults]]\njoint = 1\ntick = 20\ncode = 9\n";
    let mut bench = Bench::new(&format!(
        "lost_frames = {{ ticks = [30], periods = 2 }}\n{fault}"
    ));
    bench.enable();
    while bench.setpoint.tick < 29 {
        bench.period();
    }
    assert_eq!(bench.feedback.state[1], JointState::Fault);
    bench.setpoint.reset = 1;
    let states: Vec<_> = (30..=32).map(|_| bench.period().state[1]).collect();
    assert_eq!(
        states,
        [JointState::Fault, JointState::Fault, JointState::Enabled]
    );
}

#[test]
fn a_latch_is_told_where_it_was_armed_by_the_drives_that_caught_it() {
    let switch = "[[switches]]\ninput = 3\njoint = 0\nabove_mm = 1.0125\n";
    for (arm, caught) in [
        ((3, 1), true),
        ((3, 2), false),
        ((4, 1), false),
        ((0, 0), false),
    ] {
        let mut bench = Bench::new(&format!("latch_joints = [0]\n{switch}"));
        bench.enable();
        bench.setpoint.arm = Arm {
            input: arm.0,
            edge: arm.1,
        };
        let mut latches = Vec::new();
        for _ in 0..5 {
            bench.setpoint.position[0] += 0.01;
            bench.setpoint.position[1] += 0.01;
            latches.extend(
                bench
                    .period()
                    .latches
                    .into_iter()
                    .filter(|latch| latch.edge != 0),
            );
        }
        assert_eq!(latches.len(), usize::from(caught), "{arm:?}");
        for latch in latches {
            assert_eq!((latch.input, latch.edge, latch.joints), (3, 1, 1));
            assert!((latch.position[0] - 1.0125).abs() < 1e-9 && latch.position[1] == 0.0);
            assert!(
                (latch.before_s - 0.000_75).abs() < 1e-9,
                "{}",
                latch.before_s
            );
        }
    }
}

#[test]
fn answers_are_behind_by_as_many_periods_as_the_driver_says() {
    let mut bench = Bench::new("delay_periods = 3");
    assert_eq!(bench.attached.delay_periods[..3], [3; 3]);
    assert_eq!(bench.enable(), 4);
    let mut told = vec![bench.setpoint.position[0]; 3];
    for _ in 0..50 {
        bench.setpoint.position[0] += 0.01;
        told.push(bench.setpoint.position[0]);
        let at = bench.period().position[0];
        assert_eq!(at, told[told.len() - 4]);
    }
}

#[test]
fn a_bus_clock_tells_its_phase_and_a_bus_takes_its_time_to_start() {
    let began = std::time::Instant::now();
    let mut bench = Bench::on(
        "bus_start_s = 0.05\nbus_clock = { drift_ppm = 70, jitter_us = 100 }",
        true,
    );
    assert!(began.elapsed().as_secs_f64() >= 0.05);
    // On the virtual clock nobody waits for it: with the wait there are thirty seconds here, however fast the computer.
    let began = std::time::Instant::now();
    Bench::new("bus_start_s = 30");
    assert!(began.elapsed().as_secs_f64() < 30.0);
    let feedback = bench.period();
    assert!(
        feedback.has_phase == 1 && feedback.phase_ns.abs() <= 600_000,
        "{}",
        feedback.phase_ns
    );
    assert_eq!(Bench::new("").period().has_phase, 0);
}

/// The same seed, the same drives.
#[test]
fn everything_random_comes_from_the_seed() {
    let row = |seed: u32| {
        let text = "start_spread_mm = 20\nencoder_noise_mm = 0.01\nlost_frames = { probability = 0.1 }\npatience_periods = 9";
        let mut bench = Bench::new(&format!("seed = {seed}\n{text}"));
        bench.setpoint.enable = 1;
        (0..200)
            .map(|_| {
                (
                    bench.period().position.0[..3].to_vec(),
                    bench.feedback.age_periods[0],
                )
            })
            .collect::<Vec<_>>()
    };
    assert!(row(1) == row(1) && row(1) != row(2));
}
