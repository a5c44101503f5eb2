//! What the machine may do, as planners see it.

use crate::abi::layout::layout;
use crate::{AxisVector, MAX_AXES};

/// Limits of one axis or joint. A rotary one is in rad.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct AxisLimits {
    /// Lowest position, mm.
    pub min_mm: f64,
    /// Highest position, mm.
    pub max_mm: f64,
    /// Highest speed in feed motion, mm/s.
    pub feed_mm_per_s: f64,
    /// Highest speed in rapid motion, mm/s.
    pub rapid_mm_per_s: f64,
    /// Highest acceleration, mm/s².
    pub acceleration_mm_per_s2: f64,
    /// Highest jerk, mm/s³; infinite where the machine states none.
    pub jerk_mm_per_s3: f64,
    /// Allowable speed difference where blocks meet, mm/s.
    pub speed_difference_mm_per_s: f64,
}

layout!(AxisLimits {
    min_mm,
    max_mm,
    feed_mm_per_s,
    rapid_mm_per_s,
    acceleration_mm_per_s2,
    jerk_mm_per_s3,
    speed_difference_mm_per_s
});

impl AxisLimits {
    /// No limit at all. Any loop; does not allocate.
    pub const fn unlimited() -> Self {
        Self {
            min_mm: f64::NEG_INFINITY,
            max_mm: f64::INFINITY,
            feed_mm_per_s: f64::INFINITY,
            rapid_mm_per_s: f64::INFINITY,
            acceleration_mm_per_s2: f64::INFINITY,
            jerk_mm_per_s3: f64::INFINITY,
            speed_difference_mm_per_s: f64::INFINITY,
        }
    }
}

/// Limits along a path at one point: the largest path speed, acceleration and jerk that keep every axis and joint.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct PathLimits {
    /// Path speed in feed motion, mm/s.
    pub feed_mm_per_s: f64,
    /// Path speed in rapid motion, mm/s.
    pub rapid_mm_per_s: f64,
    /// Path acceleration on a straight path, mm/s².
    pub acceleration_mm_per_s2: f64,
    /// Path jerk on a straight path, mm/s³.
    pub jerk_mm_per_s3: f64,
}

/// The limits of a machine. The host makes it; planners ask [`Limits::along`], or keep what [`Limits::axes`] gives.
///
/// In what the host hands to a planner, kinematics are folded in. A joint that is a scaled axis has made the limits of that
/// axis narrower. A joint that is a sum of axes is a lane of its own behind the axes ([`crate::JointLanes`]): a planner that
/// keeps the limits of every entry keeps those of the joints.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Limits {
    /// Number of axes, and of joint lanes behind them.
    pub count: u32,
    /// Limits per axis, in the order of the machine, then per joint lane.
    pub axes: [AxisLimits; MAX_AXES],
}

layout!(Limits { count, axes });

impl Limits {
    /// Limits of the given axes; the rest of the array repeats the last one and is never asked.
    ///
    /// # Errors
    /// No axis or more than [`MAX_AXES`].
    pub fn new(axes: &[AxisLimits]) -> Result<Self, String> {
        let last = axes
            .last()
            .filter(|_| axes.len() <= MAX_AXES)
            .ok_or_else(|| {
                format!(
                    "limits are given for 1 to {MAX_AXES} axes, not {}",
                    axes.len()
                )
            })?;
        let all = std::array::from_fn(|i| *axes.get(i).unwrap_or(last));
        Ok(Self {
            count: axes.len() as u32,
            axes: all,
        })
    }

    /// The limits of the axes that exist, and behind them those of the joint lanes.
    pub fn axes(&self) -> &[AxisLimits] {
        &self.axes[..self.count as usize]
    }

    /// The limits along `direction` (change of the axes per mm of path). Rough loop; does not allocate.
    ///
    /// Axes that do not move do not limit; a direction of zero gives infinite limits. Joint lanes count like axes.
    pub fn along(&self, direction: &AxisVector) -> PathLimits {
        let smallest = |of: fn(&AxisLimits) -> f64| -> f64 {
            let each = self
                .axes()
                .iter()
                .enumerate()
                .filter(|(i, _)| direction[*i] != 0.0);
            each.map(|(i, axis)| of(axis) / direction[i].abs())
                .fold(f64::INFINITY, f64::min)
        };
        PathLimits {
            feed_mm_per_s: smallest(|a| a.feed_mm_per_s),
            rapid_mm_per_s: smallest(|a| a.rapid_mm_per_s),
            acceleration_mm_per_s2: smallest(|a| a.acceleration_mm_per_s2),
            jerk_mm_per_s3: smallest(|a| a.jerk_mm_per_s3),
        }
    }
}
