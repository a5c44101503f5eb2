//! The limits as rows `c·β ≤ right` over three neighbouring coefficients, and what the interior point method keeps of them.

use super::newton::Place;
use super::solve::Task;
use super::timing::weights;
use super::{PLACES, Point};

/// Share of an acceleration limit that is used: between the places asked for it changes a little.
const ACCELERATION_SHARE: f64 = 0.99;
/// Least rate squared.
pub const MIN_RATE_SQUARED: f64 = 1e-3;
/// A bound on the rate squared where none is stated: sixteen times the speed of the first timing.
const MAX_RATE_SQUARED: f64 = 256.0;

/// A linear form of an interval's three coefficients.
pub type Form = [f64; 3];

/// Two rows, `|form·β| ≤ right`: slack and multiplier of each. A pass leaves residual and 1/slack in `change` and `answer`,
/// and turns them into the changes of slack and multiplier.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pair {
    pub slack: [f64; 2],
    pub multiplier: [f64; 2],
    pub change: [f64; 2],
    pub answer: [f64; 2],
}

/// One row, the same way.
#[derive(Clone, Copy, Debug, Default)]
pub struct Single {
    pub slack: f64,
    pub multiplier: f64,
    pub change: f64,
    pub answer: f64,
}

/// Places on an interval: weights of b there and bounds on it.
#[derive(Clone, Copy, Debug)]
pub struct Site {
    pub interval: usize,
    pub values: [Form; PLACES],
    pub most: [f64; PLACES],
    z: [f64; PLACES],
}

impl Site {
    pub fn new(interval: usize, z: [f64; PLACES], points: &[Point; PLACES]) -> Self {
        Self {
            interval,
            values: z.map(|z| weights(z)[0]),
            most: points.map(|p| p.most.min(MAX_RATE_SQUARED)),
            z,
        }
    }

    /// The coefficients that count here.
    #[inline]
    pub fn beta(&self, coefficients: &[f64]) -> Form {
        let c = &coefficients[self.interval..self.interval + 3];
        [c[0], c[1], c[2]]
    }

    /// The places as a pass sees them.
    #[inline]
    pub fn places(&self, beta: &Form) -> [Place; PLACES] {
        self.values.map(|w| {
            let b = dot(&w, beta);
            let (right, weight) = tangent(b);
            Place {
                beta: *beta,
                w,
                weight,
                common: weight * b,
                right,
            }
        })
    }
}

/// Adds the forms of a site in shares of their limits: jerk at each place per lane, then acceleration at its first two
/// places per lane.
pub fn push_forms(forms: &mut Vec<Form>, site: &Site, points: &[Point; PLACES], task: &Task) {
    let limits = &task.limits;
    let step_s = task.step_s;
    let scales = [1.0, 1.0 / step_s, 1.0 / (step_s * step_s)];
    let places: [[Form; 3]; PLACES] = site.z.map(weights);
    for (point, [value, slope, curve]) in points.iter().zip(&places) {
        for lane in 0..limits.lanes {
            let per = 1.0 / (task.jerk_share * point.jerk_share * limits.jerk[lane]);
            let x1 = point.first[lane];
            let x2 = point.second[lane];
            let x3 = point.third[lane];
            forms.push(std::array::from_fn(|n| {
                per * (x3 * value[n]
                    + 1.5 * x2 * slope[n] * scales[1]
                    + 0.5 * x1 * curve[n] * scales[2])
            }));
        }
    }
    for (point, [value, slope, _]) in points.iter().zip(&places).take(2) {
        for lane in 0..limits.lanes {
            let per =
                1.0 / (ACCELERATION_SHARE * point.acceleration_share * limits.acceleration[lane]);
            let x1 = point.first[lane];
            let x2 = point.second[lane];
            forms.push(std::array::from_fn(|n| {
                per * (x2 * value[n] + 0.5 * x1 * slope[n] * scales[1])
            }));
        }
    }
}

/// The right sides of the jerk rows at a place with the rate squared `b`: `right` and the weight of b on the left side.
///
/// `J·b^(−1/2)` is convex, its tangent `3/2·b₀^(−1/2) − 1/2·b₀^(−3/2)·b` lies below.
#[inline]
pub fn tangent(b: f64) -> (f64, f64) {
    let inverse = 1.0 / b.max(MIN_RATE_SQUARED).sqrt();
    (1.5 * inverse, 0.5 * inverse / b.max(MIN_RATE_SQUARED))
}

#[inline]
pub fn dot(a: &Form, b: &Form) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
