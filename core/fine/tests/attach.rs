//! Attaching: from drives without torque to joints that hold, from a fault back to work. The drives of these tests start
//! anywhere, enable one after the other, sag while they do, and fail in any state.

use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};

use tandem_fine::{FaultKind, FineConfig, FineLoop};
use tandem_rig::Random;
use tandem_rings::{HostEnd, MachineState, Queued, RestCause, RoughEnd, Sizes, bridge};
use tandem_sdk::{
    Attached, AxisLimits, AxisVector, Driver, DriverContext, DriverDescription, Feedback, JointState, Limits, MAX_AXES,
    PluginError, Segment, SegmentFlags, Setpoint,
};

const PERIOD_S: f64 = 0.001;
/// One increment of the encoders, mm.
const COUNT_MM: f64 = 1e-3;
const JOINTS: usize = 3;

/// What the test makes the drives do, and what they were told.
#[derive(Default)]
struct Script {
    /// Exchanges with `enable = 1` after which each joint holds.
    enable_after: [u64; JOINTS],
    /// How far a joint sinks in every period in which it does not hold, mm.
    sag_mm: [f64; JOINTS],
    /// Joint that faults from now on, until it is reset.
    fault: Option<usize>,
    /// Joint that is lost from now on.
    lost: Option<usize>,
    /// What the bus says of each exchange, ns.
    phase_ns: Option<i64>,
    /// Periods by which all of the feedback is old from now on.
    age: u32,
    enabled_for: u64,
    position: AxisVector,
    /// Every setpoint, with the feedback that was known before it.
    told: Vec<(Setpoint, Feedback)>,
    resets: u32,
}

struct Drives(Arc<Mutex<Script>>);

impl Driver for Drives {
    fn describe(&self) -> DriverDescription {
        DriverDescription::real()
    }
    fn open(&mut self, _context: &DriverContext) -> Result<(), PluginError> {
        Ok(())
    }
    fn start(&mut self) -> Result<Attached, PluginError> {
        Ok(Attached::at(self.0.lock().unwrap().position))
    }
    fn exchange(&mut self, setpoint: &Setpoint, feedback: &mut Feedback) -> Result<(), PluginError> {
        let mut script = self.0.lock().unwrap();
        script.told.push((*setpoint, *feedback));
        if script.age > 0 {
            feedback.age_periods = [script.age; MAX_AXES];
            return Ok(());
        }
        if setpoint.reset != 0 {
            (script.fault, script.resets) = (None, script.resets + 1);
        }
        script.enabled_for = if setpoint.enable == 0 { 0 } else { script.enabled_for + 1 };
        for joint in 0..JOINTS {
            let holds = setpoint.enable != 0 && script.enabled_for > script.enable_after[joint];
            feedback.state[joint] = match (holds, setpoint.enable != 0) {
                _ if script.fault == Some(joint) => JointState::Fault,
                _ if script.lost == Some(joint) => JointState::Lost,
                (true, _) => JointState::Enabled,
                (false, true) => JointState::Enabling,
                (false, false) => JointState::Disabled,
            };
            feedback.fault_code[joint] = if script.fault == Some(joint) { 0x7210 } else { 0 };
            if feedback.state[joint] == JointState::Enabled {
                script.position[joint] = setpoint.position[joint];
            } else {
                script.position[joint] -= script.sag_mm[joint];
            }
        }
        feedback.position = script.position;
        (feedback.has_phase, feedback.phase_ns) = (u32::from(script.phase_ns.is_some()), script.phase_ns.unwrap_or(5));
        feedback.age_periods = [0; MAX_AXES];
        Ok(())
    }
    fn quick_stop(&mut self) {}
    fn stop(&mut self) -> Result<(), PluginError> {
        Ok(())
    }
}

struct Bench {
    fine: FineLoop,
    rough: RoughEnd,
    host: HostEnd,
    script: Arc<Mutex<Script>>,
    epoch: u32,
    position: AxisVector,
    start_s: f64,
}

impl Bench {
    fn new(script: Script, enable_periods: u64) -> Self {
        let (attached, script) = (Attached::at(script.position), Arc::new(Mutex::new(script)));
        let drives = Box::new(Drives(Arc::clone(&script)));
        Self::of(drives, attached, enable_periods, script)
    }

