//! Acceleration and deceleration *after* interpolation: the planner `after-interpolation`.
//!
//! The classical scheme that look-ahead planners are compared with, after Cheol-Soo Lee and Je-Phil Lee, "2-step motion
//! control loop and look-ahead", where it is called ADAI. The programmed path is driven at the command feeds, as steps
//! of feed without any acceleration, one block directly after the other; then the position of every axis goes through
//! the same low-pass filter:
//!
//! | `filter` | what it is | settles within |
//! |---|---|---|
//! | `linear` (default) | moving average over `time_constant_ms` | the time constant τ |
//! | `bell` | moving average over τ, then one over τ/2 | 1.5 τ |
//! | `exponential` | lag of first order with time constant T | the lag falls below 1e-9 mm |
//!
//! It is quick and never looks ahead, and it pays with the path: corners are cut (linear: by `F·τ·sin(θ/2)/4` for a turn
//! of θ) and arcs of radius R shrink (linear: by `R·(1 − sin(ωτ/2)/(ωτ/2))`, ω = F/R). Accelerations come out as `F/τ`,
//! whatever the machine can do. It therefore says that it leaves the path and breaks limits, and a host runs it with
//! simulated drives and `guard.mode = "count"` only. Where the program needs rest (exact stop, dwell, rapid, end) it
//! waits until the filter has settled and rests on the programmed position exactly.
//!
//! ```toml
//! [planner]
//! plugin = "after-interpolation"
//! [planner.options]
//! filter = "bell"
//! time_constant_ms = 30
//! ```
//!
//! A time constant in the part program (`TA`) is ignored: one filter serves all axes for the whole run.

mod feeds;
mod filter;
mod motion;
mod options;
mod piece;
mod planner;
mod signal;

pub use options::{FilterKind, Options};
pub use planner::{AfterInterpolation, BUFFER_BLOCKS};

use tandem_sdk::{PlannerContext, PluginError};

tandem_sdk::plugin!(planner "after-interpolation" = open);

fn open(options: &Options, context: &PlannerContext) -> Result<AfterInterpolation, PluginError> {
    options.check()?;
    AfterInterpolation::new(options, context)
}
