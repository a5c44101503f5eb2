//! A drive by CiA 402: its states, its modes, the axis that it moves.

mod axis;
mod description;
mod homing;
mod motion;
mod objects;
mod probe;
mod state;
mod trouble;

pub use description::{Cut, DriveDescription};
pub(crate) use objects::{default_pdos, judge_write};
pub use state::DriveState;
pub(crate) use trouble::{Condition, Trouble};

use crate::firmware::dictionary::Dictionary;
use axis::{Axis, Power};
use homing::Homing;
use objects::Slots;
use probe::Probe;
use state::Command;

/// Time of one step of a drive's own loop, in ns.
pub(crate) const STEP_NS: u64 = 125_000;
/// The same in s.
const STEP_S: f64 = STEP_NS as f64 / 1e9;
/// Below this velocity an axis stands, in counts/s: less than a count in a step.
const REST_COUNTS_PER_S: f64 = 1000.0;
/// Codes of faults: following error, lost bus, homing.
const FOLLOWING_ERROR: u16 = 0x8611;
const BUS_LOST: u16 = 0x7500;

/// A drive.
#[derive(Clone, Debug)]
pub(crate) struct Drive {
    of: DriveDescription,
    slots: Slots,
    state: DriveState,
    last_control: u16,
    mode: i64,
    axis: Axis,
    course: Course,
    homing_status: u16,
    /// The start bit of a homing has been 0 since the last one.
    homing_ready: bool,
    /// Velocity that needs no error of position, from the master or from the drive's own ramps.
    feed_forward: f64,
    probes: [Probe; 2],
    probe_levels: [bool; 2],
    /// Time until the brake is open or holds, in s.
    brake_s: f64,
    /// Time for which the following error has been too large, in s.
    late_s: f64,
    stop: Option<Stop>,
    emergency: Option<u16>,
    pub(crate) trouble: Trouble,
}

/// A stop on a ramp, and the state behind it.
#[derive(Clone, Copy, Debug)]
struct Stop {
    deceleration: f64,
    then: DriveState,
}

/// What the demand follows while the drive is enabled.
#[derive(Clone, Copy, Debug)]
enum Course {
    /// Rest.
    Hold,
    /// The master's positions: this velocity for so long.
    Cyclic { velocity: f64, left_s: f64 },
    /// The master's velocities.
    Velocity,
    /// A homing.
    Homing(Homing),
}

impl Drive {
    /// Adds the objects of a drive to a dictionary.
    pub(crate) fn describe(of: &DriveDescription, dictionary: &mut Dictionary) {
        Slots::describe(of, dictionary);
        objects::describe_records(of, dictionary);
    }

    /// A drive whose objects lie in `dictionary`; none where they do not.
    pub(crate) fn new(of: &DriveDescription, dictionary: &Dictionary) -> Option<Self> {
        let probe_levels = of
            .probes_counts
            .map(|edge| edge.is_some_and(|edge| of.position_counts > edge));
        Some(Self {
            of: of.clone(),
            slots: Slots::find(dictionary)?,
            state: DriveState::NotReady,
            last_control: 0,
            mode: 0,
            axis: Axis::new(of),
            course: Course::Hold,
            homing_status: 0,
            homing_ready: true,
            feed_forward: 0.0,
            probes: [Probe::default(); 2],
            probe_levels,
            brake_s: 0.0,
            late_s: 0.0,
            stop: None,
            emergency: None,
            trouble: Trouble::default(),
        })
    }

    /// Its state.
    pub(crate) fn state(&self) -> DriveState {
        self.state
    }

    /// Where the axis stands, in counts, and how fast it is, in counts/s.
    pub(crate) fn position_and_velocity(&self) -> (f64, f64) {
        (self.axis.position, self.axis.velocity)
    }

    /// Position by which its switches go, in counts: homing does not change it.
    pub(crate) fn place(&self) -> f64 {
        self.axis.place()
    }

    /// Limits of its cycle and of its patience with missing setpoints.
    pub(crate) fn min_cycle_ns(&self) -> u32 {
        self.of.min_cycle_us.saturating_mul(1000)
    }

    /// Errors of synchronization that it stands.
    pub(crate) fn sync_error_limit(dictionary: &Dictionary) -> u64 {
        dictionary.number(objects::SYNC_ERROR, 2)
    }

    /// Sets a probe's input from outside.
    pub(crate) fn set_probe(&mut self, probe: usize, level: bool) {
        if let Some(input) = self.probe_levels.get_mut(probe) {
            *input = level;
            let position = self.axis.position;
            self.probes[probe].follow(level, position);
        }
    }

    /// Sets the torque of the process, as a share of the rated one.
    pub(crate) fn set_load(&mut self, load: f64) {
        self.axis.load = load;
    }

    /// A fault that came up since this was last asked, for the emergency message.
    pub(crate) fn take_emergency(&mut self) -> Option<u16> {
        self.emergency.take().filter(|_| self.of.emergency)
    }

