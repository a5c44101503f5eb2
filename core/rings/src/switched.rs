//! What is switched beside the axes.

/// Number of the output that stands for mist coolant; user outputs are 0 to 61.
pub const MIST: u32 = 62;
/// Number of the output that stands for flood coolant.
pub const FLOOD: u32 = 63;

/// What switched last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SwitchedBy {
    /// A word of the program.
    #[default]
    Program,
    /// A door: the spindle stops where it opens, and turns again behind the operator's resume.
    Door,
    /// The operator's abort.
    Abort,
    /// A fault, when the axes are at rest.
    Fault,
    /// The emergency stop.
    EmergencyStop,
}

impl SwitchedBy {
    /// As people and programs read it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Program => "program",
            Self::Door => "door",
            Self::Abort => "abort",
            Self::Fault => "fault",
            Self::EmergencyStop => "emergency stop",
        }
    }
}

/// Spindle, coolant and outputs as the drives were sent them in a period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Switched {
    /// Digital outputs, bit n is output n; [`MIST`] and [`FLOOD`] are the coolant.
    pub outputs: u64,
    /// Speed asked of the spindle, rad/s; its sign is the direction.
    pub spindle_rad_per_s: f64,
    /// What switched last; a trace does not keep it.
    pub by: SwitchedBy,
}

impl Switched {
    /// The outputs of the user alone, without coolant.
    pub fn user_outputs(&self) -> u64 {
        self.outputs & !(1 << MIST | 1 << FLOOD)
    }

    /// Whether this output is on.
    pub fn is_on(&self, output: u32) -> bool {
        self.outputs >> output & 1 == 1
    }

    /// The coolant as people and programs read it.
    pub fn coolant(&self) -> &'static str {
        match (self.is_on(MIST), self.is_on(FLOOD)) {
            (false, false) => "off",
            (true, false) => "mist",
            (false, true) => "flood",
            (true, true) => "both",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn coolant_and_outputs_of_the_user_share_the_bits() {
        let on = |outputs: &[u32]| Switched {
            outputs: outputs.iter().fold(0, |bits, output| bits | 1 << output),
            ..Switched::default()
        };
        let names =
            [&[][..], &[MIST], &[FLOOD], &[MIST, FLOOD]].map(|outputs| on(outputs).coolant());
        assert_eq!(names, ["off", "mist", "flood", "both"]);
        let all = on(&[0, 5, MIST, FLOOD]);
        assert!(all.is_on(5) && all.is_on(MIST) && !all.is_on(1));
        assert_eq!(all.user_outputs(), 0b10_0001);
    }

    /// By its name alone people and programs know which it is.
    #[test]
    fn whatever_switches_has_a_name_of_its_own() {
        let all = [
            SwitchedBy::Program,
            SwitchedBy::Door,
            SwitchedBy::Abort,
            SwitchedBy::Fault,
            SwitchedBy::EmergencyStop,
        ];
        let names: HashSet<_> = all.iter().map(|by| by.name()).collect();
        assert_eq!(names.len(), all.len());
    }
}
