//! Inputs with a role: each in every state of the machine, with fresh and with old samples, at ticks drawn from a seed.

use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};

use tandem_fine::{Fault, FaultKind, FineConfig, FineLoop, GuardMode, InputFault, Joints, MissedLimits, Roles};
use tandem_rig::Random;
use tandem_rings::{HostEnd, MachineState, Queued, RestCause, RoughEnd, Sizes, StopCause, bridge};
use tandem_sdk::{
    Attached, AxisLimits, AxisVector, Driver, DriverContext, DriverDescription, Edge, Event, EventKind, Feedback,
    JointState, Limits, MAX_AXES, PluginError, Segment, SegmentFlags, Setpoint, StopOn,
};

const PERIOD_S: f64 = 0.001;
const JOINTS: usize = 2;
const ACCELERATION_MM_PER_S2: f64 = 1000.0;
const SPINDLE_RAD_PER_S: f64 = 100.0;
/// Exchanges that the drives need to hold.
const ENABLE: u64 = 20;
/// Exchanges that the spindle needs to turn.
const SPIN_UP: u32 = 40;
/// Age that no input may be above, periods.
const MAX_AGE: u16 = 5;
/// Input that probing waits for.
const PROBE: u32 = 7;

/// The drives, as the test makes them.
struct Script {
    inputs: u64,
    age: [u16; 64],
    enabled_for: u64,
    spun_for: u32,
    faulty: bool,
    told: Vec<Setpoint>,
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
enum Role {
    EmergencyStop,
    DrivesReady,
    Door,
    FeedHold,
    Limit,
    Probe,
}

const ROLES: [Role; 6] = [Role::EmergencyStop, Role::DrivesReady, Role::Door, Role::FeedHold, Role::Limit, Role::Probe];

/// What the machine does when an input trips.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Doing {
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

const ALL: [Doing; 10] = [
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
    fn moves(self) -> bool {
        [Self::Running, Self::Probing, Self::Homing, Self::Jogging].contains(&self)
    }
}

struct Bench {
    fine: FineLoop,
    rough: RoughEnd,
    host: HostEnd,
    script: Arc<Mutex<Script>>,
    epoch: u32,
    x_mm: f64,
    start_s: f64,
    closed: bool,
    input: u32,
}

fn config(roles: Roles, unhomed: u32) -> FineConfig {
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
        period_s: PERIOD_S,
        limits: Limits::new(&[axis; JOINTS]).unwrap(),
        joints: Joints::Axes,
        speed_difference_mm_per_s: [0.0; MAX_AXES],
        order: 2,
        guard: GuardMode::Stop,
        position: AxisVector::ZERO,
        max_feed_ratio: 1.0,
        max_following_error_mm: AxisVector([0.01; MAX_AXES]),
        missed: MissedLimits::default(),
        kept_outputs: 0,
        pause_at_stops: false,
        dry_run: false,
        unhomed,
        record_drives: false,
        attached: Attached::default(),
        enable_periods: 500,
        disable_periods: 100,
        reset_drives: false,
        plans_from_rest: true,
        roles,
    }
}

