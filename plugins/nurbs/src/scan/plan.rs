//! Planning one window.

use tandem_motion::retime::{End, LaneLimits, MAX_LANES, PLACES, Point, Retimer};

use super::motion::Rated;
use super::points::{Slow, slow_down};
use super::spline::{evaluate, fill};
use super::timing::Timing;
use crate::stream::check::check;
use crate::stream::{Bounds, Cursor, Planning, Route, Slower, Start, TRIES, Window, lay_times, lower, window_s};

/// Jerk share of the first try.
const JERK_SHARE: f64 = 0.98;
/// Tries that also lower the speed where single points exceed the jerk; then samples alone count.
const LOCAL_TRIES: usize = 5;
/// Intervals of the grid at least.
const MIN_INTERVALS: usize = 8;

/// The planning of windows; keeps its memory.
#[derive(Debug, Default)]
pub struct Scan {
    timing: Timing,
    retimer: Retimer,
    points: Vec<[Point; PLACES]>,
    slow: Vec<Slow>,
}

impl Planning for Scan {
    type Motion = Rated;

    fn plan(&mut self, route: &Route, bounds: &Bounds, start: &Start, end_mm: f64, window: &mut Window<Rated>) -> bool {
        let rests = start.state.speed_mm_per_s == 0.0;
        let mut slower = Slower { speed: 1.0, jerk: JERK_SHARE };
        let tries = TRIES[usize::from(rests)];
        self.slow.clear();
        // The last try whose samples keep the limits, where single points do not.
        let mut kept = None;
        for n in 1..=tries {
            self.solve(route, bounds, &slower, start, end_mm, window);
            let worst = check(route, bounds, start, window);
            let known = self.slow.len();
            let points_over = n < LOCAL_TRIES && slow_down(route, bounds, &window.motion, &mut self.slow);
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
        check(route, bounds, start, window).is_kept()
    }
}

impl Scan {
    fn solve(
        &mut self,
        route: &Route,
        bounds: &Bounds,
        slower: &Slower,
        start: &Start,
        end_mm: f64,
        window: &mut Window<Rated>,
    ) {
        let window_s = window_s(bounds, start.state.speed_mm_per_s);
        window.whole = self.timing.make(route, bounds, slower, &start.state, (end_mm, window_s));
        let steps = &self.timing.steps;
        let total_s = steps[steps.len() - 1].0;
        let intervals = ((total_s / grid_s(bounds)).ceil() as usize).max(MIN_INTERVALS);
        let motion = &mut window.motion;
        let step_s = total_s / intervals as f64;
        motion.step_s = step_s;
        fill(&mut motion.coefficients, steps, intervals, step_s, &start.state);
        self.fill_points(route, bounds, slower, motion, intervals);
        let begin = if start.state.speed_mm_per_s == 0.0 { End::Rest } else { End::Moving };
        self.retimer.solve(&self.points, &lanes(bounds), slower.jerk, step_s, (begin, End::Rest));
        std::mem::swap(&mut motion.rate, &mut self.retimer.rate);
        let rate = &motion.rate;
        lay_times(&mut window.times, (0..intervals).map(|k| rate.time_s(k, 1.0, step_s)));
    }

    /// The motion at the places of the grid, by the chain rule.
    fn fill_points(&mut self, route: &Route, bounds: &Bounds, slower: &Slower, motion: &Rated, intervals: usize) {
        self.points.clear();
        let (mut cursor, lanes) = (Cursor::default(), bounds.context.axes.count());
        for k in 0..intervals {
            self.points.push([0.0, 0.5, 1.0].map(|z| {
                let [s, s1, s2, s3] = evaluate(&motion.coefficients, k, z, motion.step_s);
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
