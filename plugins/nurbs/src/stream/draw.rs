//! Windows as segments.

use tandem_motion::hermite;
use tandem_sdk::{AxisVector, MAX_AXES, Segment};

use super::bernstein::{bernstein, highest};
use super::route::Side;
use super::{Bounds, Cursor, Leg, Motion, Route, State, Window};

/// Most that a segment may stand off its path, mm.
const OFF_MM: f64 = 1e-8;
/// Most that the jerk at the end of a segment may be off, as a share of the limit; and what is not looked for below, mm:
/// the path by arc length is no smoother.
const JERK_OFF: f64 = 0.004;
const MIN_OFF_MM: f64 = 1.5e-9;
/// What a segment may exceed the feed by.
const FEED_OFF: f64 = 1.0 + 1e-4;
/// Halvings of an interval until a segment follows the path.
const MAX_HALVINGS: u32 = 30;

/// Least duration of a segment through both its ends, s: the derivatives of a shorter one are rounding.
const MIN_S: f64 = 5e-5;
/// The same in a sharp turn, s, where the rounding of positions takes less than a share of the jerk.
const SHARP_S: f64 = 4e-6;
const NOISE: f64 = 0.002;
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

/// From where a segment is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Pen<'a> {
    /// Time in the window, s.
    pub from_s: f64,
    /// Where the segment before ends: this one goes on there, whatever the path rounds to.
    pub at: &'a AxisVector,
}

/// Draws the segment at `pen`: at most a rough period long or four fine ones, to the end of the interval of the grid, to the
/// next knot and to the end of the leg at the front, where that leaves more than slivers. Where the leg ends at once and
/// another goes on it has no duration. Velocity and acceleration of both ends are met, and the position of the end; it keeps to
/// the travel as the path does. It is the same segment whenever it is drawn from there: what was judged is what is driven. Does
/// not allocate.
pub fn draw<M: Motion>(
    route: &Route,
    bounds: &Bounds,
    window: &Window<M>,
    pen: &Pen,
    segment: &mut Segment,
) -> Drawn {
    let from_s = pen.from_s;
    let k = window.interval(from_s);
    let border_s = window.times[k + 1];
    let context = &bounds.context;
    let asked_s = from_s
        + context
            .rough_period_s
            .max(4.0 * context.fine_period_s)
            .max(MIN_S);
    let mut until_s = if border_s - asked_s < MIN_S {
        border_s
    } else {
        asked_s
    };
    let mut cursor = Cursor::default();
    // The last way of a rest takes long where jerk is low: near the end is the end only where the window ends.
    let leg_end_mm = route.front().end_mm;
    let same_mm = route.front().same_mm();
    let duration_s = window.duration_s();
    let is_over = |end: &State, until_s: f64| {
        end.s_mm >= leg_end_mm || until_s >= duration_s && end.s_mm > leg_end_mm - same_mm
    };
    let start = window.at_in(k, from_s);
    match first_break(route.front(), window, k, [from_s, until_s]) {
        Some(Break::Knot(break_s)) => until_s = break_s,
        Some(Break::Over) => {
            fill(
                route,
                &mut cursor,
                (pen, [&start, &start]),
                0.0,
                segment,
                sliver,
            );
            return Drawn {
                until_s: from_s,
                leg_over: true,
            };
        }
        None => {}
    }
    let mut end = window.at_in(k, until_s);
    if until_s - from_s < MIN_S {
        fill(
            route,
            &mut cursor,
            (pen, [&start, &end]),
            until_s - from_s,
            segment,
            sliver,
        );
        // At the end of the travel it meets its end: what it drifts is more than rounding there.
        if !stays(bounds, segment, false) {
            fill(
                route,
                &mut cursor,
                (pen, [&start, &end]),
                until_s - from_s,
                segment,
                hermite,
            );
        }
        return Drawn {
            until_s,
            leg_over: is_over(&end, until_s),
        };
    }
    let jerk_mm_per_s3 = route.front().least.jerk_mm_per_s3;
    let min_s = min_s(bounds, pen.at);
    for _ in 0..MAX_HALVINGS {
        fill(
            route,
            &mut cursor,
            (pen, [&start, &end]),
            until_s - from_s,
            segment,
            hermite,
        );
        if until_s - from_s < 2.0 * min_s
            || follows(route, &mut cursor, jerk_mm_per_s3, segment)
                && stays(bounds, segment, true)
                && (keeps_feed(route.front(), segment)
                    || until_s - from_s < bounds.context.fine_period_s)
        {
            break;
        }
        until_s = f64::midpoint(from_s, until_s);
        end = window.at_in(k, until_s);
    }
    Drawn {
        until_s,
        leg_over: is_over(&end, until_s),
    }
}

/// The shortest segment through both its ends whose jerk is not that of rounding of positions, s: in a sharp turn the path asks
/// for it. A quintic whose ends are off by e has 60·e/T³ of that.
fn min_s(bounds: &Bounds, at: &AxisVector) -> f64 {
    let lanes = bounds.context.limits.axes().iter().zip(at.0);
    let noise = lanes
        .map(|(limits, x)| 60.0 * f64::EPSILON * x.abs().max(1.0) / limits.jerk_mm_per_s3)
        .fold(0.0, f64::max);
    (noise / NOISE).cbrt().clamp(SHARP_S, MIN_S)
}

