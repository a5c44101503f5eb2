//! The motion at the places of the grid, and between them where the path turns much or its third derivative jumps.

use tandem_motion::nurbs::AlongPath;
use tandem_motion::retime::{Between, GRID, PLACES, Point};
use tandem_sdk::MAX_AXES;

use super::motion::Rated;
use super::spline::evaluate;
use crate::stream::slowdown::Slowdowns;
use crate::stream::{Bounds, Cursor, Leg, Route};

/// Turns of the path in an interval that ask for more places, rad, and where these are.
const MORE: [(f64, &[[f64; PLACES]]); 2] = [
    (0.15, &[[0.125, 0.25, 0.375], [0.625, 0.75, 0.875]]),
    (0.06, &[[0.22, 0.36, 0.78]]),
];
/// Knots of an interval that are looked at.
const KNOTS: usize = 2;
/// A try that lowers the speed to less than this share needs another motion: a rate on the present one would be found too,
/// but on a grid that is too coarse for it.
const SLOWER: f64 = 0.85;

/// Share of an axis's acceleration that turning may take: the rows of the grid see to the rest.
const TURNING: f64 = 0.95;
/// How far around a knot its step of acceleration shows beside the jerk in samples, in fine periods.
const SHOWN_PERIODS: f64 = 0.75;

/// Intervals at the start of a window in motion with a little more of rate squared, acceleration and jerk.
const YIELDING: usize = 3;
const YIELDED: [f64; 3] = [1.0008, 1.006, 1.02];

/// What a place had when the grid was laid.
#[derive(Clone, Copy, Debug, Default)]
struct PlaceBounds {
    s_mm: f64,
    /// Bound on the rate squared without slowdowns.
    most: f64,
    /// Factor of the speed by slowdowns.
    speed: f64,
    /// Share of the jerk that a step of acceleration leaves.
    jerk: f64,
    /// At the start of a window in motion.
    yields: bool,
}

/// A knot, whose step of acceleration takes its part of the jerk that samples show around it.
#[derive(Clone, Copy, Debug)]
struct Knot {
    interval: usize,
    s_mm: f64,
    /// How far it shows, mm.
    shown_mm: f64,
    /// Share of the jerk that it leaves.
    left: f64,
}

/// The places; keeps its memory.
#[derive(Debug, Default)]
pub struct Grid {
    pub points: Vec<[Point<MAX_AXES>; PLACES]>,
    pub between: Vec<Between>,
    places: Vec<[PlaceBounds; PLACES]>,
    more: Vec<[PlaceBounds; PLACES]>,
    knots: Vec<Knot>,
    /// How much faster than the motion a knot may be passed, for what is left of the jerk there.
    faster: f64,
}

impl Grid {
    /// Lays the grid of `intervals` along `motion`, whose speed is to become up to `faster` times as high at knots.
    pub fn lay(
        &mut self,
        route: &Route,
        bounds: &Bounds,
        motion: &Rated,
        (intervals, faster): (usize, f64),
        slowdowns: &Slowdowns,
    ) {
        self.faster = faster;
        self.knots.clear();
        self.points.clear();
        self.between.clear();
        self.places.clear();
        self.more.clear();
        let mut cursor = Cursor::default();
        // The end of an interval is the start of the next, but for the third derivative of the motion.
        let mut start: Option<(f64, AlongPath)> = None;
        for k in 0..intervals {
            let states = GRID.map(|z| evaluate(&motion.coefficients, k, z, motion.step_s));
            let mut turn = 0.0;
            let mut laid = [(Point::default(), PlaceBounds::default()); PLACES];
            for (n, state) in states.iter().enumerate() {
                let at = match start {
                    Some((s_mm, at)) if n == 0 && s_mm == state[0] => at,
                    _ => route.at(state[0], &mut cursor).0,
                };
                let leg = route.find(state[0], &mut cursor);
                laid[n] = place(leg, bounds, slowdowns, (state, f64::INFINITY), &at);
                if n == 1 {
                    turn = leg.course.counted_length(&at.curvature) * (states[2][0] - states[0][0]);
                }
                start = Some((state[0], at));
            }
            self.points.push(laid.map(|(point, _)| point));
            self.places.push(laid.map(|(_, place)| place));
            let more = MORE
                .iter()
                .find(|(much, _)| turn > *much)
                .map_or(&[][..], |(_, more)| more);
            for z in more {
                self.look(route, bounds, motion, slowdowns, (k, *z), &mut cursor);
            }
            self.look_at_knots(
                route,
                bounds,
                motion,
                slowdowns,
                (k, [states[0][0], states[2][0]]),
            );
        }
        self.leave_around_knots();
    }

