//! The interior point method.

use super::banded::Pentadiagonal;
use super::share::{Form, MAX_SINGLES, Rows, Share, Sides};
use super::timing::{Rate, weights};
use super::{End, GRID, PLACES, Point};
use crate::lanes::{Lanes, each, larger, largest, smaller};

/// A bound on the rate squared where none is stated: sixteen times the speed of the first timing.
const MAX_RATE_SQUARED: f64 = 256.0;
/// Mean complementarity that no solvable problem comes to.
const HOPELESS: f64 = 1e3;
/// How near to its bound a step may go.
const BOUNDARY: f64 = 0.95;

/// How solving starts.
#[derive(Clone, Copy, Debug)]
struct Start {
    /// Least slack.
    slack: f64,
    /// Slack times multiplier.
    product: f64,
}

/// From a rate of 1, which may be far from what is sought.
const FIRST: Start = Start {
    slack: 0.1,
    product: 0.05,
};
/// From a rate that was found for about the same points.
const AGAIN: Start = Start {
    slack: 0.01,
    product: 1e-3,
};

/// How solving ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Status {
    /// Iterations made.
    pub iterations: usize,
    /// Mean complementarity at the end: how far from the optimum.
    pub gap: f64,
    /// Largest violation of a row, whose right side is 1 at a rate of 1.
    pub violation: f64,
}

/// What is asked of a solution, and what it may cost.
#[derive(Clone, Copy, Debug)]
pub struct Asked {
    /// Mean complementarity.
    pub gap: f64,
    /// Violation of a row, whose right side is 1 at a rate of 1.
    pub violation: f64,
    /// Iterations at most.
    pub iterations: usize,
    /// Least rate squared.
    pub min_rate_squared: f64,
}

/// What each axis may do, as factors of acceleration and jerk: what is used of a limit is 1. An axis that is not there has 0.
#[derive(Clone, Copy, Debug)]
pub struct Factors<const L: usize> {
    /// One over the acceleration, s²/mm.
    pub per_acceleration: Lanes<L>,
    /// One over the jerk, s³/mm.
    pub per_jerk: Lanes<L>,
}

/// Three places of an interval: the rows there.
#[derive(Clone, Copy, Debug)]
struct Site<const L: usize, const GROUPS: usize> {
    interval: usize,
    /// The time of the interval counts here: once for each.
    timed: bool,
    /// Weights of b at each place.
    values: [[f64; 3]; PLACES],
    forms: [Form<L>; GROUPS],
    most: [f64; PLACES],
}

/// Solves retimings of up to `L` axes; keeps its memory from one to the next.
///
/// At three places of each interval there are `GROUPS` pairs of rows for each axis: jerk at every place, then acceleration
/// at the first one (4 groups) or two (5 groups). The rate is bounded from above at as many places and one more.
#[derive(Debug)]
pub struct Retimer<const L: usize, const GROUPS: usize> {
    sites: Vec<Site<L, GROUPS>>,
    intervals: usize,
    step_s: f64,
    rows: Vec<Rows<L, GROUPS>>,
    matrix: Pentadiagonal,
    step: Vec<f64>,
    /// Which unknown a coefficient is; negative for one that is fixed.
    unknown: Vec<i32>,
    unknowns: usize,
    /// Mean complementarity.
    gap: f64,
    min_rate_squared: f64,
    /// The result.
    pub rate: Rate,
}

impl<const L: usize, const GROUPS: usize> Default for Retimer<L, GROUPS> {
    fn default() -> Self {
        Self {
            sites: Vec::new(),
            intervals: 0,
            step_s: 0.0,
            rows: Vec::new(),
            matrix: Pentadiagonal::default(),
            step: Vec::new(),
            unknown: Vec::new(),
            unknowns: 0,
            gap: 0.0,
            min_rate_squared: 0.0,
            rate: Rate::default(),
        }
    }
}

#[inline(always)]
fn dot(w: &[f64; 3], beta: &[f64; 3]) -> f64 {
    w[0] * beta[0] + w[1] * beta[1] + w[2] * beta[2]
}

