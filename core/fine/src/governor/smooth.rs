//! The governor where jerk is limited: the rate of program time is smooth itself.
//!
//! With q the plan in program time an axis jerks by `q‴σ³ + 3q″σσ̇ + q′σ̈`. What is chosen for a period is σ̈. Limits at
//! the points of the period give an interval for it; those further ahead bound σ̇ early enough to bring it down.

use super::Governor;
use crate::law::to_rest;
use crate::outlook::{Ahead3, Outlook};

/// Share of the limits that is aimed at: the rest covers what changes within a period.
const MARGIN: f64 = 0.995;
/// Share of jerk and acceleration that σ is foreseen to have at least, where the plan uses all of them: without any it would
/// never leave a rest there. The one tolerance on jerk covers it; what the acceleration really leaves counts later.
const LEFT: f64 = 0.006;
/// By which share of the limit jerk goes beyond it where it must: the first that leaves a rate is taken.
const EXCESSES: [f64; 8] = [0.01, 0.03, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2];
/// Least rate that is told from none.
const SLOWEST: f64 = 1e-4;
/// Least way to an aim that is told from none.
const NEAREST: f64 = 1e-8;
/// Below this share of what one period can change, a rate is where it was to go.
const SNAP: f64 = 1e-3;

/// What is asked of the coming period.
#[derive(Clone, Copy, Debug)]
pub struct Aim {
    /// Rate of program time to reach.
    pub sigma: f64,
    /// Path speed not to exceed, mm/s.
    pub speed_mm_per_s: f64,
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
struct Interval {
    low: f64,
    high: f64,
}

impl Interval {
    const ALL: Self = Self { low: f64::NEG_INFINITY, high: f64::INFINITY };

    /// Keeps `|constant + slope·x| ≤ most`.
    fn keep(&mut self, constant: f64, slope: f64, most: f64) {
        // A constant beyond the limit that nothing can change leaves no interval; rounding is not such a case.
        let (a, b) = ((-most - constant) / slope, (most - constant) / slope);
        if a.is_nan() || b.is_nan() || slope.abs() < f64::MIN_POSITIVE {
            return;
        }
        self.low = self.low.max(a.min(b));
        self.high = self.high.min(a.max(b));
    }

    fn is_empty(&self) -> bool {
        self.low > self.high
    }

    fn contains(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }

    /// The value nearest to `wanted`; of an empty interval its middle.
    fn nearest(&self, wanted: f64) -> f64 {
        if self.is_empty() { f64::midpoint(self.low, self.high) } else { wanted.clamp(self.low, self.high) }
    }
}

/// The way of σ to its aim, seen from a point ahead.
#[derive(Clone, Copy, Debug)]
struct Way {
    /// 1 towards the aim, −1 towards rest.
    direction: f64,
    /// How far σ has to go from here.
    left: f64,
    /// Time to the point, s.
    there_s: f64,
}

/// What is left for the rate of program time at a point.
#[derive(Clone, Copy, Debug)]
struct Reserve {
    /// Largest |σ̇|, 1/s.
    most_per_s: f64,
    /// |σ̈| with which it can be brought down, 1/s².
    change_per_s2: f64,
}

/// The largest ρ with `square·ρ² + slope·ρ ≤ room`, `room ≥ 0`; infinite where there is none.
fn root(square: f64, slope: f64, room: f64) -> f64 {
    let sum = slope + (slope * slope + 4.0 * square * room).sqrt();
    if sum > 0.0 { 2.0 * room / sum } else { -slope / square.max(f64::MIN_POSITIVE) }
}

impl Governor {
    /// Chooses the rate for this period where jerk is limited, and takes it.
    pub fn smooth(&mut self, aim: &Aim, outlook: &Outlook) -> Chosen {
        let wanted = self.wanted(aim, outlook);
        if wanted == 0.0 && self.rate_per_s == 0.0 {
            return Chosen { delta_s: self.sigma * self.period_s, relaxed: false };
        }
        let mut early = Interval::ALL;
        self.early(aim, outlook, &mut early);
        let mut firm = Interval::ALL;
        self.accelerations(outlook, &mut firm);
        let mut all = firm;
        self.jerks(outlook, 0.0, &mut all);
        // Where next to nothing moves the limits leave more than small steps; to come in they are there.
        let small = outlook.most_change_per_s2;
        let (down, up) = if self.rate_per_s < 0.0 { (small, 4.0 * small) } else { (4.0 * small, small) };
        let foreseen = early.nearest(wanted).clamp(-down, up);
        let relaxed = all.is_empty();
        let mut least = all;
        for excess in EXCESSES {
            if !least.is_empty() {
                break;
            }
            least = firm;
            self.jerks(outlook, excess, &mut least);
        }
        let chosen = if least.is_empty() { firm.nearest(foreseen) } else { least.nearest(foreseen) };
        let before = self.rate_per_s;
        let delta_s = self.pass(chosen);
        // Where σ has met an end of its range, σ̇ ended there and not as chosen.
        let change = (self.rate_per_s - before) / self.period_s;
        let cut = self.rate_per_s == 0.0 && !all.contains(change);
        self.settle(aim, outlook);
        Chosen { delta_s, relaxed: relaxed || cut }
    }

