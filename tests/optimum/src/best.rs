//! The shortest time along a curve, by a slow solver: the whole curve at once, on a fine grid, in many rounds.
//!
//! The motion of one round, as a spline of the path coordinate over its time, is retimed
//! ([`tandem_motion::retime`]) to the motion of the next; the grid becomes finer from round to round. Nothing is streamed and
//! nothing is held back: shares of limits are 1. Then the motion is sampled as the fine loop does it; where a difference of
//! samples exceeds a limit, that place gets less, until none does. So the time found is one that can be driven.
//!
//! Where the curvature jumps, acceleration does too. A jump Δa makes a third difference of 0.75·Δa/T at some phase of the
//! tick, whatever the motion around it is; the speed at such a knot is held to what leaves no more than the jerk limit.

use tandem_motion::nurbs::{AlongPath, Place};
use tandem_motion::retime::{
    AnyRetimer, AxisLimits, Between, End, GRID, PLACES, Point, Rate, Task,
};
use tandem_sdk::MAX_AXES;

use crate::course::{Course, Limits};

/// Grids of the rounds, as multiples of the last one.
const ROUNDS: [f64; 9] = [8.0, 8.0, 8.0, 4.0, 4.0, 2.0, 2.0, 1.0, 1.0];
/// Largest third difference of a unit step of acceleration, per 1/T.
const STEP: f64 = 0.75;
/// Rounds in which samples are made to keep the limits.
const REPAIRS: usize = 12;
/// What a difference may exceed its limit by: rounding.
const ROUNDING: f64 = 1e-6;
/// What the next round aims at where it was exceeded.
const AIM: f64 = 0.998;
/// Phases of the tick at which samples are taken.
const PHASES: usize = 4;

/// What was found.
#[derive(Clone, Copy, Debug)]
pub struct Best {
    /// Shortest time under the limits at every instant but for jumps of acceleration at knots, s.
    pub relaxed_s: f64,
    /// Time of the motion whose samples keep every limit, s; not a number where none was found.
    pub kept_s: f64,
    /// Largest share of a limit that samples of the first reach.
    pub relaxed_share: f64,
}

/// A motion along the course: the path coordinate as a cubic B-spline of pseudo-time, and its rate.
#[derive(Clone, Debug, Default)]
struct Motion {
    coefficients: Vec<f64>,
    step_s: f64,
    rate: Rate,
}

/// Less of a limit on a part of the path.
#[derive(Clone, Copy, Debug)]
struct Ease {
    from_mm: f64,
    to_mm: f64,
    speed: f64,
    jerk: f64,
    acceleration: f64,
}

/// The shortest time along `course` from rest to rest, on a last grid of `step_s`; no number where no rate is found for some place.
pub fn best(course: &Course, limits: &Limits, step_s: f64) -> Best {
    let none = Best {
        relaxed_s: f64::NAN,
        kept_s: f64::NAN,
        relaxed_share: f64::NAN,
    };
    let mut motion = slow(course, limits);
    let mut eases = Vec::new();
    let mut retimer = AnyRetimer::default();
    for factor in ROUNDS {
        motion = turn(
            course,
            limits,
            &motion,
            factor * step_s,
            &eases,
            &mut retimer,
        );
        if !motion.duration_s().is_finite() {
            return none;
        }
    }
    let relaxed_s = motion.duration_s();
    let relaxed_share = ease(course, limits, &motion, &mut Vec::new());
    let mut kept_s = f64::NAN;
    for _ in 0..REPAIRS {
        if ease(course, limits, &motion, &mut eases) <= 1.0 + ROUNDING {
            kept_s = motion.duration_s();
            break;
        }
        motion = turn(course, limits, &motion, step_s, &eases, &mut retimer);
        if !motion.duration_s().is_finite() {
            break;
        }
    }
    Best {
        relaxed_s,
        kept_s,
        relaxed_share,
    }
}

