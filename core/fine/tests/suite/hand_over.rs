//! Homing by the drive: a joint is handed over, neither followed nor judged, and adopted where its drive says that it is.

use crate::demanding;

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use demanding::{Bench, HOMING_CODE, Script, config};
use tandem_fine::{FaultKind, FineConfig};
use tandem_rig::Random;
use tandem_rings::{MachineState, RestCause};
use tandem_sdk::{Attached, AxisVector, EventKind, JointState, MAX_AXES, StopOn};

const JOINTS: usize = 2;
const HOMED: usize = 1;

/// A machine somewhere, whose second joint is to be homed by its drive.
fn unhomed(random: &mut Random) -> Bench {
    let position =
        AxisVector::from_slice(&[random.between(-500.0, 500.0), random.between(-500.0, 500.0)]);
    let script = Script {
        position,
        homing_takes: 1 + random.below(200),
        homed_at_mm: random.between(-900.0, 900.0),
        homing_lag: random.below(5),
        was_homed: if random.below(2) == 1 { 1 << HOMED } else { 0 },
        ..Script::new(JOINTS)
    };
    let attached = Attached {
        delay_periods: [2; MAX_AXES],
        ..Attached::default()
    };
    let config = FineConfig {
        unhomed: 1 << HOMED,
        record_drives: true,
        enable_periods: 100,
        attached,
        ..config(JOINTS)
    };
    let mut bench = Bench::new(&config, script);
    assert_eq!(
        bench.rest(20).map(|rest| rest.cause),
        Some(RestCause::Attached)
    );
    bench
}

fn hand_over(bench: &mut Bench, within_s: f64) {
    bench.queue_event(
        EventKind::HomeByDrive,
        (HOMED as u32).cast_signed(),
        within_s,
    );
}

/// No setpoint but that of the joint in its drive's hands ever jumped, and its first one behind is where it is.
fn assert_bumpless(bench: &Bench) {
    let script = bench.script();
    let told: Vec<_> = script.told.iter().map(|(told, _)| *told).collect();
    for pair in told
        .windows(2)
        .filter(|pair| pair[1].enable != 0 && pair[0].enable != 0)
    {
        assert_eq!(pair[0].position[0], pair[1].position[0]);
        if pair[0].homing == 0 && pair[1].homing == 0 {
            assert!(
                (pair[0].position[HOMED] - pair[1].position[HOMED]).abs() <= 0.1,
                "{pair:?}"
            );
        }
        assert_eq!(
            (pair[1].velocity, pair[1].acceleration),
            (AxisVector::ZERO, AxisVector::ZERO)
        );
    }
}

#[test]
fn a_joint_is_adopted_where_its_drive_says_that_it_is() {
    for seed in 1..=100 {
        let mut random = Random::new(seed);
        let mut bench = unhomed(&mut random);
        hand_over(&mut bench, 10.0);
        let rest = bench
            .rest(300)
            .unwrap_or_else(|| panic!("seed {seed}: {:?}", bench.fault()));
        let homed_at_mm = bench.script().homed_at_mm;
        assert_eq!(
            (rest.cause, rest.position[HOMED]),
            (RestCause::Corrected, homed_at_mm),
            "seed {seed}"
        );
        bench.ticks(20);
        assert_eq!(bench.fault(), None, "seed {seed}");
        let script = bench.script();
        assert_eq!(
            (script.last().homing, script.position[HOMED]),
            (0, homed_at_mm)
        );
        let handed_over = script
            .told
            .iter()
            .filter(|(told, _)| told.homing != 0)
            .count() as u64;
        let takes = script.homing_takes + script.homing_lag;
        assert!(
            (takes..=takes + 2).contains(&handed_over),
            "seed {seed}: {handed_over}"
        );
        drop(script);
        assert_bumpless(&bench);
    }
}

