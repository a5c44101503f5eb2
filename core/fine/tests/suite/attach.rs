//! Attaching: from drives without torque to joints that hold, from a fault back to work. The drives of these tests start
//! anywhere, enable one after the other, sag while they do, and fail in any state.

use crate::demanding;

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use demanding::{Bench, FAULT_CODE, Script, config};
use rtrb::RingBuffer;
use tandem_fine::{FaultKind, FineConfig};
use tandem_rig::Random;
use tandem_rings::{MachineState, RestCause};
use tandem_sdk::{
    Arm, Attached, AxisVector, Edge, EventKind, Feedback, JointState, Kinematics, MAX_AXES,
    Setpoint, StopOn,
};

/// One increment of the encoders, mm.
const COUNT_MM: f64 = 1e-3;
const JOINTS: usize = 3;
/// Reports of rests that nobody has taken, at most.
const MAX_RESTS: usize = 8;

/// Three joints with so many periods to be enabled in.
fn three(script: Script, enable_periods: u64) -> Bench {
    Bench::new(
        &FineConfig {
            enable_periods,
            ..config(JOINTS)
        },
        script,
    )
}

/// The rest at which all joints hold, within so many periods.
fn attach(bench: &mut Bench, most: u64) -> Option<AxisVector> {
    let rest = bench.rest(most)?;
    assert_eq!(rest.cause, RestCause::Attached);
    Some(rest.position)
}

/// Queues 0.1 s of acceleration along X and 0.1 s to rest: 5 mm.
fn queue_move(bench: &mut Bench) {
    bench.queue(0, 0.1, 0.0, StopOn::default());
}

/// Whole exchanges after which each joint holds.
fn after(each: [u64; JOINTS]) -> [u64; MAX_AXES] {
    std::array::from_fn(|joint| each.get(joint).copied().unwrap_or_default())
}

fn somewhere(random: &mut Random) -> AxisVector {
    AxisVector(std::array::from_fn(|i| {
        if i < JOINTS {
            random.between(-900.0, 900.0)
        } else {
            0.0
        }
    }))
}

#[test]
fn joints_are_enabled_where_they_stand_and_motion_starts_there() {
    for seed in 1..=200 {
        let mut random = Random::new(seed);
        let position = somewhere(&mut random);
        let enable_after = std::array::from_fn(|_| random.below(300));
        let mut bench = three(
            Script {
                enable_after,
                position,
                ..Script::new(JOINTS)
            },
            1000,
        );
        let rest = attach(&mut bench, 400).unwrap_or_else(|| panic!("seed {seed}: not enabled"));
        assert_eq!(rest.0[..JOINTS], position.0[..JOINTS], "seed {seed}");
        assert_eq!(
            bench.fine.next_tick(),
            0,
            "ticks are counted from the first motion on"
        );
        queue_move(&mut bench);
        bench.ticks(250);
        assert_eq!(bench.fine.fault(), None, "seed {seed}");
        let reached = bench.script().position[0];
        assert!(
            (reached - position[0] - 5.0).abs() < 1e-9,
            "seed {seed}: {reached}"
        );
        bench.assert_bumpless(COUNT_MM);
    }
}

#[test]
fn a_joint_that_gravity_pulls_sinks_only_until_it_holds() {
    let script = Script {
        enable_after: after([0, 3000, 2]),
        sag_mm: std::array::from_fn(|joint| if joint == 2 { COUNT_MM } else { 0.0 }),
        ..Script::new(JOINTS)
    };
    let mut bench = three(script, 5000);
    let rest = attach(&mut bench, 4000).expect("enabled");
    assert!(rest[2].abs() <= 10.0 * COUNT_MM, "{}", rest[2]);
    assert!(rest[2] < 0.0, "it sank before it held");
    bench.assert_bumpless(COUNT_MM);
}

