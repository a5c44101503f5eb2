//! The share of the Newton system that three places of an interval have, several intervals at once.

use super::PLACES;
use crate::lanes::{Lanes, each};

/// Single rows at most: bounds on b from above at each place, and from below at the second.
pub const MAX_SINGLES: usize = PLACES + 1;

/// Intervals side by side: four numbers fill a wide register, and none of them is wasted, however many axes there are.
pub const WIDE: usize = 4;
/// One number of each of them.
pub type Wide = Lanes<WIDE>;

/// A linear form of an interval's three coefficients.
pub type Form = [Wide; 3];

/// Slacks, multipliers and residuals of a pair of rows.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    pub slack: [Wide; 2],
    pub multiplier: [Wide; 2],
    pub residual: [Wide; 2],
    /// 1 over slack times multiplier: one division gives both their inverses.
    pub inverse: [Wide; 2],
}

impl Pair {
    const NONE: Self = Self {
        slack: [[0.0; WIDE]; 2],
        multiplier: [[0.0; WIDE]; 2],
        residual: [[0.0; WIDE]; 2],
        inverse: [[0.0; WIDE]; 2],
    };
}

/// The same of a single row.
#[derive(Clone, Copy, Debug)]
pub struct Single {
    pub slack: Wide,
    pub multiplier: Wide,
    pub residual: Wide,
    pub inverse: Wide,
}

impl Single {
    const NONE: Self = Self {
        slack: [0.0; WIDE],
        multiplier: [0.0; WIDE],
        residual: [0.0; WIDE],
        inverse: [0.0; WIDE],
    };
}

/// The rows at three places: a group is a pair for every axis. They lie on whole cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Rows<const L: usize, const GROUPS: usize> {
    pub pairs: [[Pair; GROUPS]; L],
    /// What multiplies b in the rows of jerk at each place, in the last pass.
    pub weight: [Wide; PLACES],
    pub singles: [Single; MAX_SINGLES],
}

impl<const L: usize, const GROUPS: usize> Rows<L, GROUPS> {
    pub const NONE: Self = Self {
        pairs: [[Pair::NONE; GROUPS]; L],
        weight: [[0.0; WIDE]; PLACES],
        singles: [Single::NONE; MAX_SINGLES],
    };
}

/// The right sides at a place: `weight·b ± form·β ≤ right`.
#[derive(Clone, Copy, Debug)]
pub struct Sides {
    pub weight: Wide,
    /// `weight·b − right`.
    pub over: Wide,
}

/// Hessian (upper triangle by rows) and gradient.
#[derive(Clone, Copy, Debug, Default)]
pub struct Share {
    pub hessian: [Wide; 6],
    pub gradient: [Wide; 3],
}

const AT: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// `w·β`.
#[inline(always)]
pub fn dot(w: &[Wide; 3], beta: &[Wide; 3]) -> Wide {
    each(|i| w[0][i] * beta[0][i] + w[1][i] * beta[1][i] + w[2][i] * beta[2][i])
}

/// Weight and slope of a row that is `over` its right side; writes its residual.
#[inline(always)]
fn row(
    over: &Wide,
    (slack, multiplier): (&Wide, &Wide),
    (residual, inverse): (&mut Wide, &mut Wide),
    target: f64,
) -> (Wide, Wide) {
    *residual = each(|i| over[i] + slack[i]);
    *inverse = each(|i| 1.0 / (slack[i] * multiplier[i]));
    let per_slack: Wide = each(|i| multiplier[i] * inverse[i]);
    (
        each(|i| multiplier[i] * per_slack[i]),
        each(|i| (target + multiplier[i] * residual[i]) * per_slack[i]),
    )
}

/// Weights and slopes of a pair of rows that are `over` their right sides.
#[inline(always)]
fn both(over: &[Wide; 2], pair: &mut Pair, target: f64) -> ([Wide; 2], [Wide; 2]) {
    let [mut d, mut g] = [[[0.0; WIDE]; 2]; 2];
    for n in 0..2 {
        (d[n], g[n]) = row(
            &over[n],
            (&pair.slack[n], &pair.multiplier[n]),
            (&mut pair.residual[n], &mut pair.inverse[n]),
            target,
        );
    }
    (d, g)
}

impl Share {
    /// Adds a pair of rows of jerk at `place`; `common` is its weight times the weights of b.
    #[inline(always)]
    pub fn jerk(
        &mut self,
        form: &Form,
        beta: &[Wide; 3],
        (place, common): (&Sides, &[Wide; 3]),
        pair: &mut Pair,
        target: f64,
    ) {
        let value = dot(form, beta);
        let over = [
            each(|i| place.over[i] + value[i]),
            each(|i| place.over[i] - value[i]),
        ];
        let (d, g) = both(&over, pair, target);
        let plus = [0, 1, 2].map(|n| each(|i| common[n][i] + form[n][i]));
        let minus = [0, 1, 2].map(|n| each(|i| common[n][i] - form[n][i]));
        self.add(&plus, &d[0], &g[0]);
        self.add(&minus, &d[1], &g[1]);
    }

    /// Adds a pair of rows of acceleration, which is linear in b: `±form·β ≤ 1`.
    #[inline(always)]
    pub fn acceleration(&mut self, form: &Form, beta: &[Wide; 3], pair: &mut Pair, target: f64) {
        let value = dot(form, beta);
        let over = [each(|i| value[i] - 1.0), each(|i| -value[i] - 1.0)];
        let (d, g) = both(&over, pair, target);
        let bend = each(|i| d[0][i] + d[1][i]);
        let slope = each(|i| g[0][i] - g[1][i]);
        self.add(form, &bend, &slope);
    }

    /// Adds the single row `sign·w·β ≤ …` that is `over` its right side.
    #[inline(always)]
    pub fn single(
        &mut self,
        w: &[Wide; 3],
        sign: f64,
        over: &Wide,
        single: &mut Single,
        target: f64,
    ) {
        let (bend, slope) = row(
            over,
            (&single.slack, &single.multiplier),
            (&mut single.residual, &mut single.inverse),
            target,
        );
        let slope = each(|i| sign * slope[i]);
        self.add(w, &bend, &slope);
    }

    /// Adds `bend·w·wᵀ` and `slope·w`.
    #[inline(always)]
    pub fn add(&mut self, w: &[Wide; 3], bend: &Wide, slope: &Wide) {
        let bent: [Wide; 3] = [0, 1, 2].map(|n| each(|i| bend[i] * w[n][i]));
        for (n, (a, b)) in AT.into_iter().enumerate() {
            let entry = self.hessian[n];
            self.hessian[n] = each(|i| entry[i] + bent[a][i] * w[b][i]);
        }
        for n in 0..3 {
            let entry = self.gradient[n];
            self.gradient[n] = each(|i| entry[i] + slope[i] * w[n][i]);
        }
    }
}
