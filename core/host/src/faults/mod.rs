//! Faults on purpose: seeded wrappers around any driver, from `[faults]` of `machine.toml`.
//!
//! Each entry of `[[faults.wrap]]` is a [`Wrapper`]: a driver around a driver, as network stacks inject faults between
//! the stack and a device. The first entry stands next to the drives, each further one around those before it. What a
//! wrapper does is decided by the seed, the count of exchanges and the tick of the setpoint, so a run repeats.

mod entry;
mod kind;
mod nearest;
mod options;
mod random;
mod schedule;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_allocation;
mod wrapper;

use tandem_machine::Machine;
use tandem_sdk::Driver;

use crate::error::HostError;
use crate::joints::JointSpace;
use crate::rules::refusal;
use entry::Refusal;
use options::{Faults, Joints};
use wrapper::Wrapper;

/// Puts the machine's faults around `driver`, which is not open yet; without `[faults]` it is given back as it is.
/// Host; allocates.
///
/// # Errors
/// What `[faults]` says wrongly, with its place in the machine file.
pub fn wrap(machine: &Machine, driver: Box<dyn Driver>, joints: &JointSpace) -> Result<Box<dyn Driver>, HostError> {
    let Some(table) = &machine.faults else { return Ok(driver) };
    let joints = Joints { rotary: joints.rotary(), count: joints.count() };
    let faults = Faults::read(table, &joints).map_err(|Refusal { key, cause }| refusal(machine, &key, cause))?;
    let seed = faults.seed;
    let around = |inner, (index, plan)| Box::new(Wrapper::new(inner, plan, seed, index)) as Box<dyn Driver>;
    Ok((0..).zip(faults.wrap).fold(driver, around))
}
