//! Evaluation: the span of a parameter, position and derivatives.

use tandem_sdk::AxisVector;

use super::levels::{Lanes, Levels, Row, combine, mix};
use super::{AlongPath, Derivatives, MAX_DEGREE, Nurbs};

impl Nurbs {
    /// Index of the knot span that holds `u` (A2.1): the last one with `knots[span] ≤ u`, so that a knot belongs to the span
    /// behind it, and the end of the curve to its last span. `u` outside is taken to the nearer end. Does not allocate.
    #[inline]
    pub fn span(&self, u: f64) -> usize {
        let inside = &self.knots[self.degree..self.points()];
        let behind = inside.partition_point(|knot| *knot <= u.min(self.last_start()));
        self.degree + behind.max(1) - 1
    }

    /// [`Nurbs::span`] found by marching from the span `hint`: constant work where `u` lies in it or the next.
    #[inline]
    pub fn span_from(&self, hint: usize, u: f64) -> usize {
        let mut span = hint.clamp(self.degree, self.points() - 1);
        let last = self.points() - 1;
        while span < last && u >= self.knots[span + 1] {
            span += 1;
        }
        while span > self.degree
            && (u < self.knots[span] || self.knots[span] == self.knots[span + 1])
        {
            span -= 1;
        }
        span
    }

    /// Start of the last span that has an extent.
    #[inline]
    fn last_start(&self) -> f64 {
        let end = self.knots[self.points()];
        let mut index = self.points() - 1;
        while self.knots[index] == end {
            index -= 1;
        }
        self.knots[index]
    }

    /// Position at `u`, mm. Does not allocate.
    pub fn position(&self, u: f64) -> AxisVector {
        let (from, to) = self.range();
        let span = self.span(u);
        self.derivatives_in(span, u.clamp(from, to)).position
    }

    /// Position and three derivatives at `u`, mm; at a knot those behind it. Does not allocate.
    #[inline]
    pub fn derivatives(&self, u: f64) -> Derivatives {
        let (from, to) = self.range();
        self.derivatives_in(self.span(u), u.clamp(from, to))
    }

    /// Position and three derivatives of the piece on `span` at `u`, mm: at the end of the span those before the knot.
    ///
    /// The derivatives of the homogeneous curve come from its derived control points (A3.3, A3.4) and one triangle of
    /// basis functions (A2.2), those of the curve from the quotient rule (A4.2). Does not allocate.
    #[inline]
    pub fn derivatives_in(&self, span: usize, u: f64) -> Derivatives {
        match &self.levels {
            Levels::Narrow(levels) => derivatives(&self.quotients(levels, span, u)),
            Levels::Wide(levels) => derivatives(&self.quotients(levels, span, u)),
        }
    }

    /// Position and derivatives by arc length of the piece on `span` at `u`; `None` where the curve stands still in its
    /// parameter.
    ///
    /// `u_s = 1/σ`, `u_ss = −(C′·C″)/σ⁴`, `u_sss = u_s·(−(C″·C″ + C′·C‴)/σ⁴ + 4(C′·C″)²/σ⁶)` with σ = |C′|, and the chain
    /// rule. Does not allocate.
    #[inline]
    pub fn along_path_in(&self, span: usize, u: f64) -> Option<AlongPath> {
        match &self.levels {
            Levels::Narrow(levels) => self.along(&self.quotients(levels, span, u)),
            Levels::Wide(levels) => self.along(&self.quotients(levels, span, u)),
        }
    }

    /// The same at `u`; at a knot behind it.
    #[inline]
    pub fn along_path(&self, u: f64) -> Option<AlongPath> {
        let (from, to) = self.range();
        self.along_path_in(self.span(u), u.clamp(from, to))
    }

    /// |C′| of the piece on `span` at `u`, as path speed counts it: less work than all derivatives. Does not allocate.
    #[inline]
    pub fn speed_in(&self, span: usize, u: f64) -> f64 {
        match &self.levels {
            Levels::Narrow(levels) => self.speed(levels, span, u),
            Levels::Wide(levels) => self.speed(levels, span, u),
        }
    }

    #[inline]
    fn speed<const N: usize>(&self, levels: &[Vec<[f64; N]>; 4], span: usize, u: f64) -> f64
    where
        [f64; N]: Lanes,
    {
        let weight = <[f64; N]>::WEIGHT;
        let rows = self.basis(span, u);
        let first = span - self.degree;
        let point = combine(&levels[0], first, self.degree, &rows[0]);
        let rate = combine(&levels[1], first, self.degree - 1, &rows[1]);
        let inverse = 1.0 / point[weight];
        let rate = mix(inverse, &rate, -rate[weight] * inverse * inverse, &point);
        self.counted_dot(&rate, &rate).sqrt()
    }

