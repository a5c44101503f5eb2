//! The mean over a whole number of tooth periods.

/// Longest mean, in samples.
pub const LONGEST: usize = 512;

/// Means over the last samples, also over a part of one: sums are kept, so a mean costs two of them. Allocates when made.
#[derive(Clone, Debug)]
pub struct RunningMean {
    /// Sum of all samples up to each of the last ones.
    sums: Vec<f64>,
    at: usize,
    seen: usize,
}

impl RunningMean {
    /// No samples yet.
    pub fn new() -> Self {
        Self {
            sums: vec![0.0; LONGEST + 2],
            at: 0,
            seen: 0,
        }
    }

    /// Takes a sample.
    pub fn push(&mut self, value: f64) {
        let sum = self.sums[self.at] + value;
        self.at = (self.at + 1) % self.sums.len();
        self.sums[self.at] = sum;
        self.seen = (self.seen + 1).min(LONGEST);
    }

    /// Mean over the last `samples`, or over as many as there are; 0 where there are none.
    pub fn of(&self, samples: f64) -> f64 {
        let samples = samples.min(self.seen as f64);
        if samples <= 0.0 {
            return 0.0;
        }
        let whole = samples.floor();
        let ago = |count: usize| self.sums[(self.at + self.sums.len() - count) % self.sums.len()];
        let (near, far) = (ago(whole as usize), ago(whole as usize + 1));
        // Where nothing is older, the part of a sample is 0.
        let start = if samples == whole {
            near
        } else {
            near + (far - near) * (samples - whole)
        };
        (self.sums[self.at] - start) / samples
    }

    /// Multiplies everything remembered. Only differences of sums count: the sums start again from zero.
    pub(crate) fn scale(&mut self, factor: f64) {
        let now = self.sums[self.at];
        self.sums
            .iter_mut()
            .for_each(|sum| *sum = (*sum - now) * factor);
    }
}

impl Default for RunningMean {
    fn default() -> Self {
        Self::new()
    }
}

/// How many samples to average: the fewest whole tooth periods that are no shorter than `rough`, the samples of a rough
/// period; `rough` itself where no tooth period is known, or where one is longer than [`LONGEST`].
pub fn window(rough: f64, tooth: Option<f64>) -> f64 {
    let Some(tooth) = tooth.filter(|tooth| *tooth > 0.0 && *tooth <= LONGEST as f64) else {
        return rough;
    };
    let periods = (rough / tooth).ceil().max(1.0);
    if periods * tooth <= LONGEST as f64 {
        periods * tooth
    } else {
        rough
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn the_window_is_whole_tooth_periods() {
        assert_eq!(window(8.0, None), 8.0);
        assert_eq!(window(8.0, Some(100.0 / 3.0)), 100.0 / 3.0);
        assert_eq!(window(8.0, Some(3.0)), 9.0);
        assert_eq!(window(8.0, Some(8.0)), 8.0);
        assert_eq!(
            (
                window(8.0, Some(0.0)),
                window(8.0, Some(1e4)),
                window(8.0, Some(f64::NAN))
            ),
            (8.0, 8.0, 8.0)
        );
    }

    #[test]
    fn tooth_ripple_averages_out() {
        let tooth = 100.0 / 3.0;
        let mut mean = RunningMean::new();
        let (mut worst, mut rough) = (0.0_f64, 0.0_f64);
        for k in 0..3000 {
            mean.push(0.1 + 0.05 * (TAU * f64::from(k) / tooth).sin());
            if k > 40 {
                worst = worst.max((mean.of(tooth) - 0.1).abs());
                rough = rough.max((mean.of(8.0) - 0.1).abs());
            }
        }
        assert!(
            worst < 2e-4 && rough > 0.04,
            "{worst} over a tooth period, {rough} over 8 samples"
        );
    }

    #[test]
    fn it_starts_with_what_there_is() {
        let mut mean = RunningMean::new();
        assert_eq!(mean.of(8.0), 0.0);
        mean.push(3.0);
        mean.push(5.0);
        assert_eq!(
            (mean.of(1.0), mean.of(8.0), mean.of(1.5)),
            (5.0, 4.0, 6.5 / 1.5)
        );
    }
}
