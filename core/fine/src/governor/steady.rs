//! Whether the rate of program time can be made constant again: what keeps the jerk limit on every way that is begun.
//!
//! A constant σ is admissible wherever the plan is. So σ̈ of a period is good if from its end on σ̇ can be brought to zero
//! within the limits, tried out period by period on the plan ahead. From a state that was reached so, there is always
//! a σ̈ that is: the next one of that way.

use super::Governor;
use super::smooth::{Interval, LEFT};
use crate::course::{Motion, Place};
use crate::outlook::Outlook;
use crate::steps::{AROUND, Recent, Steps};

/// Share of the acceleration limit that is used at the points of a period: between them it may be higher.
const ACCELERATION_MARGIN: f64 = 0.998;
/// Share of the jerk limit that the coming period uses.
const JERK_MARGIN: f64 = 0.997;
/// What a way that is begun uses less than that at its worst: its next periods find the plan where it was but for rounding.
const BEGUN: f64 = -0.003;
/// What a way that goes on may use more.
const GOES_ON: f64 = 5e-4;
/// Shares with which a way that was begun is tried again.
const GOING_ON: [f64; 4] = [BEGUN, BEGUN + 2e-4, 0.0, GOES_ON];
/// Program time that is none, s.
const NONE_S: f64 = 1e-9;
/// Tries between the σ̈ wanted and the one that makes σ constant.
const HALVINGS: u32 = 4;
/// Time in which σ must have become constant, in units of the longest a/J, and how many periods that may be.
const LONGEST: f64 = 3.2;
const MOST_PERIODS: f64 = 640.0;

/// The rate of program time, and where it is on the plan.
#[derive(Clone, Copy, Debug)]
pub(super) struct Way<'a> {
    pub sigma: f64,
    pub rate_per_s: f64,
    pub place: Place<'a>,
    /// Steps of the plan that the next samples show.
    pub recent: Recent,
}

impl Way<'_> {
    /// Goes on for a period.
    fn pass(&mut self, change_per_s2: f64, h: f64) {
        let (sigma, rate) = (self.sigma, self.rate_per_s);
        let mut left_s = h * (sigma + h * (rate / 2.0 + h * change_per_s2 / 6.0));
        let mut crossed: Option<Steps> = None;
        while left_s > NONE_S {
            left_s = self.place.advance(left_s);
            if left_s > NONE_S
                && let Some(steps) = self.place.step()
            {
                crossed.get_or_insert_default().join(&steps);
            }
        }
        self.recent.pass(crossed.as_ref());
        self.sigma = sigma + h * (rate + h * change_per_s2 / 2.0);
        self.rate_per_s = rate + h * change_per_s2;
    }
}

impl Governor {
    /// The σ̈ nearest to `wanted` from which σ can be made constant within the limits; `None` where there is none.
    pub(super) fn steadied(&self, wanted: f64, here: Way<'_>, outlook: &Outlook) -> Option<f64> {
        let h = self.period_s;
        let range = self.range(&here, GOES_ON, outlook)?;
        let steadies = |change: f64, more: f64| {
            let mut way = here;
            way.pass(change, h);
            self.steadies(way, more, outlook)
        };
        let wanted = range.nearest(wanted);
        if steadies(wanted, BEGUN) {
            return Some(wanted);
        }
        let (mut good, mut bad) = (range.nearest(-self.rate_per_s / h), wanted);
        let mut found = None;
        for _ in 0..HALVINGS {
            let between = f64::midpoint(good, bad);
            if steadies(between, BEGUN) {
                (good, found) = (between, Some(between));
            } else {
                bad = between;
            }
        }
        // The way that was begun goes on: with other shares it would be another, and meet the plan at other places.
        let goes_on = |more: f64| {
            let change = self.range(&here, more, outlook)?.nearest(-self.rate_per_s / h);
            steadies(change, more).then_some(change)
        };
        found.or_else(|| GOING_ON.into_iter().find_map(goes_on))
    }

    /// Whether σ becomes constant.
    fn steadies(&self, mut way: Way<'_>, more: f64, outlook: &Outlook) -> bool {
        let h = self.period_s;
        let periods = (LONGEST * outlook.horizon_s / h).clamp(16.0, MOST_PERIODS) as u32;
        for _ in 0..periods {
            if !(0.0..=1.0).contains(&way.sigma) {
                return false;
            }
            if way.rate_per_s == 0.0 {
                return true;
            }
            let Some(range) = self.range(&way, more, outlook) else { return false };
            let steady = -way.rate_per_s / h;
            let change = range.nearest(steady);
            way.pass(change, h);
            if change == steady {
                way.rate_per_s = 0.0;
            }
        }
        false
    }

    /// σ̈ that the limits allow in the period that begins here; `more` is added to the share of the jerk.
    fn range(&self, way: &Way<'_>, more: f64, outlook: &Outlook) -> Option<Interval> {
        let h = self.period_s;
        let mut interval = Interval::ALL;
        let whole_s = h * (way.sigma + h * way.rate_per_s / 2.0).clamp(0.0, 1.0);
        let (mut place, mut left_s) = (way.place, whole_s);
        let bounds = (outlook, &self.reserve(way));
        self.keep_at(way, 0.0, &place.motion(), more, bounds, &mut interval);
        while left_s > NONE_S {
            left_s = place.advance(left_s);
            let part = 1.0 - left_s / whole_s;
            self.keep_at(way, part, &place.motion(), more, bounds, &mut interval);
            if left_s > NONE_S {
                place.step();
                self.keep_at(way, part, &place.motion(), more, bounds, &mut interval);
            }
        }
        (!interval.is_empty()).then_some(interval)
    }

    /// Steps of the plan that the samples of this period and the next ones show together.
    pub(super) fn reserve(&self, way: &Way<'_>) -> Steps {
        let mut steps = way.recent.steps();
        let (h, periods) = (self.period_s, f64::from(AROUND) + 1.0);
        let soon = (way.sigma + periods * h * way.rate_per_s.max(0.0)).clamp(0.0, 1.0);
        steps.join(&way.place.steps_within(periods * h * soon));
        steps
    }

    /// Jerk and acceleration at a point of the period, the share `part` of its program time from its start.
    fn keep_at(
        &self,
        way: &Way<'_>,
        part: f64,
        motion: &Motion,
        more: f64,
        (outlook, reserve): (&Outlook, &Steps),
        keep: &mut Interval,
    ) {
        let (h, rate) = (self.period_s, way.rate_per_s);
        let sigma = (way.sigma + part * h * rate).clamp(0.0, 1.0);
        let (square, cube) = (sigma * sigma, sigma * sigma * sigma);
        for (axis, (acceleration_limit, jerk_limit)) in outlook.limits() {
            let velocity = motion.velocity[axis];
            let planned = cube * motion.jerk[axis];
            let turning = 3.0 * motion.acceleration[axis] * sigma;
            let left = JERK_MARGIN * jerk_limit - reserve.jerk_mm_per_s3(axis, sigma, h);
            let most = left.max(planned.abs() + LEFT * jerk_limit) + more * jerk_limit;
            keep.keep(planned + turning * rate, velocity + turning * part * h, most);
            let planned = square * motion.acceleration[axis];
            let left = ACCELERATION_MARGIN * acceleration_limit - reserve.acceleration_mm_per_s2(axis, sigma, h);
            let most = left.max(planned.abs());
            keep.keep(planned + velocity * rate, velocity * part * h, most);
        }
    }
}
