//! The smooth planner. One program for all of these tests: linking one for each costs a clean build a minute.

#[path = "../common/mod.rs"]
mod common;
mod neighbours;
mod random;
mod supply;
mod times;
