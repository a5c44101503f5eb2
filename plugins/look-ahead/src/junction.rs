//! The feed at which two blocks may meet, and what a block's junctions cost inside it.
//!
//! Axis rule. Where the direction steps by Δu at the feed v, the velocity of an axis steps by v·Δu. Think of the
//! velocity g that runs through the mean of both directions at every junction and in between takes the step back at a
//! constant rate. It never differs from the velocity by more than half a step, so with |v·Δu| ≤ V at every junction and
//! |dg/dt| ≤ A everywhere, the velocity changes by at most A·Δt + V over any window of time, whatever lies in it: that
//! is the leaky bucket that judge and guard keep. Inside a block the rate is `(v_s·Δu_s + v_e·Δu_e)/(2·t)`, signed, so
//! that a zigzag pays for its steps but not for their sum.

use tandem_sdk::{AxisLimits, AxisVector};

use crate::geometry::Entry;
use crate::options::Junction;
use crate::rows::{Row, Rows};

/// Planners stay this far inside the limits.
const MARGIN: f64 = 0.999;

/// Steps below this are rounding of the directions, not corners.
const STRAIGHT: f64 = 1e-9;

/// Most of an axis' acceleration that the constant form of the junction cost may take.
const CONSTANT_SHARE: f64 = 0.5;

/// The junction rule with the limits it needs.
#[derive(Clone, Debug)]
pub struct Rule {
    kind: Junction,
    axes: Vec<AxisLimits>,
    fine_period_s: f64,
}

impl Rule {
    /// The rule `kind` for the given axes. The fine period enters the tangent feed only.
    pub fn new(kind: Junction, axes: &[AxisLimits], fine_period_s: f64) -> Self {
        Self { kind, axes: axes.to_vec(), fine_period_s }
    }

    /// Sets the junction between `before` and `after`: its feed, and the half steps on both sides.
    pub fn join(&self, before: &mut Entry, after: &mut Entry) {
        if before.rests_before(after) {
            return;
        }
        let directions = [before.direction(true), after.direction(false)];
        let step = directions[1] - directions[0];
        let capped = before.feed_mm_per_s.min(after.feed_mm_per_s);
        let feed = match self.kind {
            Junction::Tangent => self.tangent(before, after, &directions),
            Junction::Axis => self.speed_difference(&step),
        };
        after.junction_mm_per_s = feed.min(capped);
        before.half_steps[1] = step * 0.5;
        after.half_steps[0] = step * 0.5;
    }

    /// `max(A·T_s/(1 − cos θ), V)`: equation (4) with its floor. The floor belongs to the tangent feed only.
    fn tangent(&self, before: &Entry, after: &Entry, directions: &[AxisVector; 2]) -> f64 {
        let drop = tandem_motion::one_minus_cos(&directions[0], &directions[1]);
        let acceleration = self.smallest_acceleration(before).min(self.smallest_acceleration(after));
        let floor = self.axes.iter().map(|a| a.speed_difference_mm_per_s).fold(f64::INFINITY, f64::min);
        if drop < STRAIGHT * STRAIGHT { f64::INFINITY } else { (acceleration * self.fine_period_s / drop).max(floor) }
    }

    fn speed_difference(&self, step: &AxisVector) -> f64 {
        let stepping = self.axes.iter().enumerate().filter(|(i, _)| step[*i].abs() > STRAIGHT);
        stepping.map(|(i, a)| MARGIN * a.speed_difference_mm_per_s / step[i].abs()).fold(f64::INFINITY, f64::min)
    }

    /// The smallest acceleration of the axes that move in a block, as published.
    fn smallest_acceleration(&self, entry: &Entry) -> f64 {
        let most = entry.path.as_ref().map(tandem_motion::Path::max_direction).unwrap_or_default();
        let moving = self.axes.iter().enumerate().filter(|(i, _)| most[*i] > 0.0);
        moving.map(|(_, a)| a.acceleration_mm_per_s2).fold(f64::INFINITY, f64::min)
    }

    /// Fills in what limits the speed inside `entry`, whose end junction would allow `end_mm_per_s`.
    pub fn limit(&self, entry: &mut Entry, end_mm_per_s: f64) {
        let Some(path) = entry.path else { return };
        entry.rows = Rows::default();
        if self.kind == Junction::Tangent {
            return entry.rows.push(Row { h: 1.0, k: 0.0, a: self.smallest_acceleration(entry) });
        }
        let (most, bend) = (path.max_direction(), path.max_curvature());
        for (axis, limits) in self.axes.iter().enumerate() {
            let acceleration = MARGIN * limits.acceleration_mm_per_s2;
            let straight = Row { h: most[axis], k: bend[axis], a: acceleration };
            entry.rows.push(junction_row(entry, axis, straight, end_mm_per_s));
        }
    }
}

/// The row of one axis with the cost of the junctions: in the form that allows the higher speed.
///
/// The rate that takes the steps back is at most `v_peak·(v_s|Δu_s| + v_e|Δu_e|)/(2L)`. Where the junctions are slow and
/// the block long, that is a small constant. In a chain of chords, where the junction feeds are the feed itself, it goes
/// with the square of the speed: `w·|Δu_s + Δu_e|/(2L)`, and what is left where the end speeds differ goes with the
/// path acceleration.
fn junction_row(entry: &Entry, axis: usize, row: Row, end_mm_per_s: f64) -> Row {
    let [before, after] = entry.half_steps.map(|h| h[axis]);
    if before == 0.0 && after == 0.0 {
        return row;
    }
    let length = entry.length_mm();
    let ends = entry.junction_mm_per_s * before.abs() + end_mm_per_s * after.abs();
    let constant = Row { a: row.a - entry.feed_mm_per_s * ends / length, ..row };
    let square = Row { h: row.h + before.abs().max(after.abs()), k: row.k + (before + after).abs() / length, a: row.a };
    let slow = entry.junction_mm_per_s.min(end_mm_per_s).powi(2);
    let reach = |r: &Row| (r.h * slow + 2.0 * length * r.a) / (r.h + 2.0 * length * r.k);
    let affordable = constant.a >= (1.0 - CONSTANT_SHARE) * row.a;
    let enough = entry.feed_mm_per_s.powi(2);
    if affordable && reach(&constant).min(enough) >= reach(&square).min(enough) { constant } else { square }
}
