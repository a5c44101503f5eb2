//! The fine loop. One program for all of these tests: linking one for each costs a clean build a minute.

mod attach;
#[allow(dead_code)] // what tests beside these need of it
#[path = "../common/mod.rs"]
mod common;
mod curved;
#[path = "../demanding/mod.rs"]
mod demanding;
mod feed;
mod hand_over;
mod jerk;
mod missed;
mod progress;
mod promises;
mod ratio;
mod rounds;
mod single_block;
#[path = "../smooth/mod.rs"]
mod smooth;
mod switched;
