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

/// Which entry of the upper triangle of a Hessian, row by row, is in a row and a column.
const AT: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

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
    /// Each interval follows the one before.
    follow: bool,
    /// 1 where the time of the interval counts here: once for each.
    timed: Wide,
    /// Weights of b at each place.
    values: [[Wide; 3]; PLACES],
    /// Of the axes that move, one behind the other.
    forms: [[Form; GROUPS]; L],
    most: [Wide; PLACES],
    /// How many there are. Behind the last of all it stands again, and is not counted twice in what is sought.
    count: usize,
}

impl<const L: usize, const GROUPS: usize> Sites<L, GROUPS> {
    const NONE: Self = Self {
        count: 0,
        interval: [0; WIDE],
        follow: false,
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
        over: each(|i| weight[i] * b[i] - 1.5 * inverse[i]),
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

/// The coefficients that count in each interval of sites.
#[inline(always)]
fn beta<const L: usize, const GROUPS: usize>(
    coefficients: &[f64],
    sites: &Sites<L, GROUPS>,
) -> [Wide; 3] {
    let interval = &sites.interval;
    if sites.follow {
        let c: &[f64; WIDE + 2] = coefficients[interval[0]..]
            .first_chunk()
            .expect("coefficients of all intervals");
        return [0, 1, 2].map(|n| each(|i| c[n + i]));
    }
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
    /// `count` times with what is pushed between, and [`Retimer::solve`].
    pub fn begin(&mut self, count: usize, step_s: f64, moving: &[bool; L]) {
        // Sites are large: where room is made for some more at a time, those there are would be copied again and again.
        let missing = count.div_ceil(WIDE).saturating_sub(self.sites.len());
        self.sites.reserve(missing);
        self.rows.reserve(missing);
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
        let moving = &self.moving[..self.moving_count];
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
            for (form, l) in sites.forms.iter_mut().zip(moving) {
                let per_jerk = factors.per_jerk[*l] * per_share;
                let [third, second, first] = [
                    per_jerk * point.third[*l],
                    per_jerk * (1.5 * r1) * point.second[*l],
                    per_jerk * (0.5 * r2) * point.first[*l],
                ];
                for i in 0..3 {
                    form[n][i][at] = third * value[i] + second * slope[i] + first * curve[i];
                }
            }
            if n >= Self::ACCELERATIONS {
                continue;
            }
            let per_share = 1.0 / point.acceleration_share;
            for (form, l) in sites.forms.iter_mut().zip(moving) {
                let per_acceleration = factors.per_acceleration[*l] * per_share;
                let second = per_acceleration * point.second[*l];
                let first = per_acceleration * (0.5 * r1) * point.first[*l];
                for i in 0..3 {
                    form[PLACES + n][i][at] = second * value[i] + first * slope[i];
                }
            }
        }
    }

    /// Fills the lanes behind the last site with that, and notes which sites are of intervals that follow each other.
    fn fill_up(&mut self) {
        self.sites.truncate(self.count.div_ceil(WIDE));
        self.rows.truncate(self.sites.len());
        for sites in &mut self.sites {
            let k = sites.interval[0];
            sites.follow = sites.count == WIDE && (1..WIDE).all(|at| sites.interval[at] == k + at);
        }
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
            let near = status.gap < asked.gap;
            // Multipliers grow without bound where no rate keeps the rows.
            let lost = status.gap > HOPELESS || status.gap.is_nan();
            let over = lost || status.iterations == asked.iterations;
            // How far rows are violated takes a fifth of a system, and counts only where nothing is left but them.
            if near || over {
                status.violation = self.violation();
                if over || status.violation < asked.violation {
                    return status;
                }
            }
            let target = shrink * status.gap;
            self.assemble(target);
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
            let beta = beta(&self.rate.coefficients, sites);
            let places = places(sites, &beta, self.min_rate_squared);
            let forms = &sites.forms[..self.moving_count];
            for (form, pairs) in forms.iter().zip(&mut rows.pairs) {
                for (group, pair) in pairs.iter_mut().enumerate() {
                    let value = dot(&form[group], &beta);
                    let room = match places.get(group) {
                        Some(place) => each(|i| -place.over[i]),
                        None => [1.0; WIDE],
                    };
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

    /// The largest violation of a row at the present rate.
    #[inline(always)]
    fn violation(&self) -> f64 {
        let mut most = [0.0; WIDE];
        for sites in &self.sites {
            let beta = beta(&self.rate.coefficients, sites);
            let places = places(sites, &beta, self.min_rate_squared);
            for form in &sites.forms[..self.moving_count] {
                for (group, form) in form.iter().enumerate() {
                    let value = dot(form, &beta);
                    let size: Wide = each(|i| value[i].abs());
                    most = match places.get(group) {
                        Some(place) => each(|i| larger(most[i], place.over[i] + size[i])),
                        None => each(|i| larger(most[i], size[i] - 1.0)),
                    };
                }
            }
            let along = [0, 1, 2].map(|n| dot(&sites.values[n], &beta));
            for n in 0..Self::BOUNDS {
                most = each(|i| larger(most[i], along[n][i] - sites.most[n][i]));
            }
            most = each(|i| larger(most[i], self.min_rate_squared - along[1][i]));
        }
        largest(&most)
    }

    /// The Newton system with `f = Σ b^(−1/2)` in the middles.
    #[inline(always)]
    fn assemble(&mut self, target: f64) {
        self.matrix.clear(self.unknowns);
        self.step.clear();
        self.step.resize(self.unknowns, 0.0);
        for k in 0..self.sites.len() {
            let sites = &self.sites[k];
            let beta = beta(&self.rate.coefficients, sites);
            let places = places(sites, &beta, self.min_rate_squared);
            let rows = &mut self.rows[k];
            let mut share = Share::default();
            let forms = &sites.forms[..self.moving_count];
            let pairs = &mut rows.pairs[..self.moving_count];
            for (group, place) in places.iter().enumerate() {
                rows.weight[group] = place.weight;
                let w = &sites.values[group];
                let common = [0, 1, 2].map(|n| each(|i| w[n][i] * place.weight[i]));
                for (form, pair) in forms.iter().zip(&mut *pairs) {
                    share.jerk(
                        &form[group],
                        &beta,
                        (place, &common),
                        &mut pair[group],
                        target,
                    );
                }
            }
            for group in PLACES..GROUPS {
                for (form, pair) in forms.iter().zip(&mut *pairs) {
                    share.acceleration(&form[group], &beta, &mut pair[group], target);
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
            let (interval, count) = (sites.interval, sites.count);
            if sites.follow
                && let Some(first) = self.first_of_row(interval[0])
            {
                self.scatter_all(first, &share);
                continue;
            }
            for at in 0..count {
                self.scatter(interval[at], &share, at);
            }
        }
    }

    /// The first unknown of as many intervals as there are lanes, from `k` on, where all of their coefficients are unknowns of their own.
    #[inline(always)]
    fn first_of_row(&self, k: usize) -> Option<usize> {
        let unknown: &[i32; WIDE + 2] = self.unknown[k..].first_chunk()?;
        let first = usize::try_from(unknown[0]).ok()?;
        let last = usize::try_from(unknown[WIDE + 1]).ok()?;
        (last == first + WIDE + 1).then_some(first)
    }

    /// Adds the shares of intervals that follow each other to the system.
    #[inline(always)]
    fn scatter_all(&mut self, first: usize, share: &Share) {
        let rows: &mut [[f64; 3]; WIDE + 2] = self.matrix.rows[first..]
            .first_chunk_mut()
            .expect("unknowns of their own");
        let step: &mut [f64; WIDE + 2] = self.step[first..]
            .first_chunk_mut()
            .expect("unknowns of their own");
        for at in 0..WIDE {
            for i in 0..3 {
                for j in i..3 {
                    rows[at + i][j - i] += share.hessian[AT[i][j]][at];
                }
                step[at + i] -= share.gradient[i][at];
            }
        }
    }

    /// Adds the share of one interval.
    #[inline(always)]
    fn scatter(&mut self, k: usize, share: &Share, at: usize) {
        let hessian = share.hessian.map(|entry| entry[at]);
        let gradient = share.gradient.map(|entry| entry[at]);
        let unknown: [i32; 3] = *self.unknown[k..].first_chunk().expect("three coefficients");
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
        let (length, back) = self.turn_into_falls(target);
        let mut products = [0.0; WIDE];
        for rows in &mut self.rows {
            for pairs in &mut rows.pairs[..self.moving_count] {
                for pair in pairs {
                    for n in 0..2 {
                        let (slack, multiplier, fall) =
                            (pair.slack[n], pair.multiplier[n], pair.residual[n]);
                        let inverse = &pair.inverse[n];
                        let new_slack: Wide = each(|i| slack[i] - length * fall[i]);
                        // Δλ = (target − λ·(s + Δs))/s.
                        let new_multiplier: Wide = each(|i| {
                            let per_slack = multiplier[i] * inverse[i];
                            multiplier[i]
                                + back * (target - multiplier[i] * (slack[i] - fall[i])) * per_slack
                        });
                        products = each(|i| products[i] + new_slack[i] * new_multiplier[i]);
                        pair.slack[n] = new_slack;
                        pair.multiplier[n] = new_multiplier;
                    }
                }
            }
            for single in &mut rows.singles[..=Self::BOUNDS] {
                let (slack, multiplier, fall) = (single.slack, single.multiplier, single.residual);
                single.slack = each(|i| slack[i] - length * fall[i]);
                single.multiplier = each(|i| {
                    let per_slack = multiplier[i] * single.inverse[i];
                    multiplier[i]
                        + back * (target - multiplier[i] * (slack[i] - fall[i])) * per_slack
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

    /// Replaces residuals by how much the slacks fall; gives how far slacks and multipliers may go.
    #[inline(always)]
    fn turn_into_falls(&mut self, target: f64) -> (f64, f64) {
        let step = &self.step;
        self.change.clear();
        self.change.extend(
            self.unknown
                .iter()
                .map(|unknown| usize::try_from(*unknown).map_or(0.0, |u| step[u])),
        );
        let mut reach = Reach::default();
        for (sites, rows) in self.sites.iter().zip(&mut self.rows) {
            let step = beta(&self.change, sites);
            let along = [0, 1, 2].map(|n| dot(&sites.values[n], &step));
            let forms = &sites.forms[..self.moving_count];
            for (form, pairs) in forms.iter().zip(&mut rows.pairs) {
                for (group, pair) in pairs.iter_mut().enumerate() {
                    let value = dot(&form[group], &step);
                    // Rows of acceleration have no part in b.
                    let common = match along.get(group) {
                        Some(along) => each(|i| rows.weight[group][i] * along[i]),
                        None => [0.0; WIDE],
                    };
                    for (n, sign) in [1.0, -1.0].into_iter().enumerate() {
                        let residual = pair.residual[n];
                        let fall: Wide = each(|i| residual[i] + common[i] + sign * value[i]);
                        pair.residual[n] = fall;
                        reach.row(&fall, &pair.multiplier[n], &pair.inverse[n], target);
                    }
                }
            }
            for n in 0..=Self::BOUNDS {
                let single = &mut rows.singles[n];
                let residual = single.residual;
                let fall: Wide = if n < Self::BOUNDS {
                    each(|i| residual[i] + along[n][i])
                } else {
                    each(|i| residual[i] - along[1][i])
                };
                single.residual = fall;
                reach.row(&fall, &single.multiplier, &single.inverse, target);
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
    /// Of a row: −Δs/s, and that of the multiplier, (s + Δs − target/λ)/s.
    #[inline(always)]
    fn row(&mut self, fall: &Wide, multiplier: &Wide, inverse: &Wide, target: f64) {
        let shrinking: Wide = each(|i| fall[i] * multiplier[i] * inverse[i]);
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
