//! One fine period, as the fine loop reports it.

use tandem_sdk::{AxisVector, MAX_ANALOG, MAX_AXES};

use crate::OperatorInputs;
use crate::switched::Switched;

/// What the machine is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum MachineState {
    /// At rest, nothing to do, or waiting for the queue to fill.
    #[default]
    Standstill = 0,
    /// Following the program.
    Running = 1,
    /// Feed hold: stopping or stopped on the path.
    Holding = 2,
    /// The queue ran low: stopping or stopped on the path until it has filled.
    Starved = 3,
    /// Ramping out after a fault, off the path.
    Stopping = 4,
    /// Stopped by a fault; sticky until reset. A machine starts like this.
    Fault = 5,
    /// Reset, but the drives do not hold.
    Disabled = 6,
}

impl MachineState {
    /// The state of a number, as [`crate::Status::state`] holds it.
    pub fn from_number(number: u32) -> Self {
        [
            Self::Standstill,
            Self::Running,
            Self::Holding,
            Self::Starved,
            Self::Stopping,
            Self::Fault,
            Self::Disabled,
        ]
        .into_iter()
        .find(|s| *s as u32 == number)
        .unwrap_or_default()
    }

    /// The state's name as traces and people read it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Standstill => "standstill",
            Self::Running => "running",
            Self::Holding => "holding",
            Self::Starved => "starved",
            Self::Stopping => "stopping",
            Self::Fault => "fault",
            Self::Disabled => "disabled",
        }
    }
}

/// Why the machine is being stopped, or kept at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StopCause {
    /// It is not.
    #[default]
    None,
    /// Feed hold.
    Hold,
    /// A door is open, or was, and nobody has resumed.
    Door,
    /// An input asks for a feed hold, or has, and nobody has resumed.
    HoldInput,
    /// A cut waits for the spindle to come to its speed.
    Spindle,
    /// The program waits for the operator.
    ProgramStop,
    /// The queue ran low.
    Starvation,
    /// An input edge ends the motion, or it had the level waited for before.
    Edge,
    /// The operator's abort.
    Abort,
    /// A fault on the soft side: the machine stops on the path.
    SoftFault,
    /// Any other fault: the axes ramp out.
    Fault,
}

impl StopCause {
    /// The cause as people and programs read it.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Hold => "hold",
            Self::Door => "door",
            Self::HoldInput => "hold input",
            Self::Spindle => "spindle",
            Self::ProgramStop => "program stop",
            Self::Starvation => "starvation",
            Self::Edge => "input edge",
            Self::Abort => "abort",
            Self::SoftFault => "soft fault",
            Self::Fault => "fault",
        }
    }
}

/// One fine period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Number of the period.
    pub tick: u64,
    /// Block that moved.
    pub block: u64,
    /// Program line that moved.
    pub line: u32,
    /// What the machine was doing.
    pub state: MachineState,
    /// Position sent, axis space, mm or rad.
    pub command: AxisVector,
    /// Position read back, axis space, mm or rad.
    pub feedback: AxisVector,
    /// Speed read back, axis space.
    pub speed: AxisVector,
    /// Mean motor current per joint, A.
    pub current_a: AxisVector,
    /// Path speed of the setpoints, mm/s.
    pub feed_mm_per_s: f64,
    /// The same at the end of the period, where [`Sample::feed_mm_per_s`] is its mean.
    pub end_feed_mm_per_s: f64,
    /// Programmed feed, mm/s; infinite for rapids.
    pub programmed_feed_mm_per_s: f64,
    /// Rate of program time at the end of the period.
    pub sigma: f64,
    /// Feed ratio in force, of override, strategy and policy.
    pub ratio: f64,
    /// The operator's feed override; 1 where the program forbids it.
    pub feed_override: f64,
    /// Spindle speed read back, rad/s.
    pub spindle_rad_per_s: f64,
    /// Spindle, coolant and outputs as they were sent.
    pub switched: Switched,
    /// How much later than the bus wants it the exchange was, ns; `None` where no driver tells.
    pub phase_ns: Option<i64>,
    /// Analog inputs of the driver.
    pub analog: [f64; MAX_ANALOG],
    /// Digital inputs.
    pub inputs: u64,
    /// Bit per digital input of which nothing was heard in this period.
    pub old_inputs: u64,
    /// Age of the feedback of each joint, fine periods.
    pub age_periods: [u32; MAX_AXES],
    /// Why the machine is being stopped, as this position was chosen.
    pub cause: StopCause,
    /// What the operator asked for in this period.
    pub given: OperatorInputs,
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn a_state_is_found_by_its_number_and_a_number_that_is_none_is_standstill() {
        for number in 0..7 {
            assert_eq!(MachineState::from_number(number) as u32, number);
        }
        assert_eq!(MachineState::from_number(7), MachineState::Standstill);
    }

    /// By its name alone people and programs know which it is.
    #[test]
    fn every_state_and_every_cause_of_a_stop_has_a_name_of_its_own() {
        let states: HashSet<_> = (0..7)
            .map(|n| MachineState::from_number(n).name())
            .collect();
        assert_eq!(states.len(), 7);
        let causes = [
            StopCause::None,
            StopCause::Hold,
            StopCause::Door,
            StopCause::HoldInput,
            StopCause::Spindle,
            StopCause::ProgramStop,
            StopCause::Starvation,
            StopCause::Edge,
            StopCause::Abort,
            StopCause::SoftFault,
            StopCause::Fault,
        ];
        let names: HashSet<_> = causes.iter().map(|cause| cause.name()).collect();
        assert_eq!(names.len(), causes.len());
    }
}
