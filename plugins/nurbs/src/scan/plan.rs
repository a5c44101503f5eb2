//! Planning one window.

use tandem_motion::retime::{End, LaneLimits, MAX_LANES, PLACES, Point, Retimer};
use tandem_sdk::AxisVector;

use super::check::{self, Slow, Worst};
use super::route::{Bounds, Cursor, Route};
use super::spline::{evaluate, fill};
use super::timing::Timing;
use super::window::Window;

/// Time of a window at least, s.
const WINDOW_S: f64 = 1.0;
/// Jerk share of the first try.
const JERK_SHARE: f64 = 0.98;
/// Tries in motion; and from rest, where each later one is slower.
const TRIES: [usize; 2] = [6, 24];
/// Tries that also lower the speed where single points exceed the jerk; then samples alone count.
const LOCAL_TRIES: usize = 5;
/// Intervals of the grid at least.
const MIN_INTERVALS: usize = 8;

/// A state on the path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    pub s_mm: f64,
    pub speed_mm_per_s: f64,
    pub acceleration_mm_per_s2: f64,
}

/// What a try takes back.
#[derive(Clone, Copy, Debug)]
pub struct Slower {
    /// Factor of the speed caps.
    pub speed: f64,
    /// Share of the jerk limits.
    pub jerk: f64,
}

/// From where a window is planned.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    pub state: State,
    /// The last three samples, and when the next one comes, s.
    pub history: [AxisVector; 3],
    pub first_tick_s: f64,
}

/// The planning of windows; keeps its memory.
#[derive(Debug, Default)]
pub struct Planning {
    timing: Timing,
    retimer: Retimer,
    points: Vec<[Point; PLACES]>,
    slow: Vec<Slow>,
}

impl Planning {
    /// Plans from `start` towards `end_mm` into `window`; false where no try keeps the limits.
    pub fn plan(&mut self, route: &Route, bounds: &Bounds, start: &Start, end_mm: f64, window: &mut Window) -> bool {
        let rests = start.state.speed_mm_per_s == 0.0;
        let mut slower = Slower { speed: 1.0, jerk: JERK_SHARE };
        let tries = TRIES[usize::from(rests)];
        self.slow.clear();
        // The last try whose samples keep the limits, where single points do not.
        let mut kept = None;
        for n in 1..=tries {
            self.solve(route, bounds, &slower, start, end_mm, window);
            let worst = check::check(route, bounds, start, window);
            let known = self.slow.len();
            let points_over = n < LOCAL_TRIES && check::slow_down(route, bounds, window, &mut self.slow);
            if worst.is_kept() && !points_over {
                return true;
            }
            if worst.is_kept() {
                kept = Some((slower, known));
            } else if n >= LOCAL_TRIES && kept.is_some() {
                break;
            }
            slower = lower(slower, &worst, rests && !worst.is_kept() && n >= TRIES[0]);
        }
        let Some((slower, known)) = kept else { return false };
        self.slow.truncate(known);
        self.solve(route, bounds, &slower, start, end_mm, window);
        check::check(route, bounds, start, window).is_kept()
    }

    fn solve(
        &mut self,
        route: &Route,
        bounds: &Bounds,
        slower: &Slower,
        start: &Start,
        end_mm: f64,
        window: &mut Window,
    ) {
        let window_s = window_s(bounds, start.state.speed_mm_per_s);
        window.whole = self.timing.make(route, bounds, slower, &start.state, (end_mm, window_s));
        let steps = &self.timing.steps;
        let total_s = steps[steps.len() - 1].0;
        let intervals = ((total_s / grid_s(bounds)).ceil() as usize).max(MIN_INTERVALS);
        window.step_s = total_s / intervals as f64;
        fill(&mut window.coefficients, steps, intervals, window.step_s, &start.state);
        self.fill_points(route, bounds, slower, window, intervals);
        let begin = if start.state.speed_mm_per_s == 0.0 { End::Rest } else { End::Moving };
        self.retimer.solve(&self.points, &lanes(bounds), slower.jerk, window.step_s, (begin, End::Rest));
        std::mem::swap(&mut window.rate, &mut self.retimer.rate);
        window.lay_times();
    }

    /// The motion at the places of the grid, by the chain rule.
    fn fill_points(&mut self, route: &Route, bounds: &Bounds, slower: &Slower, window: &Window, intervals: usize) {
        self.points.clear();
        let (mut cursor, lanes) = (Cursor::default(), bounds.context.axes.count());
        for k in 0..intervals {
            self.points.push([0.0, 0.5, 1.0].map(|z| {
                let [s, s1, s2, s3] = evaluate(&window.coefficients, k, z, window.step_s);
                let (at, leg) = route.at(s, &mut cursor);
                let mut point = Point::default();
                for lane in 0..lanes {
                    let (x1, x2, x3) = (at.direction[lane], at.curvature[lane], at.third[lane]);
                    point.first[lane] = x1 * s1;
                    point.second[lane] = x2 * s1 * s1 + x1 * s2;
                    point.third[lane] = x3 * s1 * s1 * s1 + 3.0 * x2 * s1 * s2 + x1 * s3;
                }
                if s1 > 1e-9 {
                    let mut cap = slower.speed * leg.cap_mm_per_s(&at, bounds);
                    for slow in self.slow.iter().filter(|slow| slow.from_mm <= s && s <= slow.to_mm) {
                        cap = cap.min(slow.speed_mm_per_s);
                    }
                    point.most = (cap / s1).powi(2);
                }
                point
            }));
        }
    }
}

/// What the next try takes back: what was exceeded, in proportion, and everything where that did not help.
fn lower(slower: Slower, worst: &Worst, all: bool) -> Slower {
    let mut next = slower;
    if worst.jerk > 1.0 || worst.acceleration > 1.0 {
        next.jerk *= (0.995 / worst.jerk.max(worst.acceleration)).max(0.8);
    }
    if worst.speed > 1.0 || all {
        let share = if all { 0.7 } else { (0.998 / worst.speed).max(0.8) };
        next.speed *= share;
    }
    next
}

/// Grid of pseudo-time, s: a fifth of the time in which an acceleration is built up.
fn grid_s(bounds: &Bounds) -> f64 {
    let axes = bounds.context.limits.axes().iter();
    let build_up_s = axes.map(|a| a.acceleration_mm_per_s2 / a.jerk_mm_per_s3).fold(f64::INFINITY, f64::min);
    let period_s = bounds.context.fine_period_s;
    (build_up_s / 5.0).clamp(period_s, (3.0 * period_s).max(0.008))
}

/// Time of a window, s: three stops from `speed_mm_per_s`.
fn window_s(bounds: &Bounds, speed_mm_per_s: f64) -> f64 {
    let stop_s = |a: &tandem_sdk::AxisLimits| {
        speed_mm_per_s / a.acceleration_mm_per_s2 + a.acceleration_mm_per_s2 / a.jerk_mm_per_s3
    };
    bounds.context.limits.axes().iter().map(|a| 3.0 * stop_s(a)).fold(WINDOW_S, f64::max)
}

fn lanes(bounds: &Bounds) -> LaneLimits {
    let axes = bounds.context.limits.axes();
    let all = |of: fn(&tandem_sdk::AxisLimits) -> f64| -> [f64; MAX_LANES] {
        std::array::from_fn(|i| axes.get(i).map_or(f64::INFINITY, of))
    };
    LaneLimits { lanes: axes.len(), acceleration: all(|a| a.acceleration_mm_per_s2), jerk: all(|a| a.jerk_mm_per_s3) }
}
