//! The clock of a command.

use tandem_host::{Clock, Registry, moves_metal};
use tandem_machine::Machine;

use crate::args;

/// The clock that was asked for; where none was, that of the driver: real drives live in real time.
pub fn of(asked: Option<args::Clock>, machine: &Machine, registry: &Registry) -> Clock {
    match asked {
        Some(clock) => clock.into(),
        None if moves_metal(machine, registry) => Clock::Wall,
        None => Clock::Virtual,
    }
}
