//! The interior point method.

use super::banded::Pentadiagonal;
use super::newton::{Place, Share};
use super::rows::{Bounds, Form, LEAST, Pair, Single, dot, push_forms, tangent, value_weights};
use super::timing::Rate;
use super::{End, LaneLimits, PLACES, Point};

/// Iterations at most.
const ITERATIONS: usize = 40;
/// Mean complementarity at which a solution is good enough.
const ENOUGH: f64 = 3e-5;
/// Mean complementarity from which no solution is found any more: there is none.
const LOST: f64 = 1e6;
/// Violation of a row, as a share of its limit, that is as good as none.
const FEASIBLE: f64 = 2e-3;
/// How near to its bound a step may go.
const BOUNDARY: f64 = 0.95;
/// Bounds on b of an interval.
const SINGLES: usize = PLACES + 1;

/// How solving starts.
#[derive(Clone, Copy, Debug)]
struct Start {
    /// Least slack.
    slack: f64,
    /// Slack times multiplier.
    product: f64,
}

/// From a rate of 1, which may be far from what is sought.
const FIRST: Start = Start { slack: 0.1, product: 0.05 };
/// From a rate that was found for about the same points.
const AGAIN: Start = Start { slack: 0.01, product: 1e-3 };

/// How solving ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Status {
    /// Iterations made.
    pub iterations: usize,
    /// Mean complementarity at the end: how far from the optimum.
    pub gap: f64,
    /// Largest violation of a row, as a share of its limit.
    pub violation: f64,
}

impl Status {
    /// Whether all rows are kept.
    pub fn is_feasible(&self) -> bool {
        self.violation < FEASIBLE
    }
}

/// Solves retimings; keeps its memory from one to the next.
#[derive(Debug, Default)]
pub struct Retimer {
    forms: Vec<Form>,
    pairs: Vec<Pair>,
    bounds: Vec<Bounds>,
    singles: Vec<Single>,
    matrix: Pentadiagonal,
    step: Vec<f64>,
    /// Which unknown a coefficient is; none for one that is fixed.
    unknown: Vec<Option<u32>>,
    unknowns: usize,
    lanes: usize,
    values: [Form; PLACES],
    /// The result.
    pub rate: Rate,
}

impl Retimer {
    /// Finds the rate for `points`, three places an interval of `step_s`. `jerk_share` of the jerk limits is used. Rough
    /// loop; allocates where the grid is larger than any before.
    pub fn solve(
        &mut self,
        points: &[[Point; PLACES]],
        limits: &LaneLimits,
        jerk_share: f64,
        step_s: f64,
        ends: (End, End),
    ) -> Status {
        self.prepare(points, limits, jerk_share, step_s, ends);
        self.rate.coefficients.clear();
        self.rate.coefficients.resize(points.len() + 2, 1.0);
        self.start(FIRST);
        self.iterate()
    }

    /// The same, from the present [`Retimer::rate`]: that of points which were about the same, on the same grid.
    pub fn solve_again(
        &mut self,
        points: &[[Point; PLACES]],
        limits: &LaneLimits,
        jerk_share: f64,
        step_s: f64,
        ends: (End, End),
    ) -> Status {
        self.prepare(points, limits, jerk_share, step_s, ends);
        self.start(AGAIN);
        self.iterate()
    }

    fn prepare(
        &mut self,
        points: &[[Point; PLACES]],
        limits: &LaneLimits,
        jerk_share: f64,
        step_s: f64,
        ends: (End, End),
    ) {
        self.lanes = limits.lanes;
        self.values = value_weights();
        self.forms.clear();
        for places in points {
            push_forms(&mut self.forms, places, limits, jerk_share, step_s);
        }
        self.bounds.clear();
        self.bounds.extend(points.iter().map(Bounds::new));
        self.name_unknowns(points.len() + 2, ends);
    }

    fn iterate(&mut self) -> Status {
        let mut status = Status { iterations: 0, gap: self.gap(), violation: f64::INFINITY };
        let mut shrink = 0.1;
        loop {
            let target = shrink * status.gap;
            status.violation = self.assemble(target);
            if status.iterations == ITERATIONS || status.gap > LOST || status.gap < ENOUGH && status.is_feasible() {
                return status;
            }
            self.matrix.solve(&mut self.step);
            let length = self.advance(target);
            shrink = match length {
                l if l > 0.9 => 0.1,
                l if l > 0.7 => 0.2,
                l if l > 0.4 => 0.4,
                _ => 0.8,
            };
            status.gap = self.gap();
            status.iterations += 1;
        }
    }

