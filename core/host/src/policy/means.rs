//! Means over a rough period, as the script is told them.

use tandem_machine::Machine;
use tandem_policy::{MAX_SCRIPT_SIGNALS, Period};
use tandem_sdk::{Axes, AxisVector, FineSample};

/// Signals of a feed strategy that every script is told, by their names.
const SIGNALS: [&str; 3] = ["cutting_torque_nm", "reference_torque_nm", "spindle_load"];

/// Makes a [`Period`] of the samples of each rough period.
#[derive(Clone, Debug)]
pub struct Means {
    axes: Axes,
    fine_period_s: f64,
    distance_left_mm: f64,
    /// Where the strategy publishes each of [`SIGNALS`].
    signals: [Option<usize>; 3],
    /// What scripts may ask for by name, in the order of [`super::setup::signals`].
    sources: Vec<Source>,
}

/// Where a signal comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    /// The feed strategy's, by its number.
    Strategy(usize),
    /// An analog input, by its number.
    Analog(usize),
    /// A digital input, by its number.
    Digital(u32),
}

/// What a script looks at.
pub struct Looks<'a> {
    /// More than version 1 of the ABI tells.
    pub closer: bool,
    /// Signals by name, as indices of those of the machine.
    pub signals: &'a [usize],
}

impl Means {
    /// For a program of `length_mm` on `machine` with a strategy that publishes `signals`.
    pub fn new(machine: &Machine, length_mm: f64, signals: &[&str]) -> Self {
        let analog = machine.analog.iter();
        let inputs = machine.inputs.iter();
        let sources = (0..signals.len())
            .map(Source::Strategy)
            .chain(analog.map(|analog| Source::Analog(analog.input as usize)))
            .chain(inputs.map(|input| Source::Digital(input.input)));
        Self {
            sources: sources.collect(),
            ..Self::of_axes(machine.axes, machine.fine_period_s, length_mm, signals)
        }
    }

    fn of_axes(axes: Axes, fine_period_s: f64, length_mm: f64, signals: &[&str]) -> Self {
        let place = |name: &str| signals.iter().position(|signal| *signal == name);
        Self {
            axes,
            fine_period_s,
            distance_left_mm: length_mm,
            signals: SIGNALS.map(place),
            sources: vec![],
        }
    }

    /// The means of rough period number `period`, as far as a script looks; what the strategy answered for it, if there is one.
    pub fn of(
        &mut self,
        period: u64,
        samples: &[FineSample],
        strategy: Option<(f64, &[f64])>,
        looks: &Looks<'_>,
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
            ..Period::default()
        };
        let means = if looks.closer {
            self.closer(samples, signals, looks.signals, &means)
        } else {
            means
        };
        self.distance_left_mm = (self.distance_left_mm - feed_mm_per_s * means.duration_s).max(0.0);
        Period {
            distance_left_mm: self.distance_left_mm,
            ..means
        }
    }

    /// `means` with what is told per axis, and the signals that the script asks for.
    fn closer(
        &self,
        samples: &[FineSample],
        strategy: &[f64],
        signals: &[usize],
        means: &Period,
    ) -> Period {
        let fresh = || samples.iter().filter(|sample| sample.is_new());
        let heard = fresh().count() as f64;
        let mut closer = Period {
            position: samples.last().map_or(AxisVector::ZERO, |last| last.command),
            sigma: samples.iter().map(|sample| sample.sigma).sum::<f64>()
                / samples.len().max(1) as f64,
            ..*means
        };
        let mut speed = AxisVector::ZERO;
        let mut error = AxisVector::ZERO;
        let mut most = AxisVector::ZERO.map(|_| f64::NAN);
        for sample in fresh() {
            let now = sample.command - sample.position;
            speed += sample.speed;
            error += now;
            for (most, now) in most.0.iter_mut().zip(now.0) {
                *most = most.max(now.abs());
            }
        }
        closer.speed = speed * (1.0 / heard);
        closer.axis_error = error * (1.0 / heard);
        closer.max_axis_error = most;
        for (slot, signal) in closer
            .signals
            .iter_mut()
            .zip(signals)
            .take(MAX_SCRIPT_SIGNALS)
        {
            *slot = self
                .sources
                .get(*signal)
                .map_or(f64::NAN, |source| mean_of(*source, samples, strategy));
        }
        closer
    }

    /// Length over the linear axes.
    fn distance_mm(&self, vector: &AxisVector) -> f64 {
        let linear = (0..self.axes.count()).filter(|axis| !self.axes.is_rotary(*axis));
        linear.map(|axis| vector[axis].powi(2)).sum::<f64>().sqrt()
    }
}

