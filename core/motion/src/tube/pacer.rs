//! How fast a motion can be driven.

use super::lanes::{Lanes, each, larger, largest, smaller};
use super::pace_share::{Form, GROUPS, Rows, SINGLES, Share, Sides};
use crate::retime::{End, Pentadiagonal, Rate, weights};

/// Slack times multiplier at the start.
const START: f64 = 0.05;
/// Weights of b at the start, in the middle and at the end of an interval.
const VALUES: [[f64; 3]; 3] = [[0.5, 0.5, 0.0], [0.125, 0.75, 0.125], [0.0, 0.5, 0.5]];
/// Least rate squared.
const MIN_RATE_SQUARED: f64 = 0.01;
/// Mean complementarity that no solvable problem comes to.
const HOPELESS: f64 = 1e3;
/// How near to its bound a step may go.
const BOUNDARY: f64 = 0.95;

/// The motion at the start or in the middle of an interval: derivatives by pseudo-time, and the highest rate squared.
#[derive(Clone, Copy, Debug)]
pub struct Place<const L: usize> {
    /// First derivative, mm/s.
    pub first: Lanes<L>,
    /// Second derivative, mm/s².
    pub second: Lanes<L>,
    /// Highest rate squared here: feed and axis speeds.
    pub most: f64,
}

/// How pacing ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaceStatus {
    /// Iterations made.
    pub iterations: usize,
    /// Mean complementarity.
    pub gap: f64,
    /// Largest violation, as a share of a limit.
    pub violation: f64,
}

/// What is asked of a solution, and what it may cost.
#[derive(Clone, Copy, Debug)]
pub struct Asked {
    /// Mean complementarity.
    pub gap: f64,
    /// Violation of a limit, as a share of it.
    pub violation: f64,
    /// Iterations at most.
    pub iterations: usize,
}

/// Paces; keeps its memory from one time to the next.
#[derive(Debug)]
pub struct Pacer<const L: usize> {
    forms: Vec<[Form<L>; GROUPS]>,
    most: Vec<[f64; 2]>,
    rows: Vec<Rows<L>>,
    matrix: Pentadiagonal,
    step: Vec<f64>,
    /// Which unknown a coefficient is; negative for one that is fixed.
    unknown: Vec<i32>,
    unknowns: usize,
    /// Mean complementarity.
    gap: f64,
    /// The result.
    pub rate: Rate,
}

impl<const L: usize> Default for Pacer<L> {
    fn default() -> Self {
        Self {
            forms: Vec::new(),
            most: Vec::new(),
            rows: Vec::new(),
            matrix: Pentadiagonal::default(),
            step: Vec::new(),
            unknown: Vec::new(),
            unknowns: 0,
            gap: 0.0,
            rate: Rate::default(),
        }
    }
}

#[inline(always)]
fn dot(w: &[f64; 3], beta: &[f64; 3]) -> f64 {
    w[0] * beta[0] + w[1] * beta[1] + w[2] * beta[2]
}

/// The rows `weight·b ± form·β ≤ right` at a place: `b^(−1/2)` is convex, its tangent lies below.
#[inline(always)]
fn sides(z: f64, beta: &[f64; 3]) -> Sides {
    let w = weights(z)[0];
    let b = larger(dot(&w, beta), MIN_RATE_SQUARED);
    let inverse = 1.0 / b.sqrt();
    let weight = 0.5 * inverse / b;
    Sides {
        w,
        weight,
        common: weight * b,
        right: 1.5 * inverse,
    }
}

/// The three places of an interval where limits are asked for.
#[inline(always)]
fn places(beta: &[f64; 3]) -> [Sides; 3] {
    [sides(0.0, beta), sides(0.5, beta), sides(1.0, beta)]
}

impl<const L: usize> Pacer<L> {
    /// Begins a grid with intervals of `step_s`. Then [`Pacer::push`] every interval, and [`Pacer::solve`].
    pub fn begin(&mut self) {
        self.forms.clear();
        self.most.clear();
        self.rows.clear();
    }

    /// The next interval: the motion at its start and in its middle, the first and second derivative at its end, and its
    /// third derivative. `per_acceleration` and `per_jerk` are 1 over the limits.
    #[inline(always)]
    pub fn push(
        &mut self,
        (start, middle, end): (&Place<L>, &Place<L>, [&Lanes<L>; 2]),
        third: &Lanes<L>,
        (per_acceleration, per_jerk): (&Lanes<L>, &Lanes<L>),
        step_s: f64,
    ) {
        let r1 = 1.0 / step_s;
        let r2 = 1.0 / (step_s * step_s);
        let jerk = |z: f64, x1: &Lanes<L>, x2: &Lanes<L>| -> Form<L> {
            let [value, slope, curve] = weights(z);
            let entry = |n: usize| -> Lanes<L> {
                let w0 = value[n];
                let w1 = 1.5 * r1 * slope[n];
                let w2 = 0.5 * r2 * curve[n];
                each(|l| per_jerk[l] * (third[l] * w0 + x2[l] * w1 + x1[l] * w2))
            };
            [entry(0), entry(1), entry(2)]
        };
        let [value, slope, _] = weights(0.0);
        let entry = |n: usize| -> Lanes<L> {
            let w0 = value[n];
            let w1 = 0.5 * r1 * slope[n];
            each(|l| per_acceleration[l] * (start.second[l] * w0 + start.first[l] * w1))
        };
        let acceleration = [entry(0), entry(1), entry(2)];
        self.forms.push([
            jerk(0.0, &start.first, &start.second),
            jerk(0.5, &middle.first, &middle.second),
            jerk(1.0, end[0], end[1]),
            acceleration,
        ]);
        self.most.push([start.most, middle.most]);
    }

