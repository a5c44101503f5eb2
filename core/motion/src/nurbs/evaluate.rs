//! Evaluation: the span of a parameter, position and derivatives.

use tandem_sdk::AxisVector;

use super::curve::Level;
use super::{Derivatives, MAX_DEGREE, Nurbs};

/// Non-zero basis functions of one degree.
type Row = [f64; MAX_DEGREE + 1];

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
        let (mut span, last) = (hint.clamp(self.degree, self.points() - 1), self.points() - 1);
        while span < last && u >= self.knots[span + 1] {
            span += 1;
        }
        while span > self.degree && (u < self.knots[span] || self.knots[span] == self.knots[span + 1]) {
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
        let mut rows = [Row::default(); 4];
        self.basis(span, u.clamp(from, to), &mut rows);
        let (weighted, weight) = combine(&self.levels[0], span - self.degree, self.degree, &rows[0]);
        weighted * (1.0 / weight)
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
        let mut rows = [Row::default(); 4];
        self.basis(span, u, &mut rows);
        let first = span - self.degree;
        let mut homogeneous = [(AxisVector::ZERO, 0.0); 4];
        for order in 0..=self.degree.min(3) {
            homogeneous[order] = combine(&self.levels[order], first, self.degree - order, &rows[order]);
        }
        self.quotient(&homogeneous)
    }

    #[inline]
    fn quotient(&self, [a, a1, a2, a3]: &[(AxisVector, f64); 4]) -> Derivatives {
        let inverse = 1.0 / a.1;
        let position = a.0 * inverse;
        if self.plain {
            return Derivatives { position, first: a1.0 * inverse, second: a2.0 * inverse, third: a3.0 * inverse };
        }
        let first = (a1.0 - position * a1.1) * inverse;
        let second = (a2.0 - first * (2.0 * a1.1) - position * a2.1) * inverse;
        let third = (a3.0 - second * (3.0 * a1.1) - first * (3.0 * a2.1) - position * a3.1) * inverse;
        Derivatives { position, first, second, third }
    }

    /// The non-zero basis functions at `u` of the degrees p, p − 1, p − 2 and p − 3 (A2.2, which passes through all of them).
    #[inline]
    fn basis(&self, span: usize, u: f64, rows: &mut [Row; 4]) {
        let (mut left, mut right) = (Row::default(), Row::default());
        let mut row = Row::default();
        row[0] = 1.0;
        for degree in 0..=self.degree {
            if degree > 0 {
                left[degree] = u - self.knots[span + 1 - degree];
                right[degree] = self.knots[span + degree] - u;
                raise(&mut row, degree, &left, &right);
            }
            if let Some(kept) = rows.get_mut(self.degree - degree) {
                *kept = row;
            }
        }
    }
}

/// Basis functions of degree `degree` from those of the degree below.
#[inline]
fn raise(row: &mut Row, degree: usize, left: &Row, right: &Row) {
    let mut saved = 0.0;
    for index in 0..degree {
        let share = row[index] / (right[index + 1] + left[degree - index]);
        row[index] = saved + right[index + 1] * share;
        saved = left[degree - index] * share;
    }
    row[degree] = saved;
}

#[inline]
fn combine(level: &Level, first: usize, degree: usize, row: &Row) -> (AxisVector, f64) {
    let (mut weighted, mut weight) = (AxisVector::ZERO, 0.0);
    let points = level.weighted[first..=first + degree].iter().zip(&level.weights[first..=first + degree]);
    for ((point, w), share) in points.zip(row) {
        weighted += *point * *share;
        weight += w * share;
    }
    (weighted, weight)
}
