//! One interval's share of the Newton system.

use super::rows::{Form, MIN_RATE_SQUARED, Pair, Single, dot};

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

    /// The time that an interval takes, `b^(−1/2)` with `b = w·β`.
    #[inline]
    pub fn time(&mut self, w: &Form, beta: &Form) {
        let b = dot(w, beta).max(MIN_RATE_SQUARED);
        let slope = -0.5 / (b * b.sqrt());
        self.square(w, -1.5 * slope / b);
        self.slope(w, slope);
    }

    /// Rows `weight·w·β ± form·β ≤ right` of some lanes at one place, where `common` is `weight·w·β`.
    #[inline]
    pub fn pairs(&mut self, forms: &[Form], pairs: &mut [Pair], place: &Place, target: f64) {
        let mut sum = 0.0;
        let mut slope = 0.0;
        let mut mixed = [0.0; 3];
        for (form, pair) in forms.iter().zip(pairs) {
            let value = dot(form, &place.beta);
            let left = place.common + value;
            let right = place.common - value;
            let over = [left - place.right, right - place.right];
            let mut rows = [[0.0; 2]; 2];
            for n in 0..2 {
                let per_slack = 1.0 / pair.slack[n];
                let residual = over[n] + pair.slack[n];
                rows[0][n] = pair.multiplier[n] * per_slack;
                rows[1][n] = (target + pair.multiplier[n] * residual) * per_slack;
                pair.change[n] = residual;
                pair.answer[n] = per_slack;
            }
            let [[d0, d1], [g0, g1]] = rows;
            let over = (place.common + value.abs() - place.right) / place.right;
            self.violation = if over > self.violation {
                over
            } else {
                self.violation
            };
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
        let per_slack = 1.0 / single.slack;
        let residual = over + single.slack;
        single.change = residual;
        single.answer = per_slack;
        self.violation = if over > self.violation {
            over
        } else {
            self.violation
        };
        self.square(w, single.multiplier * per_slack);
        self.slope(
            w,
            sign * (target + single.multiplier * residual) * per_slack,
        );
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

/// How near to its bound a step may go.
const BOUNDARY: f64 = 0.95;

/// How far slacks and multipliers may go: the largest shares of them that a whole step would take, for both rows of pairs.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reach {
    slack: [f64; 2],
    multiplier: [f64; 2],
}

impl Reach {
    /// The changes of both rows of a pair, whose sides change by `common ± change`.
    #[inline]
    pub fn pair(&mut self, pair: &mut Pair, common: f64, change: f64, target: f64) {
        for (n, side) in [common + change, common - change].into_iter().enumerate() {
            let per_slack = pair.answer[n];
            let change = -pair.change[n] - side;
            let answer = (target - pair.multiplier[n] * (pair.slack[n] + change)) * per_slack;
            pair.change[n] = change;
            pair.answer[n] = answer;
            let shares = [-change * per_slack, -answer / pair.multiplier[n]];
            self.slack[n] = if shares[0] > self.slack[n] {
                shares[0]
            } else {
                self.slack[n]
            };
            self.multiplier[n] = if shares[1] > self.multiplier[n] {
                shares[1]
            } else {
                self.multiplier[n]
            };
        }
    }

    /// The changes of a row whose side changes by `change`.
    #[inline]
    pub fn single(&mut self, single: &mut Single, change: f64, target: f64) {
        let per_slack = single.answer;
        let change = -single.change - change;
        let answer = (target - single.multiplier * (single.slack + change)) * per_slack;
        single.change = change;
        single.answer = answer;
        let shares = [-change * per_slack, -answer / single.multiplier];
        self.slack[0] = if shares[0] > self.slack[0] {
            shares[0]
        } else {
            self.slack[0]
        };
        self.multiplier[0] = if shares[1] > self.multiplier[0] {
            shares[1]
        } else {
            self.multiplier[0]
        };
    }

    /// Lengths of the step for slacks and for multipliers, 1 at most.
    pub fn lengths(&self) -> [f64; 2] {
        [self.slack, self.multiplier].map(|[a, b]| (BOUNDARY / a.max(b)).min(1.0))
    }
}
