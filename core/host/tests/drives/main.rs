//! Several drivers on one machine, as the fine loop calls them.

mod cut_line;
#[allow(dead_code)] // what other tests need of it
mod four_axes;
mod mapping;
mod mirror;
mod starts;

use four_axes::{machine, program};
