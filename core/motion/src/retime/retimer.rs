//! The interior point method.

use super::banded::Pentadiagonal;
use super::share::{Form, Rows, Share, Sides, WIDE, Wide, dot};
use super::timing::{Rate, weights};
use super::{End, GRID, PLACES, Point};
use crate::in_wide_instructions;
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

/// Three places each of as many intervals as there are lanes, side by side: the rows there. They lie on whole cache lines: half of the
/// wide loads would cross from one to the next.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Sites<const L: usize, const GROUPS: usize> {
    interval: [usize; WIDE],
    /// 1 where the time of the interval counts here: once for each.
    timed: Wide,
    /// Weights of b at each place.
    values: [[Wide; 3]; PLACES],
    /// Of every axis.
    forms: [[Form; GROUPS]; L],
    most: [Wide; PLACES],
    /// How many there are. Behind the last of all it stands again, and is not counted twice in what is sought.
    count: usize,
}

impl<const L: usize, const GROUPS: usize> Sites<L, GROUPS> {
    const NONE: Self = Self {
        count: 0,
        interval: [0; WIDE],
        timed: [0.0; WIDE],
        values: [[[0.0; WIDE]; 3]; PLACES],
        forms: [[[[0.0; WIDE]; 3]; GROUPS]; L],
        most: [[0.0; WIDE]; PLACES],
    };
}

/// Solves retimings of up to `L` axes; keeps its memory from one to the next.
///
/// At three places of each interval there are `GROUPS` pairs of rows for each axis: jerk at every place, then acceleration
/// at the first one (4 groups) or two (5 groups). The rate is bounded from above at as many places and one more.
#[derive(Debug)]
pub struct Retimer<const L: usize, const GROUPS: usize> {
    sites: Vec<Sites<L, GROUPS>>,
    /// How many sites were pushed.
    count: usize,
    intervals: usize,
    step_s: f64,
    /// The axes that move: the rows of others are kept whatever the rate is.
    moving: [usize; L],
    moving_count: usize,
    rows: Vec<Rows<L, GROUPS>>,
    matrix: Pentadiagonal,
    step: Vec<f64>,
    /// The change of each coefficient.
    change: Vec<f64>,
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
            count: 0,
            intervals: 0,
            step_s: 0.0,
            moving: [0; L],
            moving_count: 0,
            rows: Vec::new(),
            matrix: Pentadiagonal::default(),
            step: Vec::new(),
            change: Vec::new(),
            unknown: Vec::new(),
            unknowns: 0,
            gap: 0.0,
            min_rate_squared: 0.0,
            rate: Rate::default(),
        }
    }
}

/// The rows `weight·b ± form·β ≤ right` at a place where b is `w·β`: the right side of the jerk, `b^(−1/2)`, is convex, its
/// tangent `3/2·b₀^(−1/2) − 1/2·b₀^(−3/2)·b` lies below.
#[inline(always)]
fn sides(w: &[Wide; 3], beta: &[Wide; 3], min_rate_squared: f64) -> Sides {
    let b = dot(w, beta);
    let b: Wide = each(|i| larger(b[i], min_rate_squared));
    let inverse: Wide = each(|i| 1.0 / b[i].sqrt());
    let weight: Wide = each(|i| 0.5 * inverse[i] / b[i]);
    Sides {
        weight,
        common: each(|i| weight[i] * b[i]),
        right: each(|i| 1.5 * inverse[i]),
    }
}

/// The places of sites at the present rate.
#[inline(always)]
fn places<const L: usize, const GROUPS: usize>(
    sites: &Sites<L, GROUPS>,
    beta: &[Wide; 3],
    min_rate_squared: f64,
) -> [Sides; PLACES] {
    let [a, b, c] = &sites.values;
    [
        sides(a, beta, min_rate_squared),
        sides(b, beta, min_rate_squared),
        sides(c, beta, min_rate_squared),
    ]
}

/// The coefficients that count in each interval.
#[inline(always)]
fn beta(coefficients: &[f64], interval: &[usize; WIDE]) -> [Wide; 3] {
    let mut beta = [[0.0; WIDE]; 3];
    for (i, k) in interval.iter().enumerate() {
        let c: &[f64; 3] = coefficients[*k..]
            .first_chunk()
            .expect("three coefficients");
        for n in 0..3 {
            beta[n][i] = c[n];
        }
    }
    beta
}

