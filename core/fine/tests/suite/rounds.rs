//! Fault, reset, run again: a hundred times on one machine, each joint in each phase, on machines that are drawn.

use crate::demanding;

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use demanding::{ACCELERATION_MM_PER_S2, Bench, FAULT_CODE, FEED_MM_PER_S, Script, config};
use tandem_fine::{FaultKind, FineConfig, Joints};
use tandem_rig::Random;
use tandem_rings::{MachineState, RestCause};
use tandem_sdk::{
    Arm, Attached, AxisVector, Edge, EventKind, Kinematics, Limits, MAX_AXES, Setpoint, StopOn,
};

/// Rounds on each machine.
const ROUNDS: u64 = 105;
/// Input that probing waits for.
const PROBE: u32 = 7;
/// What rounding of the axes' places gives, mm.
const ROUNDING_MM: f64 = 1e-6;

/// What the machine does when a joint faults.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Enabling,
    Moving,
    Holding,
    Homing,
    Probing,
    Jogging,
    RampingOut,
}

const PHASES: [Phase; 7] = [
    Phase::Enabling,
    Phase::Moving,
    Phase::Holding,
    Phase::Homing,
    Phase::Probing,
    Phase::Jogging,
    Phase::RampingOut,
];

/// How the joints hang on the axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Map {
    Axes,
    /// The axes in another order, and some the other way round.
    Turned,
    /// The first joint is bent by the second.
    Bent,
}

struct Turned;

impl Kinematics for Turned {
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        let mut joints = *axes;
        (joints[0], joints[1]) = (axes[1], -axes[0]);
        joints
    }
    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        let mut axes = *joints;
        (axes[0], axes[1]) = (-joints[1], joints[0]);
        axes
    }
}

struct Bent;

impl Kinematics for Bent {
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        let mut joints = *axes;
        joints[0] += 20.0 * (axes[1] / 100.0).sin();
        joints
    }
    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        let mut axes = *joints;
        axes[0] -= 20.0 * (joints[1] / 100.0).sin();
        axes
    }
}

/// A machine that lives through all rounds.
struct Machine {
    bench: Bench,
    random: Random,
    joints: usize,
    period_s: f64,
    map: Map,
    round: String,
}

impl Machine {
    fn drawn(seed: u64) -> Self {
        let mut random = Random::new(seed);
        let map = [Map::Axes, Map::Turned, Map::Bent][seed as usize % 3];
        let joints = (if map == Map::Axes { 1 } else { 2 })
            + random.below(if map == Map::Bent { 3 } else { 5 }) as usize;
        let behind = random.below(6) as usize;
        let period_s = [0.0005, 0.001, 0.002, 0.004][random.below(4) as usize];
        let mut script = Script {
            behind,
            homing_takes: u64::MAX,
            position: somewhere(&mut random, joints),
            ..Script::new(joints)
        };
        // What the drives say of their states is as late as what they say of their places.
        script.enable_after = std::array::from_fn(|_| 2 + behind as u64 + random.below(30));
        script.reset_takes = random.below(12);
        script.brake_for = std::array::from_fn(|_| random.below(20));
        let attached = Attached {
            delay_periods: [behind as u32; MAX_AXES],
            ..Attached::default()
        };
        let plain = FineConfig {
            period_s,
            attached,
            ..config(joints)
        };
        let (config, kinematics): (_, Option<Box<dyn Kinematics>>) = match map {
            Map::Axes => (plain, None),
            Map::Turned => (plain, Some(Box::new(Turned))),
            Map::Bent => {
                let limits =
                    Limits::new(&[plain.limits.axes()[0]; MAX_AXES][..2 * joints]).unwrap();
                (
                    FineConfig {
                        limits,
                        joints: Joints::Curved { axes: joints },
                        ..plain
                    },
                    Some(Box::new(Bent)),
                )
            }
        };
        let bench = Bench::with(&config, script, kinematics);
        Self {
            bench,
            random,
            joints,
            period_s,
            map,
            round: String::new(),
        }
    }

    /// Where the drives have the axes, mm.
    fn axes(&self) -> AxisVector {
        let joints = self.bench.script().position;
        match self.map {
            Map::Axes => joints,
            Map::Turned => Turned.to_axes(&joints),
            Map::Bent => Bent.to_axes(&joints),
        }
    }

