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
//! Rough loop. A [`Retimer`] allocates when its grid grows; solving again on a grid no larger does not allocate.

mod banded;
mod newton;
mod rows;
mod solve;
mod timing;

pub use banded::Pentadiagonal;
pub use solve::{Retimer, Status, Task};
pub use timing::{Rate, weights};

/// Axes that a retiming takes.
pub const MAX_LANES: usize = tandem_sdk::MAX_AXES;

/// Places on each interval at which limits are asked for: its start, its middle and its end.
pub const PLACES: usize = 3;

/// The motion at one place: derivatives by pseudo-time per axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// First derivative, mm/s.
    pub first: [f64; MAX_LANES],
    /// Second derivative, mm/s².
    pub second: [f64; MAX_LANES],
    /// Third derivative, mm/s³, of the interval that the point belongs to.
    pub third: [f64; MAX_LANES],
    /// Highest rate squared here: feed, chord error and axis speeds together.
    pub most: f64,
    /// Share of the jerk limits that may be used here, beside that of the whole motion: less where the motion between the
    /// places takes more jerk than at them.
    pub jerk_share: f64,
    /// Share of the acceleration limits that may be used here.
    pub acceleration_share: f64,
}

impl Default for Point {
    fn default() -> Self {
        let zero = [0.0; MAX_LANES];
        Self {
            first: zero,
            second: zero,
            third: zero,
            most: f64::INFINITY,
            jerk_share: 1.0,
            acceleration_share: 1.0,
        }
    }
}

/// Further places of an interval at which limits are asked for: where a derivative of the motion jumps both sides of that,
/// where it turns much more places between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Between {
    /// The interval.
    pub interval: usize,
    /// Where in it, 0 to 1.
    pub z: [f64; PLACES],
    /// The motion there.
    pub points: [Point; PLACES],
}

/// What each axis may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaneLimits {
    /// Number of axes.
    pub lanes: usize,
    /// Acceleration, mm/s².
    pub acceleration: [f64; MAX_LANES],
    /// Jerk, mm/s³.
    pub jerk: [f64; MAX_LANES],
}

/// How the motion begins or ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// At rest: the rate there is free.
    Rest,
    /// In motion: time goes on unscaled, so position, velocity and acceleration are kept.
    Moving,
}
