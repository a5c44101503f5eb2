//! Planning one window.

use tandem_motion::retime::{ASKED, AnyRetimer, Asked, AxisLimits, End, Task};
use tandem_sdk::MAX_AXES;

use super::first::First;
use super::grid::Grid;
use super::motion::{Driven, Rated};
use super::points::ease;
use super::spline::fill;
use crate::stream::check::{Look, check};
use crate::stream::slowdown::Slowdowns;
use crate::stream::{Bounds, Job, Motion as _, Planning, Window, lay_times, longest_s};
use crate::windowed::{Ramps, Windowed};

/// Share of the jerk limits that is used: along the first timing, and along the motion that was found on it.
const JERK_SHARE: f64 = 0.975;
const FOUND_JERK_SHARE: f64 = 0.996;
/// Share of the acceleration limits that is used: between the places asked for it changes a little.
const ACCELERATION_SHARE: f64 = 0.99;
/// How much finer the grid is on a motion that was found, and along a first timing whose motion is only followed.
const FINER: f64 = 2.0;
const COARSER: f64 = 0.6;
/// How often what was found is followed at most, and the share of its time that it has to come to for another time.
const FOLLOWED: usize = 4;
const FASTER: f64 = 0.98;
/// How near to the least time what is only followed comes, and in how many iterations: where no rate keeps the limits on the way to
/// it, one is sought along what was found. And how near what is followed again.
const ROUGHLY: Asked = Asked {
    gap: 1e-3,
    iterations: 12,
    ..ASKED
};
const FOLLOWING: Asked = Asked { gap: 3e-4, ..ASKED };
/// How much faster than a first timing a knot may be passed, and than a motion that was found.
const FASTER_AT_KNOT: f64 = 1.2;
const FOUND_FASTER_AT_KNOT: f64 = 1.1;
/// Tries.
const TRIES: usize = 10;
/// Tries after which limits of samples are to be kept, or never will.
const HOPELESS: usize = 8;
/// Violation of a row, whose right side is 1 at a rate of 1, of which two tries of a window in motion come to nothing.
const LOST: f64 = 0.1;
/// A solution so short, s, or that takes more than this share of the ramps it began with, is compared with ramps that keep
/// every limit: ramps that keep them take no less than those did. With 0.95 planning of curves within the limits of the paper takes
/// 1.4 times the instructions and no program of the rows of `tandem-optimum` another time; with 1.05 a curve of
/// `random_curves_are_driven` takes 4 % longer than with ramps.
const SHORT_S: f64 = 0.15;
const RAMPS_SHARE: f64 = 1.0;
/// A window may take this many times as long as the ramps it began with, and as much longer as is short. What is slower than that
/// has found next to no rate for some place: to rest, and from there on a shorter way or by ramps, is faster.
const SLOWEST: f64 = 4.0;
/// Longest interval of the grid, s, unless three fine periods are longer.
const MAX_GRID_S: f64 = 5e-3;
/// Intervals of the grid at least, and at most: a motion slower than that is planned on a coarser one.
const MIN_INTERVALS: usize = 40;
const MAX_INTERVALS: usize = 20_000;

/// The planning of windows; keeps its memory.
#[derive(Debug, Default)]
pub struct Scan {
    first: First,
    /// Time of the first timing of a window without slowdowns, s.
    begun_s: f64,
    retimer: AnyRetimer,
    grid: Grid,
    slowdowns: Slowdowns,
    /// For paths on which no rate is found.
    windowed: Windowed,
    window: Window<Ramps>,
    /// What was found from the first timing.
    found: Window<Driven>,
}

/// The motion in pseudo-time along which a rate is sought.
#[derive(Clone, Copy, PartialEq)]
enum From {
    FirstTiming,
    /// The same, where what is found is only followed.
    Roughly,
    Found,
}

impl From {
    fn jerk_share(self) -> f64 {
        match self {
            Self::FirstTiming | Self::Roughly => JERK_SHARE,
            Self::Found => FOUND_JERK_SHARE,
        }
    }

    /// How much faster a knot may be passed.
    fn faster_at_knot(self) -> f64 {
        match self {
            Self::FirstTiming | Self::Roughly => FASTER_AT_KNOT,
            Self::Found => FOUND_FASTER_AT_KNOT,
        }
    }

