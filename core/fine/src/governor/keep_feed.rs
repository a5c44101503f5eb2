//! The governor where jerk is limited and the path speed is to stay below a feed that the plan goes beyond.
//!
//! What the plan does is looked at where the period ends, and not where it begins: its own jerk may turn round within. There
//! the speed may rise by no more than leaves time to bring that to nothing. And where the plan turns it may use all the jerk
//! or acceleration of an axis, so that σ cannot be lowered while it gets faster: that is tried out on the way ahead.
//!
//! A plan is made at `max_feed_ratio`, so at a lower ratio it runs through what is asked for with all its acceleration
//! and jerk. Three things keep the samples below. σ̈ is sought with which speed
//! and its rise *at the end* of the period lie on a curve that comes to the feed with no rise, and the mean of the
//! period below it. Of what is sought as much is taken as leaves a way on which the feed is kept to its end
//! (`way_below.rs`): a plan that leaves a corner may use all of an axis for so long that σ has to be low before. And from rest
//! σ begins with a rate that lasts for six periods and leaves such a way. Speed is that of the linear axes where they move more
//! than the path coordinate, which is a polynomial of its own and may run behind.

use super::keep_limits::RateState;
use super::tuning::{FEED_SHARE, MAX_LOWERING, RISE_JERK_SHARE, RISE_PERIODS};
use super::{Aim, Governor};
use crate::horizon::Horizon;
use crate::plan_ahead::PlanCursor;

/// Rounds in which σ̈ is sought: what is wrong is squared by each.
const ROUNDS: u32 = 5;
/// To which change of σ in a period it is sought.
const PRECISION: f64 = 1e-9;

/// How fast a speed may rise that is to end at a limit.
#[derive(Clone, Copy, Debug)]
struct Curve {
    jerk_mm_per_s3: f64,
    reserve_s: f64,
}

impl Curve {
    /// The rise `below_mm_per_s` below the limit, mm/s², and how fast it changes with that, 1/s. Above it is negative.
    fn rise(&self, below_mm_per_s: f64) -> (f64, f64) {
        let (reserve, way) = (self.reserve_s, below_mm_per_s.abs());
        let rise =
            2.0 * way / (reserve + (reserve * reserve + 2.0 * way / self.jerk_mm_per_s3).sqrt());
        (
            rise.copysign(below_mm_per_s),
            1.0 / (reserve + rise / self.jerk_mm_per_s3),
        )
    }
}

/// Whether the plan stands still in the period or to the end of its segment, which a dwell may reach within the period. A move that
/// begins at rest gets on, and at the end of a segment there is nothing left to pass.
fn is_in_dwell(place: &PlanCursor<'_>, h: f64) -> bool {
    let mut soon = *place;
    let passes_time = place.stretch_s(h) > 0.0;
    soon.advance(h);
    passes_time
        && place.pace().zip(soon.pace()).is_some_and(|(from, to)| {
            to.speed <= 0.0 && to.path_mm == from.path_mm && from.way_to_mm(&to) == 0.0
        })
}

impl Governor {
    /// σ̈ that brings the rate to the one aimed at, as far as the path speed stays below the feed here and ahead.
    pub(super) fn wanted_below(
        &mut self,
        aim: &Aim,
        horizon: &Horizon,
        here: &RateState<'_>,
    ) -> f64 {
        let (h, sigma) = (self.period_s, aim.goal.sigma());
        if aim.path[0] <= 0.0 {
            let goal = sigma.min(aim.ratio);
            if self.sigma < goal && (self.sigma == 0.0 || is_in_dwell(&here.place, h)) {
                // A hold in a dwell, or the end of what was queued, has taken the rate to nothing, and a dwell has no speed that
                // says how fast it is to pass.
                return self.small(self.freely(goal, horizon), horizon);
            }
            // From rest the rate was chosen for what follows.
            return -self.rate_per_s / h;
        }
        let free = self.small(self.freely(sigma, horizon), horizon);
        let speed_mm_per_s = aim.goal.speed_mm_per_s();
        let below = if speed_mm_per_s.is_finite() {
            self.below(speed_mm_per_s, free, here, horizon)
        } else {
            free
        };
        below.max(-MAX_LOWERING / (h * h))
    }