    /// Finds the rate. Rough loop; allocates where the grid is larger than any before.
    pub fn solve(&mut self, ends: (End, End), asked: &Asked) -> PaceStatus {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has what the function is compiled for.
            return unsafe { self.solve_wide(ends, asked) };
        }
        self.solve_any(ends, asked)
    }

    /// The same in wider instructions; the numbers are the same bit for bit.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn solve_wide(&mut self, ends: (End, End), asked: &Asked) -> PaceStatus {
        self.solve_any(ends, asked)
    }

    #[inline(always)]
    fn solve_any(&mut self, ends: (End, End), asked: &Asked) -> PaceStatus {
        self.name_unknowns(ends);
        self.start();
        let mut status = PaceStatus {
            iterations: 0,
            gap: START,
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
        let count = self.forms.len() + 2;
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

    #[inline(always)]
    fn start(&mut self) {
        self.rate.coefficients.clear();
        self.rate.coefficients.resize(self.forms.len() + 2, 1.0);
        for (forms, most) in self.forms.iter().zip(&self.most) {
            // At b = 1 all right sides are 1: that of the jerk rows is 3/2 less the 1/2 that b takes.
            let mut slack = [[[0.0; L]; 2]; GROUPS];
            let mut multiplier = [[[0.0; L]; 2]; GROUPS];
            for (group, form) in forms.iter().enumerate() {
                for (n, sign) in [1.0, -1.0].into_iter().enumerate() {
                    slack[group][n] =
                        each(|l| larger(1.0 - sign * (form[0][l] + form[1][l] + form[2][l]), 0.1));
                    multiplier[group][n] = each(|l| START / slack[group][n][l]);
                }
            }
            let single_slack = [
                larger(most[0] - 1.0, 0.1),
                larger(most[1] - 1.0, 0.1),
                1.0 - MIN_RATE_SQUARED,
            ];
            self.rows.push(Rows {
                slack,
                multiplier,
                residual: [[[0.0; L]; 2]; GROUPS],
                inverse: [[[0.0; L]; 2]; GROUPS],
                weight: [0.0; GROUPS],
                single_slack,
                single_multiplier: single_slack.map(|s| START / s),
                single_residual: [0.0; SINGLES],
            });
        }
    }

    #[inline(always)]
    fn beta(&self, k: usize) -> [f64; 3] {
        *self.rate.coefficients[k..]
            .first_chunk()
            .expect("three coefficients")
    }

    #[inline(always)]
    fn mean(&self, pairs: &Lanes<L>, singles: f64) -> f64 {
        (pairs.iter().sum::<f64>() + singles)
            / (self.rows.len() * (2 * GROUPS * L + SINGLES)) as f64
    }

    /// The Newton system with `f = Σ b^(−1/2)` in the middles; gives the largest violation.
    #[inline(always)]
    fn assemble(&mut self, target: f64) -> f64 {
        self.matrix.clear(self.unknowns);
        self.step.clear();
        self.step.resize(self.unknowns, 0.0);
        let mut violation = [0.0; L];
        for k in 0..self.forms.len() {
            let beta = self.beta(k);
            let forms = &self.forms[k];
            let rows = &mut self.rows[k];
            let most = &self.most[k];
            let mut share = Share::<L>::default();
            let places = places(&beta);
            for (group, place) in places.iter().enumerate() {
                share.pair(&forms[group], &beta, place, rows, group, target);
            }
            let steady = Sides {
                weight: 0.0,
                common: 0.0,
                right: 1.0,
                ..places[0]
            };
            share.pair(&forms[3], &beta, &steady, rows, 3, target);
            for (n, place) in places.iter().take(2).enumerate() {
                share.single(
                    &place.w,
                    1.0,
                    dot(&place.w, &beta) - most[n],
                    rows,
                    n,
                    target,
                );
            }
            let middle = &places[1].w;
            let b = larger(dot(middle, &beta), MIN_RATE_SQUARED);
            share.single(
                middle,
                -1.0,
                MIN_RATE_SQUARED - dot(middle, &beta),
                rows,
                2,
                target,
            );
            let slope = -0.5 / (b * b.sqrt());
            share.add(middle, -1.5 * slope / b, slope);
            violation = each(|l| larger(violation[l], share.violation[l]));
            self.scatter(k, &share);
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
            for n in 0..SINGLES {
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
        let mut most_back = [0.0; L];
        for k in 0..self.forms.len() {
            let change =
                |n: usize| usize::try_from(self.unknown[k + n]).map_or(0.0, |u| self.step[u]);
            let step = [change(0), change(1), change(2)];
            let forms = &self.forms[k];
            let rows = &mut self.rows[k];
            let along = [
                dot(&VALUES[0], &step),
                dot(&VALUES[1], &step),
                dot(&VALUES[2], &step),
                0.0,
            ];
            for group in 0..GROUPS {
                let form = &forms[group];
                let common = rows.weight[group] * along[group];
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
                    most_back =
                        each(|l| larger(most_back[l], 1.0 - shrinking[l] - target * inverse[l]));
                }
            }
            for n in 0..SINGLES {
                let along = along[usize::from(n > 0)] * if n == 2 { -1.0 } else { 1.0 };
                let slack = rows.single_slack[n];
                let multiplier = rows.single_multiplier[n];
                let change = -rows.single_residual[n] - along;
                rows.single_residual[n] = change;
                most[0] = larger(most[0], -change / slack);
                most_back[0] = larger(most_back[0], (slack + change - target / multiplier) / slack);
            }
        }
        let length = |most: &Lanes<L>| smaller(1.0, BOUNDARY / larger(largest(most), 1e-9));
        (length(&most), length(&most_back))
    }
}
