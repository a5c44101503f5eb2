//! Inputs with a role: each in every state of the machine, with fresh and with old samples, at ticks drawn from a seed.

mod bench;
#[allow(dead_code)] // what other tests need of it
#[path = "../demanding/mod.rs"]
mod demanding;
mod spindle;

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use bench::{
    ALL, AT_SPEED_WITHIN_S, Bench, Doing, ENABLE, MAX_AGE, PROBE, ROLES, Role, SPIN_UP,
    SPINDLE_RAD_PER_S,
};
use demanding::FAULT_CODE;
use tandem_fine::{FaultKind, InputFault, Roles};
use tandem_rig::Random;
use tandem_rings::{MachineState, RestCause, StopCause};
use tandem_sdk::{AxisVector, MAX_AXES, StopOn};

/// Every role in every state, fresh and old.
fn each(mut judge: impl FnMut(Bench, Doing, bool, &mut Random), of: Role) {
    let mut seed = 0;
    for doing in ALL {
        for old in [false, true] {
            for _ in 0..12 {
                seed += 1;
                let mut random = Random::new(seed);
                let input = if of == Role::Probe {
                    PROBE
                } else {
                    8 + random.below(56) as u32
                };
                // A probe is waited for as it rises.
                let closed = of != Role::Probe && random.below(2) == 0;
                let mut bench = Bench::new(of, doing, input, closed);
                bench.begin(doing, &mut random);
                let before = bench.fault();
                assert_eq!(
                    before.is_some(),
                    doing == Doing::Ramping,
                    "{doing:?} seed {seed}"
                );
                bench.trip(old);
                judge(bench, doing, old, &mut random);
            }
        }
    }
}

const DRIVE_FAULT: FaultKind = FaultKind::Drive {
    joint: 0,
    code: FAULT_CODE,
};

#[test]
fn an_emergency_stop_is_one_in_every_state() {
    each(
        |mut bench, doing, old, _| {
            let kind = FaultKind::Input {
                role: InputFault::EmergencyStop,
                input: bench.input,
                old,
            };
            bench.ticks(2);
            assert_eq!(
                bench.told().spindle_rad_per_s,
                0.0,
                "at once, whatever moves still"
            );
            bench.assert_ends_by(if doing == Doing::Ramping {
                DRIVE_FAULT
            } else {
                kind
            });
            bench.assert_limits();
            // It is pressed still: the drives are not told to hold once more.
            bench.script().fault = None;
            bench.fine.reset();
            let from = bench.script().told.len();
            bench.assert_ends_by(kind);
            assert!(
                bench.script().told[from..]
                    .iter()
                    .all(|(told, _)| told.enable == 0)
            );
            bench.release();
            bench.fine.reset();
            bench.ticks(2 * ENABLE);
            assert_eq!(bench.fault(), None);
        },
        Role::EmergencyStop,
    );
}

/// The drives do not hold for a single period, not in the first either.
#[test]
fn drives_are_not_enabled_before_an_emergency_stop_that_is_pressed_was_heard_of() {
    for old in [false, true] {
        let mut bench = Bench::new(Role::EmergencyStop, Doing::Enabling, 9, true);
        bench.trip(old);
        bench.assert_ends_by(FaultKind::Input {
            role: InputFault::EmergencyStop,
            input: 9,
            old,
        });
        assert!(bench.script().told.iter().all(|(told, _)| told.enable == 0));
    }
}

/// It is closed as long as nothing trips it, and what no exchange has told is no level.
#[test]
fn an_input_that_was_never_heard_of_is_not_called_tripped() {
    for role in ROLES {
        let mut bench = Bench::new(role, Doing::Enabling, 9, true);
        bench.script().cut = true;
        bench.ticks(10);
        assert_eq!(bench.fault(), Some(FaultKind::Driver), "{role:?}");
        assert_eq!(bench.host.status.tripped.load(Relaxed), 0, "{role:?}");
    }
}

#[test]
fn drives_that_are_not_ready_are_a_fault_where_they_hold() {
    each(
        |mut bench, doing, old, _| {
            let kind = FaultKind::Input {
                role: InputFault::DrivesReady,
                input: bench.input,
                old,
            };
            if doing == Doing::Enabling {
                while bench.fine.is_attaching() {
                    bench.ticks(1);
                }
                let enabled_for = bench.script().enabled_for;
                assert!(
                    enabled_for >= ENABLE,
                    "a contactor may close while they are enabled: {enabled_for}"
                );
            }
            bench.assert_ends_by(if doing == Doing::Ramping {
                DRIVE_FAULT
            } else {
                kind
            });
            bench.assert_limits();
        },
        Role::DrivesReady,
    );
}