    /// The greatest σ̈ up to `most` with which the speed at the end of the period is on the curve to `speed_mm_per_s` or below it,
    /// and its mean below that. From above it comes down, and does not rise first: where the plan brakes by itself within the period,
    /// harder than the curve, a rate that only kept to the curve at the end would.
    fn below(
        &self,
        speed_mm_per_s: f64,
        most: f64,
        here: &RateState<'_>,
        horizon: &Horizon,
    ) -> f64 {
        let (h, limit) = (self.period_s, FEED_SHARE * speed_mm_per_s);
        let Some(from) = here.place.pace() else {
            return most;
        };
        let jerk = horizon
            .path_jerk_mm_per_s3
            .min(limit * MAX_LOWERING / (h * h));
        let curve = Curve {
            jerk_mm_per_s3: RISE_JERK_SHARE * horizon.approach_jerk_share * jerk,
            reserve_s: RISE_PERIODS * h,
        };
        let driven = here.sigma * from.speed;
        let is_below = driven <= speed_mm_per_s / FEED_SHARE;
        let [most_at_end, most_in_mean] = if is_below {
            [limit, speed_mm_per_s]
        } else {
            [driven; 2]
        };
        let mut change = most;
        for _ in 0..ROUNDS {
            let mut way = *here;
            way.pass(change, h);
            let Some(to) = way.place.pace().filter(|to| to.speed > 0.0) else {
                break;
            };
            let speed = way.sigma * to.speed;
            let rise = way.sigma * way.sigma * to.rise + to.speed * way.rate_per_s;
            let (allowed, per_s) = curve.rise(limit - speed);
            let mut over = (rise - allowed) / (to.speed * h * (1.0 + per_s * h / 2.0));
            let mean_over = (from.way_to_mm(&to) / h - most_in_mean) * 6.0 / (to.speed * h * h);
            let end_over = (speed - most_at_end) * 2.0 / (to.speed * h * h);
            over = over.max(mean_over).max(end_over);
            if (change == most && over <= 0.0) || over.abs() * h * h < PRECISION {
                break;
            }
            change = (change - over).min(most);
        }
        change
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Goal, order3};
    use super::*;
    use crate::plan_ahead::{Ahead, Axes, PlanAhead};
    use crate::steps::Recent;
    use tandem_sdk::{AxisVector, Segment, SegmentFlags};

    const PERIOD_S: f64 = 0.001;

    /// X is linear, A turns.
    const X_AND_A: Axes = Axes {
        count: 2,
        linear: 0b01,
        rotary: 0b10,
    };

    fn stands(segment: &Segment, at_s: f64) -> bool {
        let place = PlanAhead::new(segment, [&[], &[]], X_AND_A).begin(at_s);
        is_in_dwell(&place, PERIOD_S)
    }

    /// Brought down at the jerk limit after the reserve, the rise ends at the limit; how it changes with the way to there is the slope of
    /// that.
    #[test]
    fn a_rise_that_is_brought_down_at_the_jerk_limit_ends_at_the_limit() {
        let curve = Curve {
            jerk_mm_per_s3: 10_000.0,
            reserve_s: 0.002,
        };
        for below in [-30.0, -0.5, 0.01, 0.5, 3.0, 80.0] {
            let (rise, slope_per_s) = curve.rise(below);
            let gained = rise.abs() * 0.002 + rise * rise / 20_000.0;
            assert!(
                (gained * below.signum() / below - 1.0).abs() < 1e-9,
                "{below}"
            );
            let step = 1e-6 * below;
            let change = curve.rise(below + step).0 - curve.rise(below - step).0;
            assert!(
                (change / (2.0 * step) / slope_per_s - 1.0).abs() < 1e-4,
                "{below}"
            );
        }
    }