#[test]
fn the_operator_stops_joints_that_are_on_their_way_to_holding() {
    for (seed, abort) in (1..=40).flat_map(|seed| [(seed, false), (seed, true)]) {
        let mut random = Random::new(seed);
        let enable_after = std::array::from_fn(|joint| {
            if joint == 1 {
                u64::MAX
            } else {
                random.below(60)
            }
        });
        let position = somewhere(&mut random);
        // Drives that are told to let go say for some time that they hold.
        let brake_for = [random.below(10); MAX_AXES];
        let mut bench = three(
            Script {
                enable_after,
                brake_for,
                position,
                ..Script::new(JOINTS)
            },
            500,
        );
        assert_eq!(attach(&mut bench, random.below(100)), None);
        let controls = Arc::clone(&bench.host.controls);
        if abort {
            &controls.abort
        } else {
            &controls.emergency_stop
        }
        .store(true, Relaxed);
        let before = bench.script().told.len();
        while !bench.fine.is_over() {
            bench.fine.tick();
            let told = &bench.script().told;
            assert_eq!(
                told[before..]
                    .iter()
                    .map(|(setpoint, _)| setpoint.enable)
                    .max(),
                Some(0),
                "in the next period"
            );
            assert!(
                told.len() as u64 - before as u64 <= 3 + brake_for[0],
                "they let go at once, and so does the run"
            );
        }
        assert!(!bench.fine.is_attaching());
        let kind = bench.fault();
        let rest = bench.rough.rests.pop().map(|rest| rest.cause);
        if abort {
            assert_eq!(
                (kind, rest, controls.abort.load(Relaxed)),
                (None, Ok(RestCause::Abort), false),
                "seed {seed}"
            );
        } else {
            assert_eq!(
                (kind, rest.is_err(), bench.state()),
                (Some(FaultKind::EmergencyStop), true, MachineState::Fault)
            );
        }
        assert!(bench.rough.rests.pop().is_err(), "it is told once");
        bench.assert_bumpless(COUNT_MM);
    }
}

#[test]
fn a_joint_that_lets_go_again_before_all_hold_is_waited_for_once_more() {
    let mut bench = three(
        Script {
            enable_after: after([5, 20, 0]),
            sag_mm: [0.01; MAX_AXES],
            ..Script::new(JOINTS)
        },
        500,
    );
    assert_eq!(attach(&mut bench, 10), None);
    bench.script().enable_after[0] = 40;
    assert_eq!(attach(&mut bench, 25), None, "the others hold, it does not");
    let rest = attach(&mut bench, 10).expect("all hold");
    assert_eq!(rest.0[..JOINTS], bench.script().position.0[..JOINTS]);
    assert!(rest[0] < -0.3, "it has sunk meanwhile: {}", rest[0]);
    bench.assert_bumpless(0.011);
}

#[test]
fn a_joint_that_is_never_enabled_is_named_with_its_state() {
    let script = Script {
        enable_after: after([0, u64::MAX, 0]),
        ..Script::new(JOINTS)
    };
    let mut bench = three(script, 500);
    assert_eq!(attach(&mut bench, 600), None);
    let fault = bench.fine.fault().expect("a fault");
    assert_eq!(
        fault.kind,
        FaultKind::NotEnabled {
            joint: 1,
            state: JointState::Enabling,
            code: 0
        }
    );
    assert!(bench.fine.is_over());
    assert_eq!(bench.told().enable, 0);
}

#[test]
fn a_fault_is_reset_once_and_the_machine_works_again_a_hundred_times() {
    let mut random = Random::new(7);
    let mut bench = three(
        Script {
            enable_after: after([3, 5, 4]),
            position: somewhere(&mut random),
            ..Script::new(JOINTS)
        },
        500,
    );
    for round in 0..100 {
        if random.below(4) > 0 {
            attach(&mut bench, 600)
                .unwrap_or_else(|| panic!("round {round}: {:?}", bench.fine.fault()));
            queue_move(&mut bench);
        }
        // While it is enabled, waits, moves, or rests behind the move.
        for _ in 0..random.below(if bench.rough.depth.wall_s.load().is_finite() {
            3
        } else {
            260
        }) {
            bench.fine.tick();
        }
        let joint = random.below(JOINTS as u64) as usize;
        bench.script().fault = Some(joint);
        bench.ticks(300);
        let fault = bench.fault();
        assert_eq!(
            fault,
            Some(FaultKind::Drive {
                joint,
                code: FAULT_CODE
            }),
            "round {round}"
        );
        assert_eq!(
            (bench.state(), bench.fine.is_over()),
            (MachineState::Fault, true),
            "round {round}"
        );
        assert_eq!(bench.script().resets, round, "nobody has reset it");
        // Somebody moves the axes by hand while the drives are off.
        bench.script().position = somewhere(&mut random);
        while bench.rough.rests.pop().is_ok() {}
        while bench.host.samples.pop().is_ok() {}
        bench.fine.reset();
        assert_eq!(bench.fine.fault(), None);
        bench.script().told.clear();
    }
}

#[test]
fn a_joint_that_is_lost_is_a_fault_of_its_own_in_every_state() {
    for ticks in [0, 50, 190, 230] {
        let mut bench = three(Script::new(JOINTS), 500);
        attach(&mut bench, 10).unwrap();
        queue_move(&mut bench);
        bench.ticks(ticks);
        bench.script().lost = Some(2);
        bench.fine.tick();
        assert_eq!(
            bench.fault(),
            Some(FaultKind::Lost { joint: 2, code: 0 }),
            "{ticks}"
        );
    }
}

