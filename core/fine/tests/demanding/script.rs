//! The drives of the bench: what a test makes them do, and what they were told.

use std::sync::{Arc, Mutex};

use rtrb::Consumer;
use tandem_rings::Rest;
use tandem_sdk::{
    Attached, AxisVector, Driver, DriverContext, DriverDescription, Edge, Feedback, JointState,
    Latch, MAX_AXES, PluginError, Setpoint,
};

use super::PERIOD_S;

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
    /// How far each joint is reported to be below where it was told to be, mm.
    pub droop_mm: f64,
    /// Joint that faults from now on, until it is reset.
    pub fault: Option<usize>,
    /// Joint that is lost from now on, until it is reset.
    pub lost: Option<usize>,
    /// Exchanges behind a reset for which a fault stands still.
    pub reset_takes: u64,
    /// What the bus says of each exchange, ns.
    pub phase_ns: Option<i64>,
    /// Periods by which all of the feedback is old from now on.
    pub age: u32,
    /// Periods by which the positions that are reported are behind.
    pub behind: usize,
    /// Periods by which they are older still from now on, and are said to be: what else is reported is new.
    pub late: u32,
    pub inputs: u64,
    pub input_age: [u16; 64],
    /// Exchanges that the spindle needs to turn.
    pub spin_up: u32,
    /// The line to the drives is cut: exchanges fail, and what was known stays.
    pub cut: bool,
    /// Exchanges for which a drive that is to home its joint has not begun.
    pub homing_lag: u64,
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
    /// Exchanges until a reset is done.
    pub reset_in: Option<u64>,
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
    /// The soft side takes the reports of rests while the exchanges go on.
    pub rests: Option<Consumer<Rest>>,
}

impl Script {
    /// Drives of `joints` joints that do at once what they are told.
    pub fn new(joints: usize) -> Self {
        Self {
            joints,
            enable_after: [0; MAX_AXES],
            brake_for: [0; MAX_AXES],
            sag_mm: [0.0; MAX_AXES],
            droop_mm: 0.0,
            fault: None,
            lost: None,
            reset_takes: 0,
            reset_in: None,
            phase_ns: None,
            age: 0,
            behind: 0,
            late: 0,
            inputs: 0,
            input_age: [0; 64],
            spin_up: 0,
            cut: false,
            homing_lag: 0,
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
            rests: None,
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
            self.reset_in = Some(self.reset_takes);
            self.resets += 1;
        }
        match self.reset_in {
            Some(0) => (self.fault, self.lost, self.reset_in) = (None, None, None),
            Some(left) => self.reset_in = Some(left - 1),
            None => {}
        }
        if setpoint.enable == 0 {
            (self.enabled_for, self.disabled_for) = (0, self.disabled_for.saturating_add(1));
        } else {
            (self.enabled_for, self.disabled_for) = (self.enabled_for + 1, 0);
        }
        let before = self
            .told
            .iter()
            .nth_back(1)
            .map_or(0.0, |(told, _)| told.spindle_rad_per_s);
        let speed = setpoint.spindle_rad_per_s;
        self.spun_for = match speed {
            0.0 => 0,
            _ if speed == before => self.spun_for + 1,
            _ => 1,
        };
        self.homing_for = if setpoint.homing == 0 {
            0
        } else {
            self.homing_for + 1
        };
        if self.homing_for == self.homing_lag + 1 {
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
        let begun = homes && self.homing_for > self.homing_lag;
        let own = begun && self.homed >> joint & 1 == 0 && state == JointState::Enabled;
        feedback.fault_code[joint] = if state == JointState::Fault {
            FAULT_CODE
        } else {
            0
        };
        if own && self.homing_for - self.homing_lag > self.homing_takes && !self.never_homes {
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
        if own
            && self
                .homing_fails_after
                .is_some_and(|after| self.homing_for > after)
        {
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
        Latch {
            input,
            edge,
            joints: 1,
            before_s: PERIOD_S / 2.0,
            position: self.position,
        }
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
    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        let mut script = self.0.lock().unwrap();
        script.told.push((*setpoint, *feedback));
        if let Some(rests) = &mut script.rests {
            while rests.pop().is_ok() {}
        }
        if script.cut {
            return Err(PluginError::fixed("the line is cut"));
        }
        if script.age > 0 {
            feedback.age_periods = [script.age; MAX_AXES];
            return Ok(());
        }
        script.take(setpoint);
        for joint in 0..script.joints {
            script.drive(joint, setpoint, feedback);
        }
        let begun = if script.homing_for > script.homing_lag {
            setpoint.homing
        } else {
            0
        };
        script.was_homed &= !begun;
        feedback.homed = script.homed | script.was_homed;
        let position = script.position;
        script.been.push(position);
        let behind = script.behind + script.late as usize;
        let known = script.been[script.been.len().saturating_sub(1 + behind)];
        feedback.position = known - AxisVector([script.droop_mm; MAX_AXES]);
        (feedback.inputs, feedback.input_age_periods) = (script.inputs, script.input_age);
        feedback.latches[0] = script.latch(setpoint);
        let turns = setpoint.spindle_rad_per_s == 0.0 || script.spun_for > script.spin_up;
        feedback.spindle_at_speed = u32::from(turns);
        (feedback.has_phase, feedback.phase_ns) = (
            u32::from(script.phase_ns.is_some()),
            script.phase_ns.unwrap_or(5),
        );
        feedback.age_periods = [script.late; MAX_AXES];
        Ok(())
    }
    fn quick_stop(&mut self) {}
    fn stop(&mut self) -> Result<(), PluginError> {
        Ok(())
    }
}
