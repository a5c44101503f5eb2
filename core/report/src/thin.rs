//! Very long runs: fewer points than samples, without losing a peak.

/// Cuts the samples into slices of equal length and keeps two points of each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Thinning {
    /// Samples in a slice; 2 or less keeps everything.
    slice: usize,
}

impl Thinning {
    /// The thinning that leaves at most `cap` of `samples` (rounded up to whole slices).
    pub(crate) fn new(samples: usize, cap: usize) -> Self {
        Self {
            slice: if samples > cap {
                (2 * samples).div_ceil(cap).max(3)
            } else {
                1
            },
        }
    }

    /// Samples in a slice, or `None` where nothing is thinned.
    pub(crate) fn slice(self) -> Option<usize> {
        (self.slice > 2).then_some(self.slice)
    }

    /// Of each slice the smallest and the largest value, in the order in which they occur.
    pub(crate) fn extremes(self, values: &[f64]) -> Vec<f64> {
        match self.slice() {
            None => values.to_vec(),
            Some(slice) => values.chunks(slice).flat_map(extremes_of).collect(),
        }
    }

    /// Of each slice the first and the middle sample: for what must stay together, such as the coordinates of a point.
    pub(crate) fn picks<T: Copy>(self, values: &[T]) -> Vec<T> {
        match self.slice() {
            None => values.to_vec(),
            Some(slice) => values
                .chunks(slice)
                .flat_map(|part| [part[0], part[part.len() / 2]])
                .collect(),
        }
    }

    /// Marks set anywhere in a slice are set on both its points.
    pub(crate) fn marks(self, marks: &[u8]) -> Vec<u8> {
        match self.slice() {
            None => marks.to_vec(),
            Some(slice) => marks
                .chunks(slice)
                .flat_map(|part| [part.iter().fold(0, |all, m| all | m); 2])
                .collect(),
        }
    }
}

fn extremes_of(part: &[f64]) -> [f64; 2] {
    let mut low = (0, f64::INFINITY);
    let mut high = (0, f64::NEG_INFINITY);
    for (i, &value) in part.iter().enumerate() {
        if value < low.1 {
            low = (i, value);
        }
        if value > high.1 {
            high = (i, value);
        }
    }
    match (low, high) {
        (_, (_, f64::NEG_INFINITY)) => [f64::NAN; 2],
        _ if low.0 <= high.0 => [low.1, high.1],
        _ => [high.1, low.1],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extremes_survive() {
        let mut values = vec![1.0; 10_000];
        values[1234] = -7.0;
        values[7777] = 9.0;
        let thin = Thinning::new(values.len(), 100);
        let kept = thin.extremes(&values);
        assert!(kept.len() <= 100);
        assert!(kept.contains(&-7.0) && kept.contains(&9.0));
    }

    #[test]
    fn extremes_keep_their_order() {
        assert_eq!(extremes_of(&[3.0, 9.0, 1.0]), [9.0, 1.0]);
        assert_eq!(extremes_of(&[f64::NAN, 2.0]), [2.0, 2.0]);
        assert!(extremes_of(&[f64::NAN])[0].is_nan());
    }

    #[test]
    fn every_column_keeps_the_same_number() {
        for samples in [101, 150, 200, 1001, 9999] {
            let thin = Thinning::new(samples, 100);
            let n = thin.picks(&vec![0_u32; samples]).len();
            assert!(n <= 102, "{samples} samples left {n}");
            assert_eq!(thin.extremes(&vec![0.0; samples]).len(), n);
            assert_eq!(thin.marks(&vec![0; samples]).len(), n);
        }
    }

    #[test]
    fn short_runs_are_left_alone() {
        let thin = Thinning::new(100, 100);
        assert_eq!(thin.slice(), None);
        assert_eq!(thin.extremes(&[1.0, f64::NAN]).len(), 2);
    }

    #[test]
    fn a_mark_is_never_lost() {
        let mut marks = vec![0; 1000];
        marks[501] = 2;
        assert!(Thinning::new(1000, 10).marks(&marks).contains(&2));
    }
}
