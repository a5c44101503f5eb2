//! What the machine may be doing, and who may ask for what meanwhile: one table.

use std::fmt::Write as _;

use super::words::{WORDS, word_of};

/// What the machine is doing, as operators are told it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ControllerState {
    /// An emergency stop has stopped it; the drives have let go.
    EmergencyStop = 0,
    /// The drives do not hold.
    Disabled = 1,
    /// The drives hold; it is not known where an axis stands, or the machine is to be homed first.
    HomingNeeded = 2,
    /// It stands and takes any work.
    Ready = 3,
    /// It is jogged.
    Manual = 4,
    /// It drives lines by hand.
    Mdi = 5,
    /// It drives a program, or homes.
    Running = 6,
    /// A job is held, or waits for the operator.
    Held = 7,
    /// A job is being brought to its end, or the drives are on their way to holding.
    Stopping = 8,
    /// A fault has stopped it; the drives have let go.
    Fault = 9,
}

impl ControllerState {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 10] = [
        Self::EmergencyStop,
        Self::Disabled,
        Self::HomingNeeded,
        Self::Ready,
        Self::Manual,
        Self::Mdi,
        Self::Running,
        Self::Held,
        Self::Stopping,
        Self::Fault,
    ];

    /// As people and programs read it.
    pub fn name(self) -> &'static str {
        match self {
            Self::EmergencyStop => "emergency-stop",
            Self::Disabled => "disabled",
            Self::HomingNeeded => "homing-needed",
            Self::Ready => "ready",
            Self::Manual => "manual",
            Self::Mdi => "mdi",
            Self::Running => "running",
            Self::Held => "held",
            Self::Stopping => "stopping",
            Self::Fault => "fault",
        }
    }
}

/// Why a request is refused.
const REASONS: [(char, &str); 9] = [
    ('b', "a job is driven: wait for its end, or abort it"),
    ('d', "the drives are disabled: \"enable\" enables them"),
    ('e', "the drives are enabled already"),
    (
        'f',
        "the machine stands in a fault: \"reset\" takes it back",
    ),
    ('k', "there is no fault to reset"),
    (
        'n',
        "it is not known where the machine stands, or it is to be homed first: \"home\" homes it",
    ),
    ('o', "the drives are disabled already"),
    (
        's',
        "the machine is being brought to rest, or its drives are being enabled",
    ),
    ('x', "nothing is driven"),
];

/// Whether `request` is done in `state`.
///
/// # Errors
/// Why not, in words; a request that is none is refused in every state.
pub fn judge(state: ControllerState, request: &str) -> Result<(), &'static str> {
    let Some(word) = word_of(request) else {
        return Err("there is no such request");
    };
    match word.states.chars().nth(state as usize) {
        Some('+') => Ok(()),
        code => Err(REASONS
            .iter()
            .find(|(c, _)| Some(*c) == code)
            .map_or("it is refused", |(_, why)| *why)),
    }
}

/// Names of all requests that the table judges.
pub fn requests() -> impl Iterator<Item = &'static str> {
    WORDS.iter().map(|word| word.name)
}

/// The table as the documentation prints it. Allocates.
pub fn table() -> String {
    let mut text = "| request |".to_string();
    for state in ControllerState::ALL {
        let _ = write!(text, " {} |", state.name());
    }
    text.push_str("\n|---|");
    text.push_str(&"---|".repeat(ControllerState::ALL.len()));
    for word in WORDS {
        let (name, row) = (word.name, word.states);
        let _ = write!(text, "\n| `{name}` |");
        for code in row.chars() {
            let _ = write!(
                text,
                " {} |",
                if code == '+' {
                    "done".to_string()
                } else {
                    code.to_string()
                }
            );
        }
    }
    text.push_str("\n\n");
    for (code, why) in REASONS {
        let _ = writeln!(text, "- {code}: {why}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_request_has_an_answer_in_every_state() {
        for word in WORDS {
            let (name, row) = (word.name, word.states);
            assert_eq!(row.chars().count(), ControllerState::ALL.len(), "{name}");
            for state in ControllerState::ALL {
                let answer = judge(state, name);
                assert_ne!(answer, Err("it is refused"), "{name} in {}", state.name());
                assert_ne!(answer, Err("there is no such request"), "{name}");
            }
        }
        assert!(
            ControllerState::ALL
                .iter()
                .enumerate()
                .all(|(at, state)| *state as usize == at)
        );
    }

    /// Whatever state the machine is in, it can be stopped while something moves, and work begins from `ready` alone.
    #[test]
    fn stops_are_never_refused_and_programs_begin_where_the_machine_is_ready() {
        for state in ControllerState::ALL {
            assert!(judge(state, "emergency-stop").is_ok());
            assert_eq!(
                judge(state, "start").is_ok(),
                state == ControllerState::Ready,
                "{}",
                state.name()
            );
        }
        for state in &ControllerState::ALL[4..9] {
            assert!(
                judge(*state, "hold").is_ok() && judge(*state, "abort").is_ok(),
                "{}",
                state.name()
            );
        }
        assert!(
            judge(ControllerState::Fault, "mdi").is_err()
                && judge(ControllerState::Fault, "reset").is_ok()
        );
    }
}
