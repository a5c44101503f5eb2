//! Reads `machine.toml`: what machine there is, what it may do and which plugins move it.
//!
//! Strict: an unknown key, a missing axis, an inverted limit, a value without sense is refused, and every refusal names
//! the file, the line, the key and, where a name is unknown, the nearest known one. All that is wrong is told at once.
//! Units of the file live in the names of its keys; [`Machine`] is in mm, s and rad.
//!
//! ```no_run
//! use tandem_machine::Machine;
//!
//! let overrides = [("planner.plugin".to_owned(), "block-overlap".to_owned())];
//! match Machine::read("mill.toml".as_ref(), &overrides) {
//!     Ok(machine) => println!("{}: {} axes", machine.name, machine.axes.count()),
//!     // mill.toml:21:1: axes.x.max_fed_mm_per_min: unknown key; did you mean `max_feed_mm_per_min`?
//!     Err(error) => eprintln!("{error}"),
//! }
//! ```
//!
//! [`keys`] lists every key; [`markdown`] writes the list as a reference.

mod axes;
mod convert;
mod drivers;
mod error;
mod homing;
mod inputs;
mod joints;
mod keys;
mod limits;
mod load;
mod machine;
mod motion;
mod nearest;
mod node;
mod outputs;
mod overrides;
mod parts;
mod paths;
mod places;
mod probe;
mod problems;
mod program;
mod schema;
mod section;
mod shown;
mod signals;
mod tools;
mod units;
mod values;

pub use drivers::{DriverChoice, Owned};
pub use error::{MachineError, Problem, ValuePlace};
pub use homing::{AxisHoming, DriveHoming, Foot, HomingBy, IndexPulse, SwitchHoming};
pub use inputs::{Input, Role};
pub use joints::Joint;
pub use keys::{Key, keys, markdown, tool_keys};
pub use machine::Machine;
pub use motion::{FineThread, JerkMode, Motion};
pub use nearest::meant;
pub use outputs::Output;
pub use parts::{GuardMode, Operator, PluginChoice, Policy, RecordErrorMode, Spindle};
pub use probe::Probe;
pub use program::ProgramRules;
pub use signals::Analog;
pub use tools::{Tool, ToolTable};