#[test]
fn the_phase_of_the_bus_reaches_the_clock_from_the_first_exchange_on() {
    for phase_ns in [None, Some(-1234)] {
        let mut bench = three(
            Script {
                enable_after: [9; MAX_AXES],
                phase_ns,
                ..Script::new(JOINTS)
            },
            500,
        );
        assert_eq!(bench.fine.phase_ns(), None);
        bench.fine.tick();
        assert_eq!(bench.fine.phase_ns(), phase_ns);
    }
}

#[test]
fn old_feedback_changes_no_command_and_no_following_error_is_judged_by_it() {
    let commands = |lost: bool| {
        let mut bench = three(Script::new(JOINTS), 500);
        attach(&mut bench, 10).unwrap();
        queue_move(&mut bench);
        for tick in 0..250_u32 {
            bench.script().age = if lost && tick % 7 < 3 {
                tick % 7 + 1
            } else {
                0
            };
            bench.fine.tick();
        }
        assert_eq!(bench.fine.fault(), None);
        let old = bench.fine.counters().old_feedback_periods;
        let told: Vec<_> = bench
            .script()
            .told
            .iter()
            .map(|(setpoint, _)| *setpoint)
            .collect();
        (told, old)
    };
    let ((whole, none), (lossy, counted)) = (commands(false), commands(true));
    assert_eq!(whole, lossy);
    assert_eq!(
        (none, counted),
        (0, (0..250).filter(|tick| tick % 7 < 3).count() as u64)
    );
}

#[test]
fn following_error_is_judged_against_the_command_that_the_feedback_answers() {
    for (behind, told, faults) in [(2, 2, false), (2, 0, true), (0, 2, true), (15, 15, false)] {
        let attached = Attached {
            delay_periods: [told; MAX_AXES],
            ..Attached::default()
        };
        let script = Script {
            behind,
            ..Script::new(JOINTS)
        };
        let mut bench = Bench::new(
            &FineConfig {
                attached,
                ..config(JOINTS)
            },
            script,
        );
        attach(&mut bench, 10).unwrap();
        queue_move(&mut bench);
        bench.ticks(250);
        let followed = bench
            .fine
            .fault()
            .map(|f| matches!(f.kind, FaultKind::Following { .. }));
        assert_eq!(
            followed,
            faults.then_some(true),
            "{behind} behind, {told} told"
        );
    }
}

#[test]
fn exchanges_go_on_until_every_brake_is_closed_and_no_longer() {
    for seed in 1..=50 {
        let mut random = Random::new(seed);
        // Now and then a brake takes longer than its driver has said.
        let brake_for: [u64; MAX_AXES] = std::array::from_fn(|_| random.below(130));
        let mut bench = three(
            Script {
                brake_for,
                position: somewhere(&mut random),
                ..Script::new(JOINTS)
            },
            500,
        );
        attach(&mut bench, 10).unwrap();
        bench.queue_event(EventKind::ProgramEnd, 0, 0.0);
        while !bench.fine.is_over() {
            bench.ticks(1);
        }
        assert_eq!(bench.fault(), None, "seed {seed}");
        let script = bench.script();
        let letting_go = script
            .told
            .iter()
            .rev()
            .take_while(|(told, _)| told.enable == 0)
            .count() as u64;
        let slowest = brake_for[..JOINTS].iter().max().unwrap() + 1;
        assert_eq!(letting_go, slowest.min(100), "seed {seed}: {brake_for:?}");
        assert!(
            script
                .told
                .iter()
                .all(|(told, _)| told.velocity == AxisVector::ZERO),
            "seed {seed}"
        );
    }
}

/// Two axes move until input 9 rises.
fn queue_move_to_edge(bench: &mut Bench) {
    let both = |amount: f64| AxisVector::from_slice(&[amount, amount]);
    let stop_on = StopOn {
        input: 9,
        edge: Edge::Rising,
        miss_is_fault: 0,
    };
    bench.piece([AxisVector::ZERO, both(250.0)], 0.1, false, stop_on);
    bench.piece([both(50.0), AxisVector::ZERO], 1.0, false, stop_on);
    bench.piece([both(50.0), both(-250.0)], 0.1, true, stop_on);
}

