//! What can be written.

use std::sync::Arc;

use tandem_gcode::PersistentData;
use tandem_sdk::AxisVector;

use crate::data::{Alarm, Job, JobEnd, PersistentState, Tool, ToolLife};

/// One change of what lasts. Each says the whole new value of what it names, so that of two of a kind only the later counts.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// What programs see is so: what differs from the file is written. Of parameters those that last are
    /// ([`PersistentState::keeps`]). A tool whose offset or diameter differs has been measured anew ([`Tool::measure`]); one that is
    /// missing stays. The tool length in force does not last.
    Program(Arc<PersistentData>),
    /// The place of G28 (0) or G30 (1) is that of the machine file again.
    ForgetReference(usize),
    /// The value of parameter `number`, which lasts from now on.
    ListParameter {
        /// Its number, within [`crate::USER_PARAMETERS`].
        number: usize,
        /// Its value.
        value: f64,
    },
    /// A row of the tool table, new or in the place of the one with its number.
    Tool(Box<Tool>),
    /// Life counters of a tool that the table has.
    ToolLife {
        /// The tool.
        number: u32,
        /// Its counters.
        life: ToolLife,
    },
    /// The tool table has no tool with this number any more.
    ForgetTool(u32),
    /// Whole turns of a rotary axis, by its index.
    Turns {
        /// The axis.
        axis: usize,
        /// Its turns.
        turns: i64,
    },
    /// A parameter of the policy script.
    PolicyParameter {
        /// Its name.
        name: String,
        /// Its value.
        value: f64,
    },
    /// Where the machine stands, mm or rad: history, never used.
    LastPosition(AxisVector),
    /// A job began.
    JobBegan(Box<Job>),
    /// A job ended.
    JobEnded {
        /// Its number.
        id: u64,
        /// How.
        end: Box<JobEnd>,
    },
    /// An alarm was raised.
    Raised(Box<Alarm>),
    /// An alarm was acknowledged.
    Acknowledged {
        /// Its number.
        id: u64,
        /// When, ms since 1970 (UTC).
        at_unix_ms: i64,
    },
    /// Everything but the history is replaced: the initial values of a new file, and what was imported. Alarms and the driven
    /// line stay as they are.
    Whole(Box<PersistentState>),
}
