//! How a plugin crosses the border of its crate: tables of C functions, the same for a plugin linked into the host and
//! for one in a shared library.
//!
//! An author meets none of this: [`crate::plugin!`] makes it from a plain implementation of a contract. Each kind has a
//! module with a table, the plugin's side (`extern "C"` functions that catch panics) and the host's side (a value that
//! implements the contract by calling the table).
//!
//! What a call costs beyond a plain one: an indirect jump, a look whether the plugin has panicked before, and a word for who
//! watches the thread. Nothing is allocated.
//!
//! What comes back is looked at before it is believed: a number that stands for a choice is read as a number, and one that
//! stands for none is an error with the method, the field and the value.

mod entry;
pub(crate) mod layout;
mod library;
mod watch;

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
pub use watch::{Method, Watched, Whereabouts, beat, calling, watch_this_thread};

pub(crate) use driver::open as open_driver;
pub(crate) use kinematics::open as open_kinematics;
pub(crate) use planner::open as open_planner;
pub(crate) use strategy::open as open_strategy;
