//! The limits as rows `c·β ≤ right` over three neighbouring coefficients, and what the interior point method keeps of them.

use super::timing::weights;
use super::{LaneLimits, PLACES, Point};

/// Share of an acceleration limit that is used: between the places asked for it changes a little.
const ACCELERATION_SHARE: f64 = 0.99;
/// Least rate squared.
pub const LEAST: f64 = 1e-3;
/// A bound on the rate squared where none is stated: sixteen times the speed of the first timing.
const MOST: f64 = 256.0;

/// A linear form of an interval's three coefficients.
pub type Form = [f64; 3];

/// Two rows, `|form·β| ≤ right`: slack and multiplier of each, and its residual in the last pass.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pair {
    pub slack: [f64; 2],
    pub multiplier: [f64; 2],
    pub residual: [f64; 2],
}

/// One row.
#[derive(Clone, Copy, Debug, Default)]
pub struct Single {
    pub slack: f64,
    pub multiplier: f64,
    pub residual: f64,
}

/// Weights of b at the places.
pub fn value_weights() -> [Form; PLACES] {
    [0.0, 0.5, 1.0].map(|z| weights(z)[0])
}

/// Bounds on b of an interval: at its places, and from below in its middle.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    pub most: [f64; PLACES],
}

impl Bounds {
    pub fn new(points: &[Point; PLACES]) -> Self {
        Self { most: points.map(|p| p.most.min(MOST)) }
    }
}

/// Adds the forms of an interval in shares of their limits: jerk at each place per lane, then acceleration at its start and
/// middle per lane.
pub fn push_forms(forms: &mut Vec<Form>, points: &[Point; PLACES], limits: &LaneLimits, jerk_share: f64, step_s: f64) {
    let scales = [1.0, 1.0 / step_s, 1.0 / (step_s * step_s)];
    let places: [[Form; 3]; PLACES] = [0.0, 0.5, 1.0].map(weights);
    for (point, [value, slope, curve]) in points.iter().zip(&places) {
        for lane in 0..limits.lanes {
            let per = 1.0 / (jerk_share * point.jerk_share * limits.jerk[lane]);
            let (x1, x2, x3) = (point.first[lane], point.second[lane], point.third[lane]);
            forms.push(std::array::from_fn(|n| {
                per * (x3 * value[n] + 1.5 * x2 * slope[n] * scales[1] + 0.5 * x1 * curve[n] * scales[2])
            }));
        }
    }
    for (point, [value, slope, _]) in points.iter().zip(&places).take(2) {
        for lane in 0..limits.lanes {
            let per = 1.0 / (ACCELERATION_SHARE * limits.acceleration[lane]);
            let (x1, x2) = (point.first[lane], point.second[lane]);
            forms.push(std::array::from_fn(|n| per * (x2 * value[n] + 0.5 * x1 * slope[n] * scales[1])));
        }
    }
}

/// The right sides of the jerk rows at a place with the rate squared `b`: `right` and the weight of b on the left side.
///
/// `J·b^(−1/2)` is convex, its tangent `3/2·b₀^(−1/2) − 1/2·b₀^(−3/2)·b` lies below.
#[inline]
pub fn tangent(b: f64) -> (f64, f64) {
    let inverse = 1.0 / b.max(LEAST).sqrt();
    (1.5 * inverse, 0.5 * inverse / b.max(LEAST))
}

#[inline]
pub fn dot(a: &Form, b: &Form) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
