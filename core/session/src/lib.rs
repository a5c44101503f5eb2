//! The operator's side of a machine: manual input, jogging, homing, and the hub where keys and sockets give commands.
//!
//! Each of them is a source of blocks that a run of the host pulls ([`tandem_rough::Source`]), and goes on by what the machine
//! answers. The host knows none of them.

pub mod controller;
pub mod grbl;
mod homing;
pub mod jog;
mod judge;
mod mdi;
pub mod operator;
mod standstill;

pub use homing::{HOMING, Homing};
pub use mdi::{MdiInput, MdiSession, NextLine, Pace};
