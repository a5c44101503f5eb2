//! The machine that planners are judged on: three axes, and not two of them alike.

use tandem_sdk::{Axes, AxisLimits, AxisVector, Limits, PlannerContext};

/// Fine period, s.
pub const FINE_PERIOD_S: f64 = 0.001;
/// Rough period, s.
pub const ROUGH_PERIOD_S: f64 = 0.008;
/// How far from zero programs go, mm: inside the travel of 250.
pub const REACH_MM: f64 = 200.0;

/// What a planner is told on this machine, standing at `position`.
pub fn context(position: AxisVector) -> PlannerContext {
    let axis = |acceleration_mm_per_s2| AxisLimits {
        min_mm: -250.0,
        max_mm: 250.0,
        feed_mm_per_s: 200.0,
        rapid_mm_per_s: 250.0,
        acceleration_mm_per_s2,
        jerk_mm_per_s3: acceleration_mm_per_s2 * 30.0,
        speed_difference_mm_per_s: 100.0 / 60.0,
    };
    let axes = Axes::new(&[('X', false), ('Y', false), ('Z', false)]);
    let limits = Limits::new(&[axis(1000.0), axis(1500.0), axis(600.0)]);
    PlannerContext {
        axes: axes.unwrap_or_else(|_| unreachable!("three letters of axes")),
        limits: limits.unwrap_or_else(|_| unreachable!("three axes")),
        fine_period_s: FINE_PERIOD_S,
        rough_period_s: ROUGH_PERIOD_S,
        path_tolerance_mm: 0.01,
        time_constant_s: 0.05,
        max_feed_ratio: 1.0,
        position,
        joint_lanes: None,
    }
}