    /// What is asked of a solution that does not go on from another one.
    fn asked(self) -> Asked {
        match self {
            Self::FirstTiming => ASKED,
            Self::Roughly => ROUGHLY,
            Self::Found => FOLLOWING,
        }
    }

    /// How much finer the grid is than usual.
    fn finer(self) -> f64 {
        match self {
            Self::FirstTiming => 1.0,
            Self::Roughly => COARSER,
            Self::Found => FINER,
        }
    }
}

impl Planning for Scan {
    type Motion = Driven;

    fn plan(&mut self, job: &Job<Driven>, window: &mut Window<Driven>) -> bool {
        let found = self.plan_rate(job, window);
        let slow_s = if found {
            window.duration_s()
        } else {
            f64::INFINITY
        };
        // A path so short and sharp that limits between samples count most.
        let doubtful =
            slow_s < SHORT_S || slow_s > RAMPS_SHARE * self.begun_s || slow_s > long_s(job, window);
        if job.rests() && doubtful {
            return self.plan_ramps(job, window, slow_s) || found;
        }
        found
    }
}

impl Scan {
    /// The window at the rate that the limits allow; false where no try keeps them.
    fn plan_rate(&mut self, job: &Job<Driven>, window: &mut Window<Driven>) -> bool {
        if is_gentle(job.bounds) && self.plan_twice(job, window) {
            return true;
        }
        self.slowdowns.keep_first(0);
        self.keeps(job, window, From::FirstTiming)
    }

    /// A rate along the first timing, whatever that exceeds between the places of its grid, and another one along the motion that was
    /// found: at rates near 1 less of a limit is lost to its linear form. False where no try of the second keeps the limits.
    fn plan_twice(&mut self, job: &Job<Driven>, window: &mut Window<Driven>) -> bool {
        self.slowdowns.keep_first(0);
        window.whole = self.make_motion((job, From::Roughly), &mut window.motion.rated);
        self.solve(job, (From::Roughly, false), window);
        self.begun_s = self.first.end().0;
        let rate = &window.motion.rated.rate;
        let is_motion = (0..rate.intervals()).all(|k| rate.least(k).1 > 0.0);
        if !is_motion || !window.duration_s().is_finite() || self.crawls(job, window) {
            return false;
        }
        self.keeps(job, window, From::Found)
    }

    /// The rate along the motion of `window`, and along what comes of that, as long as it becomes much faster. Gives by how much
    /// the last one violates a row.
    fn follow(&mut self, job: &Job<Driven>, window: &mut Window<Driven>) -> f64 {
        let mut over = 0.0;
        for _ in 0..FOLLOWED {
            std::mem::swap(window, &mut self.found);
            self.follow_found(job, window);
            over = self.solve(job, (From::Found, false), window);
            let duration_s = window.duration_s();
            if !duration_s.is_finite() || duration_s > FASTER * self.found.duration_s() {
                break;
            }
        }
        over
    }

    /// Tries rates until limits are kept, one that begins at a motion and others that take something back; false where none does.
    fn keeps(&mut self, job: &Job<Driven>, window: &mut Window<Driven>, from: From) -> bool {
        // The last try whose samples keep the limits, where single points do not.
        let mut kept = None;
        let mut over_before = 0.0;
        for n in 1..=TRIES {
            let known = self.slowdowns.count();
            let again = n > 1 && self.grid.ease(&self.slowdowns);
            if !again {
                match from {
                    From::FirstTiming | From::Roughly => {
                        window.whole = self.make_motion((job, from), &mut window.motion.rated);
                    }
                    From::Found if n == 1 => {}
                    From::Found => self.follow_found(job, window),
                }
            }
            let over = if n == 1 && from == From::Found {
                self.follow(job, window)
            } else {
                self.solve(job, (from, again), window)
            };
            if n == 1 && from == From::FirstTiming {
                self.begun_s = self.first.end().0;
            }
            // The window before is driven on, and the next one begins where it is easier.
            let is_lost = !job.rests() && over.min(over_before) > LOST;
            over_before = over;
            if is_lost || self.crawls(job, window) {
                break;
            }
            let kept_all = !self.dips(job, window)
                && check(job, window, Look::Segments, &mut self.slowdowns).is_kept();
            if !kept_all {
                if n >= HOPELESS && kept.is_none() {
                    break;
                }
                let rated = &window.motion.rated;
                self.grid
                    .look_between(job.route, job.bounds, rated, &self.slowdowns, known);
                continue;
            }
            if n == TRIES
                || !ease(
                    job.route,
                    job.bounds,
                    &window.motion.rated,
                    &mut self.slowdowns,
                )
            {
                return true;
            }
            kept = Some(known);
        }
        if let Some(known) = kept {
            self.slowdowns.keep_first(known);
            match from {
                From::FirstTiming | From::Roughly => {
                    window.whole = self.make_motion((job, from), &mut window.motion.rated);
                }
                From::Found => {
                    self.grid.ease(&self.slowdowns);
                }
            }
            self.solve(job, (from, false), window);
            return !self.dips(job, window)
                && check(job, window, Look::Segments, &mut self.slowdowns).is_kept();
        }
        false
    }

