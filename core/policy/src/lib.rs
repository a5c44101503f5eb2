//! Policy scripts: WASM modules that tune one machine, block by block and period by period, and cannot hurt it.
//!
//! [`Engine::compile`] turns bytes into a [`Script`] and says what is missing where they are none. A [`Policy`] runs it:
//! [`Policy::offer`] and [`Policy::decide`] give it windows of blocks, [`Policy::period`] the means of a rough period.
//! What it answers are requests: checked, clamped, counted and noted. What goes wrong in it costs the script, not the
//! run: the blocks stay as programmed, and after three strikes it is not called any more.
//!
//! Everything here runs on the soft side. Calls of [`Policy::offer`], [`Policy::decide`] and [`Policy::period`] allocate
//! nothing as long as nothing goes wrong and nothing is noted. The same calls give the same answers on every computer.
//!
//! Without the feature `scripts` nothing of the WASM engine is built, and every script is refused.

#![cfg_attr(
    not(feature = "scripts"),
    allow(dead_code, reason = "what only the WASM engine calls")
)]

pub mod abi;
mod bounds;
mod budget;
mod counters;
#[cfg(feature = "scripts")]
mod engine;
mod error;
mod facts;
mod geometry;
mod inputs;
#[cfg(feature = "scripts")]
mod instance;
mod layout;
#[cfg(feature = "scripts")]
mod limits;
mod nearest;
mod notes;
mod parameters;
mod period;
mod policy;
#[cfg(feature = "scripts")]
mod script;
mod shape;
mod window;
#[cfg(not(feature = "scripts"))]
mod without;

pub use bounds::{Bounds, Tuning};
pub use budget::{Budget, MAX_BYTES, SOFT_STACK_BYTES};
pub use counters::Counters;
#[cfg(feature = "scripts")]
pub use engine::Engine;
pub use error::{Refusal, Trouble};
pub use facts::Facts;
pub use geometry::Geometry;
pub use inputs::{Input, InputKind, MAX_PROGRAM_VALUES, MAX_SCRIPT_SIGNALS};
#[cfg(feature = "scripts")]
pub use instance::Instance;
pub use parameters::{Parameter, Values};
pub use period::Period;
pub use policy::{MAX_STRIKES, Policy};
#[cfg(feature = "scripts")]
pub use script::Script;
pub use window::{Record, Sight};
#[cfg(not(feature = "scripts"))]
pub use without::{Engine, Instance, Script};
