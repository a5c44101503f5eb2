//! The governor where jerk is limited: the rate of program time is smooth itself.
//!
//! With q the plan in program time an axis jerks by `q‴σ³ + 3q″σσ̇ + q′σ̈`. What is chosen for a period is σ̈: as near to
//! what two laws ask for as leaves a way on which σ̇ comes to zero within the limits (`steady.rs`).

use super::Governor;
use super::steady::Way;
use crate::course::Place;
use crate::law::{stop_s, to_rest};
use crate::outlook::Outlook;
use crate::steps::{Recent, Steps};

/// Share of the limits that is aimed at: the rest covers what changes within a period.
const MARGIN: f64 = 0.995;
/// Share of the jerk limit that σ has at least, where the plan uses all of it: without any it would never leave a rest
/// there. The one tolerance on jerk covers it.
pub(super) const LEFT: f64 = 0.006;
/// By which share of the limit jerk goes beyond it where it must: the first that leaves a rate is taken.
const EXCESSES: [f64; 8] = [0.01, 0.03, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2];
/// How much longer than the path by its speed an axis must need to decide how a stop begins. On a line both need the same,
/// and the law of the path, which knows no single axis, comes in to rest without chatter.
const CLEARLY: f64 = 1.2;
/// Below this share of what one period can change, a rate is where it was to go.
const SNAP: f64 = 1e-3;

/// What is asked of the coming period.
#[derive(Clone, Copy, Debug)]
pub struct Aim {
    /// Rate of program time to reach.
    pub sigma: f64,
    /// Path speed not to exceed, mm/s.
    pub speed_mm_per_s: f64,
    /// Share of the programmed feeds ahead that is not to be exceeded there; infinite where the plan keeps what is asked.
    pub ratio: f64,
    /// Derivatives of the plan's path coordinate here by program time.
    pub path: [f64; 3],
}

/// What was chosen for the period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chosen {
    /// Program time that passes, s.
    pub delta_s: f64,
    /// No σ̈ keeps the jerk limit: velocity and acceleration are kept.
    pub relaxed: bool,
}

/// An interval of σ̈.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interval {
    pub(super) low: f64,
    pub(super) high: f64,
}

impl Interval {
    pub(super) const ALL: Self = Self {
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
    };

    /// Keeps `|constant + slope·x| ≤ most`.
    pub(super) fn keep(&mut self, constant: f64, slope: f64, most: f64) {
        // A constant beyond the limit that nothing can change leaves no interval; rounding is not such a case.
        if slope.abs() < f64::MIN_POSITIVE {
            return;
        }
        let (a, b) = ((-most - constant) / slope, (most - constant) / slope);
        if a.is_nan() || b.is_nan() {
            return;
        }
        // Numbers all: an instruction each, where `f64::max` also looks for what is none.
        let (low, high) = if a < b { (a, b) } else { (b, a) };
        self.low = if low > self.low { low } else { self.low };
        self.high = if high < self.high { high } else { self.high };
    }

    pub(super) fn is_empty(&self) -> bool {
        self.low > self.high
    }

    fn contains(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }

    /// The value nearest to `wanted`; of an empty interval its middle.
    pub(super) fn nearest(&self, wanted: f64) -> f64 {
        if self.is_empty() {
            f64::midpoint(self.low, self.high)
        } else {
            wanted.clamp(self.low, self.high)
        }
    }
}

impl Governor {
    /// Chooses the rate for this period where jerk is limited, and takes it. `place` is where the plan is, `recent` what of
    /// its steps the next samples show.
    pub fn smooth(
        &mut self,
        aim: &Aim,
        outlook: &Outlook,
        place: Place<'_>,
        recent: Recent,
    ) -> Chosen {
        let here = Way {
            sigma: self.sigma,
            rate_per_s: self.rate_per_s,
            place,
            recent,
        };
        let wanted = if aim.speed_mm_per_s > 0.0 && aim.speed_mm_per_s.min(aim.ratio).is_finite() {
            self.wanted_below(aim, outlook, &here)
        } else {
            self.small(
                self.wanted(aim, outlook)
                    .min(self.wanted_by_slowest(aim, outlook, &place)),
                outlook,
            )
        };
        if wanted == 0.0 && self.rate_per_s == 0.0 {
            return Chosen {
                delta_s: self.sigma * self.period_s,
                relaxed: false,
            };
        }
        let chosen = match self.steadied(wanted, here, outlook) {
            Some(change) => Chosen {
                delta_s: self.pass(change),
                relaxed: false,
            },
            None => self.go_on(outlook, &self.reserve(&here)),
        };
        self.settle(aim, outlook);
        chosen
    }

