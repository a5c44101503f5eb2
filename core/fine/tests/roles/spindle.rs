//! A spindle on its way to its speed: what waits for it, for how long, and what ends the waiting.

use std::sync::atomic::Ordering::Relaxed;

use tandem_fine::{FaultKind, FineConfig, InputFault, Roles};
use tandem_rig::Random;
use tandem_rings::{MachineState, RestCause, Sample, StopCause};
use tandem_sdk::{Attached, AxisVector, EventKind, MAX_AXES, StopOn};

use crate::bench::{self, AT_SPEED_WITHIN_S, Bench, Doing, Role, SPIN_UP, SPINDLE_RAD_PER_S};
use crate::demanding::{self, Script};

/// Exchanges behind which the drives have answered.
const ANSWERED: usize = 2;
/// Fine periods of the move that the bench queues.
const MOVE: u64 = 1400;

/// Motion along X that begins with a speed and has half of an acceleration.
fn along_x(speed_mm_per_s: f64, half_mm_per_s2: f64) -> [AxisVector; 2] {
    let mut motion = [AxisVector::ZERO; 2];
    motion[0][0] = speed_mm_per_s;
    motion[1][0] = half_mm_per_s2;
    motion
}

/// A machine whose joints hold; its spindle needs `spin_up` exchanges.
fn bench(role: Role, spin_up: u32) -> Bench {
    let mut bench = Bench::new(role, Doing::Running, 9, true);
    bench.attach();
    bench.script().spin_up = spin_up;
    bench
}

/// Setpoints from the one that turned the spindle to the first that moved behind it, and the first that moved.
fn waited(bench: &demanding::Bench) -> (usize, AxisVector) {
    let told = &bench.script().told;
    let turned = told
        .iter()
        .position(|(told, _)| told.spindle_rad_per_s != 0.0)
        .unwrap();
    let moved = turned
        + told[turned..]
            .iter()
            .position(|(told, _)| told.velocity != AxisVector::ZERO)
            .unwrap();
    (moved - turned, told[moved].0.position)
}

fn samples(bench: &mut Bench) -> Vec<Sample> {
    std::iter::from_fn(|| bench.host.samples.pop().ok()).collect()
}

/// Ends at rest where the queue ends, within limits.
fn assert_ends_well(bench: &mut Bench) {
    bench.ticks(MOVE + 100);
    assert_eq!(
        (bench.fault(), bench.state()),
        (None, MachineState::Standstill)
    );
    assert!((bench.told().position[0] - bench.position[0]).abs() < 1e-9);
    bench.assert_limits();
}

#[test]
fn a_cut_begins_when_the_spindle_turns_and_not_before() {
    for seed in 1..=40 {
        let mut random = Random::new(seed);
        let spin_up = random.below(300) as u32;
        let mut bench = bench(Role::FeedHold, spin_up);
        bench.ticks(random.below(20));
        bench.queue_spindle();
        bench.queue_move(StopOn::default());
        bench.ticks(u64::from(spin_up) + 20);
        // The exchange behind which it turns, and the next period moves.
        assert_eq!(
            waited(&bench).0,
            (spin_up as usize + 1).max(ANSWERED),
            "seed {seed}, {spin_up}"
        );
        let waits = samples(&mut bench)
            .iter()
            .filter(|sample| sample.cause == StopCause::Spindle)
            .count();
        assert_eq!(
            waits,
            (spin_up as usize).saturating_sub(1),
            "seed {seed}: what the drives have not answered is no stop"
        );
        assert_ends_well(&mut bench);
        // It turns as it is told to: the next cut waits for nothing.
        bench.queue_spindle();
        bench.queue_move(StopOn::default());
        bench.ticks(2);
        assert_ne!(bench.told().velocity, AxisVector::ZERO, "seed {seed}");
    }
}

