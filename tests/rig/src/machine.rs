//! Machines.

use tandem_sdk::{Axes, AxisLimits, AxisVector, Limits, PlannerContext};

/// An axis with 250 mm/s and travel beyond every program, without limits of jerk and of the speed difference.
pub fn axis(acceleration_mm_per_s2: f64) -> AxisLimits {
    AxisLimits {
        min_mm: -1e6,
        max_mm: 1e6,
        feed_mm_per_s: 250.0,
        rapid_mm_per_s: 250.0,
        acceleration_mm_per_s2,
        jerk_mm_per_s3: f64::INFINITY,
        speed_difference_mm_per_s: 0.0,
    }
}

/// What a planner is told on a machine with the first of the axes X, Y, Z, A (rotary), standing at zero: tolerance 0.01 mm,
/// time constant 50 ms, rough period 8 ms.
///
/// # Panics
/// There are no axes, or more than four.
pub fn context(axes: &[AxisLimits], fine_period_s: f64) -> PlannerContext {
    let names = [('X', false), ('Y', false), ('Z', false), ('A', true)];
    PlannerContext {
        axes: Axes::new(&names[..axes.len()]).unwrap(),
        limits: Limits::new(axes).unwrap(),
        fine_period_s,
        rough_period_s: 0.008,
        path_tolerance_mm: 0.01,
        time_constant_s: 0.05,
        max_feed_ratio: 1.0,
        position: AxisVector::ZERO,
        joint_lanes: None,
    }
}
