//! Why a script is refused, and what goes wrong in one that runs.

/// Why bytes are no policy script for this machine.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// This build has no engine for scripts.
    #[error("this tandem was built without policy scripts: build it with the feature scripts")]
    NoScripts,
    /// The file is too large to be compiled.
    #[error("{bytes} bytes: a policy script has at most {most}")]
    TooLarge {
        /// Its size.
        bytes: usize,
        /// What is allowed.
        most: usize,
    },
    /// The bytes are no module that the engine accepts.
    #[error("not a WASM module: {0}")]
    NotAModule(String),
    /// It asks for something of the host.
    #[error("it imports {}: a policy script needs no imports", .0.join(", "))]
    Imports(Vec<String>),
    /// It is written for another version of the ABI.
    #[error("it speaks version {0} of the policy ABI, this host speaks versions 1 to {v}", v = crate::abi::VERSION)]
    OtherVersion(String),
    /// Exports are missing or of another type.
    #[error("{}", .0.join("; "))]
    Exports(Vec<String>),
    /// Its tables in linear memory cannot be read.
    #[error("its layout is wrong: {0}")]
    Layout(String),
    /// Starting it failed.
    #[error("it does not start: {0}")]
    Start(Trouble),
    /// Parameters of the machine file do not fit, a sentence each.
    #[error("{}", .0.join("; "))]
    Parameters(Vec<String>),
    /// It wants to see what this machine or this run does not have, a sentence each.
    #[error("{}", .0.join("; "))]
    Inputs(Vec<String>),
    /// State of the script before could not be handed over.
    #[error("it does not take over the state of the script before: {0}")]
    Restore(Trouble),
}

/// What goes wrong in a running script. Each costs the instance.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Trouble {
    /// The budget of the call is spent.
    #[error("out of fuel: more than {0} instructions in one call")]
    Fuel(u64),
    /// More memory or a larger table than allowed.
    #[error("memory refused: it asked for {0}")]
    Memory(String),
    /// Too deep a recursion.
    #[error("stack overflow")]
    Stack,
    /// Any other trap.
    #[error("trap: {0}")]
    Trap(String),
    /// An answer is not a finite number.
    #[error("{what} of {value}")]
    NotFinite {
        /// Which answer.
        what: &'static str,
        /// What it was.
        value: String,
    },
}