/// The mean of a signal over `samples`; of a digital input the share of those in which it was heard to be 1. NaN where
/// nothing was heard.
fn mean_of(source: Source, samples: &[FineSample], strategy: &[f64]) -> f64 {
    let share = |value: &dyn Fn(&FineSample) -> Option<f64>| {
        let (count, sum) = samples
            .iter()
            .filter_map(value)
            .fold((0.0, 0.0), |(count, sum), value| (count + 1.0, sum + value));
        sum / count
    };
    match source {
        Source::Strategy(index) => strategy.get(index).copied().unwrap_or(f64::NAN),
        Source::Analog(input) => share(&|sample| sample.analog.get(input).copied()),
        Source::Digital(input) => share(&|sample| {
            let is_heard = sample.old_inputs >> input & 1 == 0;
            is_heard.then_some((sample.inputs >> input & 1) as f64)
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const V1: Looks<'_> = Looks {
        closer: false,
        signals: &[],
    };

    #[test]
    fn means_of_a_period_and_what_is_left() {
        let axes = Axes::new(&[('X', false), ('A', true)]).unwrap();
        let mut means = Means::of_axes(
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
            &V1,
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
        let period = means.of(4, &[sample(100.0, 0.02), old(-0.04)], None, &V1);
        assert!(
            (period.following_error_mm - 0.02).abs() < 1e-15
                && period.max_following_error_mm == 0.02
        );
        assert_eq!((period.feed_mm_per_s, period.current_a[0]), (200.0, 2.0));
        let period = means.of(5, &[old(0.02)], None, &V1);
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

    #[test]
    fn a_script_that_looks_closer_sees_each_axis_and_the_signals_it_names() {
        let axes = Axes::new(&[('X', false), ('A', true)]).unwrap();
        let mut means = Means::of_axes(axes, 0.001, 10.0, &[]);
        means.sources = vec![
            Source::Strategy(0),
            Source::Analog(2),
            Source::Digital(5),
            Source::Digital(6),
        ];
        let sample = |x: f64, celsius: f64, inputs: u64, old_inputs: u64| FineSample {
            command: AxisVector::from_slice(&[x, 1.0]),
            position: AxisVector::from_slice(&[x - 0.02, 1.5]),
            speed: AxisVector::from_slice(&[100.0 * x, 0.0]),
            analog: [0.0, 0.0, celsius, 0.0],
            sigma: 0.5,
            inputs,
            old_inputs,
            ..FineSample::default()
        };
        let samples = [
            sample(1.0, 40.0, 1 << 5, 1 << 6),
            sample(2.0, 60.0, 0, 1 << 6),
        ];
        let looks = Looks {
            closer: true,
            signals: &[1, 2, 3, 0],
        };
        let period = means.of(3, &samples, Some((1.0, &[7.5])), &looks);
        assert_eq!(period.position.0[..2], [2.0, 1.0]);
        assert_eq!(period.speed.0[..2], [150.0, 0.0]);
        let near = |one: f64, other: f64| (one - other).abs() < 1e-12;
        assert!(near(period.axis_error[0], 0.02) && near(period.axis_error[1], -0.5));
        assert!(near(period.max_axis_error[1], 0.5) && near(period.sigma, 0.5));
        assert_eq!(period.signals[..2], [50.0, 0.5]);
        assert!(period.signals[2].is_nan(), "nothing was heard of it");
        assert_eq!(period.signals[3], 7.5);
        assert!(period.signals[4].is_nan());
    }
}
