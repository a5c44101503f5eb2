//! The planner `smooth`: velocity, acceleration and jerk of every axis within limits, the path within its tolerance, near
//! the shortest time, also where blocks are short.
//!
//! 1. A guess of the timing of the path gives pseudo-time ([`timing`]).
//! 2. In pseudo-time the spline of least jerk is laid through boxes around the path ([`waypoints`], `tandem_motion::tube`).
//! 3. That motion is driven as fast as the limits allow; the times found are the timing of the next round ([`plan`]).
//! 4. The quintics that come out are checked as they are, up to their rest at the end ([`verify`]).
//! 5. The first part is driven; the next window begins in a state on it ([`core`]).
//!
//! A window that is refused costs time, never limits: the one before is driven on, at most to its rest, and it is checked
//! to its end. From rest a shorter window is tried, in the end a single straight piece ([`profile`]).

#![allow(
    clippy::inline_always,
    reason = "what is inlined is compiled for the number of lanes of its caller"
)]
#![allow(
    clippy::needless_range_loop,
    reason = "lanes of several arrays go side by side"
)]

mod chain;
mod core;
mod emit;
mod feeds;
mod flatten;
mod frame;
mod options;
mod order;
mod path_distance;
mod peaks;
mod plan;
mod planner;
mod profile;
mod report;
mod route;
mod shares;
mod span;
mod timing;
mod travel;
mod tuning;
mod turns;
mod verify;
mod waypoints;
mod window;

pub use options::Options;
pub use plan::Effort;
pub use planner::{BUFFER_CHORDS, SmoothPlanner};
pub use tuning::Tuning;

use tandem_sdk::{PlannerContext, PluginError};

tandem_sdk::plugin!(planner "smooth" = open);

fn open(options: &Options, context: &PlannerContext) -> Result<SmoothPlanner, PluginError> {
    options.check()?;
    SmoothPlanner::new(options, context)
}
