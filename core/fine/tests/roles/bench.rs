//! A fine loop whose drives report inputs as a test wants them, in every state of the machine.

use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};

use tandem_fine::{Fault, FaultKind, FineConfig, FineLoop, Roles};
use tandem_rig::Random;
use tandem_rings::{HostEnd, MachineState, Queued, RestCause, RoughEnd, Sizes, bridge};
use tandem_sdk::{
    Attached, AxisLimits, AxisVector, Driver, DriverContext, DriverDescription, Edge, Event, EventKind, Feedback,
    JointState, Limits, MAX_AXES, PluginError, Segment, SegmentFlags, Setpoint, StopOn,
};

const PERIOD_S: f64 = 0.001;
const JOINTS: usize = 2;
const ACCELERATION_MM_PER_S2: f64 = 1000.0;
const SPINDLE_RAD_PER_S: f64 = 100.0;
/// Exchanges that the drives need to hold.
pub const ENABLE: u64 = 20;
/// Exchanges that the spindle needs to turn.
pub const SPIN_UP: u32 = 40;
/// Age that no input may be above, periods.
pub const MAX_AGE: u16 = 5;
/// Input that probing waits for.
pub const PROBE: u32 = 7;

/// The drives, as the test makes them.
pub struct Script {
    pub inputs: u64,
    pub age: [u16; 64],
    pub enabled_for: u64,
    pub spun_for: u32,
    pub faulty: bool,
    pub told: Vec<Setpoint>,
}

pub struct Drives(pub Arc<Mutex<Script>>);

impl Driver for Drives {
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
        let mut script = self.0.lock().unwrap();
        script.told.push(*setpoint);
        script.enabled_for = if setpoint.enable == 0 { 0 } else { script.enabled_for + 1 };
        script.spun_for = if setpoint.spindle_rad_per_s == 0.0 { 0 } else { script.spun_for + 1 };
        let state = match script.enabled_for {
            _ if script.faulty => JointState::Fault,
            0 => JointState::Disabled,
            1..ENABLE => JointState::Enabling,
            _ => JointState::Enabled,
        };
        feedback.state[..JOINTS].fill(state);
        feedback.position = setpoint.position;
        (feedback.inputs, feedback.input_age_periods) = (script.inputs, script.age);
        let turns = setpoint.spindle_rad_per_s == 0.0 || script.spun_for > SPIN_UP;
        feedback.spindle_at_speed = u32::from(turns);
        Ok(())
    }
    fn quick_stop(&mut self) {}
    fn stop(&mut self) -> Result<(), PluginError> {
        Ok(())
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    EmergencyStop,
    DrivesReady,
    Door,
    FeedHold,
    Limit,
    Probe,
}

pub const ROLES: [Role; 6] =
    [Role::EmergencyStop, Role::DrivesReady, Role::Door, Role::FeedHold, Role::Limit, Role::Probe];

/// What the machine does when an input trips.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doing {
    Enabling,
    Waiting,
    Running,
    Holding,
    Dwelling,
    Probing,
    Homing,
    Jogging,
    Ramping,
    AtRest,
}

pub const ALL: [Doing; 10] = [
    Doing::Enabling,
    Doing::Waiting,
    Doing::Running,
    Doing::Holding,
    Doing::Dwelling,
    Doing::Probing,
    Doing::Homing,
    Doing::Jogging,
    Doing::Ramping,
    Doing::AtRest,
];

impl Doing {
    pub fn moves(self) -> bool {
        [Self::Running, Self::Probing, Self::Homing, Self::Jogging].contains(&self)
    }
}

pub struct Bench {
    pub fine: FineLoop,
    pub rough: RoughEnd,
    pub host: HostEnd,
    pub script: Arc<Mutex<Script>>,
    pub epoch: u32,
    pub x_mm: f64,
    pub start_s: f64,
    pub closed: bool,
    pub input: u32,
}