/// A door or a feed hold: everything comes to rest, and goes on when it is released and the operator resumes.
fn holds(mut bench: Bench, doing: Doing, door: bool, random: &mut Random) {
    if doing == Doing::Ramping {
        bench.ticks(2);
        assert!(!door || bench.told().spindle_rad_per_s == 0.0);
        return bench.assert_ends_by(DRIVE_FAULT);
    }
    if doing == Doing::Enabling {
        bench.attach();
    }
    bench.ticks(2);
    let controls = Arc::clone(&bench.host.controls);
    assert!(controls.hold.load(Relaxed));
    let tripped = |bench: &Bench| bench.host.status.tripped.load(Relaxed);
    assert_eq!(tripped(&bench), 1 << bench.input);
    assert_eq!(
        bench.told().spindle_rad_per_s == 0.0,
        door || [Doing::Enabling, Doing::Waiting].contains(&doing)
    );
    if [Doing::Enabling, Doing::Waiting].contains(&doing) {
        bench.queue_spindle();
        bench.queue_move(StopOn::default());
    }
    bench.come_to_rest();
    let at = bench.told().position;
    assert_eq!(
        bench.told().homing,
        0,
        "a drive that homes its joint is interrupted"
    );
    assert_eq!(
        (bench.fault(), bench.state()),
        (None, MachineState::Holding)
    );
    // Neither a resume before it is released nor the release alone lets anything move.
    for _ in 0..3 {
        controls.hold.store(false, Relaxed);
        bench.ticks(random.below(50));
    }
    bench.release();
    bench.ticks(random.below(50) + 1);
    assert_eq!(
        (bench.told().position, controls.hold.load(Relaxed)),
        (at, true)
    );
    while let Ok(sample) = bench.host.samples.pop() {
        let cause = if door {
            StopCause::Door
        } else {
            StopCause::HoldInput
        };
        let known = [cause, StopCause::None, StopCause::Spindle].contains(&sample.cause)
            || doing == Doing::Holding;
        assert!(known, "{:?} at {}", sample.cause, sample.tick);
    }
    let from = bench.script().told.len();
    controls.hold.store(false, Relaxed);
    bench.ticks(2500);
    assert_eq!(bench.fault(), None);
    assert_eq!(tripped(&bench), 0, "it is released");
    let script = bench.script();
    let moved = script.told[from..]
        .iter()
        .position(|(told, _)| told.velocity != AxisVector::ZERO);
    let turned = script.told[from..]
        .iter()
        .position(|(told, _)| told.spindle_rad_per_s != 0.0);
    assert_eq!(
        moved.is_some(),
        ![Doing::Dwelling, Doing::AtRest, Doing::HandedOver].contains(&doing)
    );
    let homed = script.told[from..].iter().any(|(told, _)| told.homing != 0);
    assert_eq!(homed, doing == Doing::HandedOver, "its drive begins anew");
    // Probing cuts nothing, and waits for no spindle.
    let waits = door && ![Doing::Enabling, Doing::Waiting, Doing::Probing].contains(&doing);
    if let (Some(moved), true) = (moved, waits) {
        assert!(
            moved - turned.unwrap() >= SPIN_UP as usize,
            "{turned:?} {moved}"
        );
    }
    drop(script);
    bench.assert_limits();
}

#[test]
fn a_door_holds_and_stops_the_spindle_until_it_is_closed_and_resumed() {
    each(
        |bench, doing, _, random| holds(bench, doing, true, random),
        Role::Door,
    );
}

#[test]
fn a_feed_hold_input_holds_until_it_is_released_and_resumed() {
    each(
        |bench, doing, _, random| holds(bench, doing, false, random),
        Role::FeedHold,
    );
}

#[test]
fn a_limit_is_a_fault_in_motion() {
    each(
        |mut bench, doing, old, _| {
            let kind = FaultKind::Input {
                role: InputFault::Limit,
                input: bench.input,
                old,
            };
            if doing == Doing::Ramping {
                return bench.assert_ends_by(DRIVE_FAULT);
            }
            if !doing.moves() {
                bench.ticks(3);
                assert_eq!(bench.fault(), None, "nothing moves");
                match doing {
                    Doing::Holding => bench.host.controls.hold.store(false, Relaxed),
                    Doing::Enabling => bench.attach(),
                    Doing::Waiting => {}
                    _ => return,
                }
                if doing != Doing::Holding {
                    bench.queue_move(StopOn::default());
                }
                bench.ticks(2);
            }
            bench.assert_ends_by(kind);
            bench.assert_limits();
        },
        Role::Limit,
    );
}