    /// At rest the first (last) three coefficients are one; in motion the first (last) two are 1.
    fn name_unknowns(&mut self, count: usize, (start, end): (End, End)) {
        let tied = |end: End, index: usize| end == End::Rest && index < 3;
        let fixed = |end: End, index: usize| end == End::Moving && index < 2;
        self.unknown.clear();
        let mut next = 0;
        for i in 0..count {
            let from_end = count - 1 - i;
            let is_fixed = fixed(start, i) || fixed(end, from_end);
            let repeats = tied(start, i) && i > 0 || tied(end, from_end) && from_end < 2;
            if !is_fixed && !repeats {
                next += 1;
            }
            self.unknown.push(if is_fixed { None } else { Some(next - 1) });
        }
        self.unknowns = next as usize;
    }

    /// Slacks and multipliers for the present rate.
    fn start(&mut self, Start { slack: least, product }: Start) {
        let per_interval = (PLACES + 2) * self.lanes;
        let pair = |value: f64, common: f64, right: f64| {
            let slack = [(right - common - value).max(least), (right - common + value).max(least)];
            Pair { slack, multiplier: slack.map(|s| product / s), residual: [0.0; 2] }
        };
        let single = |room: f64| {
            let slack = room.max(least);
            Single { slack, multiplier: product / slack, residual: 0.0 }
        };
        self.pairs.clear();
        self.singles.clear();
        for k in 0..self.bounds.len() {
            let beta = self.beta(k);
            for (n, form) in self.forms[k * per_interval..(k + 1) * per_interval].iter().enumerate() {
                let jerk = (n / self.lanes < PLACES).then(|| self.place(n / self.lanes, &beta));
                let (common, right) = jerk.map_or((0.0, 1.0), |place| (place.common, place.right));
                self.pairs.push(pair(dot(form, &beta), common, right));
            }
            for (n, most) in self.bounds[k].most.iter().enumerate() {
                self.singles.push(single(most - dot(&self.values[n], &beta)));
            }
            self.singles.push(single(dot(&self.values[1], &beta) - LEAST));
        }
    }

    fn beta(&self, k: usize) -> Form {
        let c = &self.rate.coefficients[k..k + 3];
        [c[0], c[1], c[2]]
    }

    fn gap(&self) -> f64 {
        let pairs: f64 = self.pairs.iter().map(|p| p.slack[0] * p.multiplier[0] + p.slack[1] * p.multiplier[1]).sum();
        let singles: f64 = self.singles.iter().map(|s| s.slack * s.multiplier).sum();
        (pairs + singles) / (2 * self.pairs.len() + self.singles.len()) as f64
    }

    fn place(&self, place: usize, beta: &Form) -> Place {
        let w = self.values[place];
        let b = dot(&w, beta);
        let (right, weight) = tangent(b);
        Place { beta: *beta, w, weight, common: weight * b, right }
    }

    /// The Newton system `(∇²f + CᵀDC)·Δβ = −∇f − Cᵀ(target + λ·residual)/s` with `f = Σ b^(−1/2)` in the middles; gives
    /// the largest violation of a row.
    fn assemble(&mut self, target: f64) -> f64 {
        self.matrix.clear(self.unknowns);
        self.step.clear();
        self.step.resize(self.unknowns, 0.0);
        let (lanes, per_interval) = (self.lanes, (PLACES + 2) * self.lanes);
        let mut violation = 0.0f64;
        for k in 0..self.bounds.len() {
            let beta = self.beta(k);
            let places: [Place; PLACES] = std::array::from_fn(|place| self.place(place, &beta));
            let mut share = Share::default();
            let b = dot(&self.values[1], &beta).max(LEAST);
            let slope = -0.5 / (b * b.sqrt());
            share.square(&self.values[1], -1.5 * slope / b);
            share.slope(&self.values[1], slope);
            let forms = &self.forms[k * per_interval..(k + 1) * per_interval];
            let pairs = &mut self.pairs[k * per_interval..(k + 1) * per_interval];
            let singles = &mut self.singles[k * SINGLES..(k + 1) * SINGLES];
            for (n, place) in places.iter().enumerate() {
                let rows = n * lanes..(n + 1) * lanes;
                share.pairs(&forms[rows.clone()], &mut pairs[rows], place, target);
                let over = dot(&place.w, &beta) - self.bounds[k].most[n];
                share.single(&place.w, 1.0, over, &mut singles[n], target);
            }
            let steady = Place { weight: 0.0, common: 0.0, right: 1.0, ..places[0] };
            share.pairs(&forms[PLACES * lanes..], &mut pairs[PLACES * lanes..], &steady, target);
            let under = LEAST - dot(&self.values[1], &beta);
            share.single(&self.values[1], -1.0, under, &mut singles[PLACES], target);
            violation = violation.max(share.violation);
            self.scatter(k, &share);
        }
        violation
    }

