//! Whether the rate of program time can be made constant again: what keeps the jerk limit on every way that is begun.
//!
//! A constant σ is admissible wherever the plan is. So σ̈ of a period is good if from its end on σ̇ can be brought to zero
//! within the limits, tried out period by period on the plan ahead. From a state that was reached so, there is always
//! a σ̈ that is: the next one of that way.

use tandem_sdk::MAX_AXES;

use super::Governor;
use super::smooth::{Interval, LEFT};
use crate::course::{Motion, Place};
use crate::outlook::Outlook;

/// Share of the acceleration limit that is used: rate and plan both change within a period, and the samples are in between.
const ACCELERATION_MARGIN: f64 = 0.998;
/// Share of the jerk limit that the coming period uses.
const JERK_MARGIN: f64 = 0.997;
/// What a way that is begun uses less than that at its worst: its next periods find the plan where it was but for rounding.
const BEGUN: f64 = -0.003;
/// What a way that goes on may use more.
const GOES_ON: f64 = 5e-4;
/// Shares with which a way that was begun is tried again.
const GOING_ON: [f64; 4] = [BEGUN, BEGUN + 2e-4, 0.0, GOES_ON];
/// A step of the plan's acceleration by Δ is a jerk of Δ/T in the third difference of samples around it, less beside it, by
/// a quadratic B-spline. A third difference is 1/6, 2/3 and 1/6 of the jerks of three periods: with these shares of Δ/T for
/// the period that holds the step, in its middle and at its ends, and for the period beside an end, it is never less.
const MIDDLE: f64 = 1.125;
const END: f64 = 0.6;
/// Program time that is none, s.
const NONE_S: f64 = 1e-9;
/// Tries between the σ̈ wanted and the one that makes σ constant.
const HALVINGS: u32 = 4;
/// Time in which σ must have become constant, in units of the longest a/J, and how many periods that may be.
const LONGEST: f64 = 3.2;
const MOST_PERIODS: f64 = 640.0;

/// The rate of program time, and where it is on the plan.
#[derive(Clone, Copy, Debug)]
struct Way<'a> {
    sigma: f64,
    rate_per_s: f64,
    place: Place<'a>,
    /// What steps of the acceleration in the period before count for in this one, mm/s².
    behind: [f64; MAX_AXES],
}

impl Way<'_> {
    /// Goes on for a period.
    fn pass(&mut self, change_per_s2: f64, h: f64) {
        let (sigma, rate) = (self.sigma, self.rate_per_s);
        self.behind =
            steps(&mut self.place, h * (sigma + h * (rate / 2.0 + h * change_per_s2 / 6.0)), |part| beside(1.0 - part));
        self.sigma = sigma + h * (rate + h * change_per_s2 / 2.0);
        self.rate_per_s = rate + h * change_per_s2;
    }
}

/// Goes on for `whole_s`; gives the sum of the steps of the acceleration on the way, mm/s², each with the weight of its part
/// of the way.
fn steps(place: &mut Place<'_>, whole_s: f64, weight: impl Fn(f64) -> f64) -> [f64; MAX_AXES] {
    let (mut left_s, mut sum) = (whole_s, [0.0; MAX_AXES]);
    while left_s > NONE_S {
        left_s = place.advance(left_s);
        if left_s > NONE_S {
            let weight = weight(1.0 - left_s / whole_s);
            if weight > 0.0 {
                place.cross().iter().zip(&mut sum).for_each(|(step, sum)| *sum += weight * step);
            } else {
                place.step();
            }
        }
    }
    sum
}

/// What a step so many periods away from the end of a period counts for beside it.
fn beside(away: f64) -> f64 {
    (END * (1.0 - 2.0 * away)).max(0.0)
}

/// What a step at a part of a period counts for in it.
fn inside(part: f64) -> f64 {
    MIDDLE - 2.0 * (MIDDLE - END) * (part - 0.5).abs()
}

impl Governor {
    /// Keeps what steps of the acceleration in the period of `delta_s` from `place` on count for in the next one.
    pub(super) fn leave_behind(&mut self, mut place: Place<'_>, delta_s: f64) {
        self.behind = steps(&mut place, delta_s, |part| beside(1.0 - part));
    }

    /// The σ̈ nearest to `wanted` from which σ can be made constant within the limits; `None` where there is none.
    pub(super) fn steadied(&self, wanted: f64, place: Place<'_>, outlook: &Outlook) -> Option<f64> {
        let h = self.period_s;
        let here = Way { sigma: self.sigma, rate_per_s: self.rate_per_s, place, behind: self.behind };
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
        let (mut place, mut left_s, mut jolts) = (way.place, whole_s, way.behind);
        let own = steps(&mut place, whole_s, inside);
        let ahead = steps(&mut place, whole_s / 2.0, |part| beside(part / 2.0));
        jolts.iter_mut().zip(own.iter().zip(&ahead)).for_each(|(jolt, (own, ahead))| *jolt += own + ahead);
        place = way.place;
        self.keep_at(way, 0.0, (&place.motion(), &jolts), more, outlook, &mut interval);
        while left_s > NONE_S {
            left_s = place.advance(left_s);
            let part = 1.0 - left_s / whole_s;
            self.keep_at(way, part, (&place.motion(), &jolts), more, outlook, &mut interval);
            if left_s > NONE_S {
                place.step();
                self.keep_at(way, part, (&place.motion(), &jolts), more, outlook, &mut interval);
            }
        }
        (!interval.is_empty()).then_some(interval)
    }

    /// Jerk and acceleration at a point of the period, the share `part` of its program time from its start.
    fn keep_at(
        &self,
        way: &Way<'_>,
        part: f64,
        (motion, jolts): (&Motion, &[f64; MAX_AXES]),
        more: f64,
        outlook: &Outlook,
        keep: &mut Interval,
    ) {
        let (h, rate) = (self.period_s, way.rate_per_s);
        let sigma = (way.sigma + part * h * rate).clamp(0.0, 1.0);
        let (square, cube) = (sigma * sigma, sigma * sigma * sigma);
        for (axis, (acceleration_limit, jerk_limit)) in outlook.limits() {
            let velocity = motion.velocity[axis];
            // The plan alone keeps the limit on its samples: together that is no more, or what the point has by itself.
            let alone = cube * motion.jerk[axis];
            let worst = alone.abs().max(JERK_MARGIN * jerk_limit);
            let planned = (alone + square * jolts[axis] / h).clamp(-worst, worst);
            let turning = 3.0 * motion.acceleration[axis] * sigma;
            let most = (JERK_MARGIN * jerk_limit).max(planned.abs() + LEFT * jerk_limit) + more * jerk_limit;
            keep.keep(planned + turning * rate, velocity + turning * part * h, most);
            let planned = square * motion.acceleration[axis];
            let most = (ACCELERATION_MARGIN * acceleration_limit).max(planned.abs());
            keep.keep(planned + velocity * rate, velocity * part * h, most);
        }
    }
}
