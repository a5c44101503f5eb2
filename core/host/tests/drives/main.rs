//! Several drivers on one machine, as the fine loop calls them.

#[allow(dead_code)] // what other tests need of it
mod four_axes;
mod mapping;

use four_axes::{machine, program};
