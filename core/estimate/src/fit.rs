//! Least squares.

use nalgebra::{DMatrix, DVector};

/// How well something fits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goodness {
    /// Share of the variance that is explained; 1 where there is no variance and no residual.
    pub r2: f64,
    /// Root of the mean square of the residuals.
    pub rms: f64,
    /// Largest |residual|.
    pub max: f64,
}

impl Goodness {
    /// Of what is fitted against what is measured.
    pub fn of(pairs: &[(f64, f64)]) -> Self {
        let count = pairs.len().max(1) as f64;
        let mean = pairs.iter().map(|(_, measured)| measured).sum::<f64>() / count;
        let left: f64 = pairs
            .iter()
            .map(|(fitted, measured)| (fitted - measured).powi(2))
            .sum();
        let all: f64 = pairs
            .iter()
            .map(|(_, measured)| (measured - mean).powi(2))
            .sum();
        let max = pairs
            .iter()
            .map(|(fitted, measured)| (fitted - measured).abs())
            .fold(0.0, f64::max);
        let r2 = if all > 0.0 {
            1.0 - left / all
        } else {
            f64::from(left == 0.0)
        };
        Self {
            r2,
            rms: (left / count).sqrt(),
            max,
        }
    }
}

/// Coefficients of the linear least-squares fit of `values` by `rows` of `N` terms. Columns are scaled first: the terms
/// of a polynomial in mm/min differ by ten orders of magnitude.
///
/// # Errors
/// Fewer rows than terms, or terms that depend on each other.
pub fn least_squares<const N: usize>(
    rows: &[[f64; N]],
    values: &[f64],
) -> Result<[f64; N], String> {
    if rows.len() < N {
        return Err(format!(
            "{} measurements cannot tell {N} coefficients apart",
            rows.len()
        ));
    }
    let mut matrix = DMatrix::from_fn(rows.len(), N, |row, column| rows[row][column]);
    let scales: Vec<f64> = matrix
        .column_iter()
        .map(|column| column.norm().max(f64::MIN_POSITIVE))
        .collect();
    for (mut column, scale) in matrix.column_iter_mut().zip(&scales) {
        column /= *scale;
    }
    let svd = matrix.svd(true, true);
    if svd.singular_values.min() < 1e-12 * svd.singular_values.max() {
        return Err(
            "the measurements do not tell all coefficients apart: vary sides and turns".to_string(),
        );
    }
    let solved = svd
        .solve(&DVector::from_column_slice(values), 0.0)
        .map_err(str::to_string)?;
    Ok(std::array::from_fn(|index| solved[index] / scales[index]))
}

/// Parameters that minimise the sum of the squares of `residuals`, by damped Gauss-Newton steps in the logarithms of the
/// parameters (which are positive), from `start`. A bounded number of steps.
pub fn positive_parameters<const N: usize>(
    start: [f64; N],
    residuals: impl Fn(&[f64; N]) -> Vec<f64>,
) -> [f64; N] {
    const STEPS: usize = 60;
    /// Share by which a step has to lower the sum of the squares.
    const WORTH: f64 = 1e-6;
    const PROBE: f64 = 1e-5;
    let exp = |logs: &[f64; N]| logs.map(f64::exp);
    let square = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
    let mut logs = start.map(f64::ln);
    let mut here = residuals(&exp(&logs));
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let mut jacobian = DMatrix::zeros(here.len(), N);
        for index in 0..N {
            let mut moved = logs;
            moved[index] += PROBE;
            let there = residuals(&exp(&moved));
            jacobian.set_column(
                index,
                &DVector::from_fn(here.len(), |row, _| (there[row] - here[row]) / PROBE),
            );
        }
        let gradient = jacobian.transpose() * DVector::from_column_slice(&here);
        let normal = jacobian.transpose() * &jacobian;
        let damped =
            &normal + DMatrix::from_diagonal(&normal.diagonal().map(|d| damping * d + 1e-12));
        let Some(step) = damped.lu().solve(&gradient) else {
            break;
        };
        let next: [f64; N] =
            std::array::from_fn(|index| logs[index] - step[index].clamp(-1.0, 1.0));
        let there = residuals(&exp(&next));
        let (before, after) = (square(&here), square(&there));
        if after < before {
            logs = next;
            here = there;
            damping /= 3.0;
            if after > before * (1.0 - WORTH) || after < 1e-18 {
                break;
            }
        } else if damping > 1e6 {
            break;
        } else {
            damping *= 4.0;
        }
    }
    exp(&logs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_and_a_plane_of_one_line_is_refused() {
        let rows = [[1.0, 0.0], [1.0, 1.0], [1.0, 2.0]];
        let [a, b] = least_squares(&rows, &[3.0, 5.0, 7.0]).unwrap();
        assert!((a - 3.0).abs() < 1e-12 && (b - 2.0).abs() < 1e-12);
        assert!(least_squares(&[[1.0, 2.0], [2.0, 4.0]], &[1.0, 2.0]).is_err());
        assert!(least_squares(&[[1.0, 2.0]], &[1.0]).is_err());
    }

    #[test]
    fn positive_parameters_are_found_from_far_away() {
        let [a, b] = positive_parameters([1.0, 1.0], |[a, b]| {
            (1..20)
                .map(f64::from)
                .map(|x| (a * (-x / b).exp() - 50.0 * (-x / 7.0).exp()) / 50.0)
                .collect()
        });
        assert!((a - 50.0).abs() < 1e-6 && (b - 7.0).abs() < 1e-6, "{a} {b}");
    }

    #[test]
    fn goodness_of_a_constant_is_one_only_without_residuals() {
        assert_eq!(Goodness::of(&[(2.0, 2.0), (2.0, 2.0)]).r2, 1.0);
        assert_eq!(Goodness::of(&[(2.0, 3.0), (4.0, 3.0)]).r2, 0.0);
    }
}