/// The rows `weight·b ± form·β ≤ right` at a place where b is `w·β`: the right side of the jerk, `b^(−1/2)`, is convex, its
/// tangent `3/2·b₀^(−1/2) − 1/2·b₀^(−3/2)·b` lies below.
#[inline(always)]
fn sides(w: &[f64; 3], beta: &[f64; 3], min_rate_squared: f64) -> Sides {
    let b = larger(dot(w, beta), min_rate_squared);
    let inverse = 1.0 / b.sqrt();
    let weight = 0.5 * inverse / b;
    Sides {
        w: *w,
        weight,
        common: weight * b,
        right: 1.5 * inverse,
    }
}

/// The same without a part in b: acceleration is linear in it.
fn steady(place: &Sides) -> Sides {
    Sides {
        weight: 0.0,
        common: 0.0,
        right: 1.0,
        ..*place
    }
}

/// The coefficients that count in an interval.
#[inline(always)]
fn beta(rate: &Rate, interval: usize) -> [f64; 3] {
    *rate.coefficients[interval..]
        .first_chunk()
        .expect("three coefficients")
}

impl<const L: usize, const GROUPS: usize> Retimer<L, GROUPS> {
    /// Places at which acceleration is asked for.
    const ACCELERATIONS: usize = GROUPS - PLACES;
    /// Places at which b is bounded from above; the single row after these bounds it from below.
    const BOUNDS: usize = Self::ACCELERATIONS + 1;

    /// Begins a grid with intervals of `step_s`. Then [`Retimer::push`] every interval, and [`Retimer::solve`].
    pub fn begin(&mut self, step_s: f64) {
        self.sites.clear();
        self.intervals = 0;
        self.step_s = step_s;
    }

    /// The next interval: the motion at its start, in its middle and at its end.
    #[inline(always)]
    pub fn push(&mut self, points: &[Point<L>; PLACES], factors: &Factors<L>) {
        self.push_site(self.intervals, true, (&GRID, points), factors);
        self.intervals += 1;
    }

    /// Further places of an interval: where in it, 0 to 1, and the motion there.
    pub fn push_between(
        &mut self,
        interval: usize,
        places: (&[f64; PLACES], &[Point<L>; PLACES]),
        factors: &Factors<L>,
    ) {
        self.push_site(interval, false, places, factors);
    }

    #[inline(always)]
    fn push_site(
        &mut self,
        interval: usize,
        timed: bool,
        (z, points): (&[f64; PLACES], &[Point<L>; PLACES]),
        factors: &Factors<L>,
    ) {
        let r1 = 1.0 / self.step_s;
        let r2 = 1.0 / (self.step_s * self.step_s);
        let mut forms = [[[0.0; L]; 3]; GROUPS];
        for n in 0..PLACES {
            let point = &points[n];
            let [value, slope, curve] = weights(z[n]);
            let per_share = 1.0 / point.jerk_share;
            let per_jerk: Lanes<L> = each(|l| factors.per_jerk[l] * per_share);
            for i in 0..3 {
                let w0 = value[i];
                let w1 = 1.5 * r1 * slope[i];
                let w2 = 0.5 * r2 * curve[i];
                forms[n][i] = each(|l| {
                    per_jerk[l] * (point.third[l] * w0 + point.second[l] * w1 + point.first[l] * w2)
                });
            }
        }
        for n in 0..Self::ACCELERATIONS {
            let point = &points[n];
            let [value, slope, _] = weights(z[n]);
            let per_share = 1.0 / point.acceleration_share;
            let per_acceleration: Lanes<L> = each(|l| factors.per_acceleration[l] * per_share);
            for i in 0..3 {
                let w0 = value[i];
                let w1 = 0.5 * r1 * slope[i];
                forms[PLACES + n][i] =
                    each(|l| per_acceleration[l] * (point.second[l] * w0 + point.first[l] * w1));
            }
        }
        self.sites.push(Site {
            interval,
            timed,
            values: [weights(z[0])[0], weights(z[1])[0], weights(z[2])[0]],
            forms,
            most: [points[0].most, points[1].most, points[2].most]
                .map(|most| smaller(most, MAX_RATE_SQUARED)),
        });
    }