    /// All joints hold, where they stand.
    fn attach(&mut self) {
        let rest = self
            .bench
            .rest(200)
            .unwrap_or_else(|| panic!("{}: {:?}", self.round, self.bench.fault()));
        let off = rest.position - self.axes();
        assert_eq!(rest.cause, RestCause::Attached, "{}", self.round);
        assert!(
            (0..self.joints).all(|axis| off[axis].abs() < ROUNDING_MM),
            "{}: {off:?}",
            self.round
        );
    }

    /// Queues a move of any axis with at least so long a cruise; the axis, and how far it goes.
    fn queue(&mut self, cruise_s: f64, stop_on: StopOn) -> (usize, f64) {
        let (axis, ramp_s) = (
            self.random.below(self.joints as u64) as usize,
            self.random.between(0.03, 0.15),
        );
        self.bench.queue(axis, ramp_s, cruise_s, stop_on);
        (axis, 500.0 * ramp_s * (ramp_s + cruise_s))
    }

    fn ticks_s(&mut self, time_s: f64) {
        self.bench.ticks((time_s / self.period_s).ceil() as u64);
    }

    /// The machine works: a short move ends where it is to.
    fn work(&mut self) {
        let from = self.axes();
        let (axis, by_mm) = self.queue(0.0, StopOn::default());
        self.ticks_s(0.4);
        let gone = self.axes() - from;
        assert_eq!(
            (self.bench.fault(), self.bench.state()),
            (None, MachineState::Standstill),
            "{}",
            self.round
        );
        assert!(
            (gone[axis] - by_mm).abs() < ROUNDING_MM,
            "{}: {gone:?} of {by_mm}",
            self.round
        );
    }

    /// Brings the machine to where it does that, some time into it.
    fn begin(&mut self, phase: Phase) {
        let some_s = self.random.between(0.02, 0.9);
        let controls = Arc::clone(&self.bench.host.controls);
        match phase {
            Phase::Enabling => {}
            Phase::Moving => {
                self.queue(1.0, StopOn::default());
                self.ticks_s(some_s);
            }
            Phase::Holding => {
                self.queue(1.0, StopOn::default());
                self.ticks_s(some_s);
                controls.hold.store(true, Relaxed);
                self.ticks_s(0.3);
                assert_eq!(self.bench.state(), MachineState::Holding, "{}", self.round);
            }
            Phase::Homing => {
                let joint = self.random.below(self.joints as u64) as i32;
                self.bench.queue_event(EventKind::HomeByDrive, joint, 100.0);
                self.ticks_s(0.02 + some_s / 4.0);
                assert_eq!(self.bench.told().homing, 1 << joint, "{}", self.round);
            }
            Phase::Probing => {
                self.queue(
                    1.0,
                    StopOn {
                        input: PROBE,
                        edge: Edge::Rising,
                        miss_is_fault: 0,
                    },
                );
                self.ticks_s(some_s);
                assert_eq!(
                    self.bench.told().arm,
                    Arm {
                        input: PROBE,
                        edge: 1
                    },
                    "{}",
                    self.round
                );
            }
            Phase::Jogging => {
                controls.jog.max_periods.store(20, Relaxed);
                self.queue(1.0, StopOn::default());
                for _ in 0..(some_s / self.period_s) as u64 / 10 {
                    controls.jog.beats.fetch_add(1, Relaxed);
                    self.bench.ticks(10);
                }
            }
            Phase::RampingOut => {
                self.queue(1.0, StopOn::default());
                self.ticks_s(0.2 + some_s / 2.0);
                controls.emergency_stop.store(true, Relaxed);
                self.bench.ticks(1 + self.random.below(3));
                assert_eq!(self.bench.state(), MachineState::Stopping, "{}", self.round);
            }
        }
    }

