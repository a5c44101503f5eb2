//! Faults on purpose: seeded wrappers around any driver, from the table `[faults]` of `machine.toml`.
//!
//! Each entry of `[[faults.wrap]]` is a wrapper: a driver around a driver, as network stacks inject faults between
//! the stack and a device. The first entry stands next to the drives, each further one around those before it. What a
//! wrapper does is decided by the seed, the count of exchanges and the tick of the setpoint, so a run repeats.

mod entry;
mod kind;
mod nearest;
mod options;
mod schedule;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_allocation;
mod wrapper;

use tandem_sdk::Driver;

pub use entry::Refusal;
pub use options::{Faults, Joints};
use wrapper::Wrapper;

/// Puts `faults` around `driver`, before its first exchange. Host; allocates.
pub fn wrap(driver: Box<dyn Driver>, faults: Faults) -> Box<dyn Driver> {
    let seed = faults.seed;
    let around =
        |inner, (index, plan)| Box::new(Wrapper::new(inner, plan, seed, index)) as Box<dyn Driver>;
    (0..).zip(faults.wrap).fold(driver, around)
}
