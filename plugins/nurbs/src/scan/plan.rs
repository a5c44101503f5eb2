//! Planning one window.

use tandem_motion::retime::{End, LaneLimits, MAX_LANES, PLACES, Point, Retimer};

use tandem_sdk::AxisVector;

use super::first::First;
use super::motion::{Driven, Rated};
use super::points::ease;
use super::spline::{evaluate, fill};
use crate::stream::check::check;
use crate::stream::relief::Reliefs;
use crate::stream::{Bounds, Cursor, Planning, Route, Start, Window, lay_times, window_s};
use crate::windowed::{Ramps, Windowed};

/// Share of the jerk limits that is used.
const JERK_SHARE: f64 = 0.98;
/// Tries.
const TRIES: usize = 8;
/// Tries after which limits of samples are to be kept, or never will.
const HOPELESS: usize = 6;
/// Intervals of the grid at least.
const MIN_INTERVALS: usize = 40;

/// The planning of windows; keeps its memory.
#[derive(Debug, Default)]
pub struct Scan {
    first: First,
    retimer: Retimer,
    points: Vec<[Point; PLACES]>,
    /// Path coordinates of these.
    places_mm: Vec<[f64; PLACES]>,
    /// Reliefs that lowered the speed when they were made.
    slowed: Option<usize>,
    reliefs: Reliefs,
    /// For paths on which no rate is found.
    windowed: Windowed,
    window: Window<Ramps>,
}

impl Planning for Scan {
    type Motion = Driven;

    fn plan(
        &mut self,
        route: &Route,
        bounds: &Bounds,
        start: &Start,
        end_mm: f64,
        window: &mut Window<Driven>,
    ) -> bool {
        let rests = start.state.speed_mm_per_s == 0.0;
        self.reliefs.keep_first(0);
        // The last try whose samples keep the limits, where single points do not.
        let mut kept = None;
        self.slowed = None;
        for n in 1..=TRIES {
            let known = self.reliefs.count();
            self.solve(route, bounds, start, end_mm, window);
            let worst = check(route, bounds, start, window, &mut self.reliefs);
            if !worst.is_kept() {
                if n >= HOPELESS && kept.is_none() {
                    break;
                }
                continue;
            }
            if n == TRIES || !ease(route, bounds, &window.motion.rated, &mut self.reliefs) {
                return true;
            }
            kept = Some(known);
        }
        if let Some(known) = kept {
            self.reliefs.keep_first(known);
            self.solve(route, bounds, start, end_mm, window);
            return check(route, bounds, start, window, &mut self.reliefs).is_kept();
        }
        rests && self.plan_ramps(route, bounds, start, end_mm, window)
    }
}

impl Scan {
    /// The window as the form `windowed` plans it.
    fn plan_ramps(
        &mut self,
        route: &Route,
        bounds: &Bounds,
        start: &Start,
        end_mm: f64,
        window: &mut Window<Driven>,
    ) -> bool {
        std::mem::swap(&mut self.window.motion, &mut window.motion.ramps);
        let found = self.windowed.plan(route, bounds, start, end_mm, &mut self.window);
        std::mem::swap(&mut self.window.motion, &mut window.motion.ramps);
        window.take_all_but_motion(&mut self.window);
        window.motion.by_ramps = true;
        found
    }

    fn solve(&mut self, route: &Route, bounds: &Bounds, start: &Start, end_mm: f64, window: &mut Window<Driven>) {
        window.motion.by_ramps = false;
        let motion = &mut window.motion.rated;
        let begin = if start.state.speed_mm_per_s == 0.0 { End::Rest } else { End::Moving };
        // A try that takes back nothing but jerk goes on from what there is.
        let slowed = Some(self.reliefs.slowed());
        if self.slowed == slowed {
            self.ease_points();
            std::mem::swap(&mut motion.rate, &mut self.retimer.rate);
            self.retimer.solve_again(&self.points, &lanes(bounds), JERK_SHARE, motion.step_s, (begin, End::Rest));
        } else {
            window.whole = self.make_motion(route, bounds, start, end_mm, motion);
            self.retimer.solve(&self.points, &lanes(bounds), JERK_SHARE, motion.step_s, (begin, End::Rest));
        }
        self.slowed = slowed;
        std::mem::swap(&mut motion.rate, &mut self.retimer.rate);
        let (rate, step_s) = (&motion.rate, motion.step_s);
        lay_times(&mut window.times, (0..rate.intervals()).map(|k| rate.time_s(k, 1.0, step_s)));
    }

