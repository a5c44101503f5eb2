//! The feed at which two blocks may meet, and what a block's junctions cost inside it.
//!
//! Axis rule. Where the direction steps by Δu at the feed v, the velocity of an axis steps by v·Δu. Think of the
//! velocity g that runs through the mean of both directions at every junction and in between takes the step back at a
//! constant rate. It never differs from the velocity by more than half a step, so with |v·Δu| ≤ V at every junction and
//! |dg/dt| ≤ A everywhere, the velocity changes by at most A·Δt + V over any window of time, whatever lies in it: that
//! is the leaky bucket that judge and guard keep. Inside a block the rate is `(v_s·Δu_s + v_e·Δu_e)/(2·t)`, signed, so
//! that a zigzag pays for its steps but not for their sum.

use tandem_sdk::{Axes, AxisLimits, AxisVector};

use crate::geometry::Entry;
use crate::options::Junction;
use crate::rows::{Least, Row, Transfer, lesser, min_ratio};

/// Planners stay this far inside the limits.
const MARGIN: f64 = 0.999;

/// Steps below this are rounding of the directions, not corners.
const STRAIGHT: f64 = 1e-9;

/// Most of an axis' acceleration that the constant form of the junction cost may take. With all of it a circle of fine chords is not driven
/// at its centripetal speed any more (`a_circle_of_fine_chords_is_driven_at_its_centripetal_speed`); half of it breaks no promise.
const CONSTANT_SHARE: f64 = 0.5;

/// The junction rule with the limits it needs.
#[derive(Clone, Debug)]
pub struct Rule {
    kind: Junction,
    axes: Vec<AxisLimits>,
    names: Axes,
    fine_period_s: f64,
}

impl Rule {
    /// The rule `kind` for the axes of `names` with these limits. The fine period enters the tangent feed only.
    pub fn new(kind: Junction, names: &Axes, axes: &[AxisLimits], fine_period_s: f64) -> Self {
        Self {
            kind,
            axes: axes.to_vec(),
            names: *names,
            fine_period_s,
        }
    }

    /// Sets the junction between `before` and `after`: its feed, and half the step.
    pub fn join(&self, before: &Entry, after: &mut Entry) {
        if before.rests_before(after) {
            return;
        }
        let directions = [before.direction(true), after.direction(false)];
        let step = directions[1] - directions[0];
        let capped = lesser(before.feed_mm_per_s, after.feed_mm_per_s);
        after.junction_mm_per_s = match self.kind {
            Junction::Tangent => self.tangent(before, after, &directions).min(capped),
            Junction::Axis => self.speed_difference(&step, capped),
        };
        after.half_step = step * 0.5;
    }

    /// `max(A·T_s/(1 − cos θ), V)`: equation (4) with its floor. The floor belongs to the tangent feed only.
    fn tangent(&self, before: &Entry, after: &Entry, directions: &[AxisVector; 2]) -> f64 {
        let drop = tandem_motion::one_minus_cos(&directions[0], &directions[1]);
        let acceleration = self
            .smallest_acceleration(before)
            .min(self.smallest_acceleration(after));
        let floor = self
            .axes
            .iter()
            .map(|a| a.speed_difference_mm_per_s)
            .fold(f64::INFINITY, f64::min);
        if drop < STRAIGHT * STRAIGHT {
            f64::INFINITY
        } else {
            (acceleration * self.fine_period_s / drop).max(floor)
        }
    }

    /// The highest feed up to `most` at which no axis steps by more than its allowable speed difference.
    fn speed_difference(&self, step: &AxisVector, most: f64) -> f64 {
        let stepping = self
            .axes
            .iter()
            .zip(step.0.map(f64::abs))
            .filter(|(_, step)| *step > STRAIGHT);
        min_ratio(
            most,
            stepping.map(|(axis, step)| (MARGIN * axis.speed_difference_mm_per_s, step)),
        )
    }

    /// The smallest acceleration of the axes that move in a block, as published.
    fn smallest_acceleration(&self, entry: &Entry) -> f64 {
        let most = entry
            .path
            .as_ref()
            .map(tandem_motion::Path::max_direction)
            .unwrap_or_default();
        let moving = self.axes.iter().enumerate().filter(|(i, _)| most[*i] > 0.0);
        moving
            .map(|(_, a)| a.acceleration_mm_per_s2)
            .fold(f64::INFINITY, f64::min)
    }

