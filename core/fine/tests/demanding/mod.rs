//! A fine loop whose drives are as demanding as real ones, and fail as a test wants them to.

use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, MutexGuard};

use tandem_fine::{FaultKind, FineConfig, FineLoop};
use tandem_rings::{HostEnd, MachineState, Queued, Rest, RoughEnd, Sizes, bridge};
use tandem_sdk::{
    Attached, AxisLimits, AxisVector, Driver, DriverContext, DriverDescription, Edge, Event, EventKind, Feedback,
    JointState, Kinematics, Latch, Limits, MAX_AXES, PluginError, Segment, SegmentFlags, Setpoint, StopOn,
};

/// Fine period where a test draws none, s.
pub const PERIOD_S: f64 = 0.001;
/// What the axes may accelerate with, mm/s².
pub const ACCELERATION_MM_PER_S2: f64 = 1000.0;
/// Feed and rapid of the axes, mm/s.
pub const FEED_MM_PER_S: f64 = 100.0;
/// What the plan accelerates with, mm/s².
const PLANNED_MM_PER_S2: f64 = 500.0;
/// What a drive that is in fault says.
pub const FAULT_CODE: u32 = 0x7210;
/// What a drive says that fails while it homes its joint.
pub const HOMING_CODE: u32 = 0x8611;
/// How far a drive that homes its joint moves it in a period, mm.
const HOMING_STEP_MM: f64 = 0.05;

/// What the test makes the drives do, and what they were told.
pub struct Script {
    pub joints: usize,
    /// Exchanges with `enable = 1` after which each joint holds.
    pub enable_after: [u64; MAX_AXES],
    /// Exchanges with `enable = 0` for which each joint is held while its brake closes.
    pub brake_for: [u64; MAX_AXES],
    /// How far a joint sinks in every period in which it does not hold, mm.
    pub sag_mm: [f64; MAX_AXES],
    /// Joint that faults from now on, until it is reset.
    pub fault: Option<usize>,
    /// Joint that is lost from now on, until it is reset.
    pub lost: Option<usize>,
    /// What the bus says of each exchange, ns.
    pub phase_ns: Option<i64>,
    /// Periods by which all of the feedback is old from now on.
    pub age: u32,
    /// Periods by which the positions that are reported are behind.
    pub behind: usize,
    pub inputs: u64,
    pub input_age: [u16; 64],
    /// Exchanges that the spindle needs to turn.
    pub spin_up: u32,
    /// Exchanges that homing takes; the drive says at once that it is homed with 0.
    pub homing_takes: u64,
    /// Where a joint is then, mm.
    pub homed_at_mm: f64,
    /// Joints that say from the beginning that they are homed, of an older homing.
    pub was_homed: u32,
    pub never_homes: bool,
    pub homing_fails_after: Option<u64>,
    /// Whether a probe that is waited for is caught, in the middle of the last period, by the first joint's drive alone.
    pub catches: bool,
    pub enabled_for: u64,
    pub disabled_for: u64,
    pub spun_for: u32,
    pub homing_for: u64,
    pub homed: u32,
    pub position: AxisVector,
    /// Where the joints were behind each exchange.
    pub been: Vec<AxisVector>,
    /// Every setpoint, with the feedback that was known before it.
    pub told: Vec<(Setpoint, Feedback)>,
    pub resets: u32,
}

impl Script {
    /// Drives of `joints` joints that do at once what they are told.
    pub fn new(joints: usize) -> Self {
        Self {
            joints,
            enable_after: [0; MAX_AXES],
            brake_for: [0; MAX_AXES],
            sag_mm: [0.0; MAX_AXES],
            fault: None,
            lost: None,
            phase_ns: None,
            age: 0,
            behind: 0,
            inputs: 0,
            input_age: [0; 64],
            spin_up: 0,
            homing_takes: 0,
            homed_at_mm: 0.0,
            was_homed: 0,
            never_homes: false,
            homing_fails_after: None,
            catches: false,
            enabled_for: 0,
            disabled_for: u64::MAX,
            spun_for: 0,
            homing_for: 0,
            homed: 0,
            position: AxisVector::ZERO,
            been: vec![],
            told: vec![],
            resets: 0,
        }
    }

