//! A way on which the feed is kept to its end. A change of the rate of program time is begun only where there is one: no later
//! sample is then beyond the feed, whatever the plan does in between.
//!
//! From the end of the period on σ either becomes constant, at a rate at which no place ahead is too fast, or it is lowered
//! as far as the limits allow, until it is constant at the rate at which the plan keeps the feed everywhere. Either is tried
//! out on the queued plan period by period, with the same bounds as the period that is driven. So it does not matter that an
//! axis which turns leaves nothing to lower σ with just before the plan is too fast: a rate from which it would have to be
//! lowered there is never reached. The way that was found is kept, and is gone where the next period finds no better one.

use super::Aim;
use super::interval::Interval;
use super::keep_limits::{RateState, WaySearch, nearest_with_way};
use super::tuning::{
    FEED_POINT_MIN_RATE, FEED_POINT_SPACING, FEED_WAY_LANDING_SHARE, FEED_WAY_PERIODS,
    FEED_WAY_RAMPS, FEED_WAY_SINGLE_PERIODS, FEED_WAY_STEPS, MAX_LOWERING,
};
use crate::horizon::Horizon;
use crate::plan_ahead::{Pace, PlanCursor};

/// Tries between the σ̈ wanted and the one that lowers σ as far as the limits allow.
const HALVINGS: u32 = 3;
/// Places ahead at which a constant rate is looked at.
const PLACES: usize = 48;
/// Rates with which it may begin from rest.
const BEGINNINGS: u32 = 5;
/// How often the feed is looked at in a step of a way that lasts for as many periods or more.
const LOOKS: u32 = 4;
/// Relative tolerance on the feed.
const TOLERANCE: f64 = 1e-7;

/// Which speed is to be kept ahead.
#[derive(Debug)]
pub(super) struct Below<'a> {
    /// Share of the programmed feeds.
    ratio: f64,
    /// Rate at which the plan keeps that share wherever it is.
    pub kept_rate: f64,
    /// The highest rates at places ahead, nearest first. Each is looked at when it is first asked for.
    most: [f64; PLACES],
    seen: usize,
    place: PlanCursor<'a>,
    /// The speed at the last one seen, as a share of the one asked for.
    begun: Option<f64>,
    /// Program time from the last one seen to the next, s.
    step_s: f64,
    /// Steps on ways that may still be tried in this period.
    steps_left: u32,
}

impl<'a> Below<'a> {
    /// What is asked for, from `here` on.
    pub(super) fn new(aim: &Aim, here: &RateState<'a>, period_s: f64) -> Self {
        let mut place = here.place;
        place.go(period_s * here.sigma);
        Self {
            ratio: aim.ratio,
            kept_rate: aim.kept_rate,
            most: [0.0; PLACES],
            seen: 0,
            place,
            begun: None,
            step_s: period_s * here.sigma.max(FEED_POINT_MIN_RATE),
            steps_left: 0,
        }
    }

    /// The highest rate from the place before to the one of this number; `None` after the last, and where nothing moves there.
    fn rate_at(&mut self, number: usize) -> Option<f64> {
        if number == self.seen && number < PLACES {
            self.most[number] = self.most_on_the_way()?;
            self.step_s *= FEED_POINT_SPACING;
            self.seen += 1;
        }
        self.most[..self.seen].get(number).copied()
    }

    /// Moves on to the next place, and gives the highest rate on the way there, by the middle and the ends of what it passes of each
    /// segment: places far ahead lie so far apart that an axis may get too fast, and slow again, between two of them.
    fn most_on_the_way(&mut self) -> Option<f64> {
        let (mut left_s, mut highest) = (self.step_s, 0.0_f64);
        loop {
            let stretch_s = self.place.stretch_s(left_s);
            let begun = self.begun;
            self.place.advance(stretch_s / 2.0);
            let middle = self.share_here()?;
            self.place.advance(stretch_s / 2.0);
            let end = self.share_here()?;
            self.begun = Some(end);
            highest = highest.max(highest_of([begun.unwrap_or(middle), middle, end]));
            left_s -= stretch_s;
            if left_s <= 0.0 {
                return Some(1.0 / highest);
            }
            self.place.step();
            self.begun = self.share_here();
            let Some(begun) = self.begun else {
                return (highest > 0.0).then_some(1.0 / highest);
            };
            highest = highest.max(begun);
        }
    }

    /// The speed of the plan at the place as a share of the one asked for; `None` where nothing moves.
    fn share_here(&self) -> Option<f64> {
        let pace = self.place.pace()?;
        Some(pace.speed / (self.ratio * self.place.feed_mm_per_s()))
    }

    /// Whether at the rate `sigma` no place ahead is too fast, which is mostly said by the first that is.
    fn is_kept_at(&mut self, sigma: f64) -> bool {
        sigma <= self.kept_rate
            || (0..)
                .map_while(|number| self.rate_at(number))
                .all(|most| sigma < most)
    }
}

