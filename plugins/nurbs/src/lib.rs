//! The planner `nurbs`: NURBS curves driven directly, slowed where a chord of the fine period would leave them.
//!
//! | `form` | what it keeps |
//! |---|---|
//! | `scan` (default) | velocity, acceleration and jerk of every axis, feed and chord error; near time-optimal |
//! | `windowed` | the same, and acceleration and jerk along the path; corners, look-ahead and cubic windows, as published |
//! | `adaptive` | feed and chord error only, as published: acceleration and jerk break the limits |
//!
//! `adaptive` is the baseline that the literature compares with, after Yeh and Hsu, "Adaptive-feedrate interpolation for
//! parametric curves with a confined chord error": in every fine period the feed is the least of the programmed one and
//! that whose chord stays within `chord_error_um` at the curvature where the period begins. It jumps from feed to feed
//! and starts at full feed, so it runs on simulated drives with `guard.mode = "count"` only.
//!
//! ```toml
//! [planner]
//! plugin = "nurbs"
//! [planner.options]
//! form = "adaptive"
//! chord_error_um = 1
//! ```
//!
//! What a form decides is the path coordinate over time; following the path at that speed is common to all of them.
//! `scan` and `windowed` plan window by window (module `stream`). Lines and arcs go the same way as curves.

mod adaptive;
mod baseline;
mod course;
mod limit;
mod options;
mod piece;
mod planner;
mod scan;
mod stream;
mod windowed;

pub use course::{Course, Stretch};
pub use limit::chord_feed_mm_per_s;
pub use options::{FormName, Options};
pub use piece::Piece;
pub use planner::{BUFFER_BLOCKS, NurbsPlanner};

use tandem_sdk::{PlannerContext, PluginError};

tandem_sdk::plugin!(planner "nurbs" = open);

fn open(options: &Options, context: &PlannerContext) -> Result<NurbsPlanner, PluginError> {
    options.check()?;
    NurbsPlanner::new(options, context)
}