    /// Goes on the way that was begun, at whose end σ is constant.
    fn go_on(&mut self, outlook: &Outlook, reserve: &Steps) -> Chosen {
        if self.rate_per_s == 0.0 {
            return Chosen {
                delta_s: self.pass(0.0),
                relaxed: false,
            };
        }
        let Some((change, last)) = self.begun.next() else {
            return self.relaxed(outlook, reserve);
        };
        let delta_s = self.pass(change);
        if last {
            self.rate_per_s = 0.0;
        }
        Chosen {
            delta_s,
            relaxed: false,
        }
    }

    /// Makes σ constant as soon as velocity and acceleration allow it, with no more jerk than that takes.
    fn relaxed(&mut self, outlook: &Outlook, reserve: &Steps) -> Chosen {
        let mut firm = Interval::ALL;
        self.accelerations(outlook, reserve, &mut firm);
        let mut all = firm;
        self.jerks(outlook, reserve, 0.0, &mut all);
        let mut least = all;
        for excess in EXCESSES {
            if !least.is_empty() {
                break;
            }
            least = firm;
            self.jerks(outlook, reserve, excess, &mut least);
        }
        let steady = -self.rate_per_s / self.period_s;
        let chosen = if least.is_empty() {
            firm.nearest(steady)
        } else {
            least.nearest(steady)
        };
        let chosen = firm.nearest(self.landing(chosen));
        let before = self.rate_per_s;
        let delta_s = self.pass(chosen);
        // Where σ has met an end of its range, σ̇ ended there and not as chosen.
        let change = (self.rate_per_s - before) / self.period_s;
        Chosen {
            delta_s,
            relaxed: all.is_empty() || !all.contains(change),
        }
    }

    /// `chosen`, or the σ̈ that is needed to come to the end of the range with σ constant, evenly from here on.
    fn landing(&self, chosen: f64) -> f64 {
        let (h, rate) = (self.period_s, self.rate_per_s);
        let room = if rate > 0.0 {
            1.0 - self.sigma
        } else {
            self.sigma
        };
        let periods = (2.0 * room / (h * rate.abs())).floor().max(1.0);
        let even = -rate / (periods * h);
        if rate > 0.0 {
            chosen.min(even)
        } else {
            chosen.max(even)
        }
    }

    /// Ends an approach: what rounding leaves of it is far below what a period may change.
    fn settle(&mut self, aim: &Aim, outlook: &Outlook) {
        let h = self.period_s;
        let most = SNAP * outlook.rate_change_per_s2.min(1.0 / (h * h)) * h;
        let target = if aim.speed_mm_per_s == 0.0 {
            0.0
        } else {
            aim.sigma
        };
        if (self.sigma - target).abs() < most * h && self.rate_per_s.abs() < most {
            (self.sigma, self.rate_per_s) = (target, 0.0);
        }
    }

    /// σ̈ that reaches the aim soonest, were there no limits but those of the approach.
    fn wanted(&self, aim: &Aim, outlook: &Outlook) -> f64 {
        let h = self.period_s;
        let [speed, acceleration, jerk] = aim.path;
        let most = MARGIN * outlook.rate_change_per_s2;
        let free = if most.is_finite() {
            self.approach(self.sigma - aim.sigma, outlook.share * most, most)
        } else {
            0.0
        };
        let (sigma, rate) = (self.sigma, self.rate_per_s);
        let along = sigma * sigma * acceleration + speed * rate;
        let path_jerk = outlook.path_jerk_to_rest(sigma, sigma * speed, along);
        let path_jerk = MARGIN * path_jerk.min(speed * outlook.most_change_per_s2);
        if aim.speed_mm_per_s.is_infinite() || speed <= 0.0 || !path_jerk.is_finite() {
            return free;
        }
        let over = sigma * speed - aim.speed_mm_per_s;
        if over == 0.0 && along == 0.0 {
            return free.min(0.0);
        }
        let asked = to_rest(
            over - h * along / 2.0,
            along,
            outlook.share * path_jerk,
            4.0 * path_jerk,
            h,
        );
        let planned = sigma * (sigma * sigma * jerk + 3.0 * acceleration * rate);
        let capped = (asked - planned) / speed;
        // At its bound the law of the rate only says that its aim is far.
        if free < most {
            free.min(capped)
        } else {
            capped
        }
    }

