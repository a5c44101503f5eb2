//! The spline of least jerk through boxes.

use super::banded::{self, Row};
use super::spline::{Spline, weights};
use crate::in_wide_instructions;
use crate::lanes::{Lanes, each, larger, largest, smaller};

/// Iterations at most.
const ITERATIONS: usize = 24;
/// Mean complementarity at which a solution is good enough.
const ENOUGH: f64 = 2e-3;
/// Least complementarity that is aimed at, as a share of that: what is there already waits for the other lanes, whose boxes may be
/// harder to meet.
const FLOOR: f64 = 0.1;
/// Violation of a box, as a share of its half width, that is as good as none.
const FEASIBLE: f64 = 0.02;
/// How near to its bound a step may go.
const BOUNDARY: f64 = 0.95;
/// Weight of the squared jerk below the hinge.
const GENTLE: f64 = 0.1;
/// Share of the jerk limit from which on jerk counts in full.
const HINGE: f64 = 0.7;
/// From here on the Hessian takes the hinge as closed.
const CLOSING: f64 = 0.9 * HINGE;

/// A box that the motion passes at a given pseudo-time.
#[derive(Clone, Copy, Debug)]
pub struct Waypoint<const L: usize> {
    /// Interval.
    pub interval: u32,
    /// Place in the interval, 0 to 1.
    pub z: f64,
    /// Middle of the box.
    pub point: Lanes<L>,
    /// Half width of the box in every lane, above zero.
    pub half: Lanes<L>,
}

/// How smoothing ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothStatus {
    /// Iterations made.
    pub iterations: usize,
    /// Largest violation of a box, as a share of its half width.
    pub violation: f64,
}

/// A waypoint as rows `±(B·c − p)/w ≤ 1`, their slacks, multipliers and residuals.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Rows<const L: usize> {
    weights: [f64; 4],
    point: Lanes<L>,
    per_half: Lanes<L>,
    slack: [Lanes<L>; 2],
    multiplier: [Lanes<L>; 2],
    residual: [Lanes<L>; 2],
    /// 1 over slack times multiplier: one division gives both their inverses.
    inverse: [Lanes<L>; 2],
    interval: usize,
}

impl<const L: usize> Rows<L> {
    /// Where the motion is beside the middle of the box, in half widths.
    #[inline(always)]
    fn value(&self, spline: &Spline<L>) -> Lanes<L> {
        let at = combine(&self.weights, control(spline, self.interval));
        each(|l| (at[l] - self.point[l]) * self.per_half[l])
    }
}

/// Smooths; keeps its memory from one time to the next.
#[derive(Debug)]
pub struct Smoother<const L: usize> {
    rows: Vec<Rows<L>>,
    matrix: Vec<Row<L>>,
    step: Vec<Lanes<L>>,
    /// 1/(h³·J) of each lane.
    scale: Lanes<L>,
}

impl<const L: usize> Default for Smoother<L> {
    fn default() -> Self {
        Self {
            rows: Vec::new(),
            matrix: Vec::new(),
            step: Vec::new(),
            scale: [0.0; L],
        }
    }
}

/// Value of the forms of a row group at the control points `c`.
#[inline(always)]
fn combine<const L: usize>(w: &[f64; 4], c: &[Lanes<L>; 4]) -> Lanes<L> {
    each(|l| w[0] * c[0][l] + w[1] * c[1][l] + w[2] * c[2][l] + w[3] * c[3][l])
}

impl<const L: usize> Smoother<L> {
    in_wide_instructions! {
        /// Moves the control points of `spline`, but for the first and the last three, to where the jerk is least:
        /// `Σ 0.05·r² + ½·max(0, |r| − 0.7)²` with r the jerk of each interval in units of `jerk_mm_per_s3`. Rough loop.
        pub fn smooth = smooth_any, smooth_wide(
            &mut self,
            spline: &mut Spline<L>,
            waypoints: &[Waypoint<L>],
            jerk_mm_per_s3: &Lanes<L>,
        ) -> SmoothStatus;
    }

    #[inline(always)]
    fn smooth_any(
        &mut self,
        spline: &mut Spline<L>,
        waypoints: &[Waypoint<L>],
        jerk_mm_per_s3: &Lanes<L>,
    ) -> SmoothStatus {
        let cube = spline.step_s * spline.step_s * spline.step_s;
        self.scale = each(|l| 1.0 / (cube * jerk_mm_per_s3[l]));
        self.begin(spline, waypoints);
        let mut gap = self.gap();
        let mut shrink = [0.1; L];
        let mut status = SmoothStatus {
            iterations: 0,
            violation: f64::INFINITY,
        };
        loop {
            let over = status.iterations == ITERATIONS;
            // How far boxes are missed counts only where nothing is left but them.
            if largest(&gap) < ENOUGH || over {
                status.violation = self.violation(spline);
                if over || status.violation < FEASIBLE {
                    return status;
                }
            }
            let target = each(|l| larger(shrink[l] * gap[l], FLOOR * ENOUGH));
            self.assemble(spline, &target);
            let free = 3..spline.points.len() - 3;
            banded::solve(&mut self.matrix[free.clone()], &mut self.step[free]);
            let length;
            (length, gap) = self.advance(spline, &target);
            shrink = length.map(shrink_after);
            status.iterations += 1;
        }
    }