    /// Further places of an interval: around `z`.
    pub fn look_closer(
        &mut self,
        route: &Route,
        bounds: &Bounds,
        motion: &Rated,
        slowdowns: &Slowdowns,
        (interval, z): (usize, f64),
    ) {
        let around = [z / 2.0, z, f64::midpoint(z, 1.0)];
        self.look(
            route,
            bounds,
            motion,
            slowdowns,
            (interval, around),
            &mut Cursor::default(),
        );
    }

    /// Further places in parts of the path that lie between those of the grid, at which no slowdown of them would be asked for.
    pub fn look_between(
        &mut self,
        route: &Route,
        bounds: &Bounds,
        motion: &Rated,
        slowdowns: &Slowdowns,
        known: usize,
    ) {
        for part in &slowdowns.parts()[known..] {
            let is_in = |place: &PlaceBounds| (part.from_mm..=part.to_mm).contains(&place.s_mm);
            let behind = self
                .places
                .partition_point(|places| places[0].s_mm <= part.to_mm);
            let around = behind.saturating_sub(2)..behind;
            if self.places[around].iter().flatten().any(is_in)
                || self.more.iter().flatten().any(is_in)
            {
                continue;
            }
            let interval = behind.saturating_sub(1);
            let z = motion.place(interval, f64::midpoint(part.from_mm, part.to_mm));
            self.look_closer(route, bounds, motion, slowdowns, (interval, z));
        }
    }

    /// Three more places of an interval.
    fn look(
        &mut self,
        route: &Route,
        bounds: &Bounds,
        motion: &Rated,
        slowdowns: &Slowdowns,
        (interval, z): (usize, [f64; PLACES]),
        cursor: &mut Cursor,
    ) {
        let laid = z.map(|z| {
            let state = evaluate(&motion.coefficients, interval, z, motion.step_s);
            let (at, leg) = route.at(state[0], cursor);
            place(leg, bounds, slowdowns, (&state, f64::INFINITY), &at)
        });
        self.between.push(Between {
            interval,
            z,
            points: laid.map(|(point, _)| point),
        });
        self.more.push(laid.map(|(_, place)| place));
    }

    /// Both sides of the first knots in an interval, and a place in its larger part.
    fn look_at_knots(
        &mut self,
        route: &Route,
        bounds: &Bounds,
        motion: &Rated,
        slowdowns: &Slowdowns,
        (interval, [from_mm, to_mm]): (usize, [f64; 2]),
    ) {
        let mut cursor = Cursor::default();
        let mut from_mm = from_mm;
        for _ in 0..KNOTS {
            let Some((knot_mm, sides)) = route.knot([from_mm, to_mm], &mut cursor) else {
                return;
            };
            from_mm = knot_mm;
            let at = motion.place(interval, knot_mm);
            let z = [
                at,
                at,
                if at < 0.5 {
                    f64::midpoint(at, 1.0)
                } else {
                    at / 2.0
                },
            ];
            let last = evaluate(&motion.coefficients, interval, z[2], motion.step_s);
            let state = evaluate(&motion.coefficients, interval, at, motion.step_s);
            let (other, _) = route.at(last[0], &mut cursor);
            let leg = route.find(knot_mm, &mut cursor);
            let step_cap = Leg::passing_cap_mm_per_s(&sides, bounds);
            let [before, behind] = sides;
            let laid = [
                (state, before, step_cap),
                (state, behind, step_cap),
                (last, other, f64::INFINITY),
            ];
            let laid =
                laid.map(|(state, at, cap)| place(leg, bounds, slowdowns, (&state, cap), &at));
            let mut laid = laid;
            let left = Leg::jerk_left_at_step(&sides, self.faster * state[1], step_cap, bounds);
            for (point, place) in &mut laid[..2] {
                place.jerk = left;
                point.jerk_share *= left;
            }
            self.knots.push(Knot {
                interval,
                s_mm: knot_mm,
                shown_mm: SHOWN_PERIODS * bounds.context.fine_period_s * state[1],
                left,
            });
            self.between.push(Between {
                interval,
                z,
                points: laid.map(|(point, _)| point),
            });
            self.more.push(laid.map(|(_, place)| place));
        }
    }