    /// The motion in pseudo-time; gives whether it goes to the end.
    fn make_motion(&mut self, route: &Route, bounds: &Bounds, start: &Start, end_mm: f64, motion: &mut Rated) -> bool {
        let window_s = window_s(bounds, start.state.speed_mm_per_s);
        let whole = self.first.make(route, bounds, &self.reliefs, &start.state, (end_mm, window_s));
        let (total_s, end_mm) = self.first.end();
        let intervals = ((total_s / grid_s(bounds)).ceil() as usize).max(MIN_INTERVALS);
        motion.step_s = total_s / intervals as f64;
        fill(&mut motion.coefficients, self.first.motion(), (intervals, motion.step_s), &start.state, end_mm);
        self.fill_points(route, bounds, motion, intervals);
        whole
    }

    /// The motion at the places of the grid, by the chain rule. Where the third derivative of the curve jumps inside an
    /// interval, its places have that of the side which takes more jerk.
    fn fill_points(&mut self, route: &Route, bounds: &Bounds, motion: &Rated, intervals: usize) {
        self.points.clear();
        self.places_mm.clear();
        let (mut cursor, lanes) = (Cursor::default(), bounds.context.limits.axes().len());
        for k in 0..intervals {
            let states = [0.0, 0.5, 1.0].map(|z| evaluate(&motion.coefficients, k, z, motion.step_s));
            let knot = route.knot([states[0][0], states[2][0]], &mut cursor);
            self.places_mm.push(states.map(|state| state[0]));
            self.points.push(states.map(|[s, s1, s2, s3]| {
                let (at, leg) = route.at(s, &mut cursor);
                let [speed, jerk_share] = self.reliefs.at(s);
                let mut point = Point { jerk_share, ..Point::default() };
                for lane in 0..lanes {
                    let (x1, x2) = (at.direction[lane], at.curvature[lane]);
                    point.first[lane] = x1 * s1;
                    point.second[lane] = x2 * s1 * s1 + x1 * s2;
                    let jerk = |third: &AxisVector| third[lane] * s1 * s1 * s1 + 3.0 * x2 * s1 * s2 + x1 * s3;
                    let larger = |a: f64, b: f64| if b.abs() > a.abs() { b } else { a };
                    let sides = knot.iter().flat_map(|(_, sides)| sides);
                    point.third[lane] = sides.map(|side| jerk(&side.third)).fold(jerk(&at.third), larger);
                }
                if s1 > 1e-9 {
                    point.most = (speed * leg.cap_mm_per_s(&at, bounds) / s1).powi(2);
                }
                point
            }));
        }
    }

    /// The shares of the jerk anew.
    fn ease_points(&mut self) {
        for (points, places_mm) in self.points.iter_mut().zip(&self.places_mm) {
            for (point, s_mm) in points.iter_mut().zip(places_mm) {
                point.jerk_share = self.reliefs.at(*s_mm)[1];
            }
        }
    }
}

/// Grid of pseudo-time, s: a fifth of the time in which an acceleration is built up.
fn grid_s(bounds: &Bounds) -> f64 {
    let axes = bounds.context.limits.axes().iter();
    let build_up_s = axes.map(|a| a.acceleration_mm_per_s2 / a.jerk_mm_per_s3).fold(f64::INFINITY, f64::min);
    let period_s = bounds.context.fine_period_s;
    (build_up_s / 5.0).clamp(period_s, (3.0 * period_s).max(0.008))
}

fn lanes(bounds: &Bounds) -> LaneLimits {
    let axes = bounds.context.limits.axes();
    let all = |of: fn(&tandem_sdk::AxisLimits) -> f64| -> [f64; MAX_LANES] {
        std::array::from_fn(|i| axes.get(i).map_or(f64::INFINITY, of))
    };
    LaneLimits { lanes: axes.len(), acceleration: all(|a| a.acceleration_mm_per_s2), jerk: all(|a| a.jerk_mm_per_s3) }
}
