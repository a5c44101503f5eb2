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

impl Nurbs {
    /// Whether the curve lies inside a convex set all the way between two parameters. True is proven: the control points of
    /// the parts of the curve there are inside, and a part that is not is halved up to `halvings` times. Does not allocate.
    pub fn lies_inside(
        &self,
        range: (f64, f64),
        halvings: u32,
        inside: &impl Fn(&AxisVector) -> bool,
    ) -> bool {
        let spans = self.span(range.0)..=self.span(range.1);
        spans.into_iter().all(|span| {
            let part = (
                self.knots[span].max(range.0),
                self.knots[span + 1].min(range.1),
            );
            part.1 <= part.0 || Hull::of_part(self, span, part).is_inside(halvings, inside)
        })
    }
}

impl Hull {
    /// The whole of `span`, which has an extent. Does not allocate.
    pub fn of_span(curve: &Nurbs, span: usize) -> Self {
        Self::of_part(curve, span, (curve.knots[span], curve.knots[span + 1]))
    }

    /// The part of `span`, which has an extent, between two parameters: the blossom of the curve at them. Does not allocate.
    fn of_part(curve: &Nurbs, span: usize, (from, to): (f64, f64)) -> Self {
        let mut hull = Self {
            degree: curve.degree,
            points: [[0.0; MAX_AXES + 1]; MAX_DEGREE + 1],
            range: (from, to),
        };
        for index in 0..=curve.degree {
            hull.points[index] = blossom(curve, span, |level| {
                if level + index <= curve.degree {
                    from
                } else {
                    to
                }
            });
        }
        hull
    }

    /// Its halves (de Casteljau).
    pub fn halves(&self) -> [Self; 2] {
        let middle = f64::midpoint(self.range.0, self.range.1);
        let mut first = Self {
            range: (self.range.0, middle),
            ..*self
        };
        let mut second = Self {
            range: (middle, self.range.1),
            ..*self
        };
        for level in 1..=self.degree {
            for index in 0..=self.degree - level {
                second.points[index] =
                    between(&second.points[index], &second.points[index + 1], 0.5);
            }
            first.points[level] = second.points[0];
        }
        [first, second]
    }

    /// Whether it lies inside a convex set, as far as `halvings` show.
    fn is_inside(&self, halvings: u32, inside: &impl Fn(&AxisVector) -> bool) -> bool {
        if (0..=self.degree).all(|index| inside(&self.position(index))) {
            return true;
        }
        // Its ends are places of the curve itself: where one is outside, no halving helps.
        halvings > 0
            && self.ends().iter().all(inside)
            && self
                .halves()
                .iter()
                .all(|half| half.is_inside(halvings - 1, inside))
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
        let values = self.points[..=self.degree]
            .iter()
            .map(|point| point[axis] / point[Wide::WEIGHT]);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        })
    }

    /// No point of it is nearer to `point` than this, mm.
    pub fn min_distance_mm(&self, point: &AxisVector) -> f64 {
        let off = |axis: usize| {
            let (low, high) = self.bounds(axis);
            (low - point[axis]).max(point[axis] - high).max(0.0)
        };
        (0..MAX_AXES)
            .map(|axis| off(axis).powi(2))
            .sum::<f64>()
            .sqrt()
    }
}

/// De Boor's triangle on `span` with a parameter of its own at each level.
fn blossom(curve: &Nurbs, span: usize, parameter: impl Fn(usize) -> f64) -> Wide {
    let degree = curve.degree;
    let first = span - curve.degree;
    let mut points: [Wide; MAX_DEGREE + 1] =
        std::array::from_fn(|index| curve.levels.point(first + index.min(degree)));
    for level in 1..=degree {
        for index in (level..=degree).rev() {
            let low = curve.knots[first + index];
            let high = curve.knots[span + 1 + index - level];
            let share = (parameter(level) - low) / (high - low);
            points[index] = between(&points[index - 1], &points[index], share);
        }
    }
    points[degree]
}

fn between(a: &Wide, b: &Wide, share: f64) -> Wide {
    std::array::from_fn(|n| a[n] * (1.0 - share) + b[n] * share)
}