    /// What was told last.
    pub fn last(&self) -> Setpoint {
        self.told.last().expect("an exchange").0
    }

    /// Somebody moves the joints by hand, long enough ago for the drives to know.
    pub fn move_to(&mut self, position: AxisVector) {
        self.position = position;
        self.been.clear();
    }

    fn take(&mut self, setpoint: &Setpoint) {
        if setpoint.reset != 0 {
            (self.fault, self.lost) = (None, None);
            self.resets += 1;
        }
        if setpoint.enable == 0 {
            (self.enabled_for, self.disabled_for) = (0, self.disabled_for.saturating_add(1));
        } else {
            (self.enabled_for, self.disabled_for) = (self.enabled_for + 1, 0);
        }
        let before = self.told.iter().nth_back(1).map_or(0.0, |(told, _)| told.spindle_rad_per_s);
        let speed = setpoint.spindle_rad_per_s;
        self.spun_for = match speed {
            0.0 => 0,
            _ if speed == before => self.spun_for + 1,
            _ => 1,
        };
        let begins = setpoint.homing != 0 && self.homing_for == 0;
        self.homing_for = if setpoint.homing == 0 { 0 } else { self.homing_for + 1 };
        if begins {
            self.homed &= !setpoint.homing;
        }
    }

    fn state_of(&self, joint: usize, setpoint: &Setpoint) -> JointState {
        let brakes = setpoint.enable == 0 && self.disabled_for <= self.brake_for[joint];
        let holds = brakes || setpoint.enable != 0 && self.enabled_for > self.enable_after[joint];
        match setpoint.enable {
            _ if self.fault == Some(joint) => JointState::Fault,
            _ if self.lost == Some(joint) => JointState::Lost,
            _ if holds => JointState::Enabled,
            0 => JointState::Disabled,
            _ => JointState::Enabling,
        }
    }

    /// One period of a joint; what its drive says of itself.
    fn drive(&mut self, joint: usize, setpoint: &Setpoint, feedback: &mut Feedback) {
        let mut state = self.state_of(joint, setpoint);
        let homes = setpoint.homing >> joint & 1 == 1;
        let own = homes && self.homed >> joint & 1 == 0 && state == JointState::Enabled;
        feedback.fault_code[joint] = if state == JointState::Fault { FAULT_CODE } else { 0 };
        if own && self.homing_for > self.homing_takes && !self.never_homes {
            self.homed |= 1 << joint;
            self.position[joint] = self.homed_at_mm;
        } else if own {
            self.position[joint] -= HOMING_STEP_MM;
            state = JointState::Homing;
        } else if state == JointState::Enabled && !homes {
            self.position[joint] = setpoint.position[joint];
        } else if state != JointState::Enabled {
            self.position[joint] -= self.sag_mm[joint];
        }
        if own && self.homing_fails_after.is_some_and(|after| self.homing_for > after) {
            (state, feedback.fault_code[joint]) = (JointState::Fault, HOMING_CODE);
        }
        feedback.state[joint] = state;
    }

    /// The edge that is armed, where its input has come to its level.
    fn latch(&self, setpoint: &Setpoint) -> Latch {
        let high = self.inputs >> setpoint.arm.input.min(63) & 1;
        if !self.catches || setpoint.arm.edge != Edge::Rising as u32 || high == 0 {
            return Latch::default();
        }
        let (input, edge) = (setpoint.arm.input, setpoint.arm.edge);
        Latch { input, edge, joints: 1, before_s: PERIOD_S / 2.0, position: self.position, ..Latch::default() }
    }
}