    /// The joint faults: the machine comes to rest within its limits and lets go, and nobody resets it.
    fn fault(&mut self, phase: Phase, joint: usize) {
        let from = self.bench.script().told.len();
        let resets = self.bench.script().resets;
        self.bench.script().fault = Some(joint);
        self.bench.ticks(1);
        let first = if phase == Phase::RampingOut {
            FaultKind::EmergencyStop
        } else {
            FaultKind::Drive {
                joint,
                code: FAULT_CODE,
            }
        };
        assert_eq!(
            self.bench.fault(),
            Some(first),
            "{}: in that period",
            self.round
        );
        self.ticks_s(0.4);
        assert_eq!(
            (self.bench.fault(), self.bench.state()),
            (Some(first), MachineState::Fault),
            "{}",
            self.round
        );
        assert!(
            self.bench.fine.is_over(),
            "{}: the drives have let go",
            self.round
        );
        let script = self.bench.script();
        let last = script.last();
        assert_eq!(
            (script.resets, last.enable, last.homing, last.arm),
            (resets, 0, 0, Arm::default()),
            "{}",
            self.round
        );
        let judged = script.told[from - 1..].iter().map(|(told, _)| *told);
        self.assert_ramps(&judged.collect::<Vec<_>>(), phase);
    }

    /// From one setpoint to the next no joint breaks a limit.
    fn assert_ramps(&self, told: &[Setpoint], phase: Phase) {
        let most = |limit: f64| limit * (1.0 + 1e-6) + 1e-6;
        for told in told
            .iter()
            .filter(|_| phase != Phase::Enabling && phase != Phase::Homing)
        {
            for joint in 0..self.joints {
                let (speed, acceleration) =
                    (told.velocity[joint].abs(), told.acceleration[joint].abs());
                assert!(speed <= most(FEED_MM_PER_S), "{}: {told:?}", self.round);
                assert!(
                    acceleration <= most(ACCELERATION_MM_PER_S2),
                    "{}: {told:?}",
                    self.round
                );
            }
        }
    }

    /// The operator resets the machine, whose axes somebody has moved by hand meanwhile.
    fn reset(&mut self) {
        let position = somewhere(&mut self.random, self.joints);
        let controls = &self.bench.host.controls;
        for flag in [
            &controls.hold,
            &controls.emergency_stop,
            &controls.jog.let_go,
        ] {
            flag.store(false, Relaxed);
        }
        controls.jog.max_periods.store(0, Relaxed);
        let mut script = self.bench.script();
        script.move_to(position);
        script.told.clear();
        drop(script);
        while self.bench.rough.rests.pop().is_ok() {}
        while self.bench.host.samples.pop().is_ok() {}
        self.bench.fine.reset();
        assert_eq!(self.bench.fault(), None, "{}", self.round);
    }

    /// One round: what works, faults in the phase, and is reset.
    fn round(&mut self, round: u64, phase: Phase, joint: usize) {
        if phase == Phase::Enabling {
            let script = self.bench.script();
            // Until the drives are reset their fault is what the reset is for.
            let reset = if round > 0 { script.reset_takes + 1 } else { 0 };
            let first = script.enable_after[..self.joints]
                .iter()
                .min()
                .copied()
                .unwrap_or(1);
            drop(script);
            self.bench.ticks(reset + 1 + self.random.below(first));
            assert!(self.bench.fine.is_attaching(), "{}", self.round);
        } else {
            self.attach();
            self.bench.assert_bumpless(ROUNDING_MM);
            self.work();
            self.begin(phase);
        }
        let told: Vec<_> = self
            .bench
            .script()
            .told
            .iter()
            .map(|(told, _)| told.reset)
            .collect();
        let reset = u32::from(round > 0);
        assert_eq!(
            (told[0], told.iter().sum::<u32>()),
            (reset, reset),
            "{}: for one period",
            self.round
        );
        self.fault(phase, joint);
        self.reset();
    }
}

fn somewhere(random: &mut Random, joints: usize) -> AxisVector {
    AxisVector(std::array::from_fn(|i| {
        if i < joints {
            random.between(-700.0, 700.0)
        } else {
            0.0
        }
    }))
}

#[test]
fn each_joint_faults_in_each_phase_and_the_machine_runs_again_a_hundred_times() {
    for seed in 1..=12 {
        let mut machine = Machine::drawn(seed);
        for round in 0..ROUNDS {
            let phase = match PHASES[round as usize % PHASES.len()] {
                // Where drives home axes, joints are axes.
                Phase::Homing if machine.map != Map::Axes => Phase::Moving,
                phase => phase,
            };
            let joint = round as usize / PHASES.len() % machine.joints;
            let (joints, map, period_s) = (machine.joints, machine.map, machine.period_s);
            machine.round = format!(
                "seed {seed}, {joints} joints, {map:?}, {period_s} s, round {round}, joint {joint}, {phase:?}"
            );
            machine.round(round, phase, joint);
        }
    }
}
