//! Retiming: how fast a given motion can be driven within limits of velocity, acceleration and jerk per axis.
//!
//! A motion x(τ) in a pseudo-time τ is given on a uniform grid. Sought is the rate b(τ) = (dτ/dt)² for which the time is
//! least and every axis keeps its limits. With dashes for derivatives by τ
//!
//! ```text
//! dx/dt   = x′·√b
//! d²x/dt² = x″·b + x′·b′/2
//! d³x/dt³ = √b·(x‴·b + 3/2·x″·b′ + 1/2·x′·b″)
//! ```
//!
//! b is a quadratic B-spline on the grid. Acceleration is linear in it; the jerk rows |L(b)| ≤ J·b^(−1/2) are replaced by
//! the tangent of the convex b^(−1/2) at the present b, which is an inner approximation, taken anew in every iteration of a
//! primal-dual interior point method. The Hessian has a half bandwidth of 2, so the work is linear in the grid.
//!
//! Third-order time-optimal path parametrisation as a convex-concave procedure (Verscheure et al., "Time-optimal path
//! tracking for robots", IEEE Trans. Autom. Control 54(10), 2009, for the second order), here in pseudo-time so that rests
//! are regular points.
//!
//! [`Retimer`] works on all axes of a number known to the compiler at once; [`AnyRetimer`] takes the number as it comes.
//!
//! Rough loop. Both allocate when the grid grows; solving again on a grid no larger does not allocate.

#![allow(
    clippy::inline_always,
    reason = "what is inlined is compiled for the wide instructions of its caller"
)]
#![allow(
    clippy::needless_range_loop,
    reason = "axes of several arrays go side by side"
)]

mod any;
mod banded;
mod retimer;
mod share;
mod timing;

pub use any::{ASKED, AnyRetimer, AxisLimits, Between, Task};
pub use retimer::{Asked, Factors, Retimer, Status};
pub use timing::{Rate, weights};

use crate::lanes::Lanes;

/// Places on each interval at which limits are asked for.
pub const PLACES: usize = 3;
/// Where they are: at its start, in its middle and at its end.
pub const GRID: [f64; PLACES] = [0.0, 0.5, 1.0];

/// The motion at one place: derivatives by pseudo-time per axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point<const L: usize> {
    /// First derivative, mm/s.
    pub first: Lanes<L>,
    /// Second derivative, mm/s².
    pub second: Lanes<L>,
    /// Third derivative, mm/s³, of the interval that the point belongs to.
    pub third: Lanes<L>,
    /// Highest rate squared here: feed, chord error and axis speeds together.
    pub most: f64,
    /// Share of the jerk that may be used here: less where the motion between the places takes more jerk than at them.
    pub jerk_share: f64,
    /// Share of the acceleration that may be used here.
    pub acceleration_share: f64,
}

impl<const L: usize> Default for Point<L> {
    fn default() -> Self {
        Self {
            first: [0.0; L],
            second: [0.0; L],
            third: [0.0; L],
            most: f64::INFINITY,
            jerk_share: 1.0,
            acceleration_share: 1.0,
        }
    }
}

/// How the motion begins or ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// At rest: the rate there is free.
    Rest,
    /// In motion: time goes on unscaled, so position, velocity and acceleration are kept.
    Moving,
}