    #[inline(always)]
    fn begin(&mut self, spline: &Spline<L>, waypoints: &[Waypoint<L>]) {
        self.rows.clear();
        self.rows.reserve(waypoints.len());
        for waypoint in waypoints {
            let interval = waypoint.interval as usize;
            let w = weights(waypoint.z);
            let per_half: Lanes<L> = each(|l| 1.0 / waypoint.half[l]);
            let at = combine(&w, control(spline, interval));
            let value: Lanes<L> = each(|l| (at[l] - waypoint.point[l]) * per_half[l]);
            let slack = [
                each(|l| larger(1.0 - value[l], 0.2)),
                each(|l| larger(1.0 + value[l], 0.2)),
            ];
            let multiplier = [each(|l| 0.05 / slack[0][l]), each(|l| 0.05 / slack[1][l])];
            let residual = [[0.0; L]; 2];
            let inverse = [[0.0; L]; 2];
            let point = waypoint.point;
            self.rows.push(Rows {
                interval,
                weights: w,
                point,
                per_half,
                slack,
                multiplier,
                residual,
                inverse,
            });
        }
    }

    #[inline(always)]
    fn gap(&self) -> Lanes<L> {
        let mut sum = [0.0; L];
        for row in &self.rows {
            for n in 0..2 {
                sum = each(|l| sum[l] + row.slack[n][l] * row.multiplier[n][l]);
            }
        }
        self.mean(&sum)
    }

    /// The mean of what has this `sum` over all rows.
    #[inline(always)]
    fn mean(&self, sum: &Lanes<L>) -> Lanes<L> {
        let per = 0.5 / self.rows.len().max(1) as f64;
        each(|l| sum[l] * per)
    }

    /// The largest violation of a box.
    #[inline(always)]
    fn violation(&self, spline: &Spline<L>) -> f64 {
        let mut most = [0.0; L];
        for row in &self.rows {
            let value = row.value(spline);
            most = each(|l| larger(most[l], value[l].abs() - 1.0));
        }
        largest(&most)
    }

    /// The Newton system.
    #[inline(always)]
    fn assemble(&mut self, spline: &Spline<L>, target: &Lanes<L>) {
        let count = spline.points.len();
        self.matrix.clear();
        self.matrix.resize(count, Row::ZERO);
        self.step.clear();
        self.step.resize(count, [0.0; L]);
        for k in 0..spline.intervals() {
            self.assemble_jerk(k, control(spline, k));
        }
        for row in &mut self.rows {
            let value = row.value(spline);
            let mut weight = [0.0; L];
            let mut slope = [0.0; L];
            for (n, sign) in [1.0, -1.0].into_iter().enumerate() {
                let slack = &row.slack[n];
                let multiplier = &row.multiplier[n];
                row.residual[n] = each(|l| sign * value[l] - 1.0 + slack[l]);
                let inverse: Lanes<L> = each(|l| 1.0 / (slack[l] * multiplier[l]));
                let per_slack: Lanes<L> = each(|l| multiplier[l] * inverse[l]);
                row.inverse[n] = inverse;
                weight = each(|l| weight[l] + multiplier[l] * per_slack[l]);
                slope = each(|l| {
                    slope[l]
                        + sign * (target[l] + multiplier[l] * row.residual[n][l]) * per_slack[l]
                });
            }
            let weight: Lanes<L> = each(|l| weight[l] * row.per_half[l] * row.per_half[l]);
            let slope: Lanes<L> = each(|l| slope[l] * row.per_half[l]);
            let (rows, steps) = system(&mut self.matrix, &mut self.step, row.interval);
            for i in 0..4 {
                let wi = row.weights[i];
                for j in i..4 {
                    let entry = &mut rows[i].0[j - i];
                    let w = wi * row.weights[j];
                    *entry = each(|l| entry[l] + w * weight[l]);
                }
                let entry = &mut steps[i];
                *entry = each(|l| entry[l] - wi * slope[l]);
            }
        }
    }