/// The highest of the parabola through the values at the beginning, in the middle and at the end of a stretch.
fn highest_of([begin, middle, end]: [f64; 3]) -> f64 {
    let bend = 2.0 * middle - begin - end;
    let slope = end - begin;
    if slope.abs() < 2.0 * bend {
        middle + slope * slope / (8.0 * bend)
    } else {
        begin.max(middle).max(end)
    }
}

/// Where a way has come, and whether it has been below the feed.
#[derive(Clone, Copy, Debug)]
struct Watch {
    before: Option<Pace>,
    limit_mm_per_s: f64,
    was_below: bool,
    /// The speed at which it began.
    begun_mm_per_s: f64,
}

impl Watch {
    fn new(here: &RateState<'_>, ratio: f64) -> Self {
        let before = here.place.pace();
        let limit_mm_per_s = ratio * here.place.feed_mm_per_s();
        let is_below = |pace: &Pace| here.sigma * pace.speed <= limit_mm_per_s * (1.0 + TOLERANCE);
        Self {
            was_below: before.as_ref().is_none_or(is_below),
            begun_mm_per_s: here.sigma * before.map_or(0.0, |pace| pace.speed),
            before,
            limit_mm_per_s,
        }
    }

    /// Whether the feed is kept in a period that ends at `to`, at its end and in its mean. Where it was not before, it need not
    /// be yet: the ratio has just become a lower one. But then the speed does not rise any more, so that it stays below what was asked
    /// for before.
    fn is_kept(&mut self, to: &RateState<'_>, ratio: f64, h: f64) -> bool {
        let Some(pace) = to.place.pace() else {
            self.before = None;
            return true;
        };
        let limit = ratio * to.place.feed_mm_per_s();
        let keeps = |at_end_mm_per_s: f64, mean_mm_per_s: f64| {
            to.sigma * pace.speed <= at_end_mm_per_s * (1.0 + TOLERANCE)
                && self.before.is_none_or(|before| {
                    before.way_to_mm(&pace) <= mean_mm_per_s * (1.0 + TOLERANCE) * h
                })
        };
        let kept = keeps(limit, limit.max(self.limit_mm_per_s));
        let was_below = self.was_below;
        let goes_on = kept || !was_below && keeps(self.begun_mm_per_s, self.begun_mm_per_s);
        *self = Self {
            before: Some(pace),
            limit_mm_per_s: limit,
            was_below: was_below || kept,
            ..*self
        };
        goes_on
    }
}