    /// Takes the setpoints that the master sent, to be reached within `cycle_s`.
    pub(crate) fn take_setpoints(&mut self, cycle_s: Option<f64>, dictionary: &Dictionary) {
        if self.state != DriveState::OperationEnabled || self.stop.is_some() || self.mode != 8 {
            return;
        }
        let period = cycle_s
            .unwrap_or_else(|| interpolation_s(dictionary))
            .max(STEP_S);
        // The target has 32 bits and wraps; the axis does not.
        let target = dictionary.signed(self.slots.target) as i32;
        let ahead = target.wrapping_sub(self.axis.demand.round() as i64 as i32);
        let to = self.axis.demand.round() + f64::from(ahead);
        self.course = Course::Cyclic {
            velocity: (to - self.axis.demand) / period,
            left_s: period,
        };
        self.feed_forward = dictionary.signed(self.slots.velocity_offset) as f64;
    }

    /// The bus is no longer in a state in which the master leads the drive.
    pub(crate) fn lose_bus(&mut self, dictionary: &mut Dictionary) {
        if matches!(
            self.state,
            DriveState::OperationEnabled | DriveState::QuickStopActive
        ) {
            match dictionary.signed(self.slots.abort_option) {
                0 => {}
                2 => self.switch_off(),
                3 => self.quick_stop(dictionary),
                _ => self.fail(BUS_LOST, dictionary),
            }
        } else if matches!(
            self.state,
            DriveState::ReadyToSwitchOn | DriveState::SwitchedOn
        ) {
            self.state = DriveState::SwitchOnDisabled;
        }
        dictionary.set(self.slots.control, 0);
        self.last_control = 0;
    }

    /// Goes into a fault.
    pub(crate) fn fail(&mut self, code: u16, dictionary: &mut Dictionary) {
        if matches!(
            self.state,
            DriveState::FaultReactionActive | DriveState::Fault
        ) {
            return;
        }
        dictionary.set(self.slots.error_code, i64::from(code));
        self.emergency = Some(code);
        let with_torque = matches!(
            self.state,
            DriveState::OperationEnabled | DriveState::QuickStopActive
        );
        let deceleration = match dictionary.signed(self.slots.fault_option) {
            0 => None,
            1 => Some(self.slots.deceleration),
            _ => Some(self.slots.quick_stop_deceleration),
        };
        if let Some(slot) = deceleration.filter(|_| with_torque) {
            self.state = DriveState::FaultReactionActive;
            self.begin_stop(dictionary.unsigned(slot) as f64, DriveState::Fault);
        } else {
            self.state = DriveState::Fault;
            self.stop = None;
        }
    }

    fn quick_stop(&mut self, dictionary: &Dictionary) {
        let option = dictionary.signed(self.slots.quick_stop_option);
        let slot = if matches!(option, 1 | 5) {
            self.slots.deceleration
        } else {
            self.slots.quick_stop_deceleration
        };
        let then = if option >= 5 {
            DriveState::QuickStopActive
        } else {
            DriveState::SwitchOnDisabled
        };
        if option == 0 {
            self.switch_off();
            return;
        }
        self.state = DriveState::QuickStopActive;
        self.begin_stop(dictionary.unsigned(slot) as f64, then);
    }

    fn begin_stop(&mut self, deceleration: f64, then: DriveState) {
        // The ramp begins at the speed that the axis has, so that a demand in steps does not matter.
        self.axis.demand_velocity = self.axis.velocity;
        self.course = Course::Hold;
        self.stop = Some(Stop {
            deceleration: deceleration.max(1.0),
            then,
        });
    }

    /// Takes the torque away at once.
    fn switch_off(&mut self) {
        self.state = DriveState::SwitchOnDisabled;
        self.stop = None;
        self.course = Course::Hold;
    }

    /// One step of the drive's own loop. `led` says whether the bus is in a state in which the master leads.
    pub(crate) fn step(&mut self, led: bool, dictionary: &mut Dictionary) {
        let control = dictionary.unsigned(self.slots.control) as u16;
        self.take_mode(dictionary);
        self.take_troubles(dictionary);
        if led {
            self.follow_control(control, dictionary);
        } else if self.state == DriveState::NotReady {
            self.state = DriveState::SwitchOnDisabled;
        }
        self.last_control = control;
        let power = self.power();
        if power == Power::Motor {
            self.lead(dictionary);
        }
        let before = self.axis.position;
        let limit = dictionary.unsigned(self.slots.max_torque) as f64 / 1000.0;
        self.axis
            .step(&self.of, STEP_S, power, self.feed_forward, limit);
        self.catch(before, dictionary);
        self.watch_following(dictionary);
    }

    fn take_mode(&mut self, dictionary: &Dictionary) {
        let asked = self
            .trouble
            .mode_shown
            .map_or_else(|| dictionary.signed(self.slots.mode), i64::from);
        let asked = if asked == 0 { self.mode } else { asked };
        let known = self.of.modes.iter().any(|mode| i64::from(*mode) == asked)
            || self.trouble.mode_shown.is_some();
        if asked != self.mode && known {
            self.mode = asked;
            self.homing_status = 0;
            self.feed_forward = 0.0;
            self.course = if matches!(asked, 3 | 9) {
                Course::Velocity
            } else {
                Course::Hold
            };
        }
    }