/// A motion that is far too slow: speed rises and falls as a square of a sine.
fn slow(course: &Course, limits: &Limits) -> Motion {
    let length = course.length_mm();
    let total_s = 6.0 * length / limits.feed_mm_per_s + 0.4;
    let intervals = ((total_s / 4e-3).ceil() as usize).max(64);
    let step_s = total_s / intervals as f64;
    let at = |t: f64| {
        let share = (t / total_s).clamp(0.0, 1.0);
        length * (share - (std::f64::consts::TAU * share).sin() / std::f64::consts::TAU)
    };
    let mut coefficients: Vec<f64> = (0..intervals + 3)
        .map(|n| at((n as f64 - 1.0) * step_s))
        .collect();
    coefficients[..3].fill(0.0);
    coefficients[intervals..].fill(length);
    Motion {
        coefficients,
        step_s,
        rate: Rate {
            coefficients: vec![1.0; intervals + 2],
        },
    }
}

/// The motion on a grid of its own time, retimed.
fn turn(
    course: &Course,
    limits: &Limits,
    before: &Motion,
    step_s: f64,
    eases: &[Ease],
    retimer: &mut AnyRetimer,
) -> Motion {
    let mut motion = before.on_its_time(step_s, course.length_mm());
    let mut place = Place::default();
    let mut points = Vec::with_capacity(motion.intervals());
    let mut between = Vec::new();
    let mut knot = 0;
    let knots = course.knots_mm();
    for k in 0..motion.intervals() {
        let states = GRID.map(|z| motion.spline(k, z));
        points.push(states.map(|state| {
            let at = course.at(state[0], &mut place);
            point(
                course,
                limits,
                (&state, &at),
                &Ease::at(eases, state[0]),
                f64::INFINITY,
            )
        }));
        while knot < knots.len() && knots[knot] <= states[2][0] {
            let knot_mm = knots[knot];
            knot += 1;
            if knot_mm < states[0][0] {
                continue;
            }
            let z = motion.place(k, knot_mm);
            let state = motion.spline(k, z);
            let sides = course.sides(knot_mm);
            let cap = step_cap_mm_per_s(&sides, limits);
            let [a, b] = sides.map(|at| {
                point(
                    course,
                    limits,
                    (&state, &at),
                    &Ease::at(eases, state[0]),
                    cap,
                )
            });
            between.push(Between {
                interval: k,
                z: [z; PLACES],
                points: [a, b, b],
            });
        }
    }
    let all = |of: &[f64]| -> [f64; MAX_AXES] {
        std::array::from_fn(|n| of.get(n).copied().unwrap_or(f64::INFINITY))
    };
    let task = Task {
        points: &points,
        between: &between,
        limits: AxisLimits {
            count: limits.jerk_mm_per_s3.len(),
            acceleration_mm_per_s2: all(&limits.acceleration_mm_per_s2),
            jerk_mm_per_s3: all(&limits.jerk_mm_per_s3),
        },
        step_s: motion.step_s,
        ends: (End::Rest, End::Rest),
    };
    retimer.solve(&task);
    motion
        .rate
        .coefficients
        .clone_from(&retimer.rate.coefficients);
    motion
}

/// The highest speed at which a jump of curvature leaves samples of every phase within the jerk limit.
fn step_cap_mm_per_s(sides: &[AlongPath; 2], limits: &Limits) -> f64 {
    let caps = limits
        .jerk_mm_per_s3
        .iter()
        .enumerate()
        .map(|(axis, jerk)| {
            let jump = (sides[1].curvature[axis] - sides[0].curvature[axis]).abs();
            (jerk * limits.period_s / (STEP * jump.max(1e-15))).sqrt()
        });
    caps.fold(f64::INFINITY, f64::min)
}

/// The motion at a place, by the chain rule.
fn point(
    course: &Course,
    limits: &Limits,
    ([_, s1, s2, s3], at): (&[f64; 4], &AlongPath),
    ease: &Ease,
    cap: f64,
) -> Point<MAX_AXES> {
    let mut point = Point {
        jerk_share: ease.jerk,
        acceleration_share: ease.acceleration,
        ..Point::default()
    };
    for lane in 0..limits.jerk_mm_per_s3.len() {
        let [x1, x2, x3] = [at.direction[lane], at.curvature[lane], at.third[lane]];
        point.first[lane] = x1 * s1;
        point.second[lane] = x2 * s1 * s1 + x1 * s2;
        point.third[lane] = x3 * s1 * s1 * s1 + 3.0 * x2 * s1 * s2 + x1 * s3;
    }
    if *s1 > 1e-9 {
        let cap = course.cap_mm_per_s(at, limits).min(cap);
        point.most = (ease.speed * cap / s1).powi(2);
    }
    point
}

