//! The form `scan`: near time-optimal under limits of velocity, acceleration and jerk per axis and of the chord error.
//!
//! The path of consecutive stretches that join smoothly is planned window by window. A window begins in the present state
//! and ends at rest, so that what is planned can always be driven to its end:
//!
//! 1. [`timing`]: speed caps on nodes along the path and two passes over them give a first timing;
//! 2. [`spline`]: the path coordinate over that time as a cubic B-spline, which is continuous in acceleration;
//! 3. `tandem_motion::retime`: how fast that motion can be driven;
//! 4. [`check`]: every limit on the samples of the fine period, with those before the window in front;
//! 5. [`draw`]: the first part of the window as segments; then the next window.
//!
//! A window that the check refuses is planned again with less jerk or lower caps. Where that does not help in motion, the
//! window before is driven to its end, at rest, which is checked already.

mod check;
mod draw;
mod plan;
mod planner;
mod route;
mod spline;
mod timing;
mod window;

pub use planner::ScanPlanner;