    #[test]
    fn only_what_stands_for_a_while_is_a_dwell() {
        let dwell = Segment::rest(&AxisVector::ZERO, 0.1);
        assert!(stands(&dwell, 0.05));
        assert!(
            stands(&dwell, 0.1 - 0.1 * PERIOD_S),
            "it ends in the period"
        );
        assert!(!stands(&dwell, 0.1), "it is over");
        for (axis, path) in [(0, true), (0, false), (1, true), (1, false)] {
            // From rest with all the jerk that there is: by some nanometres in the period.
            let mut begins = Segment::rest(&AxisVector::ZERO, 0.1);
            begins.coefficients[axis][3] = 5000.0;
            if path {
                begins.path[3] = 5000.0;
            }
            assert!(!stands(&begins, 0.0), "axis {axis}, path {path}");
        }
        let mut moves = Segment::rest(&AxisVector::ZERO, 0.1);
        (moves.coefficients[0][1], moves.path[1]) = (5.0, 5.0);
        assert!(!stands(&moves, 0.05));
    }

    /// A hold may have come in a dwell, which has no speed to say how fast it is to pass: its rate goes up again to what is asked for.
    #[test]
    fn a_dwell_passes_on_after_a_hold_in_it() {
        let limits = order3::tests::limits(1000.0, 10_000.0);
        let dwell = Segment::rest(&AxisVector::ZERO, 10.0);
        let ahead = Ahead::new(&dwell, Some(1.0), 0, None);
        let mut horizon = Horizon::new(&limits, 2, PERIOD_S);
        horizon.fill(&ahead, PERIOD_S);
        for (ratio, sigma, rises) in [
            (1.0, 0.0, true),
            (1.0, 0.5, true),
            (1.0, 1.0, false),
            (0.5, 0.25, true),
            (0.5, 0.5, false),
        ] {
            let mut governor = Governor::new(&limits, 2, PERIOD_S);
            governor.jump(sigma);
            let here = RateState {
                sigma,
                rate_per_s: 0.0,
                place: ahead.place(X_AND_A),
                recent: Recent::default(),
            };
            let aim = Aim {
                goal: Goal::run(1.0, 10.0, None),
                ratio,
                kept_rate: 1.0,
                path: [0.0; 3],
            };
            let wanted = governor.wanted_below(&aim, &horizon, &here);
            assert_eq!(wanted > 0.0, rises, "{sigma} of {ratio}: {wanted}");
        }
    }

    /// Below the feed the mean of a period counts as well, with all that the plan gains in it; above it the speed bends to the feed.
    #[test]
    fn the_mean_of_a_period_counts_from_below_the_feed() {
        const FEED: f64 = 10.0;
        let limits = order3::tests::limits(50_000.0, 1e6);
        let governor = Governor::new(&limits, 2, PERIOD_S);
        // Speed and mean speed of the period that is chosen where the plan goes up and down by so much within a period.
        let chosen = |speed: f64, hump: f64| {
            let mut segment = Segment::rest(&AxisVector::ZERO, 2.0);
            let (first, second) = (4.0 * hump / PERIOD_S, 4.0 * hump / PERIOD_S / PERIOD_S);
            segment.coefficients[0] = [0.0, speed, first / 2.0, -second / 3.0, 0.0, 0.0];
            segment.path = segment.coefficients[0];
            segment.flags = SegmentFlags::default();
            let ahead = Ahead::new(&segment, Some(0.0), 0, None);
            let mut horizon = Horizon::new(&limits, 2, PERIOD_S);
            horizon.fill(&ahead, PERIOD_S);
            let here = RateState {
                sigma: 1.0,
                rate_per_s: 0.0,
                place: ahead.place(X_AND_A),
                recent: Recent::default(),
            };
            let change = governor.below(FEED, 0.0, &here, &horizon);
            let mut way = here;
            way.pass(change, PERIOD_S);
            let (from, to) = (here.place.pace().unwrap(), way.place.pace().unwrap());
            [way.sigma * to.speed, from.way_to_mm(&to) / PERIOD_S, change]
        };
        let [speed, mean, _] = chosen(9.9, 3.0);
        assert!(speed < FEED * (1.0 + 1e-6), "{speed}");
        assert!((mean / FEED - 1.0).abs() < 1e-3, "{mean}");
        let [_, mean, change] = chosen(9.0, 0.1);
        assert!(mean < 9.2 && change == 0.0, "{mean}, {change}");
        // Twice as fast as the feed it is not braked to it at once.
        let [speed, mean, _] = chosen(20.0, 0.0);
        assert!(mean > 19.0 && speed > 18.0, "{speed}, {mean}");
    }