impl Bench {
    /// A machine whose `input` has `role`; `closed` is its normal level.
    fn new(role: Role, doing: Doing, input: u32, closed: bool) -> Self {
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

    fn ticks(&mut self, count: u64) {
        (0..count).for_each(|_| self.fine.tick());
    }

    fn fault(&self) -> Option<FaultKind> {
        self.fine.fault().map(|fault: Fault| fault.kind)
    }

    fn state(&self) -> MachineState {
        MachineState::from_number(self.host.status.state.load(Relaxed))
    }

    /// Ticks until all joints hold.
    fn attach(&mut self) {
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

    fn go_on(&mut self, epoch: u32, start_s: f64) {
        (self.epoch, self.start_s) = (epoch + 1, start_s);
        self.rough.depth.begin(self.epoch, start_s);
    }

    fn piece(&mut self, motion: [f64; 3], duration_s: f64, last: bool, stop_on: StopOn) {
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
    fn queue_move(&mut self, stop_on: StopOn) {
        self.piece([self.x_mm, 0.0, 250.0], 0.2, false, stop_on);
        self.piece([self.x_mm, 100.0, 0.0], 1.0, false, stop_on);
        self.piece([self.x_mm, 100.0, -250.0], 0.2, true, stop_on);
    }

    fn queue_spindle(&mut self) {
        let event = Event {
            program_time_s: self.start_s,
            epoch: self.epoch,
            ..Event::new(EventKind::Spindle, 1, 0, 0, SPINDLE_RAD_PER_S)
        };
        self.rough.segments.push(Queued::Event(event)).unwrap();
    }

    /// Brings the machine to where it does that.
    fn begin(&mut self, doing: Doing, random: &mut Random) {
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

    fn trip(&mut self, old: bool) {
        let mut script = self.script.lock().unwrap();
        if old { script.age[self.input as usize] = MAX_AGE + 1 } else { script.inputs ^= 1 << self.input }
    }

    fn release(&mut self) {
        let mut script = self.script.lock().unwrap();
        script.age = [0; 64];
        script.inputs = if self.closed { 1 << self.input } else { 0 };
    }

    fn told(&self) -> Setpoint {
        *self.script.lock().unwrap().told.last().unwrap()
    }

    /// Ticks until nothing moves.
    fn rest(&mut self) {
        self.ticks(400);
        assert_eq!(self.told().velocity, AxisVector::ZERO);
    }

    /// No setpoint went beyond a limit.
    fn assert_limits(&self) {
        for told in &self.script.lock().unwrap().told {
            let most = ACCELERATION_MM_PER_S2 * (1.0 + 1e-6) + 1e-6;
            assert!(told.velocity[0].abs() <= 100.0 * (1.0 + 1e-6), "{told:?}");
            assert!(told.acceleration[0].abs() <= most, "{told:?}");
        }
    }

    /// The machine ends in that fault, its drives off.
    fn assert_ends_by(&mut self, kind: FaultKind) {
        self.ticks(2);
        assert_eq!(self.fault(), Some(kind));
        self.ticks(400);
        assert_eq!((self.fault(), self.state(), self.told().enable), (Some(kind), MachineState::Fault, 0));
        assert!(self.fine.is_over());
    }
}

/// Every role in every state, fresh and old.
fn each(mut judge: impl FnMut(Bench, Doing, bool, &mut Random), of: Role) {
    let mut seed = 0;
    for doing in ALL {
        for old in [false, true] {
            for _ in 0..12 {
                seed += 1;
                let mut random = Random::new(seed);
                let input = if of == Role::Probe { PROBE } else { 8 + random.below(56) as u32 };
                // A probe is waited for as it rises.
                let closed = of != Role::Probe && random.below(2) == 0;
                let mut bench = Bench::new(of, doing, input, closed);
                bench.begin(doing, &mut random);
                let before = bench.fault();
                assert_eq!(before.is_some(), doing == Doing::Ramping, "{doing:?} seed {seed}");
                bench.trip(old);
                judge(bench, doing, old, &mut random);
            }
        }
    }
}

const DRIVE_FAULT: FaultKind = FaultKind::Drive { joint: 0, code: 0 };

#[test]
fn an_emergency_stop_is_one_in_every_state() {
    each(
        |mut bench, doing, old, _| {
            let kind = FaultKind::Input { role: InputFault::EmergencyStop, input: bench.input, old };
            bench.ticks(2);
            assert_eq!(bench.told().spindle_rad_per_s, 0.0, "at once, whatever moves still");
            bench.assert_ends_by(if doing == Doing::Ramping { DRIVE_FAULT } else { kind });
            bench.assert_limits();
            // It is pressed still: the drives are not told to hold once more.
            bench.script.lock().unwrap().faulty = false;
            bench.fine.reset();
            let from = bench.script.lock().unwrap().told.len();
            bench.assert_ends_by(kind);
            assert!(bench.script.lock().unwrap().told[from..].iter().all(|told| told.enable == 0));
            bench.release();
            bench.fine.reset();
            bench.ticks(2 * ENABLE);
            assert_eq!(bench.fault(), None);
        },
        Role::EmergencyStop,
    );
}

#[test]
fn drives_that_are_not_ready_are_a_fault_where_they_hold() {
    each(
        |mut bench, doing, old, _| {
            let kind = FaultKind::Input { role: InputFault::DrivesReady, input: bench.input, old };
            if doing == Doing::Enabling {
                bench.ticks(1);
                assert_eq!(bench.fault(), None, "a contactor may close while they are enabled");
                bench.ticks(ENABLE);
            }
            bench.assert_ends_by(if doing == Doing::Ramping { DRIVE_FAULT } else { kind });
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
    assert_eq!(bench.told().spindle_rad_per_s == 0.0, door || [Doing::Enabling, Doing::Waiting].contains(&doing));
    if [Doing::Enabling, Doing::Waiting].contains(&doing) {
        bench.queue_spindle();
        bench.queue_move(StopOn::default());
    }
    bench.rest();
    let at = bench.told().position;
    assert_eq!((bench.fault(), bench.state()), (None, MachineState::Holding));
    // Neither a resume before it is released nor the release alone lets anything move.
    for _ in 0..3 {
        controls.hold.store(false, Relaxed);
        bench.ticks(random.below(50));
    }
    bench.release();
    bench.ticks(random.below(50) + 1);
    assert_eq!((bench.told().position, controls.hold.load(Relaxed)), (at, true));
    while let Ok(sample) = bench.host.samples.pop() {
        let cause = if door { StopCause::Door } else { StopCause::HoldInput };
        let known = [cause, StopCause::None].contains(&sample.cause) || doing == Doing::Holding;
        assert!(known, "{:?} at {}", sample.cause, sample.tick);
    }
    let from = bench.script.lock().unwrap().told.len();
    controls.hold.store(false, Relaxed);
    bench.ticks(2500);
    assert_eq!(bench.fault(), None);
    let script = bench.script.lock().unwrap();
    let moved = script.told[from..].iter().position(|told| told.velocity != AxisVector::ZERO);
    let turned = script.told[from..].iter().position(|told| told.spindle_rad_per_s != 0.0);
    assert_eq!(moved.is_some(), ![Doing::Dwelling, Doing::AtRest].contains(&doing));
    if let (Some(moved), true, false) = (moved, door, [Doing::Enabling, Doing::Waiting].contains(&doing)) {
        assert!(moved - turned.unwrap() >= SPIN_UP as usize, "{turned:?} {moved}");
    }
    drop(script);
    bench.assert_limits();
}

#[test]
fn a_door_holds_and_stops_the_spindle_until_it_is_closed_and_resumed() {
    each(|bench, doing, _, random| holds(bench, doing, true, random), Role::Door);
}

#[test]
fn a_feed_hold_input_holds_until_it_is_released_and_resumed() {
    each(|bench, doing, _, random| holds(bench, doing, false, random), Role::FeedHold);
}

#[test]
fn a_limit_is_a_fault_in_motion() {
    each(
        |mut bench, doing, old, _| {
            let kind = FaultKind::Input { role: InputFault::Limit, input: bench.input, old };
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
            assert_eq!(bench.fault().is_none(), may, "{doing:?} {old}: {:?}", bench.fault());
            if may {
                bench.release();
                bench.ticks(10);
                assert_eq!(bench.fault(), None);
                // Once it is released, the next one counts.
                bench.trip(false);
                bench.assert_ends_by(FaultKind::Input { role: InputFault::Limit, input: 9, old: false });
            }
        }
    }
}

#[test]
fn a_limit_that_is_a_home_switch_is_none_while_axes_are_homed() {
    for homed in [false, true] {
        let mut bench = Bench::new(Role::Limit, Doing::Homing, 9, true);
        let roles = Roles { limit: 1 << 9, home_switches: 1 << 9, normally_closed: 1 << 9, ..Roles::default() };
        let (rough, end, host) = bridge(Sizes { segments: 64, samples: 1 << 14 });
        let drives = Box::new(Drives(Arc::clone(&bench.script)));
        (bench.rough, bench.host) = (rough, host);
        bench.fine = FineLoop::new(&config(roles, u32::from(!homed)), end, drives, None);
        bench.fine.reset();
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
                bench.assert_ends_by(FaultKind::Input { role: InputFault::Awaited, input: PROBE, old: true });
                bench.assert_limits();
            }
            (Doing::Probing, false) => {
                bench.rest();
                assert_eq!(bench.rough.rests.pop().map(|rest| rest.cause), Ok(RestCause::Edge));
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
        bench.script.lock().unwrap().age = [MAX_AGE; 64];
        bench.attach();
        bench.queue_move(StopOn::default());
        bench.ticks(1500);
        assert_eq!((bench.fault(), bench.state()), (None, MachineState::Standstill), "{role:?}");
    }
}

#[test]
fn a_spindle_that_does_not_turn_again_behind_a_door_is_a_fault() {
    let mut bench = Bench::new(Role::Door, Doing::Running, 9, true);
    bench.begin(Doing::Running, &mut Random::new(3));
    bench.trip(false);
    bench.rest();
    bench.release();
    bench.ticks(5);
    bench.host.controls.hold.store(false, Relaxed);
    for _ in 0..30_010 {
        bench.script.lock().unwrap().spun_for = 0;
        bench.fine.tick();
    }
    assert_eq!(bench.fault(), Some(FaultKind::SpindleSlow { within_s: 30.0 }));
}

#[test]
fn samples_say_what_of_them_is_old() {
    let mut bench = Bench::new(Role::FeedHold, Doing::Running, 9, true);
    bench.attach();
    bench.queue_move(StopOn::default());
    bench.ticks(50);
    while bench.host.samples.pop().is_ok() {}
    bench.script.lock().unwrap().age[9] = 1;
    bench.ticks(1);
    let old = bench.host.samples.pop().unwrap();
    assert_eq!((old.inputs, old.old_inputs, old.age_periods), (1 << 9, 1 << 9, [0; MAX_AXES]));
    bench.script.lock().unwrap().age[9] = 0;
    bench.ticks(1);
    assert_eq!(bench.host.samples.pop().unwrap().old_inputs, 0);
}
