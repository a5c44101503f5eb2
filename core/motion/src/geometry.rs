//! Angles between directions, in forms that do not cancel.

use tandem_sdk::AxisVector;

/// Turn angle between two directions of equal length, rad: 0 is straight on, π a reversal.
///
/// `2·atan2(|v − u|, |v + u|)` keeps its digits at both ends, where `acos` of the product loses them.
pub fn half_angle_turn_rad(before: &AxisVector, after: &AxisVector) -> f64 {
    2.0 * length(&(*after - *before)).atan2(length(&(*after + *before)))
}

/// `1 − cos θ` of the turn θ between two directions of unit length, without forming the difference.
///
/// `1 − cos θ = 2 sin²(θ/2)` and `|v − u| = 2 sin(θ/2)`.
pub fn one_minus_cos(before: &AxisVector, after: &AxisVector) -> f64 {
    let difference = *after - *before;
    difference.0.iter().map(|d| d * d).sum::<f64>() / 2.0
}

fn length(vector: &AxisVector) -> f64 {
    vector.0.iter().map(|v| v * v).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_and_large_turns_keep_their_digits() {
        let u = AxisVector::from_slice(&[1.0, 0.0]);
        for theta in [0.0f64, 1e-9, 1e-3, 1.0, 3.0, std::f64::consts::PI] {
            let v = AxisVector::from_slice(&[theta.cos(), theta.sin()]);
            assert!((half_angle_turn_rad(&u, &v) - theta).abs() <= 1e-15 + 1e-12 * theta);
            let expect = 2.0 * (theta / 2.0).sin().powi(2);
            assert!((one_minus_cos(&u, &v) - expect).abs() <= 1e-12 * expect);
        }
    }
}