    /// Position and derivatives by the quotient rule (A4.2); the lane of the weight becomes 1, 0, 0, 0.
    #[inline]
    fn quotients<const N: usize>(
        &self,
        levels: &[Vec<[f64; N]>; 4],
        span: usize,
        u: f64,
    ) -> [[f64; N]; 4]
    where
        [f64; N]: Lanes,
    {
        let weight = <[f64; N]>::WEIGHT;
        let rows = self.basis(span, u);
        let first = span - self.degree;
        let mut sums = [[0.0; N]; 4];
        for order in 0..=self.degree.min(3) {
            sums[order] = combine(&levels[order], first, self.degree - order, &rows[order]);
        }
        let [a, a1, a2, a3] = &sums;
        let inverse = 1.0 / a[weight];
        let position = a.map(|v| v * inverse);
        if self.plain {
            return [
                position,
                a1.map(|v| v * inverse),
                a2.map(|v| v * inverse),
                a3.map(|v| v * inverse),
            ];
        }
        let [w1, w2, w3] = [a1[weight], a2[weight], a3[weight]];
        let first = std::array::from_fn(|n| (a1[n] - position[n] * w1) * inverse);
        let second =
            std::array::from_fn(|n| (a2[n] - first[n] * (2.0 * w1) - position[n] * w2) * inverse);
        let third = |n: usize| {
            (a3[n] - second[n] * (3.0 * w1) - first[n] * (3.0 * w2) - position[n] * w3) * inverse
        };
        [position, first, second, std::array::from_fn(third)]
    }

    #[inline]
    fn along<const N: usize>(
        &self,
        [position, first, second, third]: &[[f64; N]; 4],
    ) -> Option<AlongPath>
    where
        [f64; N]: Lanes,
    {
        let squared = self.counted_dot(first, first);
        let u_s = 1.0 / squared.sqrt();
        if !u_s.is_finite() {
            return None;
        }
        let inverse = 1.0 / squared;
        let mixed = self.counted_dot(first, second);
        let rate = self.counted_dot(second, second) + self.counted_dot(first, third);
        let u_ss = -mixed * inverse * inverse;
        let u_sss = u_s * inverse * inverse * (4.0 * mixed * mixed * inverse - rate);
        let c = [u_s * u_s, u_s * u_s * u_s, 3.0 * u_s * u_ss];
        let by_s3: [f64; N] =
            std::array::from_fn(|n| third[n] * c[1] + second[n] * c[2] + first[n] * u_sss);
        Some(AlongPath {
            position: position.axes(),
            direction: first.map(|v| v * u_s).axes(),
            curvature: mix(c[0], second, u_ss, first).axes(),
            third: by_s3.axes(),
            parameter: [u_s, u_ss, u_sss],
        })
    }

    /// The product over the axes that path speed counts.
    #[inline]
    fn counted_dot<const N: usize>(&self, a: &[f64; N], b: &[f64; N]) -> f64
    where
        [f64; N]: Lanes,
    {
        let mut sum = 0.0;
        for axis in 0..<[f64; N]>::WEIGHT {
            sum += a[axis] * b[axis] * self.counted[axis];
        }
        sum
    }

    /// The non-zero basis functions at `u` of the degrees p, p − 1, p − 2 and p − 3 (A2.2, which passes through all of them).
    #[inline]
    fn basis(&self, span: usize, u: f64) -> [Row; 4] {
        // With a degree that is known the loops unroll.
        match self.degree {
            1 => basis::<1>(&self.knots, span, u),
            2 => basis::<2>(&self.knots, span, u),
            3 => basis::<3>(&self.knots, span, u),
            4 => basis::<4>(&self.knots, span, u),
            _ => basis::<MAX_DEGREE>(&self.knots, span, u),
        }
    }
}

#[inline]
fn basis<const P: usize>(knots: &[f64], span: usize, u: f64) -> [Row; 4] {
    let near = &knots[span + 1 - P..span + 1 + P];
    let mut rows = [Row::default(); 4];
    let mut row = Row::default();
    row[0] = 1.0;
    raise::<P, 0>(&mut row, near, u, &mut rows);
    raise::<P, 1>(&mut row, near, u, &mut rows);
    raise::<P, 2>(&mut row, near, u, &mut rows);
    raise::<P, 3>(&mut row, near, u, &mut rows);
    raise::<P, 4>(&mut row, near, u, &mut rows);
    raise::<P, 5>(&mut row, near, u, &mut rows);
    rows
}

/// Basis functions of degree `D` from those of the degree below, kept where derivatives ask for them. `near` are the knots
/// around the span.
#[inline]
fn raise<const P: usize, const D: usize>(row: &mut Row, near: &[f64], u: f64, rows: &mut [Row; 4]) {
    if D > P {
        return;
    }
    let mut saved = 0.0;
    for index in 0..D {
        let left = u - near[P + index - D];
        let right = near[P + index] - u;
        let share = row[index] / (right + left);
        row[index] = saved + right * share;
        saved = left * share;
    }
    if D > 0 {
        row[D] = saved;
    }
    if P - D < rows.len() {
        rows[P - D] = *row;
    }
}

#[inline]
fn derivatives<const N: usize>([position, first, second, third]: &[[f64; N]; 4]) -> Derivatives
where
    [f64; N]: Lanes,
{
    Derivatives {
        position: position.axes(),
        first: first.axes(),
        second: second.axes(),
        third: third.axes(),
    }
}
