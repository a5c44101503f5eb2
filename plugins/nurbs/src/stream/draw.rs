//! Windows as segments.

use tandem_motion::hermite;
use tandem_sdk::{MAX_AXES, Segment};

use super::route::{BESIDE_MM, SAME_MM};
use super::{Cursor, Motion, Route, State, Window};

/// Most that a segment may stand off its path, mm.
const OFF_MM: f64 = 1e-8;
/// Most that the jerk at the end of a segment may be off, as a share of the limit; and what is not looked for below, mm:
/// the path by arc length is no smoother.
const JERK_OFF: f64 = 0.004;
const LEAST_OFF_MM: f64 = 1.5e-9;
/// Halvings of an interval until a segment follows the path.
const MAX_HALVINGS: u32 = 30;

/// Least duration of a segment through both its ends, s: the derivatives of a shorter one are rounding.
const LEAST_S: f64 = 5e-5;
/// Least duration of any segment, s.
const SLIVER_S: f64 = 1e-6;

/// What was drawn.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    /// Until when, s from the start of the window.
    pub until_s: f64,
    /// The leg at the front is over.
    pub leg_over: bool,
}

/// Draws the segment from `from_s` on: at most to `to_s`, to the end of the interval of the grid, to the next knot and to
/// the end of the leg at the front, where that leaves more than slivers. Position, velocity and acceleration of both ends
/// are met. Does not allocate.
pub fn draw<M: Motion>(route: &Route, window: &Window<M>, (from_s, to_s): (f64, f64), segment: &mut Segment) -> Drawn {
    let k = window.interval(from_s);
    let border_s = window.times[k + 1];
    let asked_s = to_s.max(from_s + LEAST_S);
    let mut until_s = if border_s - asked_s < LEAST_S { border_s } else { asked_s };
    let mut cursor = Cursor::default();
    let leg_end_mm = route.front().end_mm;
    let start = window.at_in(k, from_s);
    let break_mm = route.front().next_break_mm(start.s_mm + SAME_MM);
    if window.at_in(k, until_s).s_mm > break_mm + SAME_MM {
        let break_s = window.time_at(break_mm, (from_s, until_s));
        if until_s - break_s > SLIVER_S && break_s - from_s > SLIVER_S {
            until_s = break_s;
        }
    }
    if until_s - from_s < LEAST_S {
        let end = window.at_in(k, until_s);
        fill_sliver(route, [&start, &end], until_s - from_s, segment);
        return Drawn { until_s, leg_over: end.s_mm > leg_end_mm - SAME_MM };
    }
    let mut end = window.at_in(k, until_s);
    let jerk_mm_per_s3 = route.front().least.jerk_mm_per_s3;
    for _ in 0..MAX_HALVINGS {
        fill(route, &mut cursor, [&start, &end], until_s - from_s, segment);
        if follows(route, &mut cursor, jerk_mm_per_s3, segment) {
            break;
        }
        if until_s - from_s < 2.0 * LEAST_S {
            break;
        }
        until_s = f64::midpoint(from_s, until_s);
        end = window.at_in(k, until_s);
    }
    Drawn { until_s, leg_over: end.s_mm > leg_end_mm - SAME_MM }
}

fn fill(route: &Route, cursor: &mut Cursor, ends: [&State; 2], duration_s: f64, segment: &mut Segment) {
    let [from, to] = ends;
    let states = [(from, BESIDE_MM), (to, -BESIDE_MM)].map(|(end, beside_mm)| {
        let at = route.at_side(end.s_mm, beside_mm, cursor);
        let (v, a) = (end.speed_mm_per_s, end.acceleration_mm_per_s2);
        [at.position, at.direction * v, at.direction * a + at.curvature * (v * v)]
    });
    let [from, to] = &states;
    for axis in 0..MAX_AXES {
        segment.coefficients[axis] = hermite(from.map(|v| v[axis]), to.map(|v| v[axis]), duration_s);
    }
    let along = ends.map(|end| [end.s_mm, end.speed_mm_per_s, end.acceleration_mm_per_s2]);
    segment.path = hermite(along[0], along[1], duration_s);
    segment.duration_s = duration_s;
}

/// A segment by the derivatives at its start: so short that its end is met to 2e-8 mm.
fn fill_sliver(route: &Route, [from, to]: [&State; 2], duration_s: f64, segment: &mut Segment) {
    let at = route.at_side(from.s_mm, BESIDE_MM, &mut Cursor::default());
    let (v, a) = (from.speed_mm_per_s, from.acceleration_mm_per_s2);
    let jerk = (to.acceleration_mm_per_s2 - a) / duration_s;
    let second = at.direction * a + at.curvature * (v * v);
    let third = at.direction * jerk + at.curvature * (3.0 * v * a) + at.third * (v * v * v);
    for axis in 0..MAX_AXES {
        let first = at.direction[axis] * v;
        segment.coefficients[axis] = [at.position[axis], first, second[axis] / 2.0, third[axis] / 6.0, 0.0, 0.0];
    }
    segment.path = [from.s_mm, v, a / 2.0, jerk / 6.0, 0.0, 0.0];
    segment.duration_s = duration_s;
}

/// A quintic that is off by e in its middle has a third derivative that is off by 384·e/T³ at its ends.
fn follows(route: &Route, cursor: &mut Cursor, jerk_mm_per_s3: f64, segment: &Segment) -> bool {
    let of_jerk_mm = JERK_OFF * jerk_mm_per_s3 * segment.duration_s.powi(3) / 384.0;
    let most_mm = OFF_MM.min(of_jerk_mm.max(LEAST_OFF_MM));
    [0.25, 0.5, 0.75].iter().all(|share| {
        let t_s = share * segment.duration_s;
        let off = route.at(segment.path_mm(t_s), cursor).0.position - segment.position(t_s);
        off.0.iter().all(|off| off.abs() <= most_mm)
    })
}
