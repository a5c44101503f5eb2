//! The hard loop: governor, evaluation, guard, drives. One call of [`FineLoop::tick`] is one fine period.
//!
//! A crate of its own so that it stays clean: nothing here allocates, locks, opens a file or makes text after
//! [`FineLoop::new`].

mod answer;
mod config;
mod cursor;
mod edge;
mod fault;
mod governor;
mod guard;
mod history;
mod horizon;
mod law;
mod outputs;
mod period_points;
mod plan_ahead;
mod ramp;
mod roles;
mod slowdowns;
mod state;
mod steps;
mod tick;

pub use config::{FineConfig, GuardMode, HomeSwitch, Joints, MissedLimits};
pub use fault::{Breach, Fault, FaultKind, InputFault};
pub use roles::Roles;
pub use tick::{FineLoop, JobEnd, Left};
