//! Finite differences of the samples, in f64: second and third differences of rounded positions would be noise.

/// Time since the sample before, in s, as a whole number of periods; NaN for the first.
///
/// Counting periods keeps the rounding of large times out of the differences.
pub(crate) fn steps_s(t_s: &[f64], period_s: f64) -> Vec<f64> {
    let step = |pair: &[f64]| ((pair[1] - pair[0]) / period_s).round().max(1.0) * period_s;
    first_then(t_s, step)
}

/// Rate of change against the sample before; NaN where that is unknown.
pub(crate) fn rate(values: &[f64], steps_s: &[f64]) -> Vec<f64> {
    let mut steps = steps_s.iter().skip(1);
    first_then(values, |pair| {
        (pair[1] - pair[0]) / steps.next().copied().unwrap_or(f64::NAN)
    })
}

fn first_then(values: &[f64], each: impl FnMut(&[f64]) -> f64) -> Vec<f64> {
    let first = values.iter().take(1).map(|_| f64::NAN);
    first.chain(values.windows(2).map(each)).collect()
}

/// Largest magnitude, leaving out what is not a number; 0 where nothing is left.
pub(crate) fn peak(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |peak, value| value.abs().max(peak))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parabola(n: usize, period_s: f64) -> (Vec<f64>, Vec<f64>) {
        let t_s: Vec<f64> = (0..n).map(|i| i as f64 * period_s).collect();
        let position = t_s.iter().map(|t| 100.0 + 0.5 * 800.0 * t * t).collect();
        (t_s, position)
    }

    #[test]
    fn a_parabola_has_constant_acceleration() {
        let (t_s, position) = parabola(500, 0.001);
        let steps = steps_s(&t_s, 0.001);
        let acceleration = rate(&rate(&position, &steps), &steps);
        assert!(acceleration[0].is_nan() && acceleration[1].is_nan());
        assert!(acceleration[2..].iter().all(|a| (a - 800.0).abs() < 1e-4));
        assert!((peak(&acceleration) - 800.0).abs() < 1e-4);
    }

    #[test]
    fn a_gap_counts_the_periods_it_spans() {
        let steps = steps_s(&[0.0, 0.001, 0.004], 0.001);
        assert!(steps[0].is_nan());
        assert_eq!(steps[1..], [0.001, 0.003]);
        assert!((rate(&[0.0, 1.0, 4.0], &steps)[2] - 1000.0).abs() < 1e-9);
    }

    #[test]
    fn nothing_gives_nothing() {
        assert!(steps_s(&[], 0.001).is_empty());
        assert_eq!(peak(&[f64::NAN]), 0.0);
    }
}
