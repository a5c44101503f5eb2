//! The hard loop: governor, evaluation, guard, drives. One call of [`FineLoop::tick`] is one fine period.
//!
//! A crate of its own so that it stays clean: nothing here allocates, locks, opens a file or makes text after
//! [`FineLoop::new`].

mod answer;
mod config;
mod course;
mod cursor;
mod edge;
mod fault;
mod governor;
mod guard;
mod history;
mod law;
mod outlook;
mod outputs;
mod points;
mod preview;
mod ramp;
mod roles;
mod state;
mod steps;
mod tick;

pub use config::{FineConfig, GuardMode, Joints, MissedLimits};
pub use fault::{Breach, Fault, FaultKind, InputFault};
pub use roles::Roles;
pub use tick::{Counters, FineLoop, JobEnd, Left};
