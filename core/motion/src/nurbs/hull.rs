//! Parts of a curve as Bezier curves, whose control points bound them: weights are positive, so that no part leaves the
//! hull of its points. What is found by halving such parts holds however uneven the parameter is.

use tandem_sdk::{AxisVector, MAX_AXES};

use super::levels::{Lanes, Wide};
use super::{MAX_DEGREE, Nurbs};

/// A part of a span by its homogeneous Bezier points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hull {
    degree: usize,
    points: [Wide; MAX_DEGREE + 1],
    /// First and last parameter.
    pub range: (f64, f64),
}

impl Hull {
    /// The whole of `span`, which has an extent: the blossom of the curve at its ends. Does not allocate.
    pub fn of_span(curve: &Nurbs, span: usize) -> Self {
        let (from, to) = (curve.knots[span], curve.knots[span + 1]);
        let mut hull = Self { degree: curve.degree, points: [[0.0; MAX_AXES + 1]; MAX_DEGREE + 1], range: (from, to) };
        for index in 0..=curve.degree {
            hull.points[index] = blossom(curve, span, |level| if level + index <= curve.degree { from } else { to });
        }
        hull
    }

    /// Its halves (de Casteljau).
    pub fn halves(&self) -> [Self; 2] {
        let middle = f64::midpoint(self.range.0, self.range.1);
        let mut first = Self { range: (self.range.0, middle), ..*self };
        let mut second = Self { range: (middle, self.range.1), ..*self };
        for level in 1..=self.degree {
            for index in 0..=self.degree - level {
                second.points[index] = between(&second.points[index], &second.points[index + 1], 0.5);
            }
            first.points[level] = second.points[0];
        }
        [first, second]
    }

    /// Degree of the curve.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Control point `index`, mm or rad.
    pub fn position(&self, index: usize) -> AxisVector {
        let point = &self.points[index];
        point.axes() * (1.0 / point[Wide::WEIGHT])
    }

    /// Where it begins and ends, mm or rad.
    pub fn ends(&self) -> [AxisVector; 2] {
        [0, self.degree].map(|index| self.position(index))
    }

    /// Between what `axis` stays, mm or rad.
    pub fn bounds(&self, axis: usize) -> (f64, f64) {
        let values = self.points[..=self.degree].iter().map(|point| point[axis] / point[Wide::WEIGHT]);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
    }

    /// No point of it is nearer to `point` than this, mm.
    pub fn least_distance_mm(&self, point: &AxisVector) -> f64 {
        let off = |axis: usize| {
            let (low, high) = self.bounds(axis);
            (low - point[axis]).max(point[axis] - high).max(0.0)
        };
        (0..MAX_AXES).map(|axis| off(axis).powi(2)).sum::<f64>().sqrt()
    }
}

/// De Boor's triangle on `span` with a parameter of its own at each level.
fn blossom(curve: &Nurbs, span: usize, parameter: impl Fn(usize) -> f64) -> Wide {
    let (degree, first) = (curve.degree, span - curve.degree);
    let mut points: [Wide; MAX_DEGREE + 1] = std::array::from_fn(|index| curve.levels.point(first + index.min(degree)));
    for level in 1..=degree {
        for index in (level..=degree).rev() {
            let (low, high) = (curve.knots[first + index], curve.knots[span + 1 + index - level]);
            let share = (parameter(level) - low) / (high - low);
            points[index] = between(&points[index - 1], &points[index], share);
        }
    }
    points[degree]
}

fn between(a: &Wide, b: &Wide, share: f64) -> Wide {
    std::array::from_fn(|n| a[n] * (1.0 - share) + b[n] * share)
}