    fn of(drives: Box<dyn Driver>, attached: Attached, enable_periods: u64, script: Arc<Mutex<Script>>) -> Self {
        let axis = AxisLimits {
            min_mm: -1000.0,
            max_mm: 1000.0,
            feed_mm_per_s: 100.0,
            rapid_mm_per_s: 100.0,
            acceleration_mm_per_s2: 1000.0,
            jerk_mm_per_s3: f64::INFINITY,
            speed_difference_mm_per_s: 0.0,
        };
        let config = FineConfig {
            max_following_error_mm: AxisVector([0.01; MAX_AXES]),
            attached,
            enable_periods,
            disable_periods: 100,
            plans_from_rest: true,
            ..FineConfig::new(PERIOD_S, Limits::new(&[axis; JOINTS]).unwrap())
        };
        let (rough, end, host) = bridge(Sizes { segments: 64, samples: 4096 });
        let mut fine = FineLoop::new(&config, end, drives, None);
        fine.reset();
        Self { fine, rough, host, script, epoch: 0, position: AxisVector::ZERO, start_s: 0.0 }
    }

    fn state(&self) -> MachineState {
        MachineState::from_number(self.host.status.state.load(Relaxed))
    }

    /// Ticks until the joints hold; the rest there.
    fn attach(&mut self, most: u64) -> Option<AxisVector> {
        for _ in 0..most {
            self.fine.tick();
            if let Ok(rest) = self.rough.rests.pop() {
                assert_eq!(rest.cause, RestCause::Attached);
                (self.epoch, self.position) = (rest.epoch + 1, rest.position);
                self.start_s = rest.program_time_s;
                self.rough.depth.begin(self.epoch, self.start_s);
                return Some(rest.position);
            }
        }
        None
    }

    /// Queues a move of X out and to rest again.
    fn queue_move(&mut self) {
        for (speed, acceleration) in [(0.0, 500.0), (50.0, -500.0)] {
            let mut segment = Segment::rest(&self.position, 0.1);
            let last = acceleration < 0.0;
            segment.coefficients[0] = [self.position[0], speed, acceleration / 2.0, 0.0, 0.0, 0.0];
            segment.path = [0.0, speed, acceleration / 2.0, 0.0, 0.0, 0.0];
            segment.flags = if last { SegmentFlags::ENDS_AT_REST } else { SegmentFlags::default() };
            (segment.epoch, segment.feed_mm_per_s) = (self.epoch, 100.0);
            segment.stop_deceleration_mm_per_s2 = 500.0;
            self.rough.segments.push(Queued::Segment { start_s: self.start_s, segment }).unwrap();
            self.position = segment.position(0.1);
            self.start_s += 0.1;
        }
        self.rough.depth.stop_deceleration_mm_per_s2.store(500.0);
        self.rough.depth.wall_s.store(f64::INFINITY);
        self.rough.depth.required_s.store(0.0);
    }

    /// No joint that did not hold was told to be more than a count from where it stood, and one that held stayed.
    fn assert_bumpless(&self) {
        let script = self.script.lock().unwrap();
        let mut held = [None; JOINTS];
        for (index, (setpoint, before)) in script.told.iter().enumerate() {
            let all = before.state[..JOINTS].iter().all(|state| *state == JointState::Enabled);
            for (joint, held) in held.iter_mut().enumerate() {
                let at = setpoint.position[joint];
                if before.state[joint] == JointState::Enabled && setpoint.enable != 0 {
                    let stays = held.unwrap_or(script.told[index - 1].0.position[joint]);
                    assert!(all || at == stays, "exchange {index}: joint {joint} moved before all held");
                    *held = Some(stays).filter(|_| !all);
                } else {
                    *held = None;
                    let known = if index == 0 { at } else { before.position[joint] };
                    assert!(
                        (at - known).abs() <= COUNT_MM,
                        "exchange {index}: joint {joint} was told {at}, stood at {known}"
                    );
                }
            }
        }
    }
}

fn somewhere(random: &mut Random) -> AxisVector {
    AxisVector(std::array::from_fn(|i| if i < JOINTS { random.between(-900.0, 900.0) } else { 0.0 }))
}