    /// Fills in what limits the speed inside `entry`, whose end junction is `end`, and from one end of it to the other.
    pub fn limit(&self, entry: &mut Entry, end: &End<'_>, transfer: &mut Transfer) {
        transfer.clear();
        let Some(path) = &entry.path else { return };
        let most = path.max_direction();
        let bend = path.max_curvature();
        let length_mm = path.length_mm();
        if self.kind == Junction::Tangent {
            let row = Row {
                h: 1.0,
                k: 0.0,
                a: self.smallest_acceleration(entry),
            };
            entry.rows.push(row);
            return transfer.push(&row, length_mm);
        }
        let costs = Costs::new(entry, length_mm, end.junction_mm_per_s);
        let mut turning = Least::new(entry.own_square);
        for (axis, limits) in self.axes.iter().enumerate() {
            let straight = Row {
                h: most[axis],
                k: bend[axis],
                a: MARGIN * limits.acceleration_mm_per_s2,
            };
            let half_steps = [entry.half_step[axis], end.half_step[axis]];
            let mut row = costs.row(straight, half_steps);
            if self.names.is_rotary(axis)
                && let Some((slowed, cap)) = costs.slowed_row(straight, half_steps, &row)
            {
                row = slowed;
                turning.and(cap);
            }
            if row.limits() {
                entry.rows.push(row);
                turning.and(row.turning_cap());
                transfer.push(&row, length_mm);
            }
        }
        entry.own_square = turning.value();
    }
}

/// The junction at the end of a block.
#[derive(Clone, Copy, Debug)]
pub struct End<'a> {
    /// Its feed, mm/s.
    pub junction_mm_per_s: f64,
    /// Half the change of direction.
    pub half_step: &'a AxisVector,
}

impl End<'_> {
    /// At rest.
    pub const REST: Self = Self {
        junction_mm_per_s: 0.0,
        half_step: &AxisVector::ZERO,
    };
}

/// What all axes of one block share in the cost of its junctions.
struct Costs {
    length_mm: f64,
    per_mm: f64,
    feed_mm_per_s: f64,
    /// Junction feeds at the start and at the end, mm/s.
    ends_mm_per_s: [f64; 2],
}

impl Costs {
    fn new(entry: &Entry, length_mm: f64, end_mm_per_s: f64) -> Self {
        Self {
            length_mm,
            per_mm: 1.0 / length_mm,
            feed_mm_per_s: entry.feed_mm_per_s,
            ends_mm_per_s: [entry.junction_mm_per_s, end_mm_per_s],
        }
    }

    /// The row of one axis with the cost of the half steps at its start and at its end, in the form that allows more speed.
    /// The rate that takes the steps back is at most `v_peak·(v_s|Δu_s| + v_e|Δu_e|)/(2L)`. Where the junctions are
    /// slow and the block long, that is a small constant. In a chain of chords, where the junction feeds are the feed
    /// itself, it goes with the square of the speed: `w·|Δu_s + Δu_e|/(2L)`, and what is left where the end speeds
    /// differ goes with the path acceleration.
    fn row(&self, row: Row, [before, after]: [f64; 2]) -> Row {
        if before == 0.0 && after == 0.0 {
            return row;
        }
        let constant = Row {
            a: row.a - self.feed_mm_per_s * self.stepped([before, after]) * self.per_mm,
            ..row
        };
        let square = Row {
            h: row.h + before.abs().max(after.abs()),
            k: row.k + (before + after).abs() * self.per_mm,
            a: row.a,
        };
        let affordable = constant.a >= (1.0 - CONSTANT_SHARE) * row.a;
        if affordable && self.reaches_as_far(&constant, &square) {
            constant
        } else {
            square
        }
    }

    /// By how much the velocity steps at both ends, in the mean.
    fn stepped(&self, [before, after]: [f64; 2]) -> f64 {
        let [start, end] = self.ends_mm_per_s;
        start * before.abs() + end * after.abs()
    }

    /// The constant form at the speed up to which it takes its share, and the square of that speed as a ratio; none where that allows no more
    /// speed than `other`. The way of a line that moves a linear axis is in mm and that of a turn alone in rad. Where one follows the
    /// other, the direction of the rotary axis steps by nearly 1: with a feed in mm/s the constant is more than the axis has, and the
    /// square leaves as little path acceleration, in mm/s², as the axis has in rad/s².
    fn slowed_row(&self, row: Row, half_steps: [f64; 2], other: &Row) -> Option<(Row, (f64, f64))> {
        let per_speed = self.stepped(half_steps) * self.per_mm;
        let afforded = CONSTANT_SHARE * row.a;
        let slowed = Row {
            a: row.a - afforded,
            ..row
        };
        let cap = (afforded * afforded, per_speed * per_speed);
        let of_other = self.reach(other);
        let is_higher = cap.0 * of_other.1 > of_other.0 * cap.1;
        let takes_more = self.feed_mm_per_s * per_speed > afforded;
        (takes_more && is_higher && self.reaches_as_far(&slowed, other)).then_some((slowed, cap))
    }

    /// Square of the speed that a row lets the block come to from its slower junction, as a ratio.
    fn reach(&self, row: &Row) -> (f64, f64) {
        let slow = lesser(self.ends_mm_per_s[0], self.ends_mm_per_s[1]).powi(2);
        (
            row.h * slow + 2.0 * self.length_mm * row.a,
            row.h + 2.0 * self.length_mm * row.k,
        )
    }

    /// Whether from the slower junction `one` reaches the feed, or at least as much speed as `other`.
    fn reaches_as_far(&self, one: &Row, other: &Row) -> bool {
        let one = self.reach(one);
        let other = self.reach(other);
        one.0 >= self.feed_mm_per_s.powi(2) * one.1 || one.0 * other.1 >= other.0 * one.1
    }
}