impl Ease {
    const NONE: Self = Self {
        from_mm: 0.0,
        to_mm: 0.0,
        speed: 1.0,
        jerk: 1.0,
        acceleration: 1.0,
    };

    /// What all of them leave at a place.
    fn at(eases: &[Self], s_mm: f64) -> Self {
        let here = eases
            .iter()
            .filter(|ease| (ease.from_mm..=ease.to_mm).contains(&s_mm));
        here.fold(Self::NONE, |all, ease| Self {
            speed: all.speed * ease.speed,
            jerk: all.jerk * ease.jerk,
            acceleration: all.acceleration * ease.acceleration,
            ..all
        })
    }
}

/// Adds what the samples ask for; gives the largest share of a limit that they reach.
fn ease(course: &Course, limits: &Limits, motion: &Motion, eases: &mut Vec<Ease>) -> f64 {
    let mut worst = 0.0f64;
    let knots = course.knots_mm();
    for phase in 0..PHASES {
        let first_s = limits.period_s * (1.0 - phase as f64 / PHASES as f64);
        let samples = motion.samples(first_s, limits.period_s);
        let mut place = Place::default();
        let positions: Vec<_> = samples
            .iter()
            .map(|s_mm| course.position(*s_mm, &mut place))
            .collect();
        for (n, four) in positions.windows(4).enumerate() {
            let (mut jerk, mut acceleration, mut speed) = (0.0f64, 0.0f64, 0.0f64);
            for (axis, most) in limits.jerk_mm_per_s3.iter().enumerate() {
                let [a, b, c, d] = [0, 1, 2, 3].map(|i: usize| four[i][axis]);
                let t = limits.period_s;
                let third = (d - 3.0 * c + 3.0 * b - a) / (t * t * t);
                let second = (d - 2.0 * c + b) / (t * t);
                jerk = jerk.max(third.abs() / most);
                acceleration = acceleration.max(second.abs() / limits.acceleration_mm_per_s2[axis]);
                speed = speed.max((d - c).abs() / t / limits.speed_mm_per_s[axis]);
            }
            speed = speed
                .max((samples[n + 3] - samples[n + 2]) / limits.period_s / limits.feed_mm_per_s);
            worst = worst.max(jerk).max(acceleration).max(speed);
            let (from_mm, to_mm) = (samples[n], samples[n + 3]);
            let less = |share: f64| {
                if share > 1.0 + ROUNDING {
                    AIM / share
                } else {
                    1.0
                }
            };
            let more = Ease {
                from_mm,
                to_mm,
                speed: less(speed),
                jerk: less(jerk),
                acceleration: less(acceleration),
            };
            if more.speed < 1.0 || more.jerk < 1.0 || more.acceleration < 1.0 {
                // Less jerk around a knot where acceleration jumps does not help: the speed is what counts.
                let jumps = knots.iter().any(|knot| (from_mm..=to_mm).contains(knot));
                let speed = if jumps {
                    more.speed * more.jerk.sqrt()
                } else {
                    more.speed
                };
                add(eases, Ease { speed, ..more });
            }
        }
    }
    worst
}

/// Adds a place, once: samples of several phases ask for the same.
fn add(eases: &mut Vec<Ease>, more: Ease) {
    if let Some(last) = eases.iter_mut().rev().take(64).find(|last| {
        (last.from_mm - more.from_mm).abs() < 0.5 * (more.to_mm - more.from_mm)
            && last.to_mm >= more.from_mm
    }) {
        last.speed = last.speed.min(more.speed);
        last.jerk = last.jerk.min(more.jerk);
        last.acceleration = last.acceleration.min(more.acceleration);
        last.from_mm = last.from_mm.min(more.from_mm);
        last.to_mm = last.to_mm.max(more.to_mm);
        return;
    }
    eases.push(more);
}

