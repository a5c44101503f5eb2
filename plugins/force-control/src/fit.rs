//! A friction model from constant-speed runs.

use crate::friction::FrictionModel;

/// The mean torque at a constant speed without any cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Speed, rad/s, signed.
    pub speed_rad_per_s: f64,
    /// Torque that opposes positive motion, N·m.
    pub torque_nm: f64,
}

/// A fitted model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// The model.
    pub model: FrictionModel,
    /// Standard deviations of Coulomb, viscous, constant and Stribeck torque, in that order; zero where not fitted.
    pub deviations: [f64; 4],
    /// Residual, N·m rms.
    pub rms_nm: f64,
}

/// Speeds, rad/s, at which the Stribeck excess may have fallen to 1/e; the best one is searched for in between.
const STRIBECK_SPEEDS: (f64, f64) = (0.05, 5.0);
/// Steps of the search, and rounds, each between the neighbours of the best of the last.
const STEPS: u32 = 60;
const ROUNDS: u32 = 5;

/// Fits Coulomb and viscous friction by least squares, and with `constant` a torque that does not depend on the speed.
/// `None` where there are too few points of different speed.
pub fn coulomb_viscous(points: &[Point], constant: bool) -> Option<Fit> {
    solve(points, None, constant)
}

/// The same with a Stribeck term; without one where an excess at low speed does not show.
pub fn stribeck(points: &[Point], constant: bool) -> Option<Fit> {
    let (mut low, mut high) = STRIBECK_SPEEDS;
    let mut best = Some(coulomb_viscous(points, constant)?);
    for _ in 0..ROUNDS {
        let step = (high / low).powf(1.0 / f64::from(STEPS));
        let fits = (0..=STEPS)
            .filter_map(|i| solve(points, Some(low * step.powf(f64::from(i))), constant));
        // An excess is positive; a negative one would only follow noise.
        let fits = fits.filter(|fit| fit.model.stribeck_nm >= 0.0).chain(best);
        best = fits.min_by(|a, b| a.rms_nm.total_cmp(&b.rms_nm));
        let speed = best?.model.stribeck_speed_rad_per_s;
        if speed == 0.0 {
            break;
        }
        low = (speed / step).max(STRIBECK_SPEEDS.0);
        high = (speed * step).min(STRIBECK_SPEEDS.1);
    }
    best
}

/// Linear least squares for a given Stribeck speed.
fn solve(points: &[Point], stribeck_speed: Option<f64>, constant: bool) -> Option<Fit> {
    let row = |point: &Point| {
        let (speed, sign) = (point.speed_rad_per_s, point.speed_rad_per_s.signum());
        let excess = stribeck_speed.map_or(0.0, |s| sign * (-(speed / s).powi(2)).exp());
        [sign, speed, f64::from(u8::from(constant)), excess]
    };
    let used = [true, true, constant, stribeck_speed.is_some()];
    let unknowns = used.iter().filter(|used| **used).count();
    if points.len() <= unknowns {
        return None;
    }
    let (mut normal, mut right) = ([[0.0; 4]; 4], [0.0; 4]);
    for point in points {
        let row = row(point);
        for i in 0..4 {
            right[i] += row[i] * point.torque_nm;
            (0..4).for_each(|j| normal[i][j] += row[i] * row[j]);
        }
    }
    // What is not fitted stays zero.
    (0..4)
        .filter(|i| !used[*i])
        .for_each(|i| normal[i][i] = 1.0);
    let inverse = inverse(normal)?;
    let found: [f64; 4] = std::array::from_fn(|i| (0..4).map(|j| inverse[i][j] * right[j]).sum());
    let miss = |point: &Point| {
        row(point)
            .iter()
            .zip(&found)
            .map(|(r, f)| r * f)
            .sum::<f64>()
            - point.torque_nm
    };
    let squares: f64 = points.iter().map(|point| miss(point).powi(2)).sum();
    let variance = squares / (points.len() - unknowns) as f64;
    let deviation = |i: usize| {
        if used[i] {
            (variance * inverse[i][i]).sqrt()
        } else {
            0.0
        }
    };
    Some(Fit {
        model: FrictionModel {
            coulomb_nm: found[0],
            viscous_nm_s_per_rad: found[1],
            constant_nm: found[2],
            stribeck_nm: found[3],
            stribeck_speed_rad_per_s: stribeck_speed.unwrap_or(0.0),
        },
        deviations: std::array::from_fn(deviation),
        rms_nm: (squares / points.len() as f64).sqrt(),
    })
}

/// Inverse of a symmetric positive matrix by Gauss and Jordan; `None` where it is singular.
fn inverse(mut a: [[f64; 4]; 4]) -> Option<[[f64; 4]; 4]> {
    let scale: [f64; 4] = std::array::from_fn(|i| a[i][i].sqrt());
    if scale.contains(&0.0) {
        return None;
    }
    (0..16).for_each(|ij| a[ij / 4][ij % 4] /= scale[ij / 4] * scale[ij % 4]);
    let mut b: [[f64; 4]; 4] =
        std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    for pivot in 0..4 {
        let by = a[pivot][pivot];
        if by < 1e-9 {
            return None;
        }
        (0..4).for_each(|j| (a[pivot][j], b[pivot][j]) = (a[pivot][j] / by, b[pivot][j] / by));
        for i in (0..4).filter(|i| *i != pivot) {
            let factor = a[i][pivot];
            for j in 0..4 {
                a[i][j] -= factor * a[pivot][j];
                b[i][j] -= factor * b[pivot][j];
            }
        }
    }
    (0..16).for_each(|ij| b[ij / 4][ij % 4] /= scale[ij / 4] * scale[ij % 4]);
    Some(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPEEDS: [f64; 8] = [0.26, 0.52, 1.05, 2.1, 4.2, 8.4, 16.8, 31.4];

    fn points(of: impl Fn(f64) -> f64) -> Vec<Point> {
        let both = SPEEDS.iter().flat_map(|speed| [*speed, -*speed]);
        both.map(|speed| Point {
            speed_rad_per_s: speed,
            torque_nm: of(speed),
        })
        .collect()
    }

    #[test]
    fn an_exact_model_is_found() {
        let of = |w: f64| 0.05 + (0.06 + 0.02 * (-(w / 0.4).powi(2)).exp()) * w.signum() + 6e-4 * w;
        let fit = stribeck(&points(of), true).unwrap();
        let model = fit.model;
        assert!(
            (model.coulomb_nm - 0.06).abs() < 1e-5
                && (model.viscous_nm_s_per_rad - 6e-4).abs() < 1e-6
        );
        assert!(
            (model.stribeck_nm - 0.02).abs() < 1e-4
                && (model.stribeck_speed_rad_per_s - 0.4).abs() < 5e-3
        );
        assert!((model.constant_nm - 0.05).abs() < 1e-5 && fit.rms_nm < 1e-5);
        let plain = coulomb_viscous(&points(|w| 0.01 * w.signum() + 5e-5 * w), false).unwrap();
        assert!((plain.model.coulomb_nm - 0.01).abs() < 1e-12 && plain.rms_nm < 1e-12);
        assert!(plain.deviations[0] < 1e-12 && plain.deviations[2] == 0.0);
    }

    #[test]
    fn too_few_points_are_no_fit() {
        assert!(coulomb_viscous(&points(|w| w)[..2], false).is_none());
        let same = vec![
            Point {
                speed_rad_per_s: 2.0,
                torque_nm: 0.1
            };
            9
        ];
        assert!(
            coulomb_viscous(&same, false).is_none(),
            "one speed says nothing of two unknowns"
        );
    }
}