    /// The same to rest soonest, by the axis that alone would need longest, where that is clearly longer than what the path
    /// takes by its speed: an axis that is slow to turn round decides, though the path hardly has its direction yet.
    fn wanted_by_slowest(&self, aim: &Aim, outlook: &Outlook, place: &Place<'_>) -> f64 {
        let (h, sigma, rate) = (self.period_s, self.sigma, self.rate_per_s);
        let [speed, acceleration, _] = aim.path;
        if aim.speed_mm_per_s > 0.0 || sigma == 0.0 || speed <= 0.0 {
            return f64::INFINITY;
        }
        let along = sigma * sigma * acceleration + speed * rate;
        let path_jerk = MARGIN * outlook.path_jerk_to_rest(sigma, sigma * speed, along);
        let path_s = stop_s(sigma * speed, along, f64::INFINITY, path_jerk);
        let (mut longest_s, mut wanted) = (CLEARLY * path_s + 2.0 * h, f64::INFINITY);
        let motion = place.motion();
        for (axis, (most, jerk)) in outlook.limits() {
            let velocity = motion.velocity[axis];
            let turning = sigma * motion.acceleration[axis];
            let (fast, changing) = (sigma * velocity, sigma * turning + velocity * rate);
            let axis_s = stop_s(fast, changing, most, MARGIN * jerk);
            if axis_s > longest_s && velocity != 0.0 {
                let planned = sigma * sigma * sigma * motion.jerk[axis] + 3.0 * turning * rate;
                let asked = to_rest(
                    fast - h * changing / 2.0,
                    changing,
                    outlook.share * MARGIN * jerk,
                    4.0 * MARGIN * jerk,
                    h,
                );
                (longest_s, wanted) = (axis_s, (asked - planned) / velocity);
            }
        }
        wanted
    }

    /// `wanted` in small steps: where next to nothing moves the limits leave more; to come in they are there.
    pub(super) fn small(&self, wanted: f64, outlook: &Outlook) -> f64 {
        let small = outlook.most_change_per_s2;
        let (down, up) = if self.rate_per_s < 0.0 {
            (small, 4.0 * small)
        } else {
            (4.0 * small, small)
        };
        wanted.clamp(-down, up)
    }

    /// σ̈ that brings the rate to `sigma` soonest; infinite where that is too far for the law to say more.
    pub(super) fn freely(&self, sigma: f64, outlook: &Outlook) -> f64 {
        let most = MARGIN * outlook.rate_change_per_s2;
        if !most.is_finite() {
            return f64::INFINITY;
        }
        let free = self.approach(self.sigma - sigma, outlook.share * most, most);
        if free < most { free } else { f64::INFINITY }
    }

    fn approach(&self, off: f64, gentle: f64, most: f64) -> f64 {
        if off == 0.0 && self.rate_per_s == 0.0 {
            return 0.0;
        }
        to_rest(
            off - self.period_s * self.rate_per_s / 2.0,
            self.rate_per_s,
            gentle,
            most,
            self.period_s,
        )
    }

    /// Acceleration at the points of the period, at the rate with which it ends.
    fn accelerations(&self, outlook: &Outlook, reserve: &Steps, interval: &mut Interval) {
        let h = self.period_s;
        let end = (self.sigma + h * self.rate_per_s).clamp(0.0, 1.0);
        for point in outlook.iter().take_while(|p| p.offset_s <= h) {
            for (axis, (limit, _)) in outlook.limits() {
                let planned = end * end * point.acceleration[axis];
                let left = MARGIN * limit - reserve.acceleration_mm_per_s2(axis, end, h);
                let most = left.max(planned.abs());
                interval.keep(
                    planned + point.velocity[axis] * self.rate_per_s,
                    point.velocity[axis] * h,
                    most,
                );
            }
        }
    }

    /// Jerk at the points of the period, up to `excess` of the limit beyond it.
    fn jerks(&self, outlook: &Outlook, reserve: &Steps, excess: f64, interval: &mut Interval) {
        let (h, rate) = (self.period_s, self.rate_per_s);
        for point in outlook.iter().take_while(|p| p.offset_s <= h) {
            let part = (point.offset_s / (h * self.sigma).max(f64::MIN_POSITIVE)).min(1.0);
            let sigma = (self.sigma + part * h * rate).clamp(0.0, 1.0);
            for (axis, (_, limit)) in outlook.limits() {
                let planned = sigma * sigma * sigma * point.jerk[axis];
                let turning = 3.0 * point.acceleration[axis] * sigma;
                let left = MARGIN * limit - reserve.jerk_mm_per_s3(axis, sigma, h);
                let most = left.max(planned.abs() + LEFT * limit) + excess * limit;
                interval.keep(
                    planned + turning * rate,
                    point.velocity[axis] + turning * part * h,
                    most,
                );
            }
        }
    }

    /// Takes σ̈ for this period; gives the program time that passes, s.
    fn pass(&mut self, change_per_s2: f64) -> f64 {
        let (h, sigma, rate) = (self.period_s, self.sigma, self.rate_per_s);
        self.sigma = sigma + h * (rate + h * change_per_s2 / 2.0);
        self.rate_per_s = rate + h * change_per_s2;
        let mut delta_s = h * (sigma + h * (rate / 2.0 + h * change_per_s2 / 6.0));
        if self.sigma <= 0.0 || self.sigma >= 1.0 {
            // There it stays: what the last step would have gone beyond is the law's rounding.
            self.sigma = self.sigma.clamp(0.0, 1.0);
            self.rate_per_s = 0.0;
            delta_s = delta_s.clamp(0.0, h);
        }
        delta_s
    }
}