impl Motion {
    fn intervals(&self) -> usize {
        self.rate
            .intervals()
            .max(self.coefficients.len().saturating_sub(3))
    }

    /// How long it takes, s.
    fn duration_s(&self) -> f64 {
        (0..self.intervals())
            .map(|k| self.rate.time_s(k, 1.0, self.step_s))
            .sum()
    }

    /// Path coordinate and derivatives by pseudo-time at `z` of interval `k`.
    fn spline(&self, k: usize, z: f64) -> [f64; 4] {
        let h = self.step_s;
        let base = self.coefficients[k];
        let [c1, c2, c3] = [1, 2, 3].map(|n| self.coefficients[k + n] - base);
        let y = 1.0 - z;
        let value = ((3.0 * z * z * z - 6.0 * z * z + 4.0) * c1
            + (-3.0 * z * z * z + 3.0 * z * z + 3.0 * z + 1.0) * c2
            + z * z * z * c3)
            / 6.0;
        let first =
            ((3.0 * z * z - 4.0 * z) * c1 + (-3.0 * z * z + 2.0 * z + 1.0) * c2 + z * z * c3)
                / (2.0 * h);
        let second = ((3.0 * z - 2.0) * c1 + (y - 2.0 * z) * c2 + z * c3) / (h * h);
        let third = (3.0 * c1 - 3.0 * c2 + c3) / (h * h * h);
        [base + value, first, second, third]
    }

    /// Where in interval `k` it passes `s_mm`, by halving.
    fn place(&self, k: usize, s_mm: f64) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..50 {
            let middle = f64::midpoint(low, high);
            if self.spline(k, middle)[0] < s_mm {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }

    /// Calls `each` with path coordinate and acceleration at times asked for in order.
    fn walk(&self) -> impl FnMut(f64) -> [f64; 2] {
        let (mut k, mut start_s) = (0, 0.0);
        let mut whole_s = self.rate.time_s(0, 1.0, self.step_s);
        move |t_s| {
            while k + 1 < self.intervals() && t_s > start_s + whole_s {
                start_s += whole_s;
                k += 1;
                whole_s = self.rate.time_s(k, 1.0, self.step_s);
            }
            let z = self
                .rate
                .place(k, (t_s - start_s).clamp(0.0, whole_s), self.step_s);
            let [s, s1, s2, _] = self.spline(k, z);
            let [b, slope, _] = self.rate.at(k, z, self.step_s);
            [s, s2 * b + s1 * slope / 2.0]
        }
    }

    /// The same motion as a spline over its own time.
    fn on_its_time(&self, step_s: f64, length_mm: f64) -> Self {
        let total_s = self.duration_s();
        let intervals = ((total_s / step_s).ceil() as usize).max(40);
        let h = total_s / intervals as f64;
        let mut at = self.walk();
        let mut coefficients: Vec<f64> = (0..intervals + 3)
            .map(|n| {
                let [s, a] = at((n as f64 - 1.0) * h);
                s - h * h / 6.0 * a
            })
            .collect();
        coefficients[..3].fill(0.0);
        coefficients[intervals..].fill(length_mm);
        let mut furthest = 0.0f64;
        for coefficient in &mut coefficients {
            furthest = furthest.max(*coefficient).min(length_mm);
            *coefficient = furthest;
        }
        Self {
            coefficients,
            step_s: h,
            rate: Rate::default(),
        }
    }

    /// Path coordinates at the tick, the first one at `first_s`, with rest before and behind.
    fn samples(&self, first_s: f64, period_s: f64) -> Vec<f64> {
        let total_s = self.duration_s();
        let mut at = self.walk();
        let mut samples = vec![0.0; 3];
        let mut t = first_s;
        while t < total_s {
            samples.push(at(t)[0]);
            t += period_s;
        }
        let end = self.coefficients[self.coefficients.len() - 1];
        samples.extend([end; 3]);
        samples
    }
}