impl<const L: usize, const GROUPS: usize> Retimer<L, GROUPS> {
    /// Places at which acceleration is asked for.
    const ACCELERATIONS: usize = GROUPS - PLACES;
    /// Places at which b is bounded from above; the single row after these bounds it from below.
    const BOUNDS: usize = Self::ACCELERATIONS + 1;

    /// Begins a grid with intervals of `step_s` for a motion of the axes that are `moving`. Then [`Retimer::push`] every interval,
    /// and [`Retimer::solve`].
    pub fn begin(&mut self, step_s: f64, moving: &[bool; L]) {
        self.count = 0;
        self.intervals = 0;
        self.step_s = step_s;
        self.moving_count = 0;
        for l in (0..L).filter(|l| moving[*l]) {
            self.moving[self.moving_count] = l;
            self.moving_count += 1;
        }
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
        let at = self.count % WIDE;
        if self.count / WIDE == self.sites.len() {
            self.sites.push(Sites::NONE);
            self.rows.push(Rows::NONE);
        }
        let sites = &mut self.sites[self.count / WIDE];
        sites.count = at + 1;
        self.count += 1;
        sites.interval[at] = interval;
        sites.timed[at] = if timed { 1.0 } else { 0.0 };
        for n in 0..PLACES {
            let point = &points[n];
            let [value, slope, curve] = weights(z[n]);
            sites.most[n][at] = smaller(point.most, MAX_RATE_SQUARED);
            for i in 0..3 {
                sites.values[n][i][at] = value[i];
            }
            let per_share = 1.0 / point.jerk_share;
            for l in &self.moving[..self.moving_count] {
                let per_jerk = factors.per_jerk[*l] * per_share;
                let [third, second, first] = [
                    per_jerk * point.third[*l],
                    per_jerk * (1.5 * r1) * point.second[*l],
                    per_jerk * (0.5 * r2) * point.first[*l],
                ];
                for i in 0..3 {
                    sites.forms[*l][n][i][at] =
                        third * value[i] + second * slope[i] + first * curve[i];
                }
            }
            if n >= Self::ACCELERATIONS {
                continue;
            }
            let per_share = 1.0 / point.acceleration_share;
            for l in &self.moving[..self.moving_count] {
                let per_acceleration = factors.per_acceleration[*l] * per_share;
                let second = per_acceleration * point.second[*l];
                let first = per_acceleration * (0.5 * r1) * point.first[*l];
                for i in 0..3 {
                    sites.forms[*l][PLACES + n][i][at] = second * value[i] + first * slope[i];
                }
            }
        }
    }