/// A driver whose answers are behind says in the first of them that the spindle turns as it was told before.
#[test]
fn a_cut_waits_until_the_drives_with_their_delay_have_answered_to_the_new_speed() {
    for seed in 1..=40 {
        let mut random = Random::new(seed);
        let (delay, spin_up) = (random.below(8) as usize, random.below(6) as u32);
        let mut attached = Attached::default();
        // One joint is slower than the other.
        attached.delay_periods[random.below(2) as usize] = delay as u32;
        // The positions of these drives are not late, which would be judged.
        let max_following_error_mm = AxisVector([f64::INFINITY; MAX_AXES]);
        let config = FineConfig {
            attached,
            max_following_error_mm,
            ..bench::config(Roles::default(), 0)
        };
        let mut bench = demanding::Bench::new(
            &config,
            Script {
                spin_up,
                ..bench::script(0)
            },
        );
        assert_eq!(
            bench.rest(100).map(|rest| rest.cause),
            Some(RestCause::Attached)
        );
        bench.queue_event(EventKind::Spindle, 0, SPINDLE_RAD_PER_S);
        bench.queue(0, 0.2, 1.0, StopOn::default());
        bench.ticks(30);
        let expected = (spin_up as usize + 1).max(ANSWERED + delay);
        assert_eq!(
            waited(&bench).0,
            expected,
            "seed {seed}: delay {delay}, turns behind {spin_up}"
        );
        bench.ticks(MOVE + 100);
        // What is to stand is waited for by nothing.
        bench.queue_event(EventKind::Spindle, 0, 0.0);
        bench.queue(0, 0.2, 1.0, StopOn::default());
        bench.ticks(2);
        assert_eq!(
            (bench.fault(), bench.told().spindle_rad_per_s),
            (None, 0.0),
            "seed {seed}"
        );
        assert_ne!(
            bench.told().velocity,
            AxisVector::ZERO,
            "seed {seed}: delay {delay}"
        );
    }
}

#[test]
fn rapids_and_dwells_go_on_and_the_cut_behind_them_waits() {
    for seed in 1..=20 {
        let mut random = Random::new(seed);
        let mut bench = bench(Role::FeedHold, 1500 + random.below(500) as u32);
        bench.queue_spindle();
        bench.rapid = true;
        bench.queue_move(StopOn::default());
        bench.rapid = false;
        let (at_mm, dwell_s) = (bench.position[0], 0.001 * (1 + random.below(50)) as f64);
        bench.piece([AxisVector::ZERO; 2], dwell_s, true, StopOn::default());
        bench.queue_move(StopOn::default());
        bench.ticks(10);
        assert!(waited(&bench).0 <= 1, "a rapid waits for nothing");
        bench.ticks(1450);
        assert_eq!(bench.told().position[0], at_mm, "seed {seed}");
        assert!(bench.host.status.spindle.waits.load(Relaxed));
        assert_eq!(
            (
                bench.state(),
                bench.host.status.spindle.told_rad_per_s.load()
            ),
            (MachineState::Holding, SPINDLE_RAD_PER_S)
        );
        bench.ticks(2000);
        assert_ends_well(&mut bench);
        assert!(!bench.host.status.spindle.waits.load(Relaxed));
    }
}

#[test]
fn a_speed_that_changes_in_a_cut_stops_it_on_its_path_where_the_spindle_needs_time() {
    for (seed, spin_up) in [(1, 0), (2, 300), (3, 25), (4, 1000)] {
        let mut random = Random::new(seed);
        let mut bench = bench(Role::FeedHold, spin_up);
        let none = StopOn::default();
        bench.piece(along_x(0.0, 250.0), 0.2, false, none);
        bench.piece(
            along_x(100.0, 0.0),
            0.3 + 0.001 * random.below(200) as f64,
            false,
            none,
        );
        bench.queue_speed(SPINDLE_RAD_PER_S);
        let place_mm = bench.position[0];
        bench.piece(along_x(100.0, 0.0), 1.0, false, none);
        bench.piece(along_x(100.0, -250.0), 0.2, true, none);
        bench.ticks(4000);
        let rests = samples(&mut bench).windows(2).any(|pair| {
            let [before, sample] = pair else { return false };
            sample.cause == StopCause::Spindle
                && sample.command == before.command
                && sample.command[0] < place_mm + 50.0
        });
        assert_eq!(rests, spin_up >= 300, "{spin_up}");
        assert_ends_well(&mut bench);
    }
}

