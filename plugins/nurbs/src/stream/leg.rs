//! A smooth stretch of a block, and what holds on it.

use std::sync::Arc;

use tandem_motion::nurbs::{AlongPath, Place};
use tandem_sdk::{AxisVector, Block, BlockKind, MAX_AXES, PlannerContext};

use super::route::{BESIDE_MM, SAME_MM, Side};
use crate::course::Course;
use crate::limit::chord_feed_mm_per_s;

/// Share of a limit that a speed may reach.
const AIM: f64 = 0.999;
/// Share of an axis's acceleration that turning may take.
const TURNING: f64 = 0.8;
/// Share of an axis's jerk that the third derivative of the path may take.
const THIRD: f64 = 0.9;
/// Share of the jerk limit that steps of velocity and acceleration may take in a fine period.
const STEP: f64 = 0.7;
/// The same share for a step of acceleration beside which the jerk is held to the rest, before the three quarters of it that
/// samples show.
const BEND_STEP: f64 = 1.2;
/// What a step of acceleration shows as a jerk of samples at most, per period.
const STEP_SHOWN: f64 = 0.75;
/// Share of the jerk limit that is the rounding of two derivatives.
const ROUNDING: f64 = 1e-3;
/// Share of the jerk limit that is left beside it at least.
const MIN_LEFT: f64 = 0.1;
/// Share of the feed below which a junction is not passed but rested at.
const WORTH: f64 = 0.05;
/// Largest turn where stretches join without rest, rad: programs round end points of arcs to 0.001 mm.
const STRAIGHT: f64 = 1e-3;

/// Share of the way to the next end or knot of a leg that is beside one of them at most.
const BESIDE_SHARE: f64 = 0.05;
/// Share of that which is rounding.
const NEAR_SHARE: f64 = 0.01;
/// Share of the length of a leg that is rounding.
const SAME_SHARE: f64 = 1e-10;

/// The limits that count here.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    pub context: PlannerContext,
    pub chord_error_mm: f64,
}

/// A smooth stretch of a block.
#[derive(Clone, Debug)]
pub struct Leg {
    pub block: Block,
    pub course: Arc<Course>,
    pub stretch: usize,
    /// Path coordinates of its ends, mm.
    pub start_mm: f64,
    pub end_mm: f64,
    /// First and last stretch of its block.
    pub begins: bool,
    pub ends: bool,
    /// The next leg goes on without rest.
    pub joined: bool,
    /// Highest speed that is to be driven, mm/s.
    pub feed_mm_per_s: f64,
    /// What the axes that move in it leave along the path.
    pub least: Least,
}

/// What axes leave along the path: the least of acceleration and of jerk, and no higher speed than that.
#[derive(Clone, Copy, Debug)]
pub struct Least {
    pub speed_mm_per_s: f64,
    pub acceleration_mm_per_s2: f64,
    pub jerk_mm_per_s3: f64,
}

impl Leg {
    /// Position and derivatives at the path coordinate `s_mm`, which is moved into the leg.
    pub fn at(&self, s_mm: f64, place: &mut Place) -> AlongPath {
        let s = (s_mm - self.start_mm).clamp(0.0, self.end_mm - self.start_mm);
        self.course.at(self.stretch, s, place)
    }

    /// How far the path goes on from `s_mm` without a feature of its own, mm.
    pub fn smooth_for_mm(&self, s_mm: f64, place: &mut Place) -> f64 {
        self.course
            .smooth_for_mm(self.stretch, (s_mm - self.start_mm).max(0.0), place)
    }

    /// Path coordinates of the leg that are the same but for rounding differ by less, mm: where a rotary axis turns much on
    /// little way, a nanometre of that is more than rounding.
    pub fn same_mm(&self) -> f64 {
        let rounding = 8.0 * f64::EPSILON * self.end_mm.abs();
        SAME_MM
            .min(SAME_SHARE * (self.end_mm - self.start_mm))
            .max(rounding)
    }

    /// How far beside its ends and knots derivatives are taken, mm: never as far as the next of them, which may be a cusp.
    pub fn beside_mm(&self) -> f64 {
        BESIDE_MM.min(BESIDE_SHARE * self.course.stretches()[self.stretch].shortest_mm())
    }

    /// What is nearer than that to an end or a knot is there, mm.
    pub fn near_mm(&self) -> f64 {
        NEAR_SHARE * self.beside_mm()
    }

