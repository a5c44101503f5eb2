//! The governor where jerk is limited and the machine is to rest at a place of the plan: the end of a line.
//!
//! A stop that is begun in time and then goes as it may does not rest at the place: what jerk is left to it changes on the way, and a
//! period is long beside what is left of the way at its end. So what is asked for is found anew in each period: σ̈ of which the end
//! of the period leaves just the way that a stop from there takes. A stop that counts on less jerk than there is on most of its
//! way makes good what turning takes of it.

use super::Governor;
use super::keep_limits::RateState;
use super::tuning::LINE_END_PERIODS;
use crate::law::Along;

/// Halvings of what may be asked for: the rate at the end of a period is known to a millionth of its change.
const HALVINGS: u32 = 20;

/// Where to rest.
#[derive(Clone, Copy, Debug)]
pub struct RestAt {
    /// Path coordinate, mm.
    pub path_mm: f64,
    /// Path deceleration that may be used, mm/s².
    pub max_mm_per_s2: f64,
    /// Path jerk that may be used, mm/s³.
    pub jerk_mm_per_s3: f64,
}

impl RestAt {
    /// Whether a stop from `way` on ends at the place or before it.
    fn is_met(&self, way: &RateState<'_>, period_s: f64) -> bool {
        if way.sigma <= 0.0 {
            return true;
        }
        way.place.pace().is_none_or(|pace| {
            let along = Along {
                speed_mm_per_s: way.sigma * pace.speed,
                acceleration_mm_per_s2: way.sigma * way.sigma * pace.rise
                    + way.rate_per_s * pace.speed,
                max_mm_per_s2: self.max_mm_per_s2,
                jerk_mm_per_s3: self.jerk_mm_per_s3,
            };
            along.way_to_mm(0.0) + LINE_END_PERIODS * period_s * along.speed_mm_per_s
                <= self.path_mm - pace.path_mm
        })
    }
}

impl Governor {
    /// The greatest σ̈ between `slowest`, that of a stop, and `wanted` from which rest is met at the place.
    pub(super) fn wanted_to_rest_at(
        &self,
        rest: &RestAt,
        (slowest, wanted): (f64, f64),
        here: &RateState<'_>,
    ) -> f64 {
        let is_met = |change: f64| {
            let mut way = *here;
            way.pass(change, self.period_s);
            rest.is_met(&way, self.period_s)
        };
        if slowest >= wanted || is_met(wanted) {
            return wanted;
        }
        let (mut met, mut passed) = (slowest, wanted);
        for _ in 0..HALVINGS {
            let between = f64::midpoint(met, passed);
            if is_met(between) {
                met = between;
            } else {
                passed = between;
            }
        }
        met
    }
}