    /// Whether the solution is slower than any motion is to be.
    fn crawls(&self, job: &Job<Driven>, window: &Window<Driven>) -> bool {
        let duration_s = window.duration_s();
        // One without a value is for the check, which lowers the speed there.
        duration_s.is_finite()
            && duration_s > longest_s(job.bounds).min(SLOWEST * self.begun_s + SHORT_S)
    }

    /// Whether the rate falls to zero somewhere, which it may between the places of the grid: then there are more of them.
    fn dips(&mut self, job: &Job<Driven>, window: &Window<Driven>) -> bool {
        let rated = &window.motion.rated;
        let mut found = false;
        for k in 0..rated.rate.intervals() {
            let (z, least) = rated.rate.least(k);
            if least <= 0.0 {
                self.grid
                    .look_closer(job.route, job.bounds, rated, &self.slowdowns, (k, z));
                found = true;
            }
        }
        found
    }

    /// The window as the form `windowed` plans it, where that takes less than `below_s`.
    fn plan_ramps(&mut self, job: &Job<Driven>, window: &mut Window<Driven>, below_s: f64) -> bool {
        let Job {
            route,
            bounds,
            start,
            driven,
            end_mm,
            ..
        } = *job;
        std::mem::swap(&mut self.window.motion, &mut window.motion.ramps);
        let found = self.windowed.plan(
            &Job {
                route,
                bounds,
                start,
                driven,
                end_mm,
                before: None,
            },
            &mut self.window,
        );
        std::mem::swap(&mut self.window.motion, &mut window.motion.ramps);
        let found = found && self.window.duration_s() < below_s;
        if found {
            window.take_all_but_motion(&mut self.window);
            window.motion.by_ramps = true;
        }
        found
    }

    /// A rate on the motion there is, from the rate before where that was about the same. Gives by how much it violates a row.
    fn solve(
        &mut self,
        job: &Job<Driven>,
        (from, again): (From, bool),
        window: &mut Window<Driven>,
    ) -> f64 {
        window.motion.by_ramps = false;
        let motion = &mut window.motion.rated;
        let begin = if job.rests() { End::Rest } else { End::Moving };
        let task = Task {
            points: &self.grid.points,
            between: &self.grid.between,
            limits: limits(job.bounds, from.jerk_share()),
            step_s: motion.step_s,
            ends: (begin, End::Rest),
        };
        let status = if again {
            std::mem::swap(&mut motion.rate, &mut self.retimer.rate);
            self.retimer.solve_again(&task)
        } else {
            self.retimer.solve_to(&task, &from.asked())
        };
        std::mem::swap(&mut motion.rate, &mut self.retimer.rate);
        let rate = &motion.rate;
        let step_s = motion.step_s;
        lay_times(
            &mut window.times,
            (0..rate.intervals()).map(|k| rate.time_s(k, 1.0, step_s)),
        );
        status.violation
    }