/// Where a segment ends before it would.
enum Break {
    /// At the next knot or end of the leg, s.
    Knot(f64),
    /// The leg ends here, but for a sliver: another one goes on.
    Over,
}

/// The first place between two times of interval `k` at which derivatives may jump, and that leaves more than slivers.
fn first_break<M: Motion>(
    front: &Leg,
    window: &Window<M>,
    k: usize,
    [from_s, until_s]: [f64; 2],
) -> Option<Break> {
    let [from_mm, until_mm] = [from_s, until_s].map(|t_s| window.at_in(k, t_s).s_mm);
    let mut known_mm = from_mm;
    loop {
        let break_mm = front.next_break_mm(known_mm + front.same_mm());
        if until_mm <= break_mm + front.same_mm() {
            return None;
        }
        let break_s = window.time_at(break_mm, (from_s, until_s));
        if until_s - break_s <= SLIVER_S {
            return None;
        }
        if break_s - from_s > SLIVER_S {
            return Some(Break::Knot(break_s));
        }
        if break_mm >= front.end_mm {
            return Some(Break::Over);
        }
        known_mm = break_mm;
    }
}

/// Both ends as one polynomial: position, velocity and acceleration of each and the duration.
type Through = fn([f64; 3], [f64; 3], f64) -> [f64; 6];

fn fill(
    route: &Route,
    cursor: &mut Cursor,
    (pen, ends): (&Pen, [&State; 2]),
    duration_s: f64,
    segment: &mut Segment,
    through: Through,
) {
    let [from, to] = ends;
    let mut states = [(from, Side::Behind), (to, Side::Before)].map(|(end, side)| {
        let at = route.at_side(end.s_mm, side, cursor);
        let v = end.speed_mm_per_s;
        let a = end.acceleration_mm_per_s2;
        [
            at.position,
            at.direction * v,
            at.direction * a + at.curvature * (v * v),
        ]
    });
    states[0][0] = *pen.at;
    let [from, to] = &states;
    for axis in 0..MAX_AXES {
        segment.coefficients[axis] =
            through(from.map(|v| v[axis]), to.map(|v| v[axis]), duration_s);
    }
    let along = ends.map(|end| [end.s_mm, end.speed_mm_per_s, end.acceleration_mm_per_s2]);
    segment.path = through(along[0], along[1], duration_s);
    segment.duration_s = duration_s;
}

/// A piece through the start and through velocity and acceleration of both ends: one so short meets the end by that too, and
/// the jerk that a quintic would take for the rounding of its ends is not in it.
fn sliver(from: [f64; 3], to: [f64; 3], h: f64) -> [f64; 6] {
    let ([x, v, a], change) = (from, to[1] - from[1]);
    if h <= 0.0 {
        return [x, v, a / 2.0, 0.0, 0.0, 0.0];
    }
    let c = 3.0 * change / (h * h) - (2.0 * a + to[2]) / h;
    let d = -2.0 * change / (h * h * h) + (a + to[2]) / (h * h);
    [x, v, a / 2.0, c / 3.0, d / 4.0, 0.0]
}

/// Whether the segment keeps to the travel, but for what rounding of positions is allowed. An end beyond it is the path's own
/// where the segment meets its ends: no shorter one mends that.
fn stays(bounds: &Bounds, segment: &Segment, meets_ends: bool) -> bool {
    let period_s = bounds.context.fine_period_s;
    bounds
        .context
        .limits
        .axes()
        .iter()
        .zip(&segment.coefficients)
        .all(|(limits, c)| {
            let rounding = 2.0 * f64::EPSILON * c[0].abs().max(1.0) / period_s;
            let low = limits.min_mm - rounding;
            let high = limits.max_mm + rounding;
            let b = bernstein(c, segment.duration_s);
            let beyond = |end: f64| end < low || end > high;
            meets_ends && (beyond(b[0]) || beyond(b[5]))
                || highest(&b, high) <= high && highest(&b.map(|v| -v), -low) <= -low
        })
}

/// Whether the segment is nowhere faster than its leg, as the motion is: where that changes much in it, a quintic through its ends is
/// another motion on the same path.
fn keeps_feed(leg: &Leg, segment: &Segment) -> bool {
    let c = &segment.path;
    let speed = [c[1], 2.0 * c[2], 3.0 * c[3], 4.0 * c[4], 5.0 * c[5]];
    let most_mm_per_s = FEED_OFF * leg.feed_mm_per_s;
    highest(&bernstein(&speed, segment.duration_s), most_mm_per_s) <= most_mm_per_s
}

/// A quintic that is off by e in its middle has a third derivative that is off by 384·e/T³ at its ends.
fn follows(route: &Route, cursor: &mut Cursor, jerk_mm_per_s3: f64, segment: &Segment) -> bool {
    let of_jerk_mm = JERK_OFF * jerk_mm_per_s3 * segment.duration_s.powi(3) / 384.0;
    let max_mm = OFF_MM.min(of_jerk_mm.max(MIN_OFF_MM));
    [0.25, 0.5, 0.75].iter().all(|share| {
        let t_s = share * segment.duration_s;
        let off = route.at(segment.path_mm(t_s), cursor).0.position - segment.position(t_s);
        off.0.iter().all(|off| off.abs() <= max_mm)
    })
}
