//! A fine loop whose drives report inputs as a test wants them, in every state of the machine.

use std::ops::{Deref, DerefMut};
use std::sync::atomic::Ordering::Relaxed;

use tandem_fine::{FaultKind, FineConfig, Roles};
use tandem_rig::Random;
use tandem_rings::{MachineState, RestCause};
use tandem_sdk::{AxisVector, Edge, EventKind, StopOn};

use crate::demanding::{self, ACCELERATION_MM_PER_S2, FEED_MM_PER_S, PERIOD_S, Script};

const JOINTS: usize = 2;
pub const SPINDLE_RAD_PER_S: f64 = 100.0;
/// Exchanges that the drives need to hold.
pub const ENABLE: u64 = 20;
/// Time that the spindle has, s.
pub const AT_SPEED_WITHIN_S: f64 = 5.0;
/// Exchanges that the spindle needs to turn.
pub const SPIN_UP: u32 = 40;
/// Age that no input may be above, periods.
pub const MAX_AGE: u16 = 5;
/// Input that probing waits for.
pub const PROBE: u32 = 7;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    EmergencyStop,
    DrivesReady,
    Door,
    FeedHold,
    Limit,
    Probe,
}

pub const ROLES: [Role; 6] = [
    Role::EmergencyStop,
    Role::DrivesReady,
    Role::Door,
    Role::FeedHold,
    Role::Limit,
    Role::Probe,
];

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
    /// A drive homes its joint.
    HandedOver,
    Jogging,
    Ramping,
    AtRest,
}

pub const ALL: [Doing; 11] = [
    Doing::Enabling,
    Doing::Waiting,
    Doing::Running,
    Doing::Holding,
    Doing::Dwelling,
    Doing::Probing,
    Doing::Homing,
    Doing::HandedOver,
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
    machine: demanding::Bench,
    pub closed: bool,
    pub input: u32,
}

impl Deref for Bench {
    type Target = demanding::Bench;

    fn deref(&self) -> &Self::Target {
        &self.machine
    }
}

impl DerefMut for Bench {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.machine
    }
}

pub fn config(roles: Roles, unhomed: u32) -> FineConfig {
    FineConfig {
        unhomed,
        roles,
        at_speed_within_s: AT_SPEED_WITHIN_S,
        ..demanding::config(JOINTS)
    }
}

/// Drives that need their time, and these levels of the inputs.
pub fn script(inputs: u64) -> Script {
    let (joints, spin_up) = (JOINTS, SPIN_UP);
    Script {
        inputs,
        spin_up,
        enable_after: [ENABLE - 1; tandem_sdk::MAX_AXES],
        ..Script::new(joints)
    }
}

impl Bench {
    /// A machine whose `input` has `role`; `closed` is its normal level.
    pub fn new(role: Role, doing: Doing, input: u32, closed: bool) -> Self {
        let mut roles = Roles {
            may_leave_limits: doing == Doing::Jogging,
            ..Roles::default()
        };
        let bit = 1 << input;
        match role {
            Role::EmergencyStop => roles.emergency_stop = bit,
            Role::DrivesReady => roles.drives_ready = bit,
            Role::Door => roles.door = bit,
            Role::FeedHold => roles.feed_hold = bit,
            Role::Limit => roles.limit = bit,
            Role::Probe => roles.home_or_probe = bit,
        }
        roles.normally_closed = if closed { bit } else { 0 };
        roles.max_age_periods[input as usize] = MAX_AGE;
        let inputs = if closed { bit } else { 0 };
        let config = config(roles, u32::from(doing == Doing::Homing));
        Self {
            machine: demanding::Bench::new(&config, script(inputs)),
            closed,
            input,
        }
    }

    /// The same machine whose inputs have these roles.
    pub fn with_roles(roles: Roles, unhomed: u32, input: u32, inputs: u64) -> Self {
        Self {
            machine: demanding::Bench::new(&config(roles, unhomed), script(inputs)),
            closed: inputs != 0,
            input,
        }
    }

    /// Ticks until all joints hold.
    pub fn attach(&mut self) {
        match self.rest(2 * ENABLE) {
            Some(rest) => assert_eq!(rest.cause, RestCause::Attached),
            None => panic!("not enabled: {:?}", self.fault()),
        }
    }

    /// Queues 0.2 s of acceleration, 1 s at 100 mm/s and 0.2 s to rest.
    pub fn queue_move(&mut self, stop_on: StopOn) {
        self.queue(0, 0.2, 1.0, stop_on);
    }

    pub fn queue_spindle(&mut self) {
        self.queue_speed(SPINDLE_RAD_PER_S);
    }

    pub fn queue_speed(&mut self, rad_per_s: f64) {
        self.queue_event(EventKind::Spindle, 0, rad_per_s);
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
        // The spindle turns by then, and what waits for it has begun.
        let (some, no_edge) = (
            u64::from(SPIN_UP) + 10 + random.below(1200),
            StopOn::default(),
        );
        match doing {
            Doing::Dwelling => {
                self.piece([AxisVector::ZERO; 2], 2.0, true, no_edge);
                self.ticks(some);
                return;
            }
            Doing::HandedOver => {
                self.script().homing_takes = u64::MAX;
                self.queue_event(EventKind::HomeByDrive, 0, 100.0);
                self.ticks(some);
                assert_eq!(self.told().homing, 1);
                return;
            }
            Doing::Probing => self.queue_move(StopOn {
                input: PROBE,
                edge: Edge::Rising,
                miss_is_fault: 0,
            }),
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
                self.script().fault = Some(0);
                self.ticks(1 + random.below(20));
            }
            _ => {}
        }
    }

    pub fn trip(&mut self, old: bool) {
        let input = self.input;
        let mut script = self.script();
        if old {
            script.input_age[input as usize] = MAX_AGE + 1;
        } else {
            script.inputs ^= 1 << input;
        }
    }

    pub fn release(&mut self) {
        let inputs = if self.closed { 1 << self.input } else { 0 };
        let mut script = self.script();
        (script.input_age, script.inputs) = ([0; 64], inputs);
    }

    /// Ticks until nothing moves.
    pub fn come_to_rest(&mut self) {
        self.ticks(400);
        assert_eq!(self.told().velocity, AxisVector::ZERO);
    }

    /// No setpoint went beyond a limit, and each says the speed that its place says.
    pub fn assert_limits(&self) {
        for pair in self.script().told.windows(2) {
            let ([before, told], joint) = ([&pair[0].0, &pair[1].0], 0);
            if told.velocity[joint] != 0.0 && told.tick == before.tick + 1 {
                let way = told.position[joint] - before.position[joint];
                let rounding = 1e-9;
                assert!(
                    (way / PERIOD_S - told.velocity[joint]).abs() < rounding,
                    "{told:?}"
                );
            }
        }
        for (told, _) in &self.script().told {
            let most = ACCELERATION_MM_PER_S2 * (1.0 + 1e-6) + 1e-6;
            assert!(
                told.velocity[0].abs() <= FEED_MM_PER_S * (1.0 + 1e-6),
                "{told:?}"
            );
            assert!(told.acceleration[0].abs() <= most, "{told:?}");
        }
    }

    /// The machine ends in that fault, its drives off.
    pub fn assert_ends_by(&mut self, kind: FaultKind) {
        self.ticks(2);
        assert_eq!(self.fault(), Some(kind));
        self.ticks(400);
        assert_eq!(
            (self.fault(), self.state(), self.told().enable),
            (Some(kind), MachineState::Fault, 0)
        );
        assert!(self.fine.is_over());
    }
}
