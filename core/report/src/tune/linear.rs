//! Linear scales.

use crate::chart::Mark;

/// From values to places on the page.
#[derive(Clone, Copy, Debug)]
pub struct Linear {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Linear {
    /// Maps what lies between the least and the greatest of `values`, and a little more, to places from `from` to `to`.
    pub fn around(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values.filter(|value| value.is_finite()) {
            (low, high) = (low.min(value), high.max(value));
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        // What is the same all over is a line in the middle, and not the noise of its last digit.
        let room = (0.06 * (high - low)).max(1e-3 * high.abs()).max(1e-9);
        Self {
            low: low - room,
            high: high + room,
            from,
            to,
        }
    }

    /// The place of a value.
    pub fn place(&self, value: f64) -> f64 {
        self.from + (value - self.low) / (self.high - self.low) * (self.to - self.from)
    }

    /// Whether a value lies within.
    pub fn has(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }

    /// About `count` marks with their places.
    pub fn places(&self, count: usize) -> impl Iterator<Item = Mark> {
        self.marks(count)
            .into_iter()
            .map(|mark| (mark, self.place(mark)))
    }

    /// Round values within, about `count` of them.
    pub fn marks(&self, count: usize) -> Vec<f64> {
        let rough = (self.high - self.low) / count.max(1) as f64;
        let decade = 10_f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0]
            .map(|step| step * decade)
            .into_iter()
            .find(|step| *step >= rough);
        let step = step.unwrap_or(10.0 * decade);
        let first = (self.low / step).ceil() as i64;
        let last = (self.high / step).floor() as i64;
        (first..=last).map(|n| n as f64 * step).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_round_and_within() {
        let scale = Linear::around([0.0, 10.0].into_iter(), 0.0, 100.0);
        assert_eq!(scale.marks(5), [0.0, 5.0, 10.0]);
        assert!(
            scale.place(0.0) > 0.0
                && scale.place(10.0) < 100.0
                && scale.has(5.0)
                && !scale.has(11.0)
        );
        for values in [
            vec![],
            vec![3.0],
            vec![f64::NAN],
            vec![-1e-9, 1e-9],
            vec![1e6, 1e6],
        ] {
            let scale = Linear::around(values.clone().into_iter(), 0.0, 1.0);
            let marks = scale.marks(5);
            assert!(
                scale.place(3.0).is_finite() && marks.len() < 20,
                "{values:?}: {marks:?}"
            );
        }
    }
}