/// Where it is, nobody but its drive knows.
#[test]
fn a_joint_in_the_hands_of_its_drive_is_in_no_sample() {
    let mut bench = unhomed(&mut Random::new(13));
    bench.script().never_homes = true;
    hand_over(&mut bench, 10.0);
    bench.ticks(20);
    while bench.host.samples.pop().is_ok() {}
    bench.ticks(20);
    assert_ne!(bench.told().homing, 0);
    assert!(bench.host.samples.pop().is_err());
}

#[test]
fn it_is_followed_again_from_there() {
    let mut bench = unhomed(&mut Random::new(9));
    hand_over(&mut bench, 10.0);
    bench.rest(300).unwrap();
    bench.queue(HOMED, 0.1, 0.0, StopOn::default());
    bench.ticks(260);
    // Feedback that answers at once where two periods were told: what is behind by them is 0.1 mm at 50 mm/s.
    let fault = bench.fault();
    assert!(
        matches!(fault, Some(FaultKind::Following { joint: HOMED, .. })),
        "it is followed again: {fault:?}"
    );
}

#[test]
fn a_drive_that_finds_nothing_or_fails_is_a_fault_with_its_code() {
    let mut bench = unhomed(&mut Random::new(3));
    bench.script().never_homes = true;
    hand_over(&mut bench, 0.3);
    assert_eq!(bench.rest(250), None);
    assert_eq!(bench.fault(), None);
    bench.ticks(200);
    let kind = FaultKind::NotHomed {
        joint: HOMED,
        state: JointState::Homing,
        code: 0,
        within_s: 0.3,
    };
    assert_eq!(bench.fault(), Some(kind));
    let last = bench.told();
    assert_eq!((last.homing, last.enable), (0, 0));
    for after in [0, 5, 60] {
        let mut bench = unhomed(&mut Random::new(4 + after));
        let mut script = bench.script();
        (script.never_homes, script.homing_fails_after) = (true, Some(after));
        drop(script);
        hand_over(&mut bench, 10.0);
        bench.ticks(200);
        assert_eq!(
            bench.fault(),
            Some(FaultKind::Drive {
                joint: HOMED,
                code: HOMING_CODE
            })
        );
        assert_bumpless(&bench);
        assert_eq!(bench.state(), MachineState::Fault);
    }
}

#[test]
fn an_abort_and_an_emergency_stop_take_the_joint_back_where_it_is() {
    for seed in 1..=20 {
        let mut random = Random::new(seed);
        let mut bench = unhomed(&mut random);
        bench.script().never_homes = true;
        hand_over(&mut bench, 10.0);
        bench.ticks(3 + random.below(150));
        let controls = Arc::clone(&bench.host.controls);
        if seed % 3 == 0 {
            controls.emergency_stop.store(true, Relaxed);
            bench.ticks(20);
            assert_eq!(bench.fault(), Some(FaultKind::EmergencyStop));
        } else if seed % 3 == 1 {
            controls.soft_fault.store(true, Relaxed);
            bench.ticks(20);
            assert_eq!(bench.fault(), Some(FaultKind::Soft));
        } else {
            let stop = if seed % 2 == 0 {
                &controls.abort
            } else {
                &controls.jog.let_go
            };
            stop.store(true, Relaxed);
            let rest = bench.rest(20).expect("a rest");
            let at_mm = bench.script().position[HOMED];
            assert_eq!(
                (rest.cause, rest.position[HOMED], bench.fault()),
                (RestCause::Abort, at_mm, None)
            );
        }
        bench.ticks(10);
        assert_eq!(bench.told().homing, 0);
        assert_bumpless(&bench);
    }
}

