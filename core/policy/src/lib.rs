//! Policy scripts: WASM modules that tune one machine, block by block and period by period, and cannot hurt it.
//!
//! [`Engine::compile`] turns bytes into a [`Script`] and says what is missing where they are none. A [`Policy`] runs it:
//! [`Policy::offer`] and [`Policy::decide`] give it windows of blocks, [`Policy::period`] the means of a rough period.
//! What it answers are requests: checked, clamped, counted and noted. What goes wrong in it costs the script, not the
//! run: the blocks stay as programmed, and after three strikes it is not called any more.
//!
//! Everything here runs on the soft side. Calls of [`Policy::offer`], [`Policy::decide`] and [`Policy::period`] allocate
//! nothing as long as nothing goes wrong and nothing is noted. The same calls give the same answers on every computer.

pub mod abi;
mod bounds;
mod budget;
mod counters;
mod engine;
mod error;
mod facts;
mod instance;
mod layout;
mod limits;
mod notes;
mod parameters;
mod period;
mod policy;
mod script;
mod shape;
mod window;

pub use bounds::{Bounds, Tuning};
pub use budget::Budget;
pub use counters::Counters;
pub use engine::{Engine, MOST_BYTES};
pub use error::{Refusal, Trouble};
pub use facts::Facts;
pub use instance::Instance;
pub use limits::SOFT_STACK_BYTES;
pub use parameters::{Parameter, Values};
pub use period::Period;
pub use policy::{MAX_STRIKES, Policy};
pub use script::Script;
pub use window::Record;
