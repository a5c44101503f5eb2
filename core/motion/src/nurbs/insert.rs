//! Knot insertion.

use super::curve::Level;
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
        let level = &self.levels[0];
        let mut next = Level::default();
        for index in 0..=self.points() {
            let share = self.share(span - count, index, u);
            next.weighted.push(mix(&level.weighted, index, share, |a, b| a * (1.0 - share) + b * share));
            next.weights.push(mix(&level.weights, index, share, |a, b| a * (1.0 - share) + b * share));
        }
        let mut knots = self.knots.clone();
        knots.insert(span + 1, u);
        Ok(self.rebuilt(next, knots))
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

/// The new control point `index`: at either end of the list only one of its two sources exists.
fn mix<T: Copy>(of: &[T], index: usize, share: f64, both: impl Fn(T, T) -> T) -> T {
    if share == 1.0 {
        of[index]
    } else if share == 0.0 {
        of[index - 1]
    } else {
        both(of[index - 1], of[index])
    }
}

impl Nurbs {
    fn rebuilt(&self, level: Level, knots: Vec<f64>) -> Self {
        let points = level.weights.len();
        let mut levels = [level, Level::default(), Level::default(), Level::default()];
        for order in 1..=self.degree.min(3) {
            levels[order] = super::curve::derived(&levels[order - 1], &knots, self.degree, order, points);
        }
        let plain = self.plain;
        Self { degree: self.degree, knots, levels, plain, counted: self.counted }
    }
}