    /// The plan gets faster at a constant rate and goes beyond the feed: the speed comes to the feed in one bend, is at it soon after the
    /// plan is, and stays there.
    #[test]
    fn the_speed_bends_to_the_feed_once_and_stays_at_it() {
        const JERK: f64 = 1000.0;
        let limits = order3::tests::limits(500.0, JERK);
        let governor = Governor::new(&limits, 2, PERIOD_S);
        for (rise, feed) in [(10.0, 12.0), (40.0, 20.0), (80.0, 30.0)] {
            let mut segment = Segment::rest(&AxisVector::ZERO, 2.0);
            segment.coefficients[0] = [0.0, 10.0, rise / 2.0, 0.0, 0.0, 0.0];
            segment.path = segment.coefficients[0];
            segment.flags = SegmentFlags::default();
            let ahead = Ahead::new(&segment, Some(0.0), 0, None);
            let mut horizon = Horizon::new(&limits, 2, PERIOD_S);
            horizon.fill(&ahead, PERIOD_S);
            let mut way = RateState {
                sigma: 1.0,
                rate_per_s: 0.0,
                place: ahead.place(X_AND_A),
                recent: Recent::default(),
            };
            let meets_s = (feed - 10.0) / rise;
            let (mut t, mut rises) = (0.0, vec![rise]);
            while t < meets_s + 0.3 {
                // Were there no feed, σ would stay as it is.
                let free = -way.rate_per_s / PERIOD_S;
                let change = governor.below(feed, free.max(0.0), &way, &horizon);
                way.pass(change, PERIOD_S);
                t += PERIOD_S;
                let pace = way.place.pace().unwrap();
                let speed = way.sigma * pace.speed;
                assert!(speed < feed * (1.0 + 1e-6), "{speed} for {feed} at {t} s");
                rises.push(way.sigma * way.sigma * pace.rise + pace.speed * way.rate_per_s);
                if t > meets_s + 2.0 * rise / JERK + 0.02 {
                    assert!(speed > 0.999 * feed, "{speed} for {feed} at {t} s");
                }
            }
            for pair in rises.windows(2) {
                let change = (pair[1] - pair[0]) / PERIOD_S;
                assert!((-JERK..1.0).contains(&change), "{change} mm/s³ for {feed}");
            }
        }
    }

    /// A lower feed is asked for just where the plan brakes by itself, harder than the way down to that feed asks: σ may rise then, the
    /// speed may not.
    #[test]
    fn on_the_way_down_to_a_lower_feed_the_speed_does_not_rise_where_the_plan_brakes() {
        let limits = order3::tests::limits(5000.0, 1.5e6);
        let governor = Governor::new(&limits, 2, PERIOD_S);
        let (speed, sigma, feed) = (0.33, 0.6, 0.026);
        for braking in [20.0, 50.0, 100.0, 150.0] {
            let mut segment = Segment::rest(&AxisVector::ZERO, 2e-3);
            // It brakes with that at the end of a period at this rate, and with nothing at its start.
            let passed_s = sigma * PERIOD_S;
            let last = -braking / (20.0 * passed_s.powi(3));
            segment.coefficients[0] = [0.0, speed, 0.0, 0.0, 0.0, last];
            segment.path = segment.coefficients[0];
            segment.flags = SegmentFlags::default();
            let ahead = Ahead::new(&segment, Some(0.0), 0, None);
            let mut horizon = Horizon::new(&limits, 2, PERIOD_S);
            horizon.fill(&ahead, PERIOD_S);
            let mut way = RateState {
                sigma,
                rate_per_s: 0.0,
                place: ahead.place(X_AND_A),
                recent: Recent::default(),
            };
            let from = way.place.pace().unwrap();
            let change = governor.below(feed, 0.1 / (PERIOD_S * PERIOD_S), &way, &horizon);
            way.pass(change, PERIOD_S);
            let to = way.place.pace().unwrap();
            let most = sigma * speed * (1.0 + 1e-6);
            let mean = from.way_to_mm(&to) / PERIOD_S;
            let end = way.sigma * to.speed;
            assert!(
                end.max(mean) <= most,
                "{end} and {mean} of {most} at {braking}"
            );
        }
    }
}