    /// Where the derivatives may jump first behind `s_mm`: a knot, or the end.
    pub fn next_break_mm(&self, s_mm: f64) -> f64 {
        let stretch = &self.course.stretches()[self.stretch];
        (self.start_mm + stretch.next_knot_mm(s_mm - self.start_mm)).min(self.end_mm)
    }

    /// Highest speed at a point: feed, chord error, axis speeds and turning.
    pub fn cap_mm_per_s(&self, at: &AlongPath, bounds: &Bounds) -> f64 {
        self.turning_cap_mm_per_s(at, bounds, TURNING)
    }

    /// The same, with a share of the acceleration for turning.
    pub fn turning_cap_mm_per_s(&self, at: &AlongPath, bounds: &Bounds, turning: f64) -> f64 {
        let curvature = self.course.counted_length(&at.curvature);
        let chord = chord_feed_mm_per_s(
            curvature,
            bounds.chord_error_mm,
            bounds.context.fine_period_s,
        );
        let along = bounds.context.limits.along(&at.direction);
        let axes = if self.block.kind == BlockKind::Rapid {
            along.rapid_mm_per_s
        } else {
            along.feed_mm_per_s
        };
        let mut cap = self.feed_mm_per_s.min(chord).min(axes);
        for (axis, limits) in bounds.context.limits.axes().iter().enumerate() {
            let bend = at.curvature[axis].abs();
            if bend > 0.0 {
                cap = cap.min((turning * limits.acceleration_mm_per_s2 / bend).sqrt());
            }
        }
        AIM * cap
    }

    /// Highest speed where the derivatives jump between two sides: the steps of velocity and acceleration as jerk of one
    /// period T, so that v·|Δx′|/T² + v²·|Δx″|/T is a share of the jerk limit.
    pub fn step_cap_mm_per_s([before, behind]: &[AlongPath; 2], bounds: &Bounds) -> f64 {
        let period_s = bounds.context.fine_period_s;
        let axes = bounds.context.limits.axes().iter().enumerate();
        let caps = axes.map(|(axis, limits)| {
            let turn =
                (behind.direction[axis] - before.direction[axis]).abs() / (period_s * period_s);
            let bend = (behind.curvature[axis] - before.curvature[axis]).abs() / period_s;
            let jerk = STEP * limits.jerk_mm_per_s3;
            2.0 * jerk / (turn + (turn * turn + 4.0 * bend * jerk).sqrt())
        });
        caps.fold(f64::INFINITY, f64::min)
    }

    /// The highest speed where all derivatives are asked for on both sides of a jump: of curvature it may take more of the jerk
    /// limit, because the jerk beside it is held to what that leaves ([`Leg::jerk_left_at_step`]).
    pub fn passing_cap_mm_per_s([before, behind]: &[AlongPath; 2], bounds: &Bounds) -> f64 {
        let period_s = bounds.context.fine_period_s;
        let axes = bounds.context.limits.axes().iter().enumerate();
        let caps = axes.map(|(axis, limits)| {
            let turn = (behind.direction[axis] - before.direction[axis]).abs()
                / (STEP * period_s * period_s);
            let bend =
                (behind.curvature[axis] - before.curvature[axis]).abs() / (BEND_STEP * period_s);
            let jerk = limits.jerk_mm_per_s3;
            2.0 * jerk / (turn + (turn * turn + 4.0 * bend * jerk).sqrt())
        });
        caps.fold(f64::INFINITY, f64::min)
    }

    /// Share of the jerk limits that a jump of curvature leaves where it is passed at `speed_mm_per_s`, or at `cap_mm_per_s`
    /// where that is less: a step Δa of acceleration makes a third difference of 0.75·Δa/T at some phase of the tick.
    pub fn jerk_left_at_step(
        [before, behind]: &[AlongPath; 2],
        speed_mm_per_s: f64,
        cap_mm_per_s: f64,
        bounds: &Bounds,
    ) -> f64 {
        let v = speed_mm_per_s.min(cap_mm_per_s);
        let axes = bounds.context.limits.axes().iter().enumerate();
        let taken = axes.map(|(axis, limits)| {
            let bend = (behind.curvature[axis] - before.curvature[axis]).abs();
            STEP_SHOWN * v * v * bend / (bounds.context.fine_period_s * limits.jerk_mm_per_s3)
        });
        let taken = taken.fold(0.0, f64::max);
        if taken > ROUNDING {
            (1.0 - taken).max(MIN_LEFT)
        } else {
            1.0
        }
    }

