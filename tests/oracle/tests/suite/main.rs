//! The oracle itself. One program for all of these tests: linking one for each costs a clean build a minute.

mod common;
mod curves;
mod deceptions;
mod dense;
mod feeds;
mod limits;
mod paths;
mod program;
mod property;
mod reading;