#[test]
fn an_axis_that_stands_on_its_limit_may_leave_it_by_hand_and_while_it_is_homed() {
    for doing in [Doing::Jogging, Doing::Homing, Doing::Running] {
        for old in [false, true] {
            let mut bench = Bench::new(Role::Limit, doing, 9, true);
            bench.attach();
            bench.trip(old);
            bench.ticks(3);
            bench.queue_move(StopOn::default());
            bench.ticks(300);
            let may = doing != Doing::Running && !old;
            assert_eq!(
                bench.fault().is_none(),
                may,
                "{doing:?} {old}: {:?}",
                bench.fault()
            );
            if may {
                bench.release();
                bench.ticks(10);
                assert_eq!(bench.fault(), None);
                // Once it is released, the next one counts.
                bench.trip(false);
                bench.assert_ends_by(FaultKind::Input {
                    role: InputFault::Limit,
                    input: 9,
                    old: false,
                });
            }
        }
    }
}

#[test]
fn a_limit_that_is_a_home_switch_is_none_while_axes_are_homed() {
    for homed in [false, true] {
        let roles = Roles {
            limit: 1 << 9,
            home_switches: 1 << 9,
            normally_closed: 1 << 9,
            ..Roles::default()
        };
        let mut bench = Bench::with_roles(roles, u32::from(!homed), 9, 1 << 9);
        bench.attach();
        bench.queue_move(StopOn::default());
        bench.ticks(200);
        bench.trip(false);
        bench.ticks(100);
        assert_eq!(bench.fault().is_some(), homed);
    }
}

#[test]
fn a_switch_that_motion_waits_for_and_does_not_hear_of_is_a_fault() {
    each(
        |mut bench, doing, old, _| match (doing, old) {
            (Doing::Probing, true) => {
                bench.assert_ends_by(FaultKind::Input {
                    role: InputFault::NotHeardOf,
                    input: PROBE,
                    old: true,
                });
                bench.assert_limits();
            }
            (Doing::Probing, false) => {
                bench.come_to_rest();
                assert_eq!(
                    bench.rough.rests.pop().map(|rest| rest.cause),
                    Ok(RestCause::Edge)
                );
            }
            _ => {
                let before = bench.fault();
                bench.ticks(50);
                assert_eq!(bench.fault(), before);
            }
        },
        Role::Probe,
    );
}

#[test]
fn an_input_that_is_old_but_not_too_old_asks_for_nothing() {
    for role in ROLES {
        let mut bench = Bench::new(role, Doing::Running, 9, true);
        bench.script().input_age = [MAX_AGE; 64];
        bench.attach();
        bench.queue_move(StopOn::default());
        bench.ticks(1500);
        assert_eq!(
            (bench.fault(), bench.state()),
            (None, MachineState::Standstill),
            "{role:?}"
        );
    }
}

#[test]
fn a_spindle_that_does_not_turn_again_behind_a_door_is_a_fault() {
    let mut bench = Bench::new(Role::Door, Doing::Running, 9, true);
    bench.begin(Doing::Running, &mut Random::new(3));
    bench.trip(false);
    bench.come_to_rest();
    bench.release();
    bench.ticks(5);
    bench.host.controls.hold.store(false, Relaxed);
    for _ in 0..5010 {
        bench.script().spun_for = 0;
        bench.fine.tick();
    }
    let (told_rad_per_s, turns_rad_per_s) = (SPINDLE_RAD_PER_S, 0.0);
    let slow = FaultKind::SpindleSlow {
        within_s: AT_SPEED_WITHIN_S,
        told_rad_per_s,
        turns_rad_per_s,
    };
    assert_eq!(bench.fault(), Some(slow));
}

#[test]
fn samples_say_what_of_them_is_old() {
    let mut bench = Bench::new(Role::FeedHold, Doing::Running, 9, true);
    bench.attach();
    bench.queue_move(StopOn::default());
    bench.ticks(50);
    while bench.host.samples.pop().is_ok() {}
    bench.script().input_age[9] = 1;
    bench.ticks(1);
    let old = bench.host.samples.pop().unwrap();
    assert_eq!(
        (old.inputs, old.old_inputs, old.age_periods),
        (1 << 9, 1 << 9, [0; MAX_AXES])
    );
    bench.script().input_age[9] = 0;
    bench.ticks(1);
    assert_eq!(bench.host.samples.pop().unwrap().old_inputs, 0);
}