    /// Ends an approach: what rounding leaves of it is far below what a period may change.
    fn settle(&mut self, aim: &Aim, outlook: &Outlook) {
        let h = self.period_s;
        let most = SNAP * outlook.rate_change_per_s2.min(1.0 / (h * h)) * h;
        let target = if aim.speed_mm_per_s == 0.0 { 0.0 } else { aim.sigma };
        if (self.sigma - target).abs() < most * h && self.rate_per_s.abs() < most {
            (self.sigma, self.rate_per_s) = (target, 0.0);
        }
    }

    /// σ̈ that reaches the aim soonest, were there no limits but those of the approach.
    fn wanted(&self, aim: &Aim, outlook: &Outlook) -> f64 {
        let h = self.period_s;
        let [speed, acceleration, jerk] = aim.path;
        let most = MARGIN * outlook.rate_change_per_s2;
        let free =
            if most.is_finite() { self.approach(self.sigma - aim.sigma, outlook.share * most, most) } else { 0.0 };
        let path_jerk = MARGIN * outlook.path_jerk_mm_per_s3.min(speed * outlook.most_change_per_s2);
        if aim.speed_mm_per_s.is_infinite() || speed <= 0.0 || !path_jerk.is_finite() {
            return free;
        }
        let (sigma, rate) = (self.sigma, self.rate_per_s);
        let along = sigma * sigma * acceleration + speed * rate;
        let over = sigma * speed - aim.speed_mm_per_s;
        if over == 0.0 && along == 0.0 {
            return free.min(0.0);
        }
        let asked = to_rest(over - h * along / 2.0, along, outlook.share * path_jerk, 4.0 * path_jerk, h);
        let planned = sigma * (sigma * sigma * jerk + 3.0 * acceleration * rate);
        let capped = (asked - planned) / speed;
        // At its bound the law of the rate only says that its aim is far.
        if free < most { free.min(capped) } else { capped }
    }

    fn approach(&self, off: f64, gentle: f64, most: f64) -> f64 {
        if off == 0.0 && self.rate_per_s == 0.0 {
            return 0.0;
        }
        to_rest(off - self.period_s * self.rate_per_s / 2.0, self.rate_per_s, gentle, most, self.period_s)
    }

    /// Acceleration at the points of the period, at the rate with which it ends.
    fn accelerations(&self, outlook: &Outlook, interval: &mut Interval) {
        let h = self.period_s;
        let end = (self.sigma + h * self.rate_per_s).clamp(0.0, 1.0);
        for point in outlook.iter().take_while(|p| p.offset_s <= h) {
            for (axis, (limit, _)) in outlook.limits() {
                let planned = end * end * point.acceleration[axis];
                let most = (MARGIN * limit).max(planned.abs());
                interval.keep(planned + point.velocity[axis] * self.rate_per_s, point.velocity[axis] * h, most);
            }
        }
    }

    /// Jerk at the points of the period, up to `excess` of the limit beyond it.
    fn jerks(&self, outlook: &Outlook, excess: f64, interval: &mut Interval) {
        let (h, rate) = (self.period_s, self.rate_per_s);
        for point in outlook.iter().take_while(|p| p.offset_s <= h) {
            let part = (point.offset_s / (h * self.sigma).max(f64::MIN_POSITIVE)).min(1.0);
            let sigma = (self.sigma + part * h * rate).clamp(0.0, 1.0);
            for (axis, (_, limit)) in outlook.limits() {
                let planned = sigma * sigma * sigma * point.jerk[axis];
                let turning = 3.0 * point.acceleration[axis] * sigma;
                let most = (MARGIN * limit).max(planned.abs() + self.left() * limit) + excess * limit;
                interval.keep(planned + turning * rate, point.velocity[axis] + turning * part * h, most);
            }
        }
    }

