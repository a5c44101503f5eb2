//! Motions inside a tube around a path: where to go within the tolerance, and how fast.
//!
//! A motion is a uniform cubic B-spline x(τ) in a pseudo-time τ, one lane an axis. Two solvers take turns:
//!
//! * [`Smoother`]: the spline with the least jerk that passes boxes around given points at given pseudo-times;
//! * [`crate::retime::Retimer`]: the rate b(τ) = (dτ/dt)² for which the time is least and every lane keeps its limits.
//!
//! Both are primal-dual interior point methods on banded systems: the work is linear in the grid, and bounded.
//!
//! Rough loop. The solvers allocate where a grid is larger than any before; solving again does not.

#![allow(
    clippy::inline_always,
    reason = "what is inlined is compiled for the wide instructions of its caller"
)]
#![allow(
    clippy::needless_range_loop,
    reason = "lanes of several arrays go side by side"
)]

mod banded;
mod smoother;
mod spline;

pub use crate::lanes::{Lanes, each};
pub use smoother::{SmoothStatus, Smoother, Waypoint};
pub use spline::Spline;