pub fn config(roles: Roles, unhomed: u32) -> FineConfig {
    let axis = AxisLimits {
        min_mm: -1000.0,
        max_mm: 1000.0,
        feed_mm_per_s: 100.0,
        rapid_mm_per_s: 100.0,
        acceleration_mm_per_s2: ACCELERATION_MM_PER_S2,
        jerk_mm_per_s3: f64::INFINITY,
        speed_difference_mm_per_s: 0.0,
    };
    FineConfig {
        linear: 0b11,
        max_following_error_mm: AxisVector([0.01; MAX_AXES]),
        unhomed,
        enable_periods: 500,
        disable_periods: 100,
        plans_from_rest: true,
        roles,
        ..FineConfig::new(PERIOD_S, Limits::new(&[axis; JOINTS]).unwrap())
    }
}

impl Bench {
    /// A machine whose `input` has `role`; `closed` is its normal level.
    pub fn new(role: Role, doing: Doing, input: u32, closed: bool) -> Self {
        let mut roles = Roles { may_leave_limits: doing == Doing::Jogging, ..Roles::default() };
        let bit = 1 << input;
        match role {
            Role::EmergencyStop => roles.emergency_stop = bit,
            Role::DrivesReady => roles.drives_ready = bit,
            Role::Door => roles.door = bit,
            Role::FeedHold => roles.feed_hold = bit,
            Role::Limit => roles.limit = bit,
            Role::Probe => roles.awaited = bit,
        }
        roles.normally_closed = if closed { bit } else { 0 };
        roles.max_age_periods[input as usize] = MAX_AGE;
        let inputs = if closed { bit } else { 0 };
        let script = Script { inputs, age: [0; 64], enabled_for: 0, spun_for: 0, faulty: false, told: vec![] };
        let script = Arc::new(Mutex::new(script));
        let (rough, end, host) = bridge(Sizes { segments: 64, samples: 1 << 14 });
        let config = config(roles, u32::from(doing == Doing::Homing));
        let mut fine = FineLoop::new(&config, end, Box::new(Drives(Arc::clone(&script))), None);
        fine.reset();
        Self { fine, rough, host, script, epoch: 0, x_mm: 0.0, start_s: 0.0, closed, input }
    }

    pub fn ticks(&mut self, count: u64) {
        (0..count).for_each(|_| self.fine.tick());
    }

    pub fn fault(&self) -> Option<FaultKind> {
        self.fine.fault().map(|fault: Fault| fault.kind)
    }

    pub fn state(&self) -> MachineState {
        MachineState::from_number(self.host.status.state.load(Relaxed))
    }

    /// Ticks until all joints hold.
    pub fn attach(&mut self) {
        for _ in 0..2 * ENABLE {
            self.fine.tick();
            if let Ok(rest) = self.rough.rests.pop() {
                assert_eq!(rest.cause, RestCause::Attached);
                self.go_on(rest.epoch, rest.program_time_s);
                return;
            }
        }
        panic!("not enabled: {:?}", self.fault());
    }

    pub fn go_on(&mut self, epoch: u32, start_s: f64) {
        (self.epoch, self.start_s) = (epoch + 1, start_s);
        self.rough.depth.begin(self.epoch, start_s);
    }

    pub fn piece(&mut self, motion: [f64; 3], duration_s: f64, last: bool, stop_on: StopOn) {
        let mut segment = Segment::rest(&AxisVector::ZERO, duration_s);
        segment.coefficients[0] = [motion[0], motion[1], motion[2], 0.0, 0.0, 0.0];
        segment.path = segment.coefficients[0];
        segment.flags = if last { SegmentFlags::ENDS_AT_REST } else { SegmentFlags::default() };
        (segment.epoch, segment.feed_mm_per_s, segment.stop_on) = (self.epoch, 100.0, stop_on);
        segment.stop_deceleration_mm_per_s2 = 500.0;
        self.rough.segments.push(Queued::Segment { start_s: self.start_s, segment }).unwrap();
        self.x_mm = segment.position(duration_s)[0];
        self.start_s += duration_s;
        self.rough.depth.stop_deceleration_mm_per_s2.store(500.0);
        self.rough.depth.wall_s.store(f64::INFINITY);
        self.rough.depth.required_s.store(0.0);
    }