    fn take_troubles(&mut self, dictionary: &mut Dictionary) {
        self.axis.blocked = self.trouble.has(Condition::Blocked);
        if let Some(code) = self.trouble.fault.take() {
            self.fail(code, dictionary);
        }
        let safe = self.trouble.has(Condition::TorqueOff)
            && !matches!(self.state, DriveState::Fault | DriveState::NotReady);
        if safe || std::mem::take(&mut self.trouble.disable) {
            self.switch_off();
        }
    }

    fn follow_control(&mut self, control: u16, dictionary: &mut Dictionary) {
        use Command::{DisableVoltage, EnableOperation, QuickStop, Shutdown, SwitchOn};
        use DriveState as State;
        let command = Command::of(control);
        let reset = control & !self.last_control & 0x80 != 0;
        let able = !self.trouble.has(Condition::TorqueOff);
        self.state = match (self.state, command) {
            (State::NotReady, _)
            | (State::ReadyToSwitchOn | State::SwitchedOn, DisableVoltage | QuickStop) => {
                State::SwitchOnDisabled
            }
            (State::Fault, _) if reset && !self.trouble.has(Condition::FaultStays) => {
                dictionary.set(self.slots.error_code, 0);
                State::SwitchOnDisabled
            }
            (State::SwitchOnDisabled, Shutdown) if able => State::ReadyToSwitchOn,
            (State::ReadyToSwitchOn, SwitchOn | EnableOperation) => State::SwitchedOn,
            (State::SwitchedOn, Shutdown) => State::ReadyToSwitchOn,
            (State::SwitchedOn, EnableOperation) if !self.trouble.has(Condition::NeverEnables) => {
                self.enable()
            }
            (State::OperationEnabled | State::QuickStopActive, DisableVoltage) => {
                self.switch_off();
                return;
            }
            (State::OperationEnabled, QuickStop) => {
                self.quick_stop(dictionary);
                return;
            }
            (State::OperationEnabled, Shutdown) => self.disable(
                self.slots.shutdown_option,
                State::ReadyToSwitchOn,
                dictionary,
            ),
            (State::OperationEnabled, SwitchOn) => {
                self.disable(self.slots.disable_option, State::SwitchedOn, dictionary)
            }
            (State::QuickStopActive, EnableOperation) if self.stop.is_none() => self.resume(),
            (state, _) => state,
        };
        if self.state == State::SwitchedOn && command != EnableOperation {
            self.brake_s = self.of.brake_open_ms / 1000.0;
        }
    }

    /// Waits for the brake; the axis is held where it stands.
    fn enable(&mut self) -> DriveState {
        if self.last_control & 0x0f != 0x0f {
            self.brake_s = self.trouble.brake_ms.unwrap_or(self.of.brake_open_ms) / 1000.0;
            self.axis.settle();
        }
        self.brake_s -= STEP_S;
        if self.brake_s > 0.0 {
            return DriveState::SwitchedOn;
        }
        self.axis.settle();
        self.resume()
    }

    fn resume(&mut self) -> DriveState {
        self.course = if matches!(self.mode, 3 | 9) {
            Course::Velocity
        } else {
            Course::Hold
        };
        self.feed_forward = 0.0;
        self.late_s = 0.0;
        DriveState::OperationEnabled
    }

    /// Leaves *Operation enabled* at once, or over a ramp where the option says so.
    fn disable(&mut self, option: usize, then: DriveState, dictionary: &Dictionary) -> DriveState {
        if self.stop.is_some() {
            return self.state;
        }
        if dictionary.signed(option) == 0 {
            self.course = Course::Hold;
            return then;
        }
        self.begin_stop(dictionary.unsigned(self.slots.deceleration) as f64, then);
        self.state
    }

    fn power(&mut self) -> Power {
        use DriveState as State;
        match self.state {
            _ if self.trouble.has(Condition::TorqueOff) => Power::Brake,
            State::OperationEnabled | State::QuickStopActive | State::FaultReactionActive => {
                self.brake_s = self.of.brake_close_ms / 1000.0;
                Power::Motor
            }
            // While the brake opens the motor holds already, and while it closes still.
            State::SwitchedOn if Command::of(self.last_control) == Command::EnableOperation => {
                Power::Motor
            }
            State::ReadyToSwitchOn | State::SwitchedOn if self.brake_s > 0.0 => {
                self.brake_s -= STEP_S;
                Power::Motor
            }
            _ if self.axis.velocity.abs() > REST_COUNTS_PER_S && self.of.brake_close_ms == 0.0 => {
                Power::None
            }
            _ => Power::Brake,
        }
    }
}

/// The period that the master states for its setpoints, in s.
fn interpolation_s(dictionary: &Dictionary) -> f64 {
    let value = dictionary.number(objects::INTERPOLATION, 1) as f64;
    let exponent = (dictionary.number(objects::INTERPOLATION, 2) as u8).cast_signed();
    value * 10_f64.powi(i32::from(exponent).clamp(-6, 0))
}