/// The drives themselves.
pub struct Drives(pub Arc<Mutex<Script>>);

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
        script.take(setpoint);
        for joint in 0..script.joints {
            script.drive(joint, setpoint, feedback);
        }
        feedback.homed = script.homed | (script.was_homed & !setpoint.homing);
        let position = script.position;
        script.been.push(position);
        feedback.position = script.been[script.been.len().saturating_sub(1 + script.behind)];
        (feedback.inputs, feedback.input_age_periods) = (script.inputs, script.input_age);
        feedback.latches[0] = script.latch(setpoint);
        let turns = setpoint.spindle_rad_per_s == 0.0 || script.spun_for > script.spin_up;
        feedback.spindle_at_speed = u32::from(turns);
        (feedback.has_phase, feedback.phase_ns) = (u32::from(script.phase_ns.is_some()), script.phase_ns.unwrap_or(5));
        feedback.age_periods = [0; MAX_AXES];
        Ok(())
    }
    fn quick_stop(&mut self) {}
    fn stop(&mut self) -> Result<(), PluginError> {
        Ok(())
    }
}

/// A machine of `axes` axes that is to move as real ones do.
pub fn config(axes: usize) -> FineConfig {
    let axis = AxisLimits {
        min_mm: -1000.0,
        max_mm: 1000.0,
        feed_mm_per_s: FEED_MM_PER_S,
        rapid_mm_per_s: FEED_MM_PER_S,
        acceleration_mm_per_s2: ACCELERATION_MM_PER_S2,
        jerk_mm_per_s3: f64::INFINITY,
        speed_difference_mm_per_s: 0.0,
    };
    FineConfig {
        max_following_error_mm: AxisVector([0.01; MAX_AXES]),
        enable_periods: 500,
        disable_periods: 100,
        plans_from_rest: true,
        ..FineConfig::new(PERIOD_S, Limits::new(&[axis; MAX_AXES][..axes]).unwrap())
    }
}

/// The fine loop, with both other ends and the drives in the test's hands.
pub struct Bench {
    pub fine: FineLoop,
    pub rough: RoughEnd,
    pub host: HostEnd,
    pub script: Arc<Mutex<Script>>,
    pub epoch: u32,
    /// Where what is queued ends.
    pub position: AxisVector,
    pub start_s: f64,
    /// What is queued is a rapid.
    pub rapid: bool,
}

impl Bench {
    /// Joints that are axes, which stand where `script` has them.
    pub fn new(config: &FineConfig, script: Script) -> Self {
        Self::with(config, script, None)
    }

    /// The same with kinematics.
    pub fn with(config: &FineConfig, script: Script, kinematics: Option<Box<dyn Kinematics>>) -> Self {
        let attached = Attached { position: script.position, ..config.attached };
        let script = Arc::new(Mutex::new(script));
        let (rough, end, host) = bridge(Sizes { segments: 64, samples: 1 << 14 });
        let drives = Box::new(Drives(Arc::clone(&script)));
        let mut fine = FineLoop::new(&FineConfig { attached, ..*config }, end, drives, kinematics);
        fine.reset();
        Self { fine, rough, host, script, epoch: 0, position: AxisVector::ZERO, start_s: 0.0, rapid: false }
    }

