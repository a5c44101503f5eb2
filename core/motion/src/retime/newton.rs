//! One interval's share of the Newton system.

use super::rows::{Form, Pair, Single, dot};

/// Hessian (upper triangle by rows) and gradient over the three coefficients, and the largest violation seen.
#[derive(Clone, Copy, Debug, Default)]
pub struct Share {
    pub hessian: [f64; 6],
    pub gradient: Form,
    pub violation: f64,
}

impl Share {
    /// Adds `weight·c·cᵀ`.
    #[inline]
    pub fn square(&mut self, c: &Form, weight: f64) {
        let w = [weight * c[0], weight * c[1], weight * c[2]];
        self.hessian[0] += w[0] * c[0];
        self.hessian[1] += w[0] * c[1];
        self.hessian[2] += w[0] * c[2];
        self.hessian[3] += w[1] * c[1];
        self.hessian[4] += w[1] * c[2];
        self.hessian[5] += w[2] * c[2];
    }

    /// Adds `c·dᵀ + d·cᵀ`.
    #[inline]
    fn cross(&mut self, c: &Form, d: &Form) {
        self.hessian[0] += 2.0 * c[0] * d[0];
        self.hessian[1] += c[0] * d[1] + c[1] * d[0];
        self.hessian[2] += c[0] * d[2] + c[2] * d[0];
        self.hessian[3] += 2.0 * c[1] * d[1];
        self.hessian[4] += c[1] * d[2] + c[2] * d[1];
        self.hessian[5] += 2.0 * c[2] * d[2];
    }

    /// Adds `weight·c` to the gradient.
    #[inline]
    pub fn slope(&mut self, c: &Form, weight: f64) {
        for (sum, c) in self.gradient.iter_mut().zip(c) {
            *sum += weight * c;
        }
    }

    /// Rows `weight·w·β ± form·β ≤ right` of some lanes at one place, where `common` is `weight·w·β`.
    #[inline]
    pub fn pairs(&mut self, forms: &[Form], pairs: &mut [Pair], place: &Place, target: f64) {
        let (mut sum, mut slope) = (0.0, 0.0);
        let mut mixed = [0.0; 3];
        for (form, pair) in forms.iter().zip(pairs) {
            let value = dot(form, &place.beta);
            let (left, right) = (place.common + value, place.common - value);
            let (d0, g0) = row(&mut pair.residual[0], pair.slack[0], pair.multiplier[0], left - place.right, target);
            let (d1, g1) = row(&mut pair.residual[1], pair.slack[1], pair.multiplier[1], right - place.right, target);
            let over = (place.common + value.abs() - place.right) / place.right;
            self.violation = if over > self.violation { over } else { self.violation };
            self.square(form, d0 + d1);
            self.slope(form, g0 - g1);
            sum += d0 + d1;
            slope += g0 + g1;
            for n in 0..3 {
                mixed[n] += (d0 - d1) * form[n];
            }
        }
        if place.weight != 0.0 {
            self.square(&place.w, sum * place.weight * place.weight);
            self.slope(&place.w, slope * place.weight);
            self.cross(&place.w, &mixed.map(|m| m * place.weight));
        }
    }

    /// The row `sign·w·β ≤ right`.
    #[inline]
    pub fn single(&mut self, w: &Form, sign: f64, over: f64, single: &mut Single, target: f64) {
        let (d, g) = row(&mut single.residual, single.slack, single.multiplier, over, target);
        self.violation = if over > self.violation { over } else { self.violation };
        self.square(w, d);
        self.slope(w, sign * g);
    }
}

/// A place of an interval as a pass sees it.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// The interval's coefficients.
    pub beta: Form,
    /// Weights of b here.
    pub w: Form,
    /// What multiplies b on the left side of jerk rows.
    pub weight: f64,
    /// `weight·w·β`.
    pub common: f64,
    /// The right side.
    pub right: f64,
}

/// Weight in the Hessian and in the gradient of a row that is `over` its right side.
#[inline]
fn row(residual: &mut f64, slack: f64, multiplier: f64, over: f64, target: f64) -> (f64, f64) {
    let per_slack = 1.0 / slack;
    *residual = over + slack;
    (multiplier * per_slack, (target + multiplier * *residual) * per_slack)
}