    /// The same, and the jerk of the curve at that speed.
    pub fn smooth_cap_mm_per_s(&self, at: &AlongPath, bounds: &Bounds) -> f64 {
        let mut cap = self.cap_mm_per_s(at, bounds);
        for (axis, limits) in bounds.context.limits.axes().iter().enumerate() {
            let third = at.third[axis].abs();
            if third > 0.0 {
                cap = cap.min((THIRD * limits.jerk_mm_per_s3 / third).cbrt());
            }
        }
        cap
    }

    /// The path at its start or end, or just inside where it stands still in its parameter; `None` where it has no direction
    /// there either.
    fn beside(&self, side: Side) -> Option<AlongPath> {
        let (s_mm, inward_mm) = match side {
            Side::Before => (self.end_mm, -self.beside_mm()),
            Side::Behind => (self.start_mm, self.beside_mm()),
        };
        let places = [s_mm, s_mm + inward_mm].map(|s| self.at(s, &mut Place::default()));
        let at = places
            .into_iter()
            .find(|at| at.direction != AxisVector::ZERO)?;
        let known = self.course.stretches()[self.stretch].directions();
        let direction = known.map_or(at.direction, |[start, end]| match side {
            Side::Before => *end,
            Side::Behind => *start,
        });
        Some(AlongPath { direction, ..at })
    }

    /// Whether `next` goes on in the same direction, and the steps there leave a speed worth it.
    pub fn runs_into(&self, next: &Self, bounds: &Bounds) -> bool {
        let ends = self.beside(Side::Before).zip(next.beside(Side::Behind));
        let Some((before, after)) = ends else {
            return false;
        };
        let straight = (0..MAX_AXES)
            .all(|axis| (after.direction[axis] - before.direction[axis]).abs() <= STRAIGHT);
        let feed_mm_per_s = self.feed_mm_per_s.min(next.feed_mm_per_s);
        straight && Self::step_cap_mm_per_s(&[before, after], bounds) >= WORTH * feed_mm_per_s
    }
}

impl Least {
    /// Of the axes that move at some of a few places of a stretch, which is to be driven at `feed_mm_per_s`.
    pub fn on(
        course: &Course,
        stretch: usize,
        bounds: &Bounds,
        rapid: bool,
        feed_mm_per_s: f64,
    ) -> Self {
        let length_mm = course.stretches()[stretch].length_mm;
        let mut place = Place::default();
        let mut least = [f64::INFINITY; 2];
        let directions = [0.0, 0.23, 0.47, 0.71, 1.0]
            .map(|s| course.at(stretch, s * length_mm, &mut place).direction);
        let tops = directions.map(|direction| {
            let along = bounds.context.limits.along(&direction);
            if rapid {
                along.rapid_mm_per_s
            } else {
                along.feed_mm_per_s
            }
        });
        let speed_mm_per_s = tops.into_iter().fold(0.0, f64::max).min(feed_mm_per_s);
        for (axis, limits) in bounds.context.limits.axes().iter().enumerate() {
            let along = directions.map(|direction| direction[axis].abs());
            if along.iter().all(|along| *along == 0.0) {
                continue;
            }
            // A joint that is a sum of axes may move further than the path; so may a rotary axis, where a place at which the
            // linear ones nearly stand still says nothing of the others. On a curve an axis that moves less at these places may move
            // more between them; on a line it does not, and a heavy table that turns a little while another axis goes a long way must
            // not slow that down as if it turned by as much.
            let joint = axis >= bounds.context.axes.count();
            let most = along.iter().copied().fold(0.0, f64::max);
            let share = if course.is_straight() {
                most
            } else if joint {
                most.max(1.0)
            } else {
                minimum(&along).max(1.0)
            };
            least = [
                least[0].min(limits.acceleration_mm_per_s2 / share),
                least[1].min(limits.jerk_mm_per_s3 / share),
            ];
        }
        Self {
            speed_mm_per_s,
            acceleration_mm_per_s2: least[0],
            jerk_mm_per_s3: least[1],
        }
    }
}

fn minimum(numbers: &[f64]) -> f64 {
    numbers.iter().copied().fold(f64::INFINITY, f64::min)
}