    pub fn script(&self) -> MutexGuard<'_, Script> {
        self.script.lock().unwrap()
    }

    pub fn ticks(&mut self, count: u64) {
        (0..count).for_each(|_| self.fine.tick());
    }

    pub fn fault(&self) -> Option<FaultKind> {
        self.fine.fault().map(|fault| fault.kind)
    }

    pub fn state(&self) -> MachineState {
        MachineState::from_number(self.host.status.state.load(Relaxed))
    }

    /// What the drives were told last.
    pub fn told(&self) -> Setpoint {
        self.script().last()
    }

    /// Ticks until a rest is reported, which begins the next epoch.
    pub fn rest(&mut self, most: u64) -> Option<Rest> {
        for _ in 0..most {
            self.fine.tick();
            if let Ok(rest) = self.rough.rests.pop() {
                (self.epoch, self.start_s, self.position) = (rest.epoch + 1, rest.program_time_s, rest.position);
                self.rough.depth.begin(self.epoch, self.start_s);
                return Some(rest);
            }
        }
        None
    }

    /// Queues a piece: where it begins, with which speed, and half of its acceleration along each axis.
    pub fn piece(&mut self, motion: [AxisVector; 2], duration_s: f64, last: bool, stop_on: StopOn) {
        let mut segment = Segment::rest(&self.position, duration_s);
        for axis in 0..MAX_AXES {
            segment.coefficients[axis] = [self.position[axis], motion[0][axis], motion[1][axis], 0.0, 0.0, 0.0];
        }
        segment.path = segment.coefficients[0];
        segment.flags = if last { SegmentFlags::ENDS_AT_REST } else { SegmentFlags::default() };
        if self.rapid {
            segment.flags = segment.flags.with(SegmentFlags::RAPID);
        }
        (segment.epoch, segment.feed_mm_per_s, segment.stop_on) = (self.epoch, FEED_MM_PER_S, stop_on);
        segment.stop_deceleration_mm_per_s2 = PLANNED_MM_PER_S2;
        self.rough.segments.push(Queued::Segment { start_s: self.start_s, segment }).unwrap();
        self.position = segment.position(duration_s);
        self.start_s += duration_s;
        self.go();
    }

    /// Queues motion of the `axis` for `cruise_s` at the speed that `ramp_s` of acceleration gives, and to rest again.
    pub fn queue(&mut self, axis: usize, ramp_s: f64, cruise_s: f64, stop_on: StopOn) {
        let along = |amount: f64| {
            let mut vector = AxisVector::ZERO;
            vector[axis] = amount;
            vector
        };
        let (speed, half) = (along(PLANNED_MM_PER_S2 * ramp_s), along(PLANNED_MM_PER_S2 / 2.0));
        self.piece([AxisVector::ZERO, half], ramp_s, false, stop_on);
        if cruise_s > 0.0 {
            self.piece([speed, AxisVector::ZERO], cruise_s, false, stop_on);
        }
        self.piece([speed, AxisVector::ZERO - half], ramp_s, true, stop_on);
    }

    pub fn queue_event(&mut self, kind: EventKind, index: i32, value: f64) {
        let event = Event::new(kind, 1, 0, index, value);
        let event = Event { program_time_s: self.start_s, epoch: self.epoch, ..event };
        self.rough.segments.push(Queued::Event(event)).unwrap();
        self.go();
    }

    /// Everything that is needed is queued.
    fn go(&self) {
        self.rough.depth.stop_deceleration_mm_per_s2.store(PLANNED_MM_PER_S2);
        self.rough.depth.wall_s.store(f64::INFINITY);
        self.rough.depth.required_s.store(0.0);
    }

    /// No joint that did not hold was told to be more than `count_mm` from where it stood, and one that held stayed until all
    /// did. A joint in its drive's hands is told to be where it is.
    pub fn assert_bumpless(&self, count_mm: f64) {
        let script = self.script();
        let mut held = [None; MAX_AXES];
        for (index, (setpoint, before)) in script.told.iter().enumerate() {
            let all = before.state[..script.joints].iter().all(|state| *state == JointState::Enabled);
            for (joint, held) in held.iter_mut().enumerate().take(script.joints) {
                let at = setpoint.position[joint];
                let own = setpoint.homing >> joint & 1 == 1 || before.state[joint] == JointState::Homing;
                if before.state[joint] == JointState::Enabled && setpoint.enable != 0 && !own {
                    let stays = held.unwrap_or(script.told[index - 1].0.position[joint]);
                    let homed = index > 0 && script.told[index - 1].0.homing >> joint & 1 == 1;
                    assert!(all || homed || at == stays, "exchange {index}: joint {joint} moved before all held");
                    *held = Some(stays).filter(|_| !all);
                } else {
                    *held = None;
                    let known = if index == 0 { at } else { before.position[joint] };
                    assert!(
                        (at - known).abs() <= count_mm,
                        "exchange {index}: joint {joint} was told {at}, stood at {known}"
                    );
                }
            }
        }
    }
}
