//! Means over a rough period, as the script is told them.

use tandem_policy::Period;
use tandem_sdk::{Axes, AxisVector, FineSample};

/// Signals of a feed strategy that a script is told, by their names.
const SIGNALS: [&str; 3] = ["cutting_torque_nm", "reference_torque_nm", "spindle_load"];

/// Makes a [`Period`] of the samples of each rough period.
#[derive(Clone, Debug)]
pub struct Means {
    axes: Axes,
    fine_period_s: f64,
    distance_left_mm: f64,
    /// Where the strategy publishes each of [`SIGNALS`].
    signals: [Option<usize>; 3],
}

impl Means {
    /// For a program of `length_mm` and a strategy that publishes `signals`.
    pub fn new(axes: Axes, fine_period_s: f64, length_mm: f64, signals: &[&str]) -> Self {
        let place = |name: &str| signals.iter().position(|signal| *signal == name);
        Self {
            axes,
            fine_period_s,
            distance_left_mm: length_mm,
            signals: SIGNALS.map(place),
        }
    }

    /// The means of rough period number `period`; what the strategy answered for it, if there is one.
    pub fn of(
        &mut self,
        period: u64,
        samples: &[FineSample],
        strategy: Option<(f64, &[f64])>,
    ) -> Period {
        let count = samples.len().max(1) as f64;
        let mean =
            |value: &dyn Fn(&FineSample) -> f64| samples.iter().map(value).sum::<f64>() / count;
        // Of what was not heard of in a period nothing is told; where that is all of it, that is no number.
        let heard = samples.iter().filter(|sample| sample.is_new()).count() as f64;
        let measured = |value: &dyn Fn(&FineSample) -> f64| {
            samples
                .iter()
                .filter(|sample| sample.is_new())
                .map(value)
                .sum::<f64>()
                / heard
        };
        let error = |sample: &FineSample| self.distance_mm(&(sample.command - sample.position));
        let (ratio, signals) = strategy.unwrap_or((1.0, &[]));
        let signal = |index: usize| {
            self.signals[index]
                .and_then(|at| signals.get(at))
                .copied()
                .unwrap_or(f64::NAN)
        };
        let feed_mm_per_s = mean(&|sample| sample.feed_mm_per_s);
        let means = Period {
            line: samples.last().map_or(0, |sample| sample.line),
            period,
            duration_s: count * self.fine_period_s,
            feed_mm_per_s,
            programmed_feed_mm_per_s: mean(&|sample| sample.programmed_feed_mm_per_s),
            following_error_mm: measured(&error),
            max_following_error_mm: samples
                .iter()
                .filter(|sample| sample.is_new())
                .map(error)
                .fold(f64::NAN, f64::max),
            cutting_torque_nm: signal(0),
            reference_torque_nm: signal(1),
            spindle_load: signal(2),
            spindle_rad_per_s: mean(&|sample| sample.spindle_rad_per_s),
            distance_left_mm: self.distance_left_mm,
            strategy_ratio: ratio,
            current_a: AxisVector(std::array::from_fn(|axis| {
                measured(&|sample| sample.current_a[axis].abs())
            })),
        };
        self.distance_left_mm = (self.distance_left_mm - feed_mm_per_s * means.duration_s).max(0.0);
        Period {
            distance_left_mm: self.distance_left_mm,
            ..means
        }
    }

    /// Length over the linear axes.
    fn distance_mm(&self, vector: &AxisVector) -> f64 {
        let linear = (0..self.axes.count()).filter(|axis| !self.axes.is_rotary(*axis));
        linear.map(|axis| vector[axis].powi(2)).sum::<f64>().sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_of_a_period_and_what_is_left() {
        let axes = Axes::new(&[('X', false), ('A', true)]).unwrap();
        let mut means = Means::new(
            axes,
            0.001,
            10.0,
            &["reference_torque_nm", "cutting_torque_nm"],
        );
        let sample = |feed, x| FineSample {
            line: 7,
            feed_mm_per_s: feed,
            command: AxisVector::from_slice(&[x, 5.0]),
            current_a: AxisVector::from_slice(&[-2.0]),
            ..FineSample::default()
        };
        let period = means.of(
            3,
            &[sample(100.0, 0.02), sample(300.0, -0.04)],
            Some((0.5, &[2.0, 1.5])),
        );
        assert_eq!(
            (period.feed_mm_per_s, period.line, period.period),
            (200.0, 7, 3)
        );
        assert!(
            (period.following_error_mm - 0.03).abs() < 1e-15
                && period.max_following_error_mm == 0.04
        );
        assert_eq!(
            (
                period.cutting_torque_nm,
                period.reference_torque_nm,
                period.strategy_ratio
            ),
            (1.5, 2.0, 0.5)
        );
        assert!(period.spindle_load.is_nan() && period.current_a[0] == 2.0);
        assert!((period.distance_left_mm - 9.6).abs() < 1e-12);
        // Of what is old nothing is told but that the feed was driven.
        let old = |x| FineSample {
            age_periods: [0, 1, 0, 0, 0, 0, 0, 0],
            ..sample(300.0, x)
        };
        let period = means.of(4, &[sample(100.0, 0.02), old(-0.04)], None);
        assert!(
            (period.following_error_mm - 0.02).abs() < 1e-15
                && period.max_following_error_mm == 0.02
        );
        assert_eq!((period.feed_mm_per_s, period.current_a[0]), (200.0, 2.0));
        let period = means.of(5, &[old(0.02)], None);
        assert!(
            [
                period.following_error_mm,
                period.max_following_error_mm,
                period.current_a[0]
            ]
            .iter()
            .all(|v| v.is_nan())
        );
    }
}