#[test]
fn joints_are_enabled_where_they_stand_and_motion_starts_there() {
    for seed in 1..=200 {
        let mut random = Random::new(seed);
        let position = somewhere(&mut random);
        let enable_after = std::array::from_fn(|_| random.below(300));
        let mut bench = Bench::new(Script { enable_after, position, ..Script::default() }, 1000);
        let rest = bench.attach(400).unwrap_or_else(|| panic!("seed {seed}: not enabled"));
        assert_eq!(rest.0[..JOINTS], position.0[..JOINTS], "seed {seed}");
        bench.queue_move();
        for _ in 0..250 {
            bench.fine.tick();
        }
        assert_eq!(bench.fine.fault(), None, "seed {seed}");
        let reached = bench.script.lock().unwrap().position[0];
        assert!((reached - position[0] - 5.0).abs() < 1e-9, "seed {seed}: {reached}");
        bench.assert_bumpless();
    }
}

#[test]
fn a_joint_that_gravity_pulls_sinks_only_until_it_holds() {
    let script = Script { enable_after: [0, 3000, 2], sag_mm: [0.0, 0.0, COUNT_MM], ..Script::default() };
    let mut bench = Bench::new(script, 5000);
    let rest = bench.attach(4000).expect("enabled");
    assert!(rest[2].abs() <= 10.0 * COUNT_MM, "{}", rest[2]);
    assert!(rest[2] < 0.0, "it sank before it held");
    bench.assert_bumpless();
}

#[test]
fn the_operator_stops_joints_that_are_on_their_way_to_holding() {
    for (seed, abort) in (1..=40).flat_map(|seed| [(seed, false), (seed, true)]) {
        let mut random = Random::new(seed);
        let enable_after = std::array::from_fn(|joint| if joint == 1 { u64::MAX } else { random.below(60) });
        let mut bench = Bench::new(Script { enable_after, position: somewhere(&mut random), ..Script::default() }, 500);
        assert_eq!(bench.attach(random.below(100)), None);
        let controls = Arc::clone(&bench.host.controls);
        if abort { &controls.abort } else { &controls.emergency_stop }.store(true, Relaxed);
        let before = bench.script.lock().unwrap().told.len();
        while !bench.fine.is_over() {
            bench.fine.tick();
            let told = &bench.script.lock().unwrap().told;
            assert_eq!(told[before..].iter().map(|(setpoint, _)| setpoint.enable).max(), Some(0), "in the next period");
            assert!(told.len() - before <= 3, "they let go at once, and so does the run");
        }
        assert!(!bench.fine.is_attaching());
        let kind = bench.fine.fault().map(|fault| fault.kind);
        let rest = bench.rough.rests.pop().map(|rest| rest.cause);
        if abort {
            assert_eq!((kind, rest, controls.abort.load(Relaxed)), (None, Ok(RestCause::Abort), false), "seed {seed}");
        } else {
            assert_eq!(
                (kind, rest.is_err(), bench.state()),
                (Some(FaultKind::EmergencyStop), true, MachineState::Fault)
            );
        }
        assert!(bench.rough.rests.pop().is_err(), "it is told once");
        bench.assert_bumpless();
    }
}

#[test]
fn a_joint_that_is_never_enabled_is_named_with_its_state() {
    let script = Script { enable_after: [0, u64::MAX, 0], ..Script::default() };
    let mut bench = Bench::new(script, 500);
    assert_eq!(bench.attach(600), None);
    let fault = bench.fine.fault().expect("a fault");
    assert_eq!(fault.kind, FaultKind::NotEnabled { joint: 1, state: JointState::Enabling, code: 0 });
    assert!(bench.fine.is_over());
    assert_eq!(bench.script.lock().unwrap().told.last().unwrap().0.enable, 0);
}

#[test]
fn a_fault_is_reset_once_and_the_machine_works_again_a_hundred_times() {
    let mut random = Random::new(7);
    let mut bench =
        Bench::new(Script { enable_after: [3, 5, 4], position: somewhere(&mut random), ..Script::default() }, 500);
    for round in 0..100 {
        if random.below(4) > 0 {
            bench.attach(600).unwrap_or_else(|| panic!("round {round}: {:?}", bench.fine.fault()));
            bench.queue_move();
        }
        // While it is enabled, waits, moves, or rests behind the move.
        for _ in 0..random.below(if bench.rough.depth.wall_s.load().is_finite() { 3 } else { 260 }) {
            bench.fine.tick();
        }
        let joint = random.below(JOINTS as u64) as usize;
        bench.script.lock().unwrap().fault = Some(joint);
        for _ in 0..300 {
            bench.fine.tick();
        }
        let fault = bench.fine.fault().map(|fault| fault.kind);
        assert_eq!(fault, Some(FaultKind::Drive { joint, code: 0x7210 }), "round {round}");
        assert_eq!((bench.state(), bench.fine.is_over()), (MachineState::Fault, true), "round {round}");
        assert_eq!(bench.script.lock().unwrap().resets, round, "nobody has reset it");
        // Somebody moves the axes by hand while the drives are off.
        bench.script.lock().unwrap().position = somewhere(&mut random);
        while bench.rough.rests.pop().is_ok() {}
        while bench.host.samples.pop().is_ok() {}
        bench.fine.reset();
        assert_eq!(bench.fine.fault(), None);
        bench.script.lock().unwrap().told.clear();
    }
}

