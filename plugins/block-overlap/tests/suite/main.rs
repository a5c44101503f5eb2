//! The block-overlap planner. One program for all of these tests: linking one for each costs a clean build a minute.

mod axis;
mod cases;
mod checks;
#[path = "../common/mod.rs"]
mod common;
mod feed_changes;
