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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan_ahead::{Ahead, TWO_LINEAR};
    use crate::steps::Recent;
    use tandem_sdk::{AxisVector, Segment, SegmentFlags};

    /// A rest is met from where a stop and two periods at the present speed are no longer than the way to it.
    #[test]
    fn a_rest_is_met_where_a_stop_and_two_periods_fit_before_it() {
        const PERIOD_S: f64 = 0.001;
        let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
        segment.coefficients[0] = [0.0, 50.0, 0.0, 0.0, 0.0, 0.0];
        segment.path = segment.coefficients[0];
        segment.flags = SegmentFlags::default();
        let ahead = Ahead::new(&segment, Some(0.1), 0, None);
        let way = |sigma: f64| RateState {
            sigma,
            rate_per_s: 0.0,
            place: ahead.place(TWO_LINEAR),
            recent: Recent::default(),
        };
        for sigma in [0.2, 0.5, 1.0] {
            let speed = 50.0 * sigma;
            // 1000 mm/s² are built up in 0.1 s, and not reached: half of the way of a ramp to rest takes √(v/j).
            let stop_mm = speed * f64::sqrt(speed / 10_000.0);
            let needed_mm = stop_mm + LINE_END_PERIODS * PERIOD_S * speed;
            for (room, expected) in [(1.0 + 1e-6, true), (1.0 - 1e-6, false)] {
                let rest = RestAt {
                    path_mm: 5.0 + room * needed_mm,
                    max_mm_per_s2: 1000.0,
                    jerk_mm_per_s3: 10_000.0,
                };
                assert_eq!(
                    rest.is_met(&way(sigma), PERIOD_S),
                    expected,
                    "{sigma} {room}"
                );
            }
        }
        let behind = RestAt {
            path_mm: 0.0,
            max_mm_per_s2: 1000.0,
            jerk_mm_per_s3: 10_000.0,
        };
        assert!(behind.is_met(&way(0.0), PERIOD_S), "what rests has met it");
    }
}
