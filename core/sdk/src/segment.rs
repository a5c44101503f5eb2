//! What the rough loop hands to the fine loop.

use crate::abi::layout::{Layout, START, fold, fold_text, layout, layout_of_enum};
use crate::{AxisVector, MAX_AXES};

/// Facts about a [`Segment`], as bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(transparent)]
pub struct SegmentFlags(pub u32);

impl Layout for SegmentFlags {
    const HASH: u64 = fold(fold_text(START, "SegmentFlags"), u32::HASH);
}

impl SegmentFlags {
    /// Rapid motion: the rapid override applies, not the feed override.
    pub const RAPID: Self = Self(1);
    /// The machine is at rest at the end: the fine loop puts a sample exactly there.
    pub const ENDS_AT_REST: Self = Self(2);
    /// The block named by the segment begins here.
    pub const BLOCK_BEGINS: Self = Self(4);
    /// The block named by the segment ends with this segment.
    pub const BLOCK_ENDS: Self = Self(8);
    /// Nothing moves (a dwell).
    pub const DWELL: Self = Self(16);
    /// Order 3: velocity or acceleration step where this begins. Put in by the host.
    pub const STEPS: Self = Self(64);

    /// Whether all bits of `other` are set.
    #[inline]
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// These bits but for those of `other`.
    #[inline]
    #[must_use]
    pub fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Both sets of bits.
    #[inline]
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

/// Which change of an input ends a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum Edge {
    /// None: an ordinary motion.
    #[default]
    None = 0,
    /// The input becomes 1 (G38.2, G38.3, homing onto a switch).
    Rising = 1,
    /// The input becomes 0 (G38.4, G38.5, homing off a switch).
    Falling = 2,
}

layout_of_enum!(Edge {
    None,
    Rising,
    Falling
});

/// What ends a motion early, and whether it is an error when nothing does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct StopOn {
    /// Number of the input, 0 to 63; or axes, by [`StopOn::home_switches`].
    pub input: u32,
    /// The change waited for.
    pub edge: Edge,
    /// 1 where reaching the end without the edge is a fault (G38.2, G38.4), else 0.
    pub miss_is_fault: u32,
}

impl StopOn {
    /// In [`StopOn::input`]: the other bits are no number, but a bit each for axes.
    const HOME: u32 = 1 << 31;

    /// The home switch of any of these axes, a bit each, whatever its input: a rising `edge` is one that trips, a falling one is
    /// one that is released. Drives catch no position at it.
    pub const fn home_switches(axes: u32, edge: Edge) -> Self {
        Self {
            input: Self::HOME | axes,
            edge,
            miss_is_fault: 0,
        }
    }

    /// The axes whose home switches are waited for, a bit each; none where it is an input.
    #[inline]
    pub const fn home_axes(&self) -> Option<u32> {
        if self.input & Self::HOME == 0 {
            None
        } else {
            Some(self.input & !Self::HOME)
        }
    }
}

layout!(StopOn {
    input,
    edge,
    miss_is_fault
});

/// A piece of motion: one polynomial of degree ≤ 5 per axis over `0 ≤ t ≤ duration_s`, in the powers of t.
///
/// The constant terms are the exact planned position; between, the polynomial stays within 1e-6 mm of the planned path.
/// The fine loop can evaluate it at any instant, which is what makes hold and override possible without the planner.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Segment {
    /// Entries of an older epoch are dropped by the fine loop: abort, probe and jog raise it.
    pub epoch: u32,
    /// Index of the block that moves (the later one where two overlap).
    pub block: u64,
    /// Line of the part program.
    pub line: u32,
    /// Facts about the segment.
    pub flags: SegmentFlags,
    /// Order of the limits that hold: 2 velocity and acceleration, 3 also jerk.
    pub order: u32,
    /// What ends the motion early: the block's [`crate::Block::stop_on`], put in by the host.
    pub stop_on: StopOn,
    /// Duration, s of program time; zero only for a rest (constant position).
    pub duration_s: f64,
    /// Coefficients per axis, `position = Σ c[n]·tⁿ`, mm or rad.
    pub coefficients: [[f64; 6]; MAX_AXES],
    /// Path coordinate from the start of the run, same form, mm.
    pub path: [f64; 6],
    /// Programmed feed, mm/s: the highest of the blocks that move here; infinite for rapids.
    pub feed_mm_per_s: f64,
    /// Path deceleration that the plan leaves everywhere in this segment, its own braking counted, mm/s².
    pub stop_deceleration_mm_per_s2: f64,
    /// Where velocity steps are allowed: how far the velocity at the start of the segment is ahead of a velocity that is
    /// continuous over the junctions, mm/s. Zero for planners with continuous velocity.
    pub step_velocity: AxisVector,
    /// How fast that lead is taken back, mm/s²: at local time t the continuous velocity is
    /// `velocity(t) − step_velocity + step_acceleration · t`, and it is what the governor limits. `core/fine/src/governor.rs`
    /// says why.
    pub step_acceleration: AxisVector,
    /// Order 3: the plan leaves room for |dσ/dt| up to this, together with the next, at every σ from 0 to 1, 1/s; infinite
    /// for order 2. On a straight path it is `a_s/v`, with `a_s` the deceleration declared above.
    pub max_sigma_rate_per_s: f64,
    /// Order 3: the plan leaves room for |d²σ/dt²| up to this, 1/s²; infinite for order 2. On a straight path J/v. What both
    /// say is counted on for the depth of the queue: building up the stop takes `rate / acceleration`. While driving, the
    /// fine loop goes by the limits themselves.
    pub max_sigma_acceleration_per_s2: f64,
}

