//! How a plugin crosses the border of its crate: tables of C functions, the same for a plugin linked into the host and
//! for one in a shared library.
//!
//! An author meets none of this: [`crate::plugin!`] makes it from a plain implementation of a contract. Each kind has a
//! module with a table, the plugin's side (`extern "C"` functions that catch panics) and the host's side (a value that
//! implements the contract by calling the table).
//!
//! What a call costs beyond a plain one: an indirect jump, and a look whether the plugin has panicked before. Nothing is
//! allocated.

mod entry;
mod library;

mod driver;
mod kinematics;
mod planner;
mod strategy;

pub use driver::driver;
pub use entry::quiet_linked_panics;
pub use kinematics::kinematics;
pub use library::{Descriptor, LAYOUT, Library, SYMBOL_PREFIX};
pub use planner::planner;
pub use strategy::feed_strategy;

pub(crate) use driver::open as open_driver;
pub(crate) use kinematics::open as open_kinematics;
pub(crate) use planner::open as open_planner;
pub(crate) use strategy::open as open_strategy;
