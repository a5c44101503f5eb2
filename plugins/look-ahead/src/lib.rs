//! The two-step look-ahead planner: the junction feeds of all buffered blocks, raised as blocks arrive.
//!
//! After Cheol-Soo Lee and Je-Phil Lee, "2-step motion control loop and look-ahead": a block may be entered at most
//! as fast as it can be left, as the junction allows, and as the block before it can bring the machine to. The update
//! here keeps two arrays, the reach from behind and the junction feeds, and gives the optimum with a bounded number of
//! evaluations a block, where one sweep as published does not.

mod buffer;
mod drive;
mod geometry;
mod junction;
mod options;
mod plan;
mod planner;
mod rows;

pub use options::{Junction, Options};
pub use planner::LookAhead;

tandem_sdk::plugin!(planner "look-ahead" = LookAhead::new);
