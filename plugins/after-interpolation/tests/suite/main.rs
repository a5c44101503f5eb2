//! The planner that filters after interpolation. One program for all of these tests: linking one for each costs a clean build a minute.

mod cases;
#[path = "../common/mod.rs"]
mod common;
mod contract;
mod random;