    /// Leaves no more of the jerk right beside a knot than at it: samples see both.
    fn leave_around_knots(&mut self) {
        let mut first_between = 0;
        for knot in self.knots.iter().filter(|knot| knot.left < 1.0) {
            let around = knot.interval.saturating_sub(1)..knot.interval + 2;
            let inside = around.start..around.end.min(self.points.len());
            let skipped = self.between[first_between..]
                .iter()
                .take_while(|more| more.interval < around.start);
            first_between += skipped.count();
            let between = self.between[first_between..]
                .iter_mut()
                .take_while(|more| around.contains(&more.interval))
                .map(|more| &mut more.points)
                .zip(&mut self.more[first_between..]);
            let all = self.points[inside.clone()]
                .iter_mut()
                .zip(&mut self.places[inside])
                .chain(between)
                .flat_map(|(points, places)| points.iter_mut().zip(places));
            for (point, place) in all {
                if (place.s_mm - knot.s_mm).abs() <= knot.shown_mm && knot.left < place.jerk {
                    point.jerk_share *= knot.left / place.jerk;
                    place.jerk = knot.left;
                }
            }
        }
    }

    /// Leaves a little more at the start: what the window before does there cannot be changed, and it was asked for at other
    /// places. The intervals are so many times finer than usual.
    pub fn yield_at_start(&mut self, finer: usize) {
        let count = (finer * YIELDING).min(self.points.len());
        let more = self
            .between
            .iter_mut()
            .zip(&mut self.more)
            .take_while(|(more, _)| more.interval < count);
        let more = more.map(|(more, places)| (&mut more.points, places));
        for (points, places) in self.points[..count]
            .iter_mut()
            .zip(&mut self.places)
            .chain(more)
        {
            for (point, place) in points.iter_mut().zip(places) {
                place.yields = true;
                place.most *= YIELDED[0];
                point.most *= YIELDED[0];
                point.acceleration_share = YIELDED[1];
                point.jerk_share *= YIELDED[2];
            }
        }
    }

    /// What slowdowns leave of jerk and speed; false where the speed becomes so much less that the grid is to be laid anew.
    pub fn ease(&mut self, slowdowns: &Slowdowns) -> bool {
        let points = self
            .points
            .iter_mut()
            .chain(self.between.iter_mut().map(|more| &mut more.points));
        let mut least = 1.0f64;
        for (points, places) in points.zip(self.places.iter().chain(&self.more)) {
            for (point, place) in points.iter_mut().zip(places) {
                let [speed, jerk] = slowdowns.at(place.s_mm);
                point.jerk_share = if place.yields {
                    YIELDED[2] * place.jerk * jerk
                } else {
                    place.jerk * jerk
                };
                point.most = place.most * speed * speed;
                least = least.min(speed / place.speed);
            }
        }
        least > SLOWER
    }
}

/// The motion at a place, by the chain rule.
fn place(
    leg: &Leg,
    bounds: &Bounds,
    slowdowns: &Slowdowns,
    ([s_mm, s1, s2, s3], cap): (&[f64; 4], f64),
    at: &AlongPath,
) -> (Point<MAX_AXES>, PlaceBounds) {
    let [speed, jerk_share] = slowdowns.at(*s_mm);
    let mut point = Point {
        jerk_share,
        ..Point::default()
    };
    for lane in 0..bounds.context.limits.axes().len() {
        let x1 = at.direction[lane];
        let x2 = at.curvature[lane];
        let x3 = at.third[lane];
        point.first[lane] = x1 * s1;
        point.second[lane] = x2 * s1 * s1 + x1 * s2;
        point.third[lane] = x3 * s1 * s1 * s1 + 3.0 * x2 * s1 * s2 + x1 * s3;
    }
    let most = if *s1 > 1e-9 {
        (leg.turning_cap_mm_per_s(at, bounds, TURNING).min(cap) / s1).powi(2)
    } else {
        f64::INFINITY
    };
    point.most = speed * speed * most;
    (
        point,
        PlaceBounds {
            s_mm: *s_mm,
            most,
            speed,
            jerk: 1.0,
            yields: false,
        },
    )
}
