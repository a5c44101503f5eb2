//! Logarithmic scales.

use crate::chart::Mark;

/// From values to places on the page.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Scale {
    /// Maps `low` to the place `from` and `high` to the place `to`; at least a decade, and nothing but positive numbers.
    pub fn new(low: f64, high: f64, from: f64, to: f64) -> Self {
        let low = if low.is_finite() && low > 0.0 {
            low
        } else {
            1.0
        };
        let high = if high.is_finite() {
            high.max(10.0 * low)
        } else {
            10.0 * low
        };
        Self {
            low,
            high,
            from,
            to,
        }
    }

    /// The place of a value; what lies outside lies at the end.
    pub fn place(&self, value: f64) -> f64 {
        let share =
            (value.clamp(self.low, self.high) / self.low).ln() / (self.high / self.low).ln();
        self.from + share * (self.to - self.from)
    }

    /// The marks with their places.
    pub fn places(&self) -> impl Iterator<Item = Mark> {
        self.marks()
            .into_iter()
            .map(|mark| (mark, self.place(mark)))
    }

    /// The powers of ten within, and where there are few, 2 and 5 times them.
    pub fn marks(&self) -> Vec<f64> {
        let decades = self.low.log10().floor() as i32..=self.high.log10().ceil() as i32;
        let steps: &[f64] = if (self.high / self.low).log10() > 4.0 {
            &[1.0]
        } else {
            &[1.0, 2.0, 5.0]
        };
        let all =
            decades.flat_map(|decade| steps.iter().map(move |step| step * f64::powi(10.0, decade)));
        all.filter(|mark| (self.low * 0.999..=self.high * 1.001).contains(mark))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decades_are_equally_wide() {
        let scale = Scale::new(1.0, 100.0, 50.0, 250.0);
        assert_eq!(
            [0.0, 1.0, 10.0, 100.0, 1e9].map(|value| scale.place(value).round()),
            [50.0, 50.0, 150.0, 250.0, 250.0]
        );
        assert_eq!(scale.marks(), [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0]);
        assert_eq!(Scale::new(1e-6, 1.0, 0.0, 1.0).marks().len(), 7);
    }

    #[test]
    fn a_scale_of_nothing_is_one() {
        for (low, high) in [
            (0.0, 0.0),
            (f64::NAN, f64::NAN),
            (5.0, 5.0),
            (f64::INFINITY, f64::NEG_INFINITY),
        ] {
            let scale = Scale::new(low, high, 0.0, 1.0);
            assert!(
                scale.place(7.0).is_finite() && !scale.marks().is_empty(),
                "{low} {high}"
            );
        }
    }
}
