//! The form `scan`: near time-optimal under limits of velocity, acceleration and jerk per axis and of the chord error.
//!
//! 1. [`first`]: ramps between corners give a first timing, behind what is left of the window before for a few periods;
//! 2. [`spline`]: the path coordinate over that time as a cubic B-spline, which is continuous in acceleration;
//! 3. `tandem_motion::retime`: how fast that motion can be driven, asked on a [`grid`] and, where the path turns much or its
//!    third derivative jumps, between;
//! 4. the check of every sample and segment, and jerk and feed at [`points`] between.
//!
//! A window that the check refuses is planned again with less jerk or lower caps.

mod first;
mod grid;
mod motion;
mod plan;
mod points;
mod spline;
mod timing;

pub use plan::Scan;