#[test]
fn a_joint_that_is_lost_is_a_fault_of_its_own_in_every_state() {
    for ticks in [0, 50, 190, 230] {
        let mut bench = Bench::new(Script::default(), 500);
        bench.attach(10).unwrap();
        bench.queue_move();
        for _ in 0..ticks {
            bench.fine.tick();
        }
        bench.script.lock().unwrap().lost = Some(2);
        bench.fine.tick();
        assert_eq!(bench.fine.fault().map(|f| f.kind), Some(FaultKind::Lost { joint: 2, code: 0 }), "{ticks}");
    }
}

#[test]
fn the_phase_of_the_bus_reaches_the_clock_from_the_first_exchange_on() {
    for phase_ns in [None, Some(-1234)] {
        let mut bench = Bench::new(Script { enable_after: [9; 3], phase_ns, ..Script::default() }, 500);
        assert_eq!(bench.fine.phase_ns(), None);
        bench.fine.tick();
        assert_eq!(bench.fine.phase_ns(), phase_ns);
    }
}

#[test]
fn old_feedback_changes_no_command_and_no_following_error_is_judged_by_it() {
    let commands = |lost: bool| {
        let mut bench = Bench::new(Script::default(), 500);
        bench.attach(10).unwrap();
        bench.queue_move();
        for tick in 0..250_u32 {
            bench.script.lock().unwrap().age = if lost && tick % 7 < 3 { tick % 7 + 1 } else { 0 };
            bench.fine.tick();
        }
        assert_eq!(bench.fine.fault(), None);
        let old = bench.fine.counters().old_feedback_periods;
        let told: Vec<_> = bench.script.lock().unwrap().told.iter().map(|(setpoint, _)| *setpoint).collect();
        (told, old)
    };
    let ((whole, none), (lossy, counted)) = (commands(false), commands(true));
    assert_eq!(whole, lossy);
    assert_eq!((none, counted), (0, (0..250).filter(|tick| tick % 7 < 3).count() as u64));
}

#[test]
fn following_error_is_judged_against_the_command_that_the_feedback_answers() {
    struct Behind(u32, Vec<AxisVector>);
    impl Driver for Behind {
        fn describe(&self) -> DriverDescription {
            DriverDescription::real()
        }
        fn open(&mut self, _context: &DriverContext) -> Result<(), PluginError> {
            Ok(())
        }
        fn start(&mut self) -> Result<Attached, PluginError> {
            Ok(Attached::default())
        }
        fn exchange(&mut self, setpoint: &Setpoint, feedback: &mut Feedback) -> Result<(), PluginError> {
            self.1.push(setpoint.position);
            feedback.follow(setpoint, JOINTS);
            feedback.position = self.1[self.1.len().saturating_sub(1 + self.0 as usize)];
            Ok(())
        }
        fn quick_stop(&mut self) {}
        fn stop(&mut self) -> Result<(), PluginError> {
            Ok(())
        }
    }
    for (behind, told, faults) in [(2, 2, false), (2, 0, true), (0, 2, true), (15, 15, false)] {
        let attached = Attached { delay_periods: [told; MAX_AXES], ..Attached::default() };
        let mut bench = Bench::of(Box::new(Behind(behind, vec![])), attached, 500, Arc::default());
        bench.attach(10).unwrap();
        bench.queue_move();
        for _ in 0..250 {
            bench.fine.tick();
        }
        let followed = bench.fine.fault().map(|f| matches!(f.kind, FaultKind::Following { .. }));
        assert_eq!(followed, faults.then_some(true), "{behind} behind, {told} told");
    }
}
