//! The emulator, judged by masters that know nothing of it, and by what real terminals once answered.

#![allow(
    clippy::large_futures,
    reason = "the futures of ethercrab hold its group of devices"
)]

#[path = "../../../../tests/counting_allocator.rs"]
mod counting_allocator;
mod cyclic;
mod rig;

mod captures;
mod clocks;
mod drives;
mod faults;
mod frames;
mod masters;
mod states;