layout!(Segment {
    epoch,
    block,
    line,
    flags,
    order,
    stop_on,
    duration_s,
    coefficients,
    path,
    feed_mm_per_s,
    stop_deceleration_mm_per_s2,
    step_velocity,
    step_acceleration,
    max_sigma_rate_per_s,
    max_sigma_acceleration_per_s2
});

impl Segment {
    /// A rest at `position` of `duration_s`, order 2.
    #[inline]
    pub fn rest(position: &AxisVector, duration_s: f64) -> Self {
        let mut coefficients = [[0.0; 6]; MAX_AXES];
        for (axis, value) in position.0.iter().enumerate() {
            coefficients[axis][0] = *value;
        }
        Self {
            epoch: 0,
            block: 0,
            line: 0,
            flags: SegmentFlags::ENDS_AT_REST,
            order: 2,
            stop_on: StopOn::default(),
            duration_s,
            coefficients,
            path: [0.0; 6],
            feed_mm_per_s: f64::INFINITY,
            stop_deceleration_mm_per_s2: f64::INFINITY,
            step_velocity: AxisVector::ZERO,
            step_acceleration: AxisVector::ZERO,
            max_sigma_rate_per_s: f64::INFINITY,
            max_sigma_acceleration_per_s2: f64::INFINITY,
        }
    }

    /// Position at local time `t_s`, mm or rad. Any loop; does not allocate.
    #[inline]
    pub fn position(&self, t_s: f64) -> AxisVector {
        AxisVector(std::array::from_fn(|axis| {
            polynomial(&self.coefficients[axis], t_s)
        }))
    }

    /// Velocity at local time `t_s`, per s of program time. Any loop; does not allocate.
    #[inline]
    pub fn velocity(&self, t_s: f64) -> AxisVector {
        AxisVector(std::array::from_fn(|axis| {
            derivatives(&self.coefficients[axis], t_s)[0]
        }))
    }

    /// Acceleration at local time `t_s`, per s² of program time. Any loop; does not allocate.
    #[inline]
    pub fn acceleration(&self, t_s: f64) -> AxisVector {
        AxisVector(std::array::from_fn(|axis| {
            derivatives(&self.coefficients[axis], t_s)[1]
        }))
    }

    /// Path coordinate at local time `t_s`, mm.
    #[inline]
    pub fn path_mm(&self, t_s: f64) -> f64 {
        polynomial(&self.path, t_s)
    }

    /// Path speed at local time `t_s`, mm/s of program time.
    #[inline]
    pub fn path_speed_mm_per_s(&self, t_s: f64) -> f64 {
        derivatives(&self.path, t_s)[0]
    }
}

/// Value at `t` of the polynomial with the coefficients `c` of a [`Segment`]. Any loop; does not allocate.
#[inline]
pub fn polynomial(c: &[f64; 6], t: f64) -> f64 {
    c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))))
}

/// First, second and third derivative of the same: velocity, acceleration and jerk. What of them is not used is not computed. Any
/// loop; does not allocate.
#[inline]
pub fn derivatives(c: &[f64; 6], t: f64) -> [f64; 3] {
    [
        c[1] + t * (2.0 * c[2] + t * (3.0 * c[3] + t * (4.0 * c[4] + t * 5.0 * c[5]))),
        2.0 * c[2] + t * (6.0 * c[3] + t * (12.0 * c[4] + t * 20.0 * c[5])),
        6.0 * c[3] + t * (24.0 * c[4] + t * 60.0 * c[5]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_those_of_the_polynomial() {
        let c = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        assert_eq!(
            [0.0, 1.0, 2.0].map(|t| polynomial(&c, t)),
            [1.0, 21.0, 321.0]
        );
        assert_eq!(derivatives(&c, 0.0), [2.0, 6.0, 24.0]);
        assert_eq!(derivatives(&c, 1.0), [70.0, 210.0, 504.0]);
        assert_eq!(derivatives(&c, 2.0), [702.0, 1254.0, 1704.0]);
    }

    #[test]
    fn derivatives_match_differences() {
        let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
        segment.coefficients[1] = [1.0, -2.0, 3.0, -4.0, 5.0, -6.0];
        let t = 0.3;
        let h = 1e-5;
        let rate = (segment.position(t + h)[1] - segment.position(t - h)[1]) / (2.0 * h);
        assert!((segment.velocity(t)[1] - rate).abs() < 1e-8);
        let curve = (segment.velocity(t + h)[1] - segment.velocity(t - h)[1]) / (2.0 * h);
        assert!((segment.acceleration(t)[1] - curve).abs() < 1e-8);
    }
}