    /// Queues 0.2 s of acceleration, 1 s at 100 mm/s and 0.2 s to rest.
    pub fn queue_move(&mut self, stop_on: StopOn) {
        self.piece([self.x_mm, 0.0, 250.0], 0.2, false, stop_on);
        self.piece([self.x_mm, 100.0, 0.0], 1.0, false, stop_on);
        self.piece([self.x_mm, 100.0, -250.0], 0.2, true, stop_on);
    }

    pub fn queue_spindle(&mut self) {
        let event = Event {
            program_time_s: self.start_s,
            epoch: self.epoch,
            ..Event::new(EventKind::Spindle, 1, 0, 0, SPINDLE_RAD_PER_S)
        };
        self.rough.segments.push(Queued::Event(event)).unwrap();
    }

    /// Brings the machine to where it does that.
    pub fn begin(&mut self, doing: Doing, random: &mut Random) {
        if doing == Doing::Enabling {
            self.ticks(1 + random.below(ENABLE - 2));
            return;
        }
        self.attach();
        if doing == Doing::Waiting {
            self.ticks(random.below(30));
            return;
        }
        self.queue_spindle();
        let (some, no_edge) = (10 + random.below(1200), StopOn::default());
        match doing {
            Doing::Dwelling => {
                self.piece([self.x_mm, 0.0, 0.0], 2.0, true, no_edge);
                self.ticks(some);
                return;
            }
            Doing::Probing => self.queue_move(StopOn { input: PROBE, edge: Edge::Rising, miss_is_fault: 0 }),
            _ => self.queue_move(no_edge),
        }
        match doing {
            Doing::AtRest => self.ticks(1500 + some),
            _ => self.ticks(some),
        }
        match doing {
            Doing::Holding => {
                self.host.controls.hold.store(true, Relaxed);
                self.ticks(400);
            }
            Doing::Ramping => {
                self.script.lock().unwrap().faulty = true;
                self.ticks(1 + random.below(20));
            }
            _ => {}
        }
    }

    pub fn trip(&mut self, old: bool) {
        let mut script = self.script.lock().unwrap();
        if old { script.age[self.input as usize] = MAX_AGE + 1 } else { script.inputs ^= 1 << self.input }
    }

    pub fn release(&mut self) {
        let mut script = self.script.lock().unwrap();
        script.age = [0; 64];
        script.inputs = if self.closed { 1 << self.input } else { 0 };
    }

    pub fn told(&self) -> Setpoint {
        *self.script.lock().unwrap().told.last().unwrap()
    }

    /// Ticks until nothing moves.
    pub fn rest(&mut self) {
        self.ticks(400);
        assert_eq!(self.told().velocity, AxisVector::ZERO);
    }

    /// No setpoint went beyond a limit.
    pub fn assert_limits(&self) {
        for told in &self.script.lock().unwrap().told {
            let most = ACCELERATION_MM_PER_S2 * (1.0 + 1e-6) + 1e-6;
            assert!(told.velocity[0].abs() <= 100.0 * (1.0 + 1e-6), "{told:?}");
            assert!(told.acceleration[0].abs() <= most, "{told:?}");
        }
    }

    /// The machine ends in that fault, its drives off.
    pub fn assert_ends_by(&mut self, kind: FaultKind) {
        self.ticks(2);
        assert_eq!(self.fault(), Some(kind));
        self.ticks(400);
        assert_eq!((self.fault(), self.state(), self.told().enable), (Some(kind), MachineState::Fault, 0));
        assert!(self.fine.is_over());
    }
}