    /// Bounds on σ̇ from all points: from each of them on it can be brought to rest at its aim, within the limits there.
    fn early(&self, aim: &Aim, outlook: &Outlook, interval: &mut Interval) {
        let h = self.period_s;
        let (mut least_up, mut least_down) = (f64::INFINITY, f64::INFINITY);
        for point in outlook.iter() {
            // At the present rate of change: σ² = σ₀² + 2σ̇·offset.
            let square = self.sigma * self.sigma + 2.0 * self.rate_per_s * point.offset_s;
            if square < 0.0 {
                break;
            }
            let sigma = square.sqrt().min(aim.sigma.max(self.sigma));
            let there_s = (2.0 * point.offset_s / (self.sigma + sigma).max(SLOWEST) - h).max(0.0);
            let used = h * self.rate_per_s.abs();
            let up = self.rate_at(
                point,
                outlook,
                aim.sigma.max(sigma),
                &Way { direction: 1.0, left: aim.sigma - self.sigma - used, there_s },
            );
            let down = self.rate_at(point, outlook, sigma, &Way { direction: -1.0, left: self.sigma - used, there_s });
            (least_up, least_down) = (least_up.min(up.change_per_s2), least_down.min(down.change_per_s2));
            let high = up.most_per_s + outlook.share * least_up * there_s;
            let low = -(down.most_per_s + outlook.share * least_down * there_s);
            interval.low = interval.low.max((low - self.rate_per_s) / h);
            interval.high = interval.high.min((high - self.rate_per_s) / h);
        }
    }

    /// The largest rate of change of σ at a point from which σ̈ brings it to zero where the aim is, and how much σ̈ there
    /// is for that.
    ///
    /// Coming in needs `σ̈ = −σ̇²/(2·(left − σ̇·t))` at the time t of the point; with ρ = |σ̇| and s the sign of the axis'
    /// velocity its jerk asks for `|q′|ρ²/(2·(left − ρt)) − 3sq″σρ ≤ J ± sq‴σ³`, which is quadratic in ρ. The acceleration
    /// asks for `|q″σ² + q′σ̇| ≤ A`.
    fn rate_at(&self, point: &Ahead3, outlook: &Outlook, sigma: f64, way: &Way) -> Reserve {
        let mut reserve = Reserve { most_per_s: f64::INFINITY, change_per_s2: f64::INFINITY };
        let (h, direction, left) = (self.period_s, way.direction, way.left.max(NEAREST));
        for (axis, (limit, jerk_limit)) in outlook.limits() {
            let towards = point.velocity[axis].signum();
            let speed = point.velocity[axis].abs();
            let turning = 3.0 * towards * point.acceleration[axis] * sigma;
            let planned = towards * point.jerk[axis] * sigma * sigma * sigma;
            let room = (MARGIN * jerk_limit + direction * planned).max(self.left() * jerk_limit);
            let square = (speed + 2.0 * way.there_s * turning).max(0.0);
            let slope = 2.0 * (way.there_s * room - left * turning);
            let coming = outlook.share * root(square, slope, 2.0 * left * room);
            let steep = coming.hypot(h * room / speed.max(f64::MIN_POSITIVE));
            let accelerated = towards * direction * point.acceleration[axis];
            // Speeding up adds to what the plan accelerates at the aim, slowing down to what it brakes at the present rate.
            let share = if direction > 0.0 { 1.0 } else { sigma * sigma };
            let held = (MARGIN * limit - (share * accelerated).max(0.0)).max(self.left() * limit) / speed;
            // Where the axis turns round, σ̈ is no help.
            let help = speed * outlook.rate_change_per_s2;
            let turned = (room + help) / (-turning).max(f64::MIN_POSITIVE);
            let turned_back =
                (MARGIN * jerk_limit - direction * planned + help).max(0.0) / turning.max(f64::MIN_POSITIVE);
            reserve.most_per_s = reserve.most_per_s.min(steep).min(held).min(turned).min(turned_back);
            let change = (room + turning * self.rate_per_s.abs()).max(0.0) / speed;
            reserve.change_per_s2 = reserve.change_per_s2.min(change);
        }
        reserve
    }

    /// What σ is foreseen to have at least. A plan that runs as it is has nothing to come back to: there a jerk that is
    /// beyond the limit at single points, and not in the samples, is left alone.
    fn left(&self) -> f64 {
        if self.sigma >= 1.0 && self.rate_per_s == 0.0 { 0.0 } else { LEFT }
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
