//! Lanes: the axes as this planner calculates with them.

use tandem_motion::tube::{Lanes, each};
use tandem_sdk::{AxisLimits, AxisVector, Block, PlannerContext};

use crate::travel::Travel;

/// Degrees in a radian: rotary lanes are in degrees, so that a path tolerance of 0.01 mm stands beside 0.01°, as in a part
/// program.
const DEGREES: f64 = 180.0 / std::f64::consts::PI;

/// Limits by lane, and the way from axes to lanes.
#[derive(Clone, Copy, Debug)]
pub struct Frame<const L: usize> {
    /// Lanes in use.
    pub count: usize,
    /// Lane units per mm or rad.
    pub scale: Lanes<L>,
    /// 1 for rotary lanes, else 0.
    pub rotary: Lanes<L>,
    /// Speed in feed motion, and in rapids.
    pub speed: [Lanes<L>; 2],
    /// Acceleration.
    pub acceleration: Lanes<L>,
    /// Jerk.
    pub jerk: Lanes<L>,
    /// The ends of the travel.
    pub travel: Travel<L>,
    /// Fine period, s.
    pub period_s: f64,
}

impl<const L: usize> Frame<L> {
    /// The largest of a limit of the axes.
    pub fn largest(&self, limit: &Lanes<L>) -> f64 {
        limit[..self.count].iter().copied().fold(0.0, f64::max)
    }

    /// The frame of a machine with at most `L` axes, whose joints that are sums of axes are kept by narrower limits of the axes.
    pub fn new(machine: &PlannerContext) -> Self {
        let context = &machine.axis_by_axis();
        let axes = context.limits.axes();
        let rotary = |i: usize| i < axes.len() && context.axes.is_rotary(i);
        let scale: Lanes<L> = std::array::from_fn(|i| if rotary(i) { DEGREES } else { 1.0 });
        // Lanes that no axis uses never move; their limits only keep them finite.
        let of = |get: fn(&AxisLimits) -> f64| -> Lanes<L> {
            std::array::from_fn(|i| {
                axes.get(i)
                    .map_or(get(&axes[0]), |axis| scale[i] * get(axis))
            })
        };
        Self {
            count: axes.len(),
            scale,
            rotary: std::array::from_fn(|i| if rotary(i) { 1.0 } else { 0.0 }),
            speed: [of(|a| a.feed_mm_per_s), of(|a| a.rapid_mm_per_s)],
            acceleration: of(|a| a.acceleration_mm_per_s2),
            jerk: of(|a| a.jerk_mm_per_s3),
            travel: Travel::new(machine, &scale),
            period_s: context.fine_period_s,
        }
    }

    /// `position` in lanes, without what may stand behind the axes.
    pub fn lanes(&self, position: &AxisVector) -> Lanes<L> {
        std::array::from_fn(|i| {
            if i < self.count {
                position[i] * self.scale[i]
            } else {
                0.0
            }
        })
    }

    /// Lanes as axes.
    pub fn axes(&self, lanes: &Lanes<L>) -> AxisVector {
        let mut position = AxisVector::ZERO;
        for i in 0..self.count {
            position[i] = lanes[i] / self.scale[i];
        }
        position
    }

    /// Whether path speed counts the rotary axes of `block`: it moves no linear one. Arcs are linear.
    pub fn counts_rotary(&self, block: &Block) -> bool {
        (0..self.count).all(|i| self.rotary[i] > 0.0 || block.start[i] == block.end[i])
            && !matches!(
                block.kind,
                tandem_sdk::BlockKind::Arc | tandem_sdk::BlockKind::Nurbs
            )
    }

    /// Factors by which path speed counts the lanes: 1 for linear ones, or 1/scale for rotary ones.
    pub fn counted(&self, rotary: bool) -> Lanes<L> {
        std::array::from_fn(|i| match (rotary, self.rotary[i] > 0.0) {
            (false, false) => 1.0,
            (true, true) => 1.0 / self.scale[i],
            _ => 0.0,
        })
    }
}

/// The largest `x` with `x·|direction| ≤ limit` in every lane.
#[inline(always)]
pub fn along<const L: usize>(limit: &Lanes<L>, direction: &Lanes<L>) -> f64 {
    let mut least = f64::INFINITY;
    for l in 0..L {
        let x = limit[l] / direction[l].abs().max(1e-12);
        least = if x < least { x } else { least };
    }
    least
}

/// Inner product.
#[inline(always)]
pub fn dot<const L: usize>(a: &Lanes<L>, b: &Lanes<L>) -> f64 {
    let mut sum = 0.0;
    for i in 0..L {
        sum += a[i] * b[i];
    }
    sum
}

/// `a + x·b`.
#[inline(always)]
pub fn plus<const L: usize>(a: &Lanes<L>, x: f64, b: &Lanes<L>) -> Lanes<L> {
    each(|i| a[i] + x * b[i])
}

/// `a − b`.
#[inline(always)]
pub fn minus<const L: usize>(a: &Lanes<L>, b: &Lanes<L>) -> Lanes<L> {
    each(|i| a[i] - b[i])
}

/// The largest |entry|.
#[inline(always)]
pub fn largest<const L: usize>(a: &Lanes<L>) -> f64 {
    a.iter()
        .fold(0.0, |most, v| if v.abs() > most { v.abs() } else { most })
}

/// The larger of two numbers; no number where either is none.
#[inline(always)]
pub fn larger(a: f64, b: f64) -> f64 {
    // Where either is no number, neither is the result.
    if b > a || b.is_nan() { b } else { a }
}

/// The squared distance of `point` from the line between `a` and `b`.
#[inline(always)]
pub fn to_chord<const L: usize>(point: &Lanes<L>, a: &Lanes<L>, b: &Lanes<L>) -> f64 {
    let chord = minus(b, a);
    let way = minus(point, a);
    let squared = dot(&chord, &chord);
    let along = if squared > 0.0 {
        (dot(&way, &chord) / squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let across: Lanes<L> = each(|l| way[l] - along * chord[l]);
    dot(&across, &across)
}
