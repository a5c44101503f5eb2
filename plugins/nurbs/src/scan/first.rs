//! The first timing of a window: ramps between corners, as the form `windowed` drives them.

use super::motion::Driven;
use super::timing::Timing;
use crate::stream::slowdown::Slowdowns;
use crate::stream::{Bounds, Cursor, Job, Route, State, window_s};
use crate::windowed::{Care, Corner, Grade, Limit, Ramp, Rounds, STEP_S, Spot, Survey, Tangential};

/// Multiples of acceleration and jerk that ramps take where the speed at the start is too high for less: in motion the
/// window before may brake in less way than a cubic ramp.
const HASTE: [f64; 4] = [1.0, 1.25, 1.6, 2.2];

/// Distance of places at least, unless the leg is shorter than many of them: with its ends alone, where it turns back on next to no
/// radius, it would be driven as slowly as these are passed; and at most, mm.
const MIN_STEP_MM: f64 = 2e-3;
const STEP_SHARE: f64 = 0.03;
const MAX_STEP_MM: f64 = 0.3;

/// Roughly: what exceeds a limit is found later.
const CARE: Care = Care {
    look_s: 1e-3,
    over: 0.01,
    rounds: 8,
};

/// A timing; keeps its memory.
#[derive(Debug, Default)]
pub struct First {
    survey: Survey,
    rounds: Rounds,
    corners: Vec<Corner>,
    ramps: Vec<Ramp>,
    /// Where the speed at the start is too high for ramps.
    steps: Timing,
    /// Time for which it follows the window before, s.
    lead_s: f64,
}

impl First {
    /// To rest at the end of the run or of the window. In motion it follows the window that is driven for the lead. Gives
    /// whether it goes to the end.
    pub fn make(&mut self, job: &Job<Driven>, slowdowns: &Slowdowns) -> bool {
        let Job {
            route,
            bounds,
            start,
            end_mm,
            before,
            ..
        } = *job;
        self.lead_s = before.map_or(0.0, |(window, now_s)| {
            window.motion.lead_s(&window.times, now_s)
        });
        let start = &before.map_or(start.state, |(window, now_s)| {
            window.at(now_s + self.lead_s)
        });
        let window_s = window_s(route, start.speed_mm_per_s);
        let mut cursor = Cursor::default();
        let mut look = |at_mm: f64| spot(route, bounds, slowdowns, at_mm, &mut cursor);
        let begin = Corner {
            at_mm: start.s_mm,
            speed_mm_per_s: start.speed_mm_per_s,
        };
        let whole = self.survey.make(begin, end_mm, window_s, &mut look);
        self.steps.steps.clear();
        if HASTE.iter().any(|haste| self.ramp(start, *haste)) {
            return whole;
        }
        self.steps
            .make(route, bounds, slowdowns, start, (end_mm, window_s))
    }

    /// The ramps, with a multiple of acceleration and jerk; false where the speed at the start is too high for them.
    fn ramp(&mut self, start: &State, haste: f64) -> bool {
        let Some(Tangential {
            acceleration_mm_per_s2: a,
            jerk_mm_per_s3: j,
        }) = self.survey.tangential
        else {
            return false;
        };
        let tangential = Tangential {
            acceleration_mm_per_s2: haste * a,
            jerk_mm_per_s3: haste * j,
        };
        self.corners.clone_from(&self.survey.corners);
        let mut limit = Limit::new(&self.survey.places);
        let grade = Grade::even(tangential);
        self.rounds.make(
            &mut self.corners,
            self.survey.feed_mm_per_s,
            &grade,
            &mut limit,
            &CARE,
            &mut self.ramps,
        );
        self.corners[0].speed_mm_per_s >= start.speed_mm_per_s && !self.ramps.is_empty()
    }

    /// Its duration, s, and where it ends, mm.
    pub fn end(&self) -> (f64, f64) {
        if let Some((time_s, end_mm)) = self.steps.steps.last() {
            return (self.lead_s + *time_s, *end_mm);
        }
        let end_mm = self
            .ramps
            .last()
            .map_or(0.0, |ramp| ramp.at(ramp.duration_s)[0]);
        (
            self.lead_s + self.ramps.iter().map(|ramp| ramp.duration_s).sum::<f64>(),
            end_mm,
        )
    }

    /// Path coordinate and acceleration over time, asked for in order.
    pub fn motion(&self, job: &Job<Driven>) -> impl FnMut(f64) -> [f64; 2] {
        let mut at = 0;
        let mut start_s = self.lead_s;
        move |t_s| {
            if let Some((window, now_s)) = job.before.filter(|_| t_s < self.lead_s) {
                let state = window.at((now_s + t_s).max(0.0));
                return [state.s_mm, state.acceleration_mm_per_s2];
            }
            if !self.steps.steps.is_empty() {
                return [self.steps.at(t_s - self.lead_s, &mut at), 0.0];
            }
            while at + 1 < self.ramps.len() && start_s + self.ramps[at].duration_s < t_s {
                start_s += self.ramps[at].duration_s;
                at += 1;
            }
            let ramp = &self.ramps[at];
            let [s_mm, _, acceleration, _] = ramp.at((t_s - start_s).clamp(0.0, ramp.duration_s));
            [s_mm, acceleration]
        }
    }
}

fn spot(
    route: &Route,
    bounds: &Bounds,
    slowdowns: &Slowdowns,
    at_mm: f64,
    cursor: &mut Cursor,
) -> Spot {
    let (at, leg) = route.at(at_mm, cursor);
    let (step_cap, knot_mm) = route.step_cap_mm_per_s(at_mm, bounds, &mut cursor.clone());
    let bend = leg.course.counted_length(&at.curvature).max(1e-9);
    let cap = leg.smooth_cap_mm_per_s(&at, bounds);
    let least_mm = MIN_STEP_MM.min(STEP_SHARE * (leg.end_mm - leg.start_mm));
    let step_mm = (0.15 / bend)
        .min(route.smooth_for_mm(at_mm, cursor))
        .clamp(least_mm, MAX_STEP_MM);
    let max_mm = if leg.course.is_straight() {
        STEP_S * cap
    } else {
        f64::INFINITY
    };
    Spot {
        speed_mm_per_s: slowdowns.at(at_mm)[0] * cap.min(step_cap),
        tangential: Tangential {
            acceleration_mm_per_s2: leg.least.acceleration_mm_per_s2,
            jerk_mm_per_s3: leg.least.jerk_mm_per_s3,
        },
        is_straight: leg.course.is_straight(),
        step_mm: step_mm.min(max_mm),
        knot_mm,
    }
}
