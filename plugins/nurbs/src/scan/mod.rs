//! The form `scan`: near time-optimal under limits of velocity, acceleration and jerk per axis and of the chord error.
//!
//! 1. [`timing`]: speed caps on nodes along the path and two passes over them give a first timing;
//! 2. [`spline`]: the path coordinate over that time as a cubic B-spline, which is continuous in acceleration;
//! 3. `tandem_motion::retime`: how fast that motion can be driven;
//! 4. the check of every sample, and [`points`] between them.
//!
//! A window that the check refuses is planned again with less jerk or lower caps.

mod first;
mod motion;
mod plan;
mod points;
mod spline;
mod timing;

pub use plan::Scan;