impl Below<'_> {
    /// The σ̈ nearest to `wanted` from which there is a way below the feed, with that way in [`WaySearch::found`]; `None` where none
    /// is found.
    pub(super) fn recoverable(
        &mut self,
        wanted: f64,
        here: &RateState<'_>,
        ways: &mut WaySearch,
        horizon: &Horizon,
    ) -> Option<f64> {
        let h = ways.period_s;
        self.steps_left = FEED_WAY_STEPS;
        let range = ways.range(here, h, horizon)?;
        let kept = ways.found.peek().filter(|_| ways.found.keeps_feed);
        let good = kept.unwrap_or(range.nearest(-MAX_LOWERING / (h * h)));
        let found = nearest_with_way(range.nearest(wanted), good, HALVINGS, |change| {
            self.leaves_way(change, here, ways, horizon)
        });
        // A way that has come to its end goes on at the rate that it has come to, which keeps what it was sought for.
        found.or_else(|| {
            let stays = here.rate_per_s == 0.0 && range.contains(0.0);
            (stays && self.leaves_way(0.0, here, ways, horizon)).then_some(0.0)
        })
    }

    /// From rest, where any rate is as good: one from which there is a way below the feed, the rate so far or one that is nearer to
    /// the one at which the plan keeps it everywhere. `None` where that one is left.
    pub(super) fn rate_to_begin_with(
        &mut self,
        mut here: RateState<'_>,
        ways: &mut WaySearch,
        horizon: &Horizon,
    ) -> Option<f64> {
        let above = here.sigma - self.kept_rate;
        self.steps_left = BEGINNINGS * FEED_WAY_STEPS;
        (0..BEGINNINGS).find_map(|halvings| {
            here.sigma = self.kept_rate + above / f64::from(1_u32 << halvings);
            self.leaves_way(0.0, &here, ways, horizon)
                .then_some(here.sigma)
        })
    }

    /// Whether after a period with σ̈ of `change` there is a way below the feed; it is noted in [`WaySearch::found`].
    fn leaves_way(
        &mut self,
        change: f64,
        here: &RateState<'_>,
        ways: &mut WaySearch,
        horizon: &Horizon,
    ) -> bool {
        let h = ways.period_s;
        let mut watch = Watch::new(here, self.ratio);
        let mut way = *here;
        way.pass(change, h);
        let found = !turns_beyond(here, change, h)
            && watch.is_kept(&way, self.ratio, h)
            && (self.becomes_constant((way, watch), ways, horizon)
                || self.becomes_slow((way, watch), ways, horizon));
        if found {
            ways.keep_tried();
            ways.found.keeps_feed = true;
        }
        found
    }

    /// Whether σ becomes constant, soonest, at a rate at which no place ahead is too fast.
    fn becomes_constant(
        &mut self,
        (mut way, mut watch): (RateState<'_>, Watch),
        ways: &mut WaySearch,
        horizon: &Horizon,
    ) -> bool {
        ways.tried.clear();
        let (mut passed, most) = (0, most_periods(ways.period_s, horizon));
        while passed < most && (0.0..=1.0).contains(&way.sigma) {
            if way.rate_per_s == 0.0 {
                return self.is_kept_at(way.sigma);
            }
            let periods = periods_of_step(passed);
            let step_s = f64::from(periods) * ways.period_s;
            let steady = -way.rate_per_s / step_s;
            let mut on = (&mut way, &mut watch);
            if self.go(&mut on, steady, periods, (ways, horizon)).is_none() {
                return false;
            }
            passed += periods;
        }
        false
    }

    /// Whether σ becomes constant at the rate at which the plan keeps the feed everywhere, lowered as far as the limits allow.
    fn becomes_slow(
        &mut self,
        (mut way, mut watch): (RateState<'_>, Watch),
        ways: &mut WaySearch,
        horizon: &Horizon,
    ) -> bool {
        ways.tried.clear();
        let (mut passed, most) = (0, most_periods(ways.period_s, horizon));
        let mut raisable = f64::INFINITY;
        while passed < most && (0.0..=1.0).contains(&way.sigma) {
            let (sigma, rate) = (way.sigma, way.rate_per_s);
            // While σ̇ is brought to nothing.
            let falling = rate * rate / (2.0 * raisable).max(f64::MIN_POSITIVE);
            let is_enough = rate <= 0.0 && sigma - falling <= self.kept_rate;
            if rate == 0.0 && is_enough {
                return true;
            }
            let periods = periods_of_step(passed);
            let step_s = f64::from(periods) * ways.period_s;
            let steady = -rate / step_s;
            let wanted = if is_enough {
                steady
            } else {
                // As low as leaves another such step to bring σ̇ to nothing.
                let landing = FEED_WAY_LANDING_SHARE * self.kept_rate - sigma - 1.5 * step_s * rate;
                (landing.max(-MAX_LOWERING) / (step_s * step_s)).min(steady)
            };
            let mut on = (&mut way, &mut watch);
            let Some(range) = self.go(&mut on, wanted, periods, (ways, horizon)) else {
                return false;
            };
            raisable = range.high.max(0.0);
            passed += periods;
        }
        false
    }

    /// Goes on for some periods with the σ̈ nearest to `wanted`, and notes it; gives what the limits allow there. `None` where
    /// they allow none, the feed is not kept, the plan is not known, or enough has been tried.
    fn go(
        &mut self,
        (way, watch): &mut (&mut RateState<'_>, &mut Watch),
        wanted: f64,
        periods: u32,
        (ways, horizon): (&mut WaySearch, &Horizon),
    ) -> Option<Interval> {
        let step_s = f64::from(periods) * ways.period_s;
        self.steps_left = self.steps_left.checked_sub(1)?;
        let range = ways
            .range(way, step_s, horizon)
            .filter(|_| way.place.is_known())?;
        let change = range.nearest(wanted);
        if turns_beyond(way, change, step_s) {
            return None;
        }
        for _ in 0..periods {
            ways.tried.push(change);
        }
        let is_steady = change == -way.rate_per_s / step_s;
        let looks = periods.min(LOOKS);
        for _ in 0..looks {
            let look_s = step_s / f64::from(looks);
            way.pass(change, look_s);
            if !watch.is_kept(way, self.ratio, look_s) {
                return None;
            }
        }
        if is_steady {
            way.rate_per_s = 0.0;
        }
        Some(range)
    }
}

/// Whether σ turns round beyond an end of its range within a step with this σ̈.
fn turns_beyond(from: &RateState<'_>, change: f64, step_s: f64) -> bool {
    let rate = from.rate_per_s;
    let turns = rate * (rate + step_s * change) < 0.0;
    turns && !(0.0..=1.0).contains(&(from.sigma - rate * rate / (2.0 * change)))
}

/// Most periods of a way.
fn most_periods(period_s: f64, horizon: &Horizon) -> u32 {
    let [least, most] = FEED_WAY_PERIODS;
    let longest_s = FEED_WAY_RAMPS * horizon.reach_s + horizon.stop_s;
    (longest_s / period_s).clamp(least, most) as u32
}

/// How many periods the next step of a way lasts behind so many.
fn periods_of_step(passed: u32) -> u32 {
    (passed / FEED_WAY_SINGLE_PERIODS).max(1)
}

#[cfg(test)]
#[path = "way_below_tests.rs"]
mod tests;
