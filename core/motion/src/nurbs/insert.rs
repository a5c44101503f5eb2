//! Knot insertion.

use super::levels::{Levels, mix};
use super::{Nurbs, NurbsError};

impl Nurbs {
    /// The same curve with `u` as a further knot (Boehm's algorithm, A5.1 for one knot). Allocates.
    ///
    /// # Errors
    /// `u` outside the curve, or a knot that stands as often as the degree already.
    pub fn insert_knot(&self, u: f64) -> Result<Self, NurbsError> {
        let (from, to) = self.range();
        let count = self.knots.iter().filter(|knot| **knot == u).count();
        if !(u > from && u < to) || count >= self.degree {
            return Err(NurbsError::Insert(u));
        }
        let span = self.span(u);
        // At either end of the list only one of the two sources of a point exists.
        let point = |index: usize| match self.share(span - count, index, u) {
            1.0 => self.levels.point(index),
            0.0 => self.levels.point(index - 1),
            share => mix(
                1.0 - share,
                &self.levels.point(index - 1),
                share,
                &self.levels.point(index),
            ),
        };
        let mut knots = self.knots.clone();
        knots.insert(span + 1, u);
        let levels = Levels::new(
            (0..=self.points()).map(point).collect(),
            &knots,
            self.degree,
        );
        Ok(Self {
            degree: self.degree,
            knots,
            levels,
            plain: self.plain,
            counted: self.counted,
        })
    }

    /// How much of the control point of the same index goes into the new one; the rest is of the one before.
    fn share(&self, last: usize, index: usize, u: f64) -> f64 {
        if index + self.degree <= self.span(u) {
            1.0
        } else if index > last {
            0.0
        } else {
            (u - self.knots[index]) / (self.knots[index + self.degree] - self.knots[index])
        }
    }
}