#[test]
fn a_hold_interrupts_the_drive_and_a_resume_begins_anew() {
    let mut bench = unhomed(&mut Random::new(11));
    bench.script().homing_takes = 100;
    // The time of the hold is none of the drive's.
    hand_over(&mut bench, 0.25);
    bench.ticks(50);
    bench.host.controls.hold.store(true, Relaxed);
    bench.ticks(3);
    assert_eq!(bench.told().homing, 0);
    // A joint that hangs a little below its command does not creep while it is held.
    bench.script().droop_mm = 1e-4;
    bench.ticks(3);
    let at = bench.script().position;
    bench.ticks(500);
    assert_eq!((bench.fault(), bench.script().position), (None, at));
    bench.script().droop_mm = 0.0;
    bench.host.controls.hold.store(false, Relaxed);
    let rest = bench.rest(200).expect("homed");
    assert_eq!(rest.position[HOMED], bench.script().homed_at_mm);
    assert_bumpless(&bench);
}

#[test]
fn what_the_host_has_set_the_position_to_before_is_forgotten() {
    let mut bench = unhomed(&mut Random::new(12));
    let before_mm = bench.position[HOMED];
    bench.queue_event(EventKind::Correct, (HOMED as u32).cast_signed(), 3.0);
    let corrected = bench.rest(20).expect("its position is set anew");
    assert_eq!(
        (corrected.cause, corrected.position[HOMED]),
        (RestCause::Corrected, before_mm + 3.0)
    );
    hand_over(&mut bench, 10.0);
    let homed_at_mm = bench.script().homed_at_mm;
    assert_eq!(bench.rest(300).expect("homed").position[HOMED], homed_at_mm);
    assert_bumpless(&bench);
}

/// Where a joint was when its drive was last heard is not where it is homed, nor where it is taken back.
#[test]
fn a_joint_is_taken_back_by_nothing_that_is_old() {
    for seed in 1..=60 {
        let mut random = Random::new(seed);
        let mut bench = unhomed(&mut random);
        // Were it homed before, nobody could tell an old homing from a new one that was not seen to begin.
        bench.script().was_homed = 0;
        bench.ticks(1);
        hand_over(&mut bench, 10.0);
        let (aborts, late) = (random.below(2) == 1, 1 + random.below(5) as u32);
        if aborts {
            bench.script().never_homes = true;
            bench.ticks(20 + random.below(50));
            bench.host.controls.abort.store(true, Relaxed);
        }
        bench.script().late = late;
        // Until the drive is through with it, and for some time more.
        assert_eq!(
            bench.rest(250),
            None,
            "seed {seed}: nothing new was heard of the joint"
        );
        bench.script().late = 0;
        let rest = bench
            .rest(20)
            .unwrap_or_else(|| panic!("seed {seed}: {:?}", bench.fault()));
        let at_mm = bench.script().position[HOMED];
        let cause = if aborts {
            RestCause::Abort
        } else {
            RestCause::Corrected
        };
        assert_eq!(
            (rest.cause, rest.position[HOMED], bench.fault()),
            (cause, at_mm, None),
            "seed {seed}"
        );
    }
}

/// A frame that was under way since before an older homing says that the joint is not homed: that does not make the older
/// homing the one that was asked for.
#[test]
fn an_old_frame_does_not_make_an_older_homing_a_new_one() {
    for seed in 1..=20 {
        let mut random = Random::new(seed);
        let mut bench = unhomed(&mut random);
        let mut script = bench.script();
        (script.was_homed, script.homing_lag) = (1 << HOMED, 30);
        drop(script);
        bench.ticks(1);
        hand_over(&mut bench, 10.0);
        bench.ticks(3 + random.below(10));
        let mut script = bench.script();
        (script.was_homed, script.late) = (0, 3);
        drop(script);
        bench.ticks(1 + random.below(5));
        let mut script = bench.script();
        (script.was_homed, script.late) = (1 << HOMED, 0);
        drop(script);
        let rest = bench
            .rest(400)
            .unwrap_or_else(|| panic!("seed {seed}: {:?}", bench.fault()));
        let homed_at_mm = bench.script().homed_at_mm;
        assert_eq!(
            (rest.cause, rest.position[HOMED]),
            (RestCause::Corrected, homed_at_mm),
            "seed {seed}"
        );
    }
}