    /// Finds the rate. Rough loop; allocates where the grid is larger than any before.
    pub fn solve(&mut self, ends: (End, End), asked: &Asked) -> Status {
        self.rate.coefficients.clear();
        self.rate.coefficients.resize(self.intervals + 2, 1.0);
        self.solve_from(FIRST, ends, asked)
    }

    /// The same, from the present [`Retimer::rate`]: that of points which were about the same, on the same grid.
    pub fn solve_again(&mut self, ends: (End, End), asked: &Asked) -> Status {
        self.solve_from(AGAIN, ends, asked)
    }

    fn solve_from(&mut self, start: Start, ends: (End, End), asked: &Asked) -> Status {
        self.min_rate_squared = asked.min_rate_squared;
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has what the function is compiled for.
            return unsafe { self.solve_wide(start, ends, asked) };
        }
        self.solve_any(start, ends, asked)
    }

    /// The same in wider instructions; the numbers are the same bit for bit.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn solve_wide(&mut self, start: Start, ends: (End, End), asked: &Asked) -> Status {
        self.solve_any(start, ends, asked)
    }

    #[inline(always)]
    fn solve_any(&mut self, start: Start, ends: (End, End), asked: &Asked) -> Status {
        self.name_unknowns(ends);
        self.start(start);
        let mut status = Status {
            iterations: 0,
            gap: start.product,
            violation: f64::INFINITY,
        };
        let mut shrink = 0.1;
        loop {
            let target = shrink * status.gap;
            status.violation = self.assemble(target);
            let good = status.gap < asked.gap && status.violation < asked.violation;
            // Multipliers grow without bound where no rate keeps the rows.
            let lost = status.gap > HOPELESS || status.gap.is_nan();
            if good || lost || status.iterations == asked.iterations {
                return status;
            }
            self.matrix.solve(&mut self.step);
            let length = self.advance(target);
            shrink = match length {
                l if l > 0.9 => 0.03,
                l if l > 0.7 => 0.2,
                l if l > 0.4 => 0.4,
                _ => 0.8,
            };
            status.gap = self.gap;
            status.iterations += 1;
        }
    }

    /// At rest the first (last) three coefficients are one; in motion the first (last) two are 1.
    fn name_unknowns(&mut self, (start, end): (End, End)) {
        let count = self.intervals + 2;
        let tied = |end: End, index: usize| end == End::Rest && index < 3;
        let fixed = |end: End, index: usize| end == End::Moving && index < 2;
        self.unknown.clear();
        let mut next = 0;
        for i in 0..count {
            let from_end = count - 1 - i;
            let is_fixed = fixed(start, i) || fixed(end, from_end);
            let repeats = tied(start, i) && i > 0 || tied(end, from_end) && from_end < 2;
            next += i32::from(!is_fixed && !repeats);
            self.unknown.push(if is_fixed { -1 } else { next - 1 });
        }
        self.unknowns = next as usize;
    }

    /// Slacks and multipliers for the present rate.
    #[inline(always)]
    fn start(&mut self, start: Start) {
        self.rows.clear();
        for site in &self.sites {
            let beta = beta(&self.rate, site.interval);
            let places = self.places(site, &beta);
            let mut slack = [[[0.0; L]; 2]; GROUPS];
            let mut multiplier = [[[0.0; L]; 2]; GROUPS];
            for group in 0..GROUPS {
                let form = &site.forms[group];
                let room = places
                    .get(group)
                    .map_or(1.0, |place| place.right - place.common);
                for (n, sign) in [1.0, -1.0].into_iter().enumerate() {
                    slack[group][n] = each(|l| {
                        let value =
                            form[0][l] * beta[0] + form[1][l] * beta[1] + form[2][l] * beta[2];
                        larger(room - sign * value, start.slack)
                    });
                    multiplier[group][n] = each(|l| start.product / slack[group][n][l]);
                }
            }
            let mut single_slack = [start.slack; MAX_SINGLES];
            for n in 0..Self::BOUNDS {
                single_slack[n] = larger(site.most[n] - dot(&site.values[n], &beta), start.slack);
            }
            let above = dot(&site.values[1], &beta) - self.min_rate_squared;
            single_slack[Self::BOUNDS] = larger(above, start.slack);
            self.rows.push(Rows {
                slack,
                multiplier,
                residual: [[[0.0; L]; 2]; GROUPS],
                inverse: [[[0.0; L]; 2]; GROUPS],
                weight: [0.0; GROUPS],
                single_slack,
                single_multiplier: single_slack.map(|s| start.product / s),
                single_residual: [0.0; MAX_SINGLES],
            });
        }
    }

    /// The places of a site at the present rate.
    #[inline(always)]
    fn places(&self, site: &Site<L, GROUPS>, beta: &[f64; 3]) -> [Sides; PLACES] {
        let [a, b, c] = &site.values;
        let least = self.min_rate_squared;
        [
            sides(a, beta, least),
            sides(b, beta, least),
            sides(c, beta, least),
        ]
    }

    #[inline(always)]
    fn mean(&self, pairs: &Lanes<L>, singles: f64) -> f64 {
        (pairs.iter().sum::<f64>() + singles)
            / (self.rows.len() * (2 * GROUPS * L + Self::BOUNDS + 1)) as f64
    }

    /// The Newton system with `f = Σ b^(−1/2)` in the middles; gives the largest violation.
    #[inline(always)]
    fn assemble(&mut self, target: f64) -> f64 {
        self.matrix.clear(self.unknowns);
        self.step.clear();
        self.step.resize(self.unknowns, 0.0);
        let mut violation = [0.0; L];
        for k in 0..self.sites.len() {
            let site = &self.sites[k];
            let beta = beta(&self.rate, site.interval);
            let places = self.places(site, &beta);
            let rows = &mut self.rows[k];
            let mut share = Share::<L>::default();
            for (group, place) in places.iter().enumerate() {
                share.pair(&site.forms[group], &beta, place, rows, group, target);
            }
            for n in 0..Self::ACCELERATIONS {
                let group = PLACES + n;
                let place = steady(&places[n]);
                share.pair(&site.forms[group], &beta, &place, rows, group, target);
            }
            for (n, place) in places.iter().take(Self::BOUNDS).enumerate() {
                let over = dot(&place.w, &beta) - site.most[n];
                share.single(&place.w, 1.0, over, rows, n, target);
            }
            let middle = &places[1].w;
            let under = self.min_rate_squared - dot(middle, &beta);
            share.single(middle, -1.0, under, rows, Self::BOUNDS, target);
            if site.timed {
                let b = larger(dot(middle, &beta), self.min_rate_squared);
                let slope = -0.5 / (b * b.sqrt());
                share.add(middle, -1.5 * slope / b, slope);
            }
            let interval = site.interval;
            violation = each(|l| larger(violation[l], share.violation[l]));
            self.scatter(interval, &share);
        }
        largest(&violation)
    }

    #[inline(always)]
    fn scatter(&mut self, k: usize, share: &Share<L>) {
        const AT: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
        let (hessian, gradient) = share.sums();
        let unknown: [i32; 3] = *self.unknown[k..].first_chunk().expect("three coefficients");
        if unknown[0] >= 0 && unknown[1] == unknown[0] + 1 && unknown[2] == unknown[1] + 1 {
            let first = unknown[0] as usize;
            let rows: &mut [[f64; 3]; 3] = self.matrix.rows[first..]
                .first_chunk_mut()
                .expect("three unknowns");
            for (i, row) in rows.iter_mut().enumerate() {
                for j in i..3 {
                    row[j - i] += hessian[AT[i][j]];
                }
                self.step[first + i] -= gradient[i];
            }
            return;
        }
        for i in 0..3 {
            let Ok(row) = usize::try_from(unknown[i]) else {
                continue;
            };
            self.step[row] -= gradient[i];
            for j in 0..3 {
                let Ok(right) = usize::try_from(unknown[j] - unknown[i]) else {
                    continue;
                };
                self.matrix.rows[row][right] += hessian[AT[i][j]];
            }
        }
    }

    /// Goes along the step as far as slacks and multipliers stay positive; gives the length of the primal step.
    #[inline(always)]
    fn advance(&mut self, target: f64) -> f64 {
        let (length, back) = self.turn_into_changes(target);
        let mut pairs = [0.0; L];
        let mut singles = 0.0;
        for rows in &mut self.rows {
            for group in 0..GROUPS {
                for n in 0..2 {
                    let change = rows.residual[group][n];
                    let slack = rows.slack[group][n];
                    let multiplier = rows.multiplier[group][n];
                    rows.slack[group][n] = each(|l| slack[l] + length * change[l]);
                    let inverse = &rows.inverse[group][n];
                    // Δλ = (target − λ·(s + Δs))/s.
                    rows.multiplier[group][n] = each(|l| {
                        let per_slack = multiplier[l] * inverse[l];
                        multiplier[l]
                            + back * (target - multiplier[l] * (slack[l] + change[l])) * per_slack
                    });
                    let slack = &rows.slack[group][n];
                    let multiplier = &rows.multiplier[group][n];
                    pairs = each(|l| pairs[l] + slack[l] * multiplier[l]);
                }
            }
            for n in 0..=Self::BOUNDS {
                let (slack, multiplier, change) = (
                    rows.single_slack[n],
                    rows.single_multiplier[n],
                    rows.single_residual[n],
                );
                rows.single_slack[n] = slack + length * change;
                rows.single_multiplier[n] =
                    multiplier + back * (target - multiplier * (slack + change)) / slack;
                singles += rows.single_slack[n] * rows.single_multiplier[n];
            }
        }
        self.gap = self.mean(&pairs, singles);
        for (coefficient, unknown) in self.rate.coefficients.iter_mut().zip(&self.unknown) {
            if let Ok(unknown) = usize::try_from(*unknown) {
                *coefficient += length * self.step[unknown];
            }
        }
        length
    }

    /// Replaces residuals by the changes of the slacks; gives how far slacks and multipliers may go.
    #[inline(always)]
    fn turn_into_changes(&mut self, target: f64) -> (f64, f64) {
        // The largest relative decrease of a slack and of a multiplier.
        let mut most = [0.0; L];
        let mut max_back = [0.0; L];
        for (site, rows) in self.sites.iter().zip(&mut self.rows) {
            let change = |n: usize| {
                usize::try_from(self.unknown[site.interval + n]).map_or(0.0, |u| self.step[u])
            };
            let step = [change(0), change(1), change(2)];
            let along = [
                dot(&site.values[0], &step),
                dot(&site.values[1], &step),
                dot(&site.values[2], &step),
            ];
            for group in 0..GROUPS {
                let form = &site.forms[group];
                // Rows of acceleration have no part in b: their weight is 0.
                let common = along
                    .get(group)
                    .map_or(0.0, |along| rows.weight[group] * along);
                let value: Lanes<L> =
                    each(|l| form[0][l] * step[0] + form[1][l] * step[1] + form[2][l] * step[2]);
                for (n, sign) in [1.0, -1.0].into_iter().enumerate() {
                    let multiplier = &rows.multiplier[group][n];
                    let residual = rows.residual[group][n];
                    let change: Lanes<L> = each(|l| -residual[l] - common - sign * value[l]);
                    rows.residual[group][n] = change;
                    // Changes over themselves: Δs/s, and that of the multiplier, (target/λ − s − Δs)/s.
                    let inverse = &rows.inverse[group][n];
                    let shrinking: Lanes<L> = each(|l| -change[l] * multiplier[l] * inverse[l]);
                    most = each(|l| larger(most[l], shrinking[l]));
                    max_back =
                        each(|l| larger(max_back[l], 1.0 - shrinking[l] - target * inverse[l]));
                }
            }
            for n in 0..=Self::BOUNDS {
                let along = if n < Self::BOUNDS {
                    along[n]
                } else {
                    -along[1]
                };
                let slack = rows.single_slack[n];
                let multiplier = rows.single_multiplier[n];
                let change = -rows.single_residual[n] - along;
                rows.single_residual[n] = change;
                most[0] = larger(most[0], -change / slack);
                max_back[0] = larger(max_back[0], (slack + change - target / multiplier) / slack);
            }
        }
        let length = |most: &Lanes<L>| smaller(1.0, BOUNDARY / larger(largest(most), 1e-9));
        (length(&most), length(&max_back))
    }
}