    /// Fills the lanes behind the last site with that.
    fn fill_up(&mut self) {
        self.sites.truncate(self.count.div_ceil(WIDE));
        self.rows.truncate(self.sites.len());
        let Some(sites) = self.sites.last_mut() else {
            return;
        };
        let last = sites.count - 1;
        for at in sites.count..WIDE {
            sites.interval[at] = sites.interval[last];
            sites.timed[at] = sites.timed[last];
            for n in 0..PLACES {
                sites.most[n][at] = sites.most[n][last];
                for i in 0..3 {
                    sites.values[n][i][at] = sites.values[n][i][last];
                }
            }
            for form in sites.forms.as_flattened_mut().as_flattened_mut() {
                form[at] = form[last];
            }
        }
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

    in_wide_instructions! {
        fn solve_from = solve_any, solve_wide(
            &mut self,
            start: Start,
            ends: (End, End),
            asked: &Asked,
        ) -> Status;
    }

    #[inline(always)]
    fn solve_any(&mut self, start: Start, ends: (End, End), asked: &Asked) -> Status {
        self.min_rate_squared = asked.min_rate_squared;
        self.name_unknowns(ends);
        self.fill_up();
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
        for (sites, rows) in self.sites.iter().zip(&mut self.rows) {
            let beta = beta(&self.rate.coefficients, &sites.interval);
            let places = places(sites, &beta, self.min_rate_squared);
            for l in &self.moving[..self.moving_count] {
                for group in 0..GROUPS {
                    let value = dot(&sites.forms[*l][group], &beta);
                    let room = match places.get(group) {
                        Some(place) => each(|i| place.right[i] - place.common[i]),
                        None => [1.0; WIDE],
                    };
                    let pair = &mut rows.pairs[*l][group];
                    for (n, sign) in [1.0, -1.0].into_iter().enumerate() {
                        pair.slack[n] = each(|i| larger(room[i] - sign * value[i], start.slack));
                        pair.multiplier[n] = each(|i| start.product / pair.slack[n][i]);
                    }
                }
            }
            for n in 0..=Self::BOUNDS {
                let room: Wide = if n < Self::BOUNDS {
                    let b = dot(&sites.values[n], &beta);
                    each(|i| sites.most[n][i] - b[i])
                } else {
                    let b = dot(&sites.values[1], &beta);
                    each(|i| b[i] - self.min_rate_squared)
                };
                let single = &mut rows.singles[n];
                single.slack = each(|i| larger(room[i], start.slack));
                single.multiplier = each(|i| start.product / single.slack[i]);
            }
        }
    }

    #[inline(always)]
    fn mean(&self, products: &Wide) -> f64 {
        let pairs = 2 * GROUPS * self.moving_count;
        products.iter().sum::<f64>() / (WIDE * self.rows.len() * (pairs + Self::BOUNDS + 1)) as f64
    }

    /// The Newton system with `f = Σ b^(−1/2)` in the middles; gives the largest violation.
    #[inline(always)]
    fn assemble(&mut self, target: f64) -> f64 {
        self.matrix.clear(self.unknowns);
        self.step.clear();
        self.step.resize(self.unknowns, 0.0);
        let mut violation = [0.0; WIDE];
        for k in 0..self.sites.len() {
            let sites = &self.sites[k];
            let beta = beta(&self.rate.coefficients, &sites.interval);
            let places = places(sites, &beta, self.min_rate_squared);
            let rows = &mut self.rows[k];
            let mut share = Share {
                violation,
                ..Share::default()
            };
            for (group, place) in places.iter().enumerate() {
                rows.weight[group] = place.weight;
                let w = &sites.values[group];
                let common = [0, 1, 2].map(|n| each(|i| w[n][i] * place.weight[i]));
                for l in &self.moving[..self.moving_count] {
                    let form = &sites.forms[*l][group];
                    share.jerk(
                        form,
                        &beta,
                        (place, &common),
                        &mut rows.pairs[*l][group],
                        target,
                    );
                }
            }
            for group in PLACES..GROUPS {
                for l in &self.moving[..self.moving_count] {
                    let form = &sites.forms[*l][group];
                    share.acceleration(form, &beta, &mut rows.pairs[*l][group], target);
                }
            }
            for n in 0..Self::BOUNDS {
                let w = &sites.values[n];
                let b = dot(w, &beta);
                let over = each(|i| b[i] - sites.most[n][i]);
                share.single(w, 1.0, &over, &mut rows.singles[n], target);
            }
            let middle = &sites.values[1];
            let b = dot(middle, &beta);
            let under = each(|i| self.min_rate_squared - b[i]);
            share.single(
                middle,
                -1.0,
                &under,
                &mut rows.singles[Self::BOUNDS],
                target,
            );
            // The weight of the tangent is that of the time's slope.
            let slope: Wide = each(|i| -sites.timed[i] * places[1].weight[i]);
            let bend = each(|i| -1.5 * slope[i] / larger(b[i], self.min_rate_squared));
            share.add(middle, &bend, &slope);
            violation = share.violation;
            let (interval, count) = (sites.interval, sites.count);
            for at in 0..count {
                self.scatter(interval[at], &share, at);
            }
        }
        largest(&violation)
    }

    #[inline(always)]
    fn scatter(&mut self, k: usize, share: &Share, at: usize) {
        const AT: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
        let hessian = share.hessian.map(|entry| entry[at]);
        let gradient = share.gradient.map(|entry| entry[at]);
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
        let mut products = [0.0; WIDE];
        for rows in &mut self.rows {
            for l in &self.moving[..self.moving_count] {
                for pair in &mut rows.pairs[*l] {
                    for n in 0..2 {
                        let (slack, multiplier, change) =
                            (pair.slack[n], pair.multiplier[n], pair.residual[n]);
                        let inverse = &pair.inverse[n];
                        let new_slack: Wide = each(|i| slack[i] + length * change[i]);
                        // Δλ = (target − λ·(s + Δs))/s.
                        let new_multiplier: Wide = each(|i| {
                            let per_slack = multiplier[i] * inverse[i];
                            multiplier[i]
                                + back
                                    * (target - multiplier[i] * (slack[i] + change[i]))
                                    * per_slack
                        });
                        products = each(|i| products[i] + new_slack[i] * new_multiplier[i]);
                        pair.slack[n] = new_slack;
                        pair.multiplier[n] = new_multiplier;
                    }
                }
            }
            for single in &mut rows.singles[..=Self::BOUNDS] {
                let (slack, multiplier, change) =
                    (single.slack, single.multiplier, single.residual);
                single.slack = each(|i| slack[i] + length * change[i]);
                single.multiplier = each(|i| {
                    let per_slack = multiplier[i] * single.inverse[i];
                    multiplier[i]
                        + back * (target - multiplier[i] * (slack[i] + change[i])) * per_slack
                });
                products = each(|i| products[i] + single.slack[i] * single.multiplier[i]);
            }
        }
        self.gap = self.mean(&products);
        for (coefficient, change) in self.rate.coefficients.iter_mut().zip(&self.change) {
            *coefficient += length * change;
        }
        length
    }

    /// Replaces residuals by the changes of the slacks; gives how far slacks and multipliers may go.
    #[inline(always)]
    fn turn_into_changes(&mut self, target: f64) -> (f64, f64) {
        let step = &self.step;
        self.change.clear();
        self.change.extend(
            self.unknown
                .iter()
                .map(|unknown| usize::try_from(*unknown).map_or(0.0, |u| step[u])),
        );
        let mut reach = Reach::default();
        for (sites, rows) in self.sites.iter().zip(&mut self.rows) {
            let step = beta(&self.change, &sites.interval);
            let along = [0, 1, 2].map(|n| dot(&sites.values[n], &step));
            for l in &self.moving[..self.moving_count] {
                for group in 0..GROUPS {
                    let value = dot(&sites.forms[*l][group], &step);
                    // Rows of acceleration have no part in b.
                    let common = match along.get(group) {
                        Some(along) => each(|i| rows.weight[group][i] * along[i]),
                        None => [0.0; WIDE],
                    };
                    let pair = &mut rows.pairs[*l][group];
                    for (n, sign) in [1.0, -1.0].into_iter().enumerate() {
                        let residual = pair.residual[n];
                        let change: Wide = each(|i| -residual[i] - common[i] - sign * value[i]);
                        pair.residual[n] = change;
                        reach.row(&change, &pair.multiplier[n], &pair.inverse[n], target);
                    }
                }
            }
            for n in 0..=Self::BOUNDS {
                let single = &mut rows.singles[n];
                let residual = single.residual;
                let change: Wide = if n < Self::BOUNDS {
                    each(|i| -residual[i] - along[n][i])
                } else {
                    each(|i| -residual[i] + along[1][i])
                };
                single.residual = change;
                reach.row(&change, &single.multiplier, &single.inverse, target);
            }
        }
        reach.lengths()
    }
}

/// How far a step may go: the largest decrease of a slack and of a multiplier, over themselves.
#[derive(Clone, Copy, Debug, Default)]
struct Reach {
    slack: Wide,
    multiplier: Wide,
}

impl Reach {
    /// Of a row: Δs/s, and that of the multiplier, (target/λ − s − Δs)/s.
    #[inline(always)]
    fn row(&mut self, change: &Wide, multiplier: &Wide, inverse: &Wide, target: f64) {
        let shrinking: Wide = each(|i| -change[i] * multiplier[i] * inverse[i]);
        self.slack = each(|i| larger(self.slack[i], shrinking[i]));
        self.multiplier =
            each(|i| larger(self.multiplier[i], 1.0 - shrinking[i] - target * inverse[i]));
    }

    /// Lengths of the step of slacks and of multipliers. Were it called, what is reached would be kept in memory for that, and each
    /// row would wait for the row before to be written there.
    #[inline(always)]
    fn lengths(&self) -> (f64, f64) {
        let length = |most: &Wide| smaller(1.0, BOUNDARY / larger(largest(most), 1e-9));
        (length(&self.slack), length(&self.multiplier))
    }
}
