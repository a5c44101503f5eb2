//! Planning one window.

use super::corners::{SECTIONS, Spot, Survey};
use super::grade::Grade;
use super::motion::Ramps;
use super::points::ease;
use super::ramp::Tangential;
use super::ramps::{Care, Rounds};
use super::ripple::Corner;
use crate::stream::check::{Look, check};
use crate::stream::slowdown::Slowdowns;
use crate::stream::{Bounds, Cursor, Job, Planning, Route, Window, lay_times, longest_s, window_s};

/// Share of acceleration and jerk of the first try.
const SHARE: f64 = 0.9995;

/// Tries that also take back jerk or speed where single points exceed the jerk.
const LOCAL_TRIES: usize = 10;

/// Tries after which what exceeds limits is slowed where it does, and not by less jerk everywhere.
const EVERYWHERE: usize = 2;

/// Tries of a window in motion; and from rest, where each later one is slower.
const TRIES: [usize; 2] = [12, 18];

/// As published.
pub const CARE: Care = Care {
    look_s: 0.2e-3,
    over: 1e-4,
    rounds: 40,
};

/// Time between places of a line at most, s.
pub const STEP_S: f64 = 0.1;

/// What a try takes back.
#[derive(Clone, Copy, Debug)]
struct Slower {
    /// Factor of the speed caps.
    speed: f64,
    /// Share of the jerk limits.
    jerk: f64,
}

/// The planning of windows; keeps its memory.
#[derive(Debug, Default)]
pub struct Windowed {
    survey: Survey,
    rounds: Rounds,
    slowdowns: Slowdowns,
    grade: Option<Grade>,
}

impl Planning for Windowed {
    type Motion = Ramps;

    fn plan(&mut self, job: &Job<Ramps>, window: &mut Window<Ramps>) -> bool {
        let rests = job.rests();
        let mut slower = Slower {
            speed: 1.0,
            jerk: SHARE,
        };
        self.slowdowns.keep_first(0);
        self.look_around(job, window);
        self.grade.iter_mut().for_each(Grade::level);
        let tries = TRIES[usize::from(rests)];
        for n in 1..=tries {
            if !self.solve(job, &slower, window) {
                return false;
            }
            let known = self.slowdowns.count();
            let mut worst = check(job, window, Look::Samples, &mut self.slowdowns);
            // After some tries samples alone count.
            if worst.is_kept() && (n > LOCAL_TRIES || !self.ease(job, window)) {
                worst = check(job, window, Look::Segments, &mut self.slowdowns);
                if worst.is_kept() {
                    return true;
                }
            }
            let over = worst.acceleration.max(worst.jerk);
            if over > 1.0 && n > EVERYWHERE {
                self.slow_there(known, window);
            } else if over > 1.0 {
                slower.jerk *= (0.995 / over).max(0.8);
            }
            slower.speed *= if rests && !worst.is_kept() && n >= TRIES[0] {
                0.7
            } else {
                1.0
            };
        }
        false
    }
}

impl Windowed {
    /// The path of the window: no try changes what it allows.
    fn look_around(&mut self, job: &Job<Ramps>, window: &mut Window<Ramps>) {
        let Job {
            route,
            bounds,
            start,
            end_mm,
            ..
        } = *job;
        let mut cursor = Cursor::default();
        let speed = start.state.speed_mm_per_s;
        let begin = Corner {
            at_mm: start.state.s_mm,
            speed_mm_per_s: speed,
        };
        let mut look = |at_mm: f64| spot(route, bounds, at_mm, &mut cursor);
        self.survey.sections = SECTIONS;
        window.whole = self
            .survey
            .make(begin, end_mm, window_s(route, speed), &mut look);
        self.survey.keep();
    }

    /// Lowers the speed where samples exceed acceleration or jerk: what ramps with less jerk do not mend is of the path.
    fn slow_there(&mut self, known: usize, window: &Window<Ramps>) {
        let mut limit = self.survey.limit();
        for part in self.slowdowns.since(known).filter(|part| part.jerk < 1.0) {
            let middle_mm = f64::midpoint(part.from_mm, part.to_mm);
            let driven = window
                .at(window.time_at(middle_mm, (0.0, window.duration_s())))
                .speed_mm_per_s;
            // It may be slower there than the limit, which is what becomes lower.
            part.speed = part
                .speed
                .min(part.jerk.cbrt() * (driven / limit.at(middle_mm)).min(1.0));
        }
    }

    /// Less where single points exceed the jerk; false where none does.
    fn ease(&mut self, job: &Job<Ramps>, window: &Window<Ramps>) -> bool {
        let mut limit = self.survey.limit();
        let grade = self.grade.as_mut();
        grade.is_some_and(|grade| {
            ease(
                job,
                &window.motion.0,
                &mut limit,
                grade,
                &mut self.slowdowns,
            )
        })
    }

    /// False where the speed at the start is too high for what follows, or a speed so low that the window has no end.
    fn solve(&mut self, job: &Job<Ramps>, slower: &Slower, window: &mut Window<Ramps>) -> bool {
        let parts = self
            .slowdowns
            .parts()
            .iter()
            .map(|part| ([part.from_mm, part.to_mm], part.speed));
        self.survey.slow(slower.speed, parts);
        let Some(least) = self.survey.tangential else {
            return false;
        };
        let least = Tangential {
            acceleration_mm_per_s2: slower.jerk * least.acceleration_mm_per_s2,
            jerk_mm_per_s3: slower.jerk * least.jerk_mm_per_s3,
        };
        let grade = self.grade.get_or_insert_with(|| Grade::even(least));
        grade.least = least;
        let mut corners = std::mem::take(&mut self.survey.corners);
        let mut limit = self.survey.limit();
        let ramps = &mut window.motion.0;
        self.rounds.make(
            &mut corners,
            self.survey.feed_mm_per_s,
            grade,
            &mut limit,
            &CARE,
            ramps,
        );
        lay_times(
            &mut window.times,
            window.motion.0.iter().map(|ramp| ramp.duration_s),
        );
        self.survey.corners = corners;
        self.survey.corners[0].speed_mm_per_s >= job.start.state.speed_mm_per_s
            && window.times.len() > 1
            && window.duration_s() <= longest_s(job.bounds)
    }
}

fn spot(route: &Route, bounds: &Bounds, at_mm: f64, cursor: &mut Cursor) -> Spot {
    let (at, leg) = route.at(at_mm, cursor);
    let (step_cap, knot_mm) = route.step_cap_mm_per_s(at_mm, bounds, &mut cursor.clone());
    let bend = leg.course.counted_length(&at.curvature).max(1e-9);
    let speed_mm_per_s = leg.cap_mm_per_s(&at, bounds).min(step_cap);
    let step_mm = (0.03 / bend)
        .min(route.smooth_for_mm(at_mm, cursor))
        .clamp(leg.beside_mm(), 0.05);
    // Where a rotary axis turns much on little way, that takes long.
    let max_mm = if leg.course.is_straight() {
        STEP_S * leg.cap_mm_per_s(&at, bounds)
    } else {
        f64::INFINITY
    };
    Spot {
        speed_mm_per_s,
        tangential: Tangential {
            acceleration_mm_per_s2: leg.least.acceleration_mm_per_s2,
            jerk_mm_per_s3: leg.least.jerk_mm_per_s3,
        },
        is_straight: leg.course.is_straight(),
        step_mm: step_mm.min(max_mm),
        knot_mm,
    }
}