    fn scatter(&mut self, k: usize, share: &Share) {
        const AT: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
        let unknown = &self.unknown[k..k + 3];
        for (i, at) in AT.iter().enumerate() {
            let Some(row) = unknown[i] else { continue };
            self.step[row as usize] -= share.gradient[i];
            for (column, at) in unknown.iter().zip(at) {
                let Some(right) = column.and_then(|column| column.checked_sub(row)) else { continue };
                self.matrix.rows[row as usize][right as usize] += share.hessian[*at];
            }
        }
    }

    /// Goes along the step as far as slacks and multipliers stay positive; gives the length of the primal step.
    fn advance(&mut self, target: f64) -> f64 {
        let lengths = self.turn_into_changes(target);
        for pair in &mut self.pairs {
            for n in 0..2 {
                let (slack, multiplier) = (&mut pair.slack[n], &mut pair.multiplier[n]);
                go(slack, multiplier, pair.residual[n], target, lengths);
            }
        }
        for single in &mut self.singles {
            go(&mut single.slack, &mut single.multiplier, single.residual, target, lengths);
        }
        for (i, coefficient) in self.rate.coefficients.iter_mut().enumerate() {
            if let Some(unknown) = self.unknown[i] {
                *coefficient += lengths[0] * self.step[unknown as usize];
            }
        }
        lengths[0]
    }

    /// Replaces residuals by the changes of the slacks; gives how far slacks and multipliers may go.
    fn turn_into_changes(&mut self, target: f64) -> [f64; 2] {
        let (lanes, per_interval) = (self.lanes, (PLACES + 2) * self.lanes);
        let mut lengths = [1.0f64; 2];
        for k in 0..self.bounds.len() {
            let beta = self.beta(k);
            let step: Form = std::array::from_fn(|n| self.unknown[k + n].map_or(0.0, |u| self.step[u as usize]));
            let along = self.values.map(|w| dot(&w, &step));
            let common: [f64; PLACES] = std::array::from_fn(|n| tangent(dot(&self.values[n], &beta)).1 * along[n]);
            let forms = &self.forms[k * per_interval..(k + 1) * per_interval];
            let pairs = &mut self.pairs[k * per_interval..(k + 1) * per_interval];
            for (index, (form, pair)) in forms.iter().zip(pairs).enumerate() {
                let common = common.get(index / lanes).copied().unwrap_or(0.0);
                let change = dot(form, &step);
                for (n, change) in [common + change, common - change].into_iter().enumerate() {
                    pair.residual[n] = -pair.residual[n] - change;
                    shorten(&mut lengths, pair.slack[n], pair.multiplier[n], pair.residual[n], target);
                }
            }
            let singles = &mut self.singles[k * SINGLES..(k + 1) * SINGLES];
            let changes = along.into_iter().chain([-along[1]]);
            for (single, change) in singles.iter_mut().zip(changes) {
                single.residual = -single.residual - change;
                shorten(&mut lengths, single.slack, single.multiplier, single.residual, target);
            }
        }
        lengths
    }
}

/// What the multiplier changes by when the slack changes by `change`.
#[inline]
fn reply(slack: f64, multiplier: f64, change: f64, target: f64) -> f64 {
    (target - multiplier * (slack + change)) / slack
}

/// Shortens the steps so that slack and multiplier stay positive.
#[inline]
fn shorten(lengths: &mut [f64; 2], slack: f64, multiplier: f64, change: f64, target: f64) {
    if change * lengths[0] < -BOUNDARY * slack {
        lengths[0] = -BOUNDARY * slack / change;
    }
    let answer = reply(slack, multiplier, change, target);
    if answer * lengths[1] < -BOUNDARY * multiplier {
        lengths[1] = -BOUNDARY * multiplier / answer;
    }
}

#[inline]
fn go(slack: &mut f64, multiplier: &mut f64, change: f64, target: f64, lengths: [f64; 2]) {
    let answer = reply(*slack, *multiplier, change, target);
    *slack += lengths[0] * change;
    *multiplier += lengths[1] * answer;
}
