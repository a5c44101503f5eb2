//! One of several drivers whose line is cut, and found again.

use tandem_host::attached_driver;
use tandem_rig::Random;
use tandem_sdk::{Feedback, JointState, Latch, Setpoint};

use crate::machine;
use crate::mirror::{Mirror, Own, drawn_answer, mirrors, registry, text};

/// A driver whose line is cut says nothing new, and that is told once; a reset that finds it again begins anew. At the
/// end all are stopped, whoever could not be.
#[test]
fn one_whose_line_is_cut_is_old_and_lost_until_a_reset_finds_it_again() {
    let mut random = Random::new(77);
    let deal = |name: &str, joints: &[usize], inputs: &[u32], spindle| Own {
        name: name.to_string(),
        joints: joints.to_vec(),
        inputs: inputs.to_vec(),
        spindle,
        ..Own::default()
    };
    let all = [
        deal("cut-none", &[2, 0], &[7], false),
        deal("cut", &[3, 1], &[40, 3], true),
    ];
    for own in &all {
        let mut answer = Feedback {
            homed: 3,
            ..drawn_answer(&mut random)
        };
        (answer.age_periods, answer.input_age_periods) = ([0; 8], [0; 64]);
        answer.latches[0] = Latch {
            input: 0,
            edge: 1,
            joints: 1,
            ..Latch::default()
        };
        (answer.has_phase, answer.phase_ns) = (u32::from(own.spindle), 9);
        mirrors().insert(
            own.name.clone(),
            Mirror {
                answer,
                ..Mirror::default()
            },
        );
    }
    let (mut driver, _) = attached_driver(&machine(&text(&all)), &registry()).unwrap();
    let (mut setpoint, mut feedback) = (
        Setpoint {
            enable: 1,
            ..Setpoint::default()
        },
        Feedback::default(),
    );
    driver.exchange(&setpoint, &mut feedback).unwrap();
    assert_eq!(
        (feedback.homed, feedback.has_phase, feedback.phase_ns),
        (0b1111, 1, 9)
    );
    assert_eq!(
        feedback
            .latches
            .iter()
            .filter(|latch| latch.edge != 0)
            .count(),
        2
    );
    mirrors().get_mut("cut").unwrap().fails = true;
    let failed = (1..=30_u32)
        .filter(|_| driver.exchange(&setpoint, &mut feedback).is_err())
        .count();
    assert_eq!((failed, feedback.spindle_at_speed), (1, 0));
    let (states, ages) = (feedback.state, feedback.age_periods);
    assert_eq!(
        (states[3], states[1], ages),
        (
            JointState::Lost,
            JointState::Lost,
            [0, 30, 0, 30, 0, 0, 0, 0]
        )
    );
    let inputs = feedback.input_age_periods;
    assert_eq!((inputs[40], inputs[3], inputs[7]), (30, 30, 0));
    let given: Vec<_> = feedback
        .latches
        .iter()
        .filter(|latch| latch.edge != 0)
        .map(|latch| latch.input)
        .collect();
    assert_eq!(given, [7], "an edge of before is not caught again");
    let mut mirror = mirrors();
    let cut = mirror.get_mut("cut").unwrap();
    (cut.fails, cut.answer.homed, cut.answer.has_phase) = (false, 0, 0);
    cut.answer.latches = Feedback::default().latches;
    drop(mirror);
    driver.exchange(&setpoint, &mut feedback).unwrap();
    assert_eq!(feedback.state[3], JointState::Lost, "nobody has reset it");
    setpoint.reset = 1;
    driver.exchange(&setpoint, &mut feedback).unwrap();
    assert_eq!(
        (feedback.state[3], feedback.age_periods[3]),
        (mirrors()["cut"].answer.state[0], 0)
    );
    assert_eq!(
        (feedback.homed, feedback.has_phase),
        (0b101, 0),
        "what it says no more"
    );
    // Where several fail in one period, the first of them is told.
    for own in &all {
        mirrors().get_mut(&own.name).unwrap().fails = true;
    }
    let told = driver.exchange(&setpoint, &mut feedback).unwrap_err();
    assert_eq!(told.message(), "the line of cut-none is cut");
    driver.quick_stop();
    assert!(driver.stop().is_err());
    for own in &all {
        let mirror = mirrors()[&own.name].clone();
        assert_eq!((mirror.quick_stops, mirror.stops), (1, 1), "{}", own.name);
    }
    // A start is as the first one: nobody has failed, and each is asked whether it has anything to begin.
    for own in &all {
        let mut mirrors = mirrors();
        let mirror = mirrors.get_mut(&own.name).unwrap();
        (mirror.fails, mirror.sends_nothing, mirror.sends) = (false, true, 0);
    }
    setpoint.reset = 0;
    for starts in 1..=3 {
        driver.start().unwrap();
        for _ in 0..5 {
            driver.exchange(&setpoint, &mut feedback).unwrap();
        }
        assert_ne!(feedback.state[3], JointState::Lost);
        let all = mirrors();
        assert_eq!((all["cut-none"].sends, all["cut"].sends), (0, starts));
    }
}
