//! The planner for curves. One program for all of these tests: linking one for each costs a clean build a minute.

mod baseline;
mod canonical;
#[path = "../common/mod.rs"]
mod common;
mod dwells;
mod every_phase;
mod hard_curves;
mod reference;
mod reference_motions;
mod short_blocks;
mod steady_feeds;