#[test]
fn a_motion_whose_edge_is_there_before_it_says_so_and_goes_next_to_nowhere() {
    let mut bench = three(Script::new(JOINTS), 500);
    let from = attach(&mut bench, 10).unwrap();
    bench.script().inputs = 1 << 9;
    queue_move_to_edge(&mut bench);
    let rest = bench.rest(50).expect("it comes to rest");
    assert_eq!((rest.cause, rest.latch), (RestCause::Already, None));
    let way_mm = rest.position[0] - from[0];
    assert!((0.0..0.01).contains(&way_mm), "{way_mm}");
}

#[test]
fn an_edge_is_armed_before_the_motion_and_a_joint_that_did_not_catch_it_is_found_between_its_samples()
 {
    for seed in 1..=50 {
        let mut random = Random::new(seed);
        let script = Script {
            catches: true,
            position: somewhere(&mut random),
            ..Script::new(JOINTS)
        };
        let mut bench = three(script, 500);
        attach(&mut bench, 10).unwrap();
        queue_move_to_edge(&mut bench);
        bench.ticks(20 + random.below(900));
        let before = bench.script().position;
        bench.script().inputs = 1 << 9;
        bench.ticks(1);
        let at_edge = bench.script().position;
        let rest = bench.rest(200).expect("it comes to rest");
        let latch = rest.latch.expect("a place of the edge");
        assert_eq!(
            (rest.cause, latch[0]),
            (RestCause::Edge, at_edge[0]),
            "seed {seed}: its drive has caught it"
        );
        let between = f64::midpoint(before[1], at_edge[1]);
        assert!(
            (latch[1] - between).abs() < 1e-9 && latch[2] == at_edge[2],
            "seed {seed}: {latch:?} {at_edge:?}"
        );
        bench.ticks(3);
        let script = bench.script();
        let arms = |(told, _): &(Setpoint, Feedback)| told.arm == Arm { input: 9, edge: 1 };
        let armed = script.told.iter().position(arms).expect("armed");
        let moved = script
            .told
            .iter()
            .position(|(told, _)| told.velocity != AxisVector::ZERO)
            .expect("moved");
        assert!(
            armed < moved,
            "seed {seed}: armed in {armed}, moved in {moved}"
        );
        assert_eq!(
            script.last().arm,
            Arm::default(),
            "seed {seed}: it is disarmed at rest"
        );
    }
}

#[test]
fn drives_whose_line_is_cut_are_not_waited_for() {
    for ticks in [0, 50, 190, 230] {
        let mut bench = three(
            Script {
                brake_for: [50; MAX_AXES],
                ..Script::new(JOINTS)
            },
            500,
        );
        attach(&mut bench, 10).unwrap();
        queue_move(&mut bench);
        bench.ticks(ticks);
        bench.script().cut = true;
        bench.ticks(1);
        assert_eq!(bench.fault(), Some(FaultKind::Driver), "in that period");
        while bench.state() != MachineState::Fault {
            bench.ticks(1);
        }
        bench.ticks(2);
        assert!(bench.fine.is_over(), "{ticks}: nothing is known of brakes");
    }
}

/// The second axis has two joints.
struct Gantry;

impl Kinematics for Gantry {
    fn joint_count(&self, axis_count: usize) -> usize {
        axis_count + 1
    }
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        AxisVector::from_slice(&[axes[0], axes[1], axes[1]])
    }
    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        AxisVector::from_slice(&[joints[0], joints[1]])
    }
}

#[test]
fn a_gantry_keeps_its_skew_from_one_reset_to_the_next() {
    let mut random = Random::new(21);
    let mut skewed = || {
        let (y, skew) = (random.between(-900.0, 900.0), random.between(-0.9, 0.9));
        AxisVector::from_slice(&[random.between(-900.0, 900.0), y, y + skew])
    };
    let mut position = skewed();
    let script = Script {
        position,
        ..Script::new(JOINTS)
    };
    let mut bench = Bench::with(&config(JOINTS - 1), script, Some(Box::new(Gantry)));
    for round in 0..40 {
        attach(&mut bench, 20).unwrap_or_else(|| panic!("round {round}: {:?}", bench.fault()));
        bench.queue(1, 0.1, 0.0, StopOn::default());
        bench.ticks(250);
        assert_eq!(bench.fault(), None, "round {round}");
        let gone = bench.script().position - position;
        assert!(
            gone[0] == 0.0 && (gone[1] - 5.0).abs() < 1e-9 && (gone[2] - 5.0).abs() < 1e-9,
            "{round}: {gone:?}"
        );
        bench.assert_bumpless(COUNT_MM);
        bench.script().fault = Some(2);
        bench.ticks(20);
        // Somebody moves the axes by hand while the drives are off.
        position = skewed();
        bench.script().move_to(position);
        bench.script().told.clear();
        while bench.rough.rests.pop().is_ok() {}
        while bench.host.samples.pop().is_ok() {}
        bench.fine.reset();
    }
}