    /// The motion in pseudo-time; gives whether it goes to the end.
    fn make_motion(&mut self, (job, from): (&Job<Driven>, From), motion: &mut Rated) -> bool {
        let whole = self.first.make(job, &self.slowdowns);
        let (total_s, end_mm) = self.first.end();
        let intervals = intervals(total_s, job.bounds, from);
        motion.step_s = total_s / intervals as f64;
        let grid = (intervals, motion.step_s);
        fill(
            &mut motion.coefficients,
            self.first.motion(job),
            grid,
            &job.start.state,
            end_mm,
        );
        self.lay(job, motion, intervals, from);
        whole
    }

    /// The motion that was found, in its own time.
    fn follow_found(&mut self, job: &Job<Driven>, window: &mut Window<Driven>) {
        let found = &self.found;
        let total_s = found.duration_s();
        let intervals = intervals(total_s, job.bounds, From::Found);
        let motion = &mut window.motion.rated;
        motion.step_s = total_s / intervals as f64;
        let at = |t_s: f64| {
            let state = found.at(t_s.clamp(0.0, total_s));
            [state.s_mm, state.acceleration_mm_per_s2]
        };
        fill(
            &mut motion.coefficients,
            at,
            (intervals, motion.step_s),
            &job.start.state,
            found.motion.end_mm(),
        );
        window.whole = found.whole;
        self.lay(job, motion, intervals, From::Found);
    }

    fn lay(&mut self, job: &Job<Driven>, motion: &Rated, intervals: usize, from: From) {
        let faster = from.faster_at_knot();
        self.grid.lay(
            job.route,
            job.bounds,
            motion,
            (intervals, faster),
            &self.slowdowns,
        );
        if !job.rests() {
            self.grid.yield_at_start(from.finer().ceil() as usize);
        }
    }
}

/// Intervals of the grid for a motion of `total_s`.
fn intervals(total_s: f64, bounds: &Bounds, from: From) -> usize {
    ((from.finer() * total_s / grid_s(bounds)).ceil() as usize).clamp(MIN_INTERVALS, MAX_INTERVALS)
}

/// A time that is long for the way of a window from rest, s: several times that of a line. The first timing says nothing of hairpins
/// that are smaller than its steps.
fn long_s(job: &Job<Driven>, window: &Window<Driven>) -> f64 {
    let least = job.route.front().least;
    let way_mm = window.motion.end_mm() - job.start.state.s_mm;
    SLOWEST
        * (way_mm / job.route.front().feed_mm_per_s.min(least.speed_mm_per_s)
            + 2.0 * (way_mm / least.acceleration_mm_per_s2).sqrt()
            + (32.0 * way_mm / least.jerk_mm_per_s3).cbrt())
}

/// Grid of pseudo-time, s: a quarter of the time in which an acceleration is built up.
fn grid_s(bounds: &Bounds) -> f64 {
    wanted_grid_s(bounds).clamp(bounds.context.fine_period_s, max_grid_s(bounds))
}

/// Whether accelerations are built up so slowly that the grid is finer than it had to be: then the jerk bounds most of a window, the
/// rate along the first timing is far from 1, and a window that is planned once more is 1 % faster. Elsewhere it is not, and planning
/// has no time for it.
fn is_gentle(bounds: &Bounds) -> bool {
    wanted_grid_s(bounds) > max_grid_s(bounds)
}

fn wanted_grid_s(bounds: &Bounds) -> f64 {
    let axes = bounds.context.limits.axes().iter();
    axes.map(|a| a.acceleration_mm_per_s2 / a.jerk_mm_per_s3)
        .fold(f64::INFINITY, f64::min)
        / 4.0
}

fn max_grid_s(bounds: &Bounds) -> f64 {
    (3.0 * bounds.context.fine_period_s).max(MAX_GRID_S)
}

/// The limits as far as the grid uses them.
fn limits(bounds: &Bounds, jerk_share: f64) -> AxisLimits {
    let axes = bounds.context.limits.axes();
    let all = |of: &dyn Fn(&tandem_sdk::AxisLimits) -> f64| -> [f64; MAX_AXES] {
        std::array::from_fn(|i| axes.get(i).map_or(f64::INFINITY, of))
    };
    AxisLimits {
        count: axes.len(),
        acceleration_mm_per_s2: all(&|a| ACCELERATION_SHARE * a.acceleration_mm_per_s2),
        jerk_mm_per_s3: all(&|a| jerk_share * a.jerk_mm_per_s3),
    }
}
