//! Why a run does not start, or cannot go on.

use tandem_gcode::{CheckReport, ProgramError};
use tandem_machine::{Machine, MachineError, ValuePlace};

/// A refusal: nothing has moved.
#[derive(Debug, thiserror::Error)]
pub enum HostError {
    /// The machine file.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// The program cannot be read.
    #[error(transparent)]
    Program(#[from] ProgramError),
    /// The program has errors.
    #[error("{} errors in the program", .0.diagnostics.len() as u64 + .0.unlisted)]
    Check(Box<CheckReport>),
    /// A plugin is not there, or refuses its options; or the machine asks for what does not go together.
    #[error("{place}: {cause}")]
    Setup {
        /// Where the machine file says so: `file:line:column: key`.
        place: String,
        /// What is wrong.
        cause: String,
    },
    /// The computer: a thread or a file.
    #[error("{0}")]
    System(String),
}

/// A refusal with the place in the machine file.
pub fn refusal(machine: &Machine, key: &str, cause: impl Into<String>) -> HostError {
    let place = match machine.place(key) {
        ValuePlace::Override(path) if path == key => ValuePlace::Override(path).to_string(),
        place => format!("{place}: {key}"),
    };
    HostError::Setup {
        place,
        cause: cause.into(),
    }
}
