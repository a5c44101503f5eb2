//! The interior point method.

use super::banded::Pentadiagonal;
use super::newton::{Place, Reach, Share};
use super::rows::{Form, MIN_RATE_SQUARED, Pair, Single, Site, dot, push_forms, tangent};
use super::timing::Rate;
use super::{Between, End, LaneLimits, PLACES, Point};

/// Iterations at most.
const ITERATIONS: usize = 40;
/// Mean complementarity at which a solution is good enough.
const ENOUGH: f64 = 1e-4;
/// Mean complementarity from which no solution is found any more, as where it is no number: there is none.
const LOST: f64 = 1e6;
/// Violation of a row, as a share of its limit, that is as good as none.
const FEASIBLE: f64 = 2e-3;
/// Bounds on b of an interval.
const SINGLES: usize = PLACES + 1;
/// Where the places of an interval lie.
const GRID: [f64; PLACES] = [0.0, 0.5, 1.0];

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
    /// Largest violation of a row, as a share of its limit.
    pub violation: f64,
}

impl Status {
    /// Whether all rows are kept.
    pub fn is_feasible(&self) -> bool {
        self.violation < FEASIBLE
    }
}

/// What is to be retimed.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// Three places on each interval of the grid.
    pub points: &'a [[Point; PLACES]],
    /// Further places.
    pub between: &'a [Between],
    /// What each axis may do.
    pub limits: LaneLimits,
    /// Share of the jerk limits that is used.
    pub jerk_share: f64,
    /// Length of an interval, s.
    pub step_s: f64,
    /// How the motion begins and ends.
    pub ends: (End, End),
}

/// Solves retimings; keeps its memory from one to the next.
#[derive(Debug, Default)]
pub struct Retimer {
    /// The intervals, and behind them the further places.
    sites: Vec<Site>,
    intervals: usize,
    forms: Vec<Form>,
    pairs: Vec<Pair>,
    singles: Vec<Single>,
    matrix: Pentadiagonal,
    step: Vec<f64>,
    /// Which unknown a coefficient is; none for one that is fixed.
    unknown: Vec<Option<u32>>,
    unknowns: usize,
    lanes: usize,
    /// The result.
    pub rate: Rate,
}

impl Retimer {
    /// Finds the rate for `task`. Rough loop; allocates where the grid is larger than any before.
    pub fn solve(&mut self, task: &Task) -> Status {
        self.prepare(task);
        self.rate.coefficients.clear();
        self.rate.coefficients.resize(task.points.len() + 2, 1.0);
        self.start(FIRST);
        self.iterate()
    }

    /// The same, from the present [`Retimer::rate`]: that of points which were about the same, on the same grid.
    pub fn solve_again(&mut self, task: &Task) -> Status {
        self.prepare(task);
        self.start(AGAIN);
        self.iterate()
    }

    fn prepare(&mut self, task: &Task) {
        self.lanes = task.limits.lanes;
        self.intervals = task.points.len();
        self.forms.clear();
        self.sites.clear();
        let grid = task
            .points
            .iter()
            .enumerate()
            .map(|(k, points)| (k, GRID, points));
        for (k, z, points) in grid.chain(
            task.between
                .iter()
                .map(|more| (more.interval, more.z, &more.points)),
        ) {
            let site = Site::new(k, z, points);
            push_forms(&mut self.forms, &site, points, task);
            self.sites.push(site);
        }
        self.name_unknowns(self.intervals + 2, task.ends);
    }

