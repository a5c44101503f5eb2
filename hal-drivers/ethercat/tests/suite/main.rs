//! The driver for EtherCAT on an emulated bus. One program for all of these tests: linking one for each costs a clean build a minute.

mod bus;
mod clocks;
#[path = "../common/mod.rs"]
mod common;
mod jointless;
mod objects;
mod start;