#[test]
fn a_spindle_that_does_not_come_is_a_fault_in_time_and_only_where_a_cut_waits() {
    let mut waits = bench(Role::FeedHold, u32::MAX);
    waits.queue_spindle();
    waits.queue_move(StopOn::default());
    let limit = (AT_SPEED_WITHIN_S * 1000.0) as u64;
    waits.ticks(limit);
    assert_eq!(waits.fault(), None);
    waits.ticks(2);
    let (within_s, told_rad_per_s) = (AT_SPEED_WITHIN_S, SPINDLE_RAD_PER_S);
    waits.assert_ends_by(FaultKind::SpindleSlow {
        within_s,
        told_rad_per_s,
        turns_rad_per_s: 0.0,
    });
    assert_eq!(waits.told().spindle_rad_per_s, 0.0);
    waits.assert_limits();
    // Nothing cuts: nobody waits, and a program that ends so is a good one.
    let mut idles = bench(Role::FeedHold, u32::MAX);
    idles.queue_spindle();
    idles.rapid = true;
    idles.queue_move(StopOn::default());
    idles.ticks(3 * limit);
    assert_eq!(
        (idles.fault(), idles.state()),
        (None, MachineState::Standstill)
    );
}

#[test]
fn hold_abort_emergency_stop_and_door_act_while_the_spindle_is_awaited() {
    for seed in 1..=24 {
        let mut random = Random::new(seed);
        let mut bench = bench(Role::Door, SPIN_UP);
        bench.queue_spindle();
        bench.queue_move(StopOn::default());
        bench.ticks(3 + random.below(u64::from(SPIN_UP) - 6));
        let controls = std::sync::Arc::clone(&bench.host.controls);
        match seed % 4 {
            0 => {
                controls.hold.store(true, Relaxed);
                bench.ticks(300);
                assert_eq!(
                    (bench.told().velocity, bench.state()),
                    (AxisVector::ZERO, MachineState::Holding)
                );
                controls.hold.store(false, Relaxed);
                bench.ticks(1);
                assert_ne!(bench.told().velocity, AxisVector::ZERO, "it turns by now");
            }
            1 => {
                controls.abort.store(true, Relaxed);
                bench.ticks(2);
                assert_eq!(
                    bench.rough.rests.pop().map(|rest| rest.cause),
                    Ok(RestCause::Abort)
                );
                assert_eq!(bench.told().spindle_rad_per_s, 0.0);
                bench.ticks(300);
                assert_eq!(
                    (bench.fault(), bench.told().velocity),
                    (None, AxisVector::ZERO)
                );
                continue;
            }
            2 => {
                controls.emergency_stop.store(true, Relaxed);
                bench.ticks(1);
                assert_eq!(bench.told().spindle_rad_per_s, 0.0);
                bench.assert_ends_by(FaultKind::EmergencyStop);
                continue;
            }
            _ => {
                bench.trip(false);
                bench.ticks(100);
                assert_eq!(bench.told().spindle_rad_per_s, 0.0);
                bench.release();
                bench.ticks(5);
                controls.hold.store(false, Relaxed);
                let from = bench.script().told.len();
                bench.ticks(u64::from(SPIN_UP) + 20);
                let told = bench.script().told.split_off(from);
                let moved = told
                    .iter()
                    .position(|(told, _)| told.velocity != AxisVector::ZERO);
                assert_eq!(
                    moved,
                    Some(SPIN_UP as usize + 1),
                    "seed {seed}: it starts from nothing"
                );
            }
        }
        assert_ends_well(&mut bench);
    }
    let kind = FaultKind::Input {
        role: InputFault::EmergencyStop,
        input: 9,
        old: false,
    };
    let mut pressed = bench(Role::EmergencyStop, SPIN_UP);
    pressed.queue_spindle();
    pressed.queue_move(StopOn::default());
    pressed.ticks(10);
    pressed.trip(false);
    pressed.assert_ends_by(kind);
}
