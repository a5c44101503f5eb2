//! The simulated drives. One program for all of these tests: linking one for each costs a clean build a minute.

mod demanding;
mod drives;
mod watchdog;