    fn iterate(&mut self) -> Status {
        let mut status = Status {
            iterations: 0,
            gap: self.gap(),
            violation: f64::INFINITY,
        };
        let mut shrink = 0.1;
        loop {
            let target = shrink * status.gap;
            status.violation = self.assemble(target);
            let lost = status.gap > LOST || status.gap.is_nan();
            if lost
                || status.iterations == ITERATIONS
                || status.gap < ENOUGH && status.is_feasible()
            {
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
            self.unknown
                .push(if is_fixed { None } else { Some(next - 1) });
        }
        self.unknowns = next as usize;
    }

    /// Slacks and multipliers for the present rate.
    fn start(
        &mut self,
        Start {
            slack: least,
            product,
        }: Start,
    ) {
        let per_site = (PLACES + 2) * self.lanes;
        let pair = |value: f64, common: f64, right: f64| {
            let slack = [
                (right - common - value).max(least),
                (right - common + value).max(least),
            ];
            Pair {
                slack,
                multiplier: slack.map(|s| product / s),
                ..Pair::default()
            }
        };
        let single = |room: f64| {
            let slack = room.max(least);
            Single {
                slack,
                multiplier: product / slack,
                ..Single::default()
            }
        };
        self.pairs.clear();
        self.singles.clear();
        for (site, forms) in self.sites.iter().zip(self.forms.chunks_exact(per_site)) {
            let beta = site.beta(&self.rate.coefficients);
            let places = site.places(&beta);
            for (n, form) in forms.iter().enumerate() {
                let (common, right) = places
                    .get(n / self.lanes)
                    .map_or((0.0, 1.0), |place| (place.common, place.right));
                self.pairs.push(pair(dot(form, &beta), common, right));
            }
            for (most, value) in site.most.iter().zip(&site.values) {
                self.singles.push(single(most - dot(value, &beta)));
            }
            self.singles
                .push(single(dot(&site.values[1], &beta) - MIN_RATE_SQUARED));
        }
    }

    fn gap(&self) -> f64 {
        let pairs: f64 = self
            .pairs
            .iter()
            .map(|p| p.slack[0] * p.multiplier[0] + p.slack[1] * p.multiplier[1])
            .sum();
        let singles: f64 = self.singles.iter().map(|s| s.slack * s.multiplier).sum();
        (pairs + singles) / (2 * self.pairs.len() + self.singles.len()) as f64
    }

    /// The Newton system `(∇²f + CᵀDC)·Δβ = −∇f − Cᵀ(target + λ·residual)/s` with `f = Σ b^(−1/2)` in the middles of the
    /// intervals; gives the largest violation of a row.
    fn assemble(&mut self, target: f64) -> f64 {
        self.matrix.clear(self.unknowns);
        self.step.clear();
        self.step.resize(self.unknowns, 0.0);
        let lanes = self.lanes;
        let per_site = (PLACES + 2) * self.lanes;
        let mut violation = 0.0f64;
        let mut forms = self.forms.chunks_exact(per_site);
        let mut pairs = self.pairs.chunks_exact_mut(per_site);
        let mut singles = self.singles.chunks_exact_mut(SINGLES);
        for (n, site) in self.sites.iter().enumerate() {
            let (Some(forms), Some(pairs), Some(singles)) =
                (forms.next(), pairs.next(), singles.next())
            else {
                break;
            };
            let beta = site.beta(&self.rate.coefficients);
            let places = site.places(&beta);
            let mut share = Share::default();
            if n < self.intervals {
                share.time(&site.values[1], &beta);
            }
            for (place, (forms, pairs)) in places
                .iter()
                .zip(forms.chunks_exact(lanes).zip(pairs.chunks_exact_mut(lanes)))
            {
                share.pairs(forms, pairs, place, target);
            }
            let steady = Place {
                weight: 0.0,
                common: 0.0,
                right: 1.0,
                ..places[0]
            };
            share.pairs(
                &forms[PLACES * lanes..],
                &mut pairs[PLACES * lanes..],
                &steady,
                target,
            );
            for ((place, most), single) in places.iter().zip(&site.most).zip(&mut *singles) {
                share.single(&place.w, 1.0, dot(&place.w, &beta) - most, single, target);
            }
            let under = MIN_RATE_SQUARED - dot(&site.values[1], &beta);
            share.single(&site.values[1], -1.0, under, &mut singles[PLACES], target);
            violation = violation.max(share.violation);
            scatter(
                &self.unknown[site.interval..site.interval + 3],
                &share,
                &mut self.matrix,
                &mut self.step,
            );
        }
        violation
    }

    /// Goes along the step as far as slacks and multipliers stay positive; gives the length of the primal step.
    fn advance(&mut self, target: f64) -> f64 {
        let [primal, dual] = self.turn_into_changes(target);
        for pair in &mut self.pairs {
            for n in 0..2 {
                pair.slack[n] += primal * pair.change[n];
                pair.multiplier[n] += dual * pair.answer[n];
            }
        }
        for single in &mut self.singles {
            single.slack += primal * single.change;
            single.multiplier += dual * single.answer;
        }
        for (coefficient, unknown) in self.rate.coefficients.iter_mut().zip(&self.unknown) {
            if let Some(unknown) = unknown {
                *coefficient += primal * self.step[*unknown as usize];
            }
        }
        primal
    }

    /// Replaces residuals by the changes of slacks and multipliers; gives how far these may go.
    fn turn_into_changes(&mut self, target: f64) -> [f64; 2] {
        let lanes = self.lanes;
        let per_site = (PLACES + 2) * self.lanes;
        let mut reach = Reach::default();
        let mut forms = self.forms.chunks_exact(per_site);
        let mut pairs = self.pairs.chunks_exact_mut(per_site);
        let mut singles = self.singles.chunks_exact_mut(SINGLES);
        for site in &self.sites {
            let (Some(forms), Some(pairs), Some(singles)) =
                (forms.next(), pairs.next(), singles.next())
            else {
                break;
            };
            let beta = site.beta(&self.rate.coefficients);
            let unknown = &self.unknown[site.interval..site.interval + 3];
            let step: Form =
                std::array::from_fn(|n| unknown[n].map_or(0.0, |u| self.step[u as usize]));
            let along = site.values.map(|w| dot(&w, &step));
            let rows = forms
                .chunks_exact(lanes)
                .zip(pairs.chunks_exact_mut(lanes))
                .enumerate();
            for (place, (forms, pairs)) in rows {
                let common = match site.values.get(place) {
                    Some(w) => tangent(dot(w, &beta)).1 * along[place],
                    None => 0.0,
                };
                for (form, pair) in forms.iter().zip(pairs) {
                    reach.pair(pair, common, dot(form, &step), target);
                }
            }
            for (single, change) in singles.iter_mut().zip(along.into_iter().chain([-along[1]])) {
                reach.single(single, change, target);
            }
        }
        reach.lengths()
    }
}

fn scatter(unknown: &[Option<u32>], share: &Share, matrix: &mut Pentadiagonal, step: &mut [f64]) {
    const AT: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
    for (i, at) in AT.iter().enumerate() {
        let Some(row) = unknown[i] else { continue };
        step[row as usize] -= share.gradient[i];
        for (column, at) in unknown.iter().zip(at) {
            let Some(right) = column.and_then(|column| column.checked_sub(row)) else {
                continue;
            };
            matrix.rows[row as usize][right as usize] += share.hessian[*at];
        }
    }
}