    /// What the jerk of interval `k` adds: its form is (−1, 3, −3, 1).
    #[inline(always)]
    fn assemble_jerk(&mut self, k: usize, c: &[Lanes<L>; 4]) {
        const D: [f64; 4] = [-1.0, 3.0, -3.0, 1.0];
        let scale = &self.scale;
        let jerk: Lanes<L> = each(|l| (c[3][l] - c[0][l] + 3.0 * (c[1][l] - c[2][l])) * scale[l]);
        let bend: Lanes<L> = each(|l| {
            (GENTLE + if jerk[l].abs() > CLOSING { 1.0 } else { 0.0 }) * scale[l] * scale[l]
        });
        let slope: Lanes<L> = each(|l| {
            let over = larger(jerk[l] - HINGE, 0.0) + smaller(jerk[l] + HINGE, 0.0);
            (GENTLE * jerk[l] + over) * scale[l]
        });
        let (rows, steps) = system(&mut self.matrix, &mut self.step, k);
        for i in 0..4 {
            for j in i..4 {
                let entry = &mut rows[i].0[j - i];
                *entry = each(|l| entry[l] + D[i] * D[j] * bend[l]);
            }
            let entry = &mut steps[i];
            *entry = each(|l| entry[l] - D[i] * slope[l]);
        }
    }

    /// Goes along the step as far as slacks and multipliers stay positive, lane by lane; gives the primal lengths, and the
    /// complementarity behind it.
    #[inline(always)]
    fn advance(&mut self, spline: &mut Spline<L>, target: &Lanes<L>) -> (Lanes<L>, Lanes<L>) {
        let count = spline.points.len();
        self.step[..3].fill([0.0; L]);
        self.step[count - 3..].fill([0.0; L]);
        // The largest relative decrease of a slack and of a multiplier.
        let mut most = [0.0; L];
        let mut max_back = [0.0; L];
        for row in &mut self.rows {
            let steps = self.step[row.interval..]
                .first_chunk()
                .expect("four control points");
            let along = combine(&row.weights, steps);
            for (n, sign) in [1.0, -1.0].into_iter().enumerate() {
                let multiplier = &row.multiplier[n];
                row.residual[n] = each(|l| row.residual[n][l] + sign * along[l] * row.per_half[l]);
                let fall = &row.residual[n];
                // Falls over what falls: −Δs/s, and that of the multiplier, (s + Δs − target/λ)/s.
                let inverse = &row.inverse[n];
                let shrinking: Lanes<L> = each(|l| fall[l] * multiplier[l] * inverse[l]);
                most = each(|l| larger(most[l], shrinking[l]));
                max_back =
                    each(|l| larger(max_back[l], 1.0 - shrinking[l] - target[l] * inverse[l]));
            }
        }
        let length: Lanes<L> = each(|l| smaller(1.0, BOUNDARY / larger(most[l], 1e-9)));
        let back: Lanes<L> = each(|l| smaller(1.0, BOUNDARY / larger(max_back[l], 1e-9)));
        let mut products = [0.0; L];
        for row in &mut self.rows {
            for n in 0..2 {
                let slack = row.slack[n];
                let multiplier = row.multiplier[n];
                let fall = row.residual[n];
                let new_slack: Lanes<L> = each(|l| slack[l] - length[l] * fall[l]);
                let inverse = &row.inverse[n];
                // Δλ = (target − λ·(s + Δs))/s.
                let new_multiplier: Lanes<L> = each(|l| {
                    let per_slack = multiplier[l] * inverse[l];
                    multiplier[l]
                        + back[l] * (target[l] - multiplier[l] * (slack[l] - fall[l])) * per_slack
                });
                products = each(|l| products[l] + new_slack[l] * new_multiplier[l]);
                (row.slack[n], row.multiplier[n]) = (new_slack, new_multiplier);
            }
        }
        for (point, step) in spline.points.iter_mut().zip(&self.step) {
            *point = each(|l| point[l] + length[l] * step[l]);
        }
        (length, self.mean(&products))
    }
}

/// What the complementarity is to shrink by after a step of this length. Where steps get stuck some slacks and multipliers are much
/// nearer to zero than others: it is to grow again, which brings them back among them.
#[inline(always)]
fn shrink_after(length: f64) -> f64 {
    match length {
        l if l > 0.8 => 0.03,
        l if l > 0.4 => 0.4,
        l if l > 0.1 => 0.8,
        _ => 4.0,
    }
}

/// The rows of the control points of interval `k`, and their right sides.
#[inline(always)]
fn system<'a, const L: usize>(
    matrix: &'a mut [Row<L>],
    step: &'a mut [Lanes<L>],
    k: usize,
) -> (&'a mut [Row<L>; 4], &'a mut [Lanes<L>; 4]) {
    let rows = matrix[k..].first_chunk_mut();
    let steps = step[k..].first_chunk_mut();
    rows.zip(steps).expect("four control points")
}

#[inline(always)]
fn control<const L: usize>(spline: &Spline<L>, k: usize) -> &[Lanes<L>; 4] {
    spline.points[k..]
        .first_chunk()
        .expect("four control points")
}