/// What stops the machine in the period of the reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cut {
    EmergencyStop,
    Abort,
    Line,
    Nonsense,
}

#[test]
fn a_reset_is_sent_for_one_period_whatever_comes_in_it() {
    for seed in 1..=80 {
        let mut random = Random::new(seed);
        let cut = random.pick(&[Cut::EmergencyStop, Cut::Abort, Cut::Line, Cut::Nonsense]);
        let script = Script {
            position: somewhere(&mut random),
            reset_takes: random.below(30),
            brake_for: [random.below(10); MAX_AXES],
            ..Script::new(JOINTS)
        };
        let mut bench = three(script, 500);
        attach(&mut bench, 10).unwrap();
        bench.script().fault = Some(random.below(JOINTS as u64) as usize);
        bench.ticks(20);
        assert_eq!((bench.script().resets, bench.fine.is_over()), (0, true));
        bench.fine.reset();
        bench.script().told.clear();
        let controls = Arc::clone(&bench.host.controls);
        // In the period that tells the drives, or while they are at it.
        bench.ticks(random.below(3));
        match cut {
            Cut::EmergencyStop => controls.emergency_stop.store(true, Relaxed),
            Cut::Abort => controls.abort.store(true, Relaxed),
            Cut::Line => bench.script().cut = true,
            Cut::Nonsense => bench.script().position[1] = f64::NAN,
        }
        bench.ticks(40);
        let resets: Vec<_> = bench
            .script()
            .told
            .iter()
            .map(|(told, _)| told.reset)
            .collect();
        assert_eq!(
            resets.iter().sum::<u32>(),
            1,
            "seed {seed}, {cut:?}: {resets:?}"
        );
        assert_eq!(resets[0], 1, "seed {seed}, {cut:?}");
    }
}

/// The reports of rests are all waiting to be taken when the operator aborts: the first one is taken while the joints come to hold.
#[test]
fn an_abort_that_finds_no_room_for_its_report_acts_when_the_joints_hold() {
    let mut bench = three(
        Script {
            enable_after: [9; MAX_AXES],
            ..Script::new(JOINTS)
        },
        500,
    );
    attach(&mut bench, 20).unwrap();
    let controls = Arc::clone(&bench.host.controls);
    while bench.rough.rests.slots() < MAX_RESTS {
        controls.abort.store(true, Relaxed);
        bench.ticks(1);
    }
    bench.script().fault = Some(0);
    bench.ticks(20);
    bench.fine.reset();
    // The period of the reset and nine more: all hold behind the next exchange.
    bench.ticks(10);
    assert!(bench.fine.is_attaching());
    let (_, nobody) = RingBuffer::new(1);
    bench.script().rests = Some(std::mem::replace(&mut bench.rough.rests, nobody));
    controls.abort.store(true, Relaxed);
    bench.ticks(1);
    assert!(
        !bench.fine.is_attaching() && controls.abort.load(Relaxed),
        "it is still to act"
    );
    let taken = bench.script().rests.take().unwrap();
    bench.rough.rests = taken;
    bench.ticks(2);
    let causes: Vec<_> = std::iter::from_fn(|| bench.rough.rests.pop().ok())
        .map(|rest| rest.cause)
        .collect();
    assert_eq!(
        (causes, controls.abort.load(Relaxed)),
        (vec![RestCause::Attached, RestCause::Abort], false)
    );
}

/// Joints are told the torque that homing may use while they are homed, those alone that have one, and no longer.
#[test]
fn torque_is_limited_for_joints_that_are_being_homed_and_have_a_limit_until_they_are_homed() {
    for unhomed in 0..1 << JOINTS {
        for homing_limits in 0..1 << JOINTS {
            let limited = unhomed & homing_limits;
            let plain = FineConfig {
                unhomed,
                homing_limits,
                ..config(JOINTS)
            };
            let mut bench = Bench::new(&plain, Script::new(JOINTS));
            attach(&mut bench, 10).expect("enabled");
            for (told, _) in &bench.script().told {
                assert_eq!(told.limited, limited, "{unhomed:b} {homing_limits:b}");
            }
            let mut left = limited;
            for (joint, number) in (0..JOINTS).zip(0_i32..) {
                bench.queue_event(EventKind::Homed, number, 0.0);
                queue_move(&mut bench);
                bench.ticks(250);
                left &= !(1 << joint);
                assert_eq!(
                    bench.told().limited,
                    left,
                    "{unhomed:b} {homing_limits:b} {joint}"
                );
            }
        }
    }
}
