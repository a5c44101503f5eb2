//! Planning one window.

use super::corners::{Spot, Survey};
use super::motion::Ramps;
use super::ramp::Tangential;
use super::ramps::Rounds;
use super::ripple::Corner;
use crate::stream::check::check;
use crate::stream::{Bounds, Cursor, Planning, Route, Slower, Start, TRIES, Window, lay_times, lower, window_s};

/// Share of acceleration and jerk of the first try.
const SHARE: f64 = 0.9995;

/// The planning of windows; keeps its memory.
#[derive(Debug, Default)]
pub struct Windowed {
    survey: Survey,
    rounds: Rounds,
}

impl Planning for Windowed {
    type Motion = Ramps;

    fn plan(&mut self, route: &Route, bounds: &Bounds, start: &Start, end_mm: f64, window: &mut Window<Ramps>) -> bool {
        let rests = start.state.speed_mm_per_s == 0.0;
        let mut slower = Slower { speed: 1.0, jerk: SHARE };
        let tries = TRIES[usize::from(rests)];
        for n in 1..=tries {
            if !self.solve(route, bounds, &slower, start, end_mm, window) {
                return false;
            }
            let worst = check(route, bounds, start, window);
            if worst.is_kept() {
                return true;
            }
            slower = lower(slower, &worst, rests && n >= TRIES[0]);
        }
        false
    }
}

impl Windowed {
    /// False where the speed at the start is too high for what follows.
    fn solve(
        &mut self,
        route: &Route,
        bounds: &Bounds,
        slower: &Slower,
        start: &Start,
        end_mm: f64,
        window: &mut Window<Ramps>,
    ) -> bool {
        let mut cursor = Cursor::default();
        let mut look = |at_mm: f64| spot(route, bounds, slower, at_mm, &mut cursor);
        let speed = start.state.speed_mm_per_s;
        let begin = Corner { at_mm: start.state.s_mm, speed_mm_per_s: speed };
        window.whole = self.survey.make(begin, end_mm, window_s(bounds, speed), &mut look);
        let Some(tangential) = self.survey.tangential else { return false };
        let corners = &mut self.survey.corners;
        let mut limit = |at_mm: f64| look(at_mm).speed_mm_per_s;
        let ramps = &mut window.motion.0;
        self.rounds.make(corners, self.survey.feed_mm_per_s, &tangential, &mut limit, ramps);
        lay_times(&mut window.times, window.motion.0.iter().map(|ramp| ramp.duration_s));
        corners[0].speed_mm_per_s >= speed && window.times.len() > 1
    }
}

fn spot(route: &Route, bounds: &Bounds, slower: &Slower, at_mm: f64, cursor: &mut Cursor) -> Spot {
    let (at, leg) = route.at(at_mm, cursor);
    let bend = leg.course.counted_length(&at.curvature).max(1e-9);
    Spot {
        speed_mm_per_s: slower.speed * leg.cap_mm_per_s(&at, bounds),
        tangential: Tangential {
            acceleration_mm_per_s2: slower.jerk * leg.least.acceleration_mm_per_s2,
            jerk_mm_per_s3: slower.jerk * leg.least.jerk_mm_per_s3,
        },
        step_mm: (0.03 / bend).clamp(3e-4, 0.05),
    }
}
