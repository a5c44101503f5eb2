//! The share of the Newton system that three places of an interval have, all axes at once.

use super::PLACES;
use crate::lanes::{Lanes, each, larger};

/// Single rows at most: bounds on b from above at each place, and from below at the second.
pub const MAX_SINGLES: usize = PLACES + 1;

/// A linear form of an interval's three coefficients, of every lane.
pub type Form<const L: usize> = [Lanes<L>; 3];

/// Slacks, multipliers and residuals of the rows at three places. A group is a pair of rows for every axis.
#[derive(Clone, Copy, Debug)]
pub struct Rows<const L: usize, const GROUPS: usize> {
    pub slack: [[Lanes<L>; 2]; GROUPS],
    pub multiplier: [[Lanes<L>; 2]; GROUPS],
    pub residual: [[Lanes<L>; 2]; GROUPS],
    /// 1 over slack times multiplier: one division gives both their inverses.
    pub inverse: [[Lanes<L>; 2]; GROUPS],
    /// What multiplies b in the rows of each group, in the last pass.
    pub weight: [f64; GROUPS],
    pub single_slack: [f64; MAX_SINGLES],
    pub single_multiplier: [f64; MAX_SINGLES],
    pub single_residual: [f64; MAX_SINGLES],
}

/// The right sides at a place: `weight·b ± form·β ≤ right`.
#[derive(Clone, Copy, Debug)]
pub struct Sides {
    /// Weights of b at the place.
    pub w: [f64; 3],
    pub weight: f64,
    /// `weight·b`.
    pub common: f64,
    pub right: f64,
}

/// Hessian (upper triangle by rows) and gradient, of every lane; their sums over the lanes count.
#[derive(Clone, Copy, Debug)]
pub struct Share<const L: usize> {
    hessian: [Lanes<L>; 6],
    gradient: [Lanes<L>; 3],
    /// Largest violation, as a share of the right side.
    pub violation: Lanes<L>,
}

const AT: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

#[inline(always)]
fn sum<const L: usize>(lanes: &Lanes<L>) -> f64 {
    let mut sum = 0.0;
    for value in lanes {
        sum += value;
    }
    sum
}

impl<const L: usize> Default for Share<L> {
    fn default() -> Self {
        Self {
            hessian: [[0.0; L]; 6],
            gradient: [[0.0; L]; 3],
            violation: [0.0; L],
        }
    }
}

impl<const L: usize> Share<L> {
    /// Adds the pair of rows `group`.
    #[inline(always)]
    pub fn pair<const GROUPS: usize>(
        &mut self,
        form: &Form<L>,
        beta: &[f64; 3],
        sides: &Sides,
        rows: &mut Rows<L, GROUPS>,
        group: usize,
        target: f64,
    ) {
        let value: Lanes<L> =
            each(|l| form[0][l] * beta[0] + form[1][l] * beta[1] + form[2][l] * beta[2]);
        let over = sides.common - sides.right;
        rows.weight[group] = sides.weight;
        self.violation = each(|l| larger(self.violation[l], over + value[l].abs()));
        let [mut d, mut g] = [[[0.0; L]; 2]; 2];
        for (n, sign) in [1.0, -1.0].into_iter().enumerate() {
            let slack = &rows.slack[group][n];
            let multiplier = &rows.multiplier[group][n];
            let residual: Lanes<L> = each(|l| over + sign * value[l] + slack[l]);
            rows.residual[group][n] = residual;
            let inverse: Lanes<L> = each(|l| 1.0 / (slack[l] * multiplier[l]));
            rows.inverse[group][n] = inverse;
            let per_slack: Lanes<L> = each(|l| multiplier[l] * inverse[l]);
            d[n] = each(|l| multiplier[l] * per_slack[l]);
            g[n] = each(|l| (target + multiplier[l] * residual[l]) * per_slack[l]);
        }
        let (sum, gap): (Lanes<L>, Lanes<L>) =
            (each(|l| d[0][l] + d[1][l]), each(|l| d[0][l] - d[1][l]));
        let common = [
            sides.w[0] * sides.weight,
            sides.w[1] * sides.weight,
            sides.w[2] * sides.weight,
        ];
        for (n, (i, j)) in AT.into_iter().enumerate() {
            let both = common[i] * common[j];
            let entry = &mut self.hessian[n];
            *entry = each(|l| {
                entry[l]
                    + sum[l] * (form[i][l] * form[j][l] + both)
                    + gap[l] * (form[i][l] * common[j] + form[j][l] * common[i])
            });
        }
        for i in 0..3 {
            let entry = &mut self.gradient[i];
            *entry = each(|l| {
                entry[l] + (g[0][l] - g[1][l]) * form[i][l] + (g[0][l] + g[1][l]) * common[i]
            });
        }
    }

    /// Adds the single row `sign·w·β ≤ …` that is `over` its right side.
    #[inline(always)]
    pub fn single<const GROUPS: usize>(
        &mut self,
        w: &[f64; 3],
        sign: f64,
        over: f64,
        rows: &mut Rows<L, GROUPS>,
        index: usize,
        target: f64,
    ) {
        let slack = rows.single_slack[index];
        let multiplier = rows.single_multiplier[index];
        rows.single_residual[index] = over + slack;
        self.violation[0] = larger(self.violation[0], over);
        let per_slack = 1.0 / slack;
        self.add(
            w,
            multiplier * per_slack,
            sign * (target + multiplier * (over + slack)) * per_slack,
        );
    }

    /// Adds `bend·w·wᵀ` and `slope·w`.
    #[inline(always)]
    pub fn add(&mut self, w: &[f64; 3], bend: f64, slope: f64) {
        for (n, (i, j)) in AT.into_iter().enumerate() {
            self.hessian[n][0] += bend * w[i] * w[j];
        }
        for i in 0..3 {
            self.gradient[i][0] += slope * w[i];
        }
    }

    /// The sums over the lanes.
    #[inline(always)]
    pub fn sums(&self) -> ([f64; 6], [f64; 3]) {
        let h = &self.hessian;
        let g = &self.gradient;
        (
            [
                sum(&h[0]),
                sum(&h[1]),
                sum(&h[2]),
                sum(&h[3]),
                sum(&h[4]),
                sum(&h[5]),
            ],
            [sum(&g[0]), sum(&g[1]), sum(&g[2])],
        )
    }
}
