//! The path coordinate over pseudo-time: a uniform cubic B-spline.

use crate::stream::State;

/// Value and derivatives of interval `k` at `z` of its length `step_s`.
pub fn evaluate(coefficients: &[f64], k: usize, z: f64, step_s: f64) -> [f64; 4] {
    // Relative to the first one: path coordinates are large, their differences are what counts.
    let base = coefficients[k];
    let [c1, c2, c3] = [1, 2, 3].map(|n| coefficients[k + n] - base);
    let y = 1.0 - z;
    let zz = z * z;
    let value = ((3.0 * zz * z - 6.0 * zz + 4.0) * c1
        + (-3.0 * zz * z + 3.0 * zz + 3.0 * z + 1.0) * c2
        + zz * z * c3)
        / 6.0;
    let first =
        ((3.0 * zz - 4.0 * z) * c1 + (-3.0 * zz + 2.0 * z + 1.0) * c2 + zz * c3) / 2.0 / step_s;
    let second = ((3.0 * z - 2.0) * c1 + (y - 2.0 * z) * c2 + z * c3) / (step_s * step_s);
    let third = (3.0 * c1 - 3.0 * c2 + c3) / (step_s * step_s * step_s);
    [base + value, first, second, third]
}

/// The spline of `intervals` that follows `motion` (time to path coordinate and acceleration) from `start` to rest at
/// `end_mm`. The coefficient `s − h²/6·s″` reproduces cubics, where that is behind the one before: a spline whose coefficients do
/// not fall never goes back, and at a sharp turn, where the acceleration jumps, those of the motion may.
pub fn fill(
    to: &mut Vec<f64>,
    mut motion: impl FnMut(f64) -> [f64; 2],
    (intervals, step_s): (usize, f64),
    start: &State,
    end_mm: f64,
) {
    to.clear();
    for index in 0..intervals + 3 {
        let t = (index as f64 - 1.0) * step_s;
        let [s_mm, acceleration] = motion(t);
        to.push(s_mm - step_s * step_s / 6.0 * acceleration);
    }
    let v = start.speed_mm_per_s * step_s;
    let a = start.acceleration_mm_per_s2 * step_s * step_s;
    let middle = start.s_mm - a / 6.0;
    to[..3].copy_from_slice(&[middle + a / 2.0 - v, middle, middle + a / 2.0 + v]);
    let count = to.len();
    to[count - 3..].fill(end_mm);
    let mut furthest_mm = to[2];
    for coefficient in &mut to[3..] {
        furthest_mm = furthest_mm.max(*coefficient).min(end_mm);
        *coefficient = furthest_mm;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spline_over_a_motion_with_a_sharp_stop_never_goes_back() {
        // It stops within one interval, and starts again.
        let motion = |t: f64| {
            if t < 0.5 {
                [t, -40.0]
            } else {
                [0.5 + 0.01 * (t - 0.5), 40.0]
            }
        };
        let intervals = 40;
        let step_s = 0.025;
        let end_mm = 0.505;
        let mut coefficients = vec![];
        let start = State {
            s_mm: 0.0,
            speed_mm_per_s: 1.0,
            acceleration_mm_per_s2: 0.0,
        };
        fill(
            &mut coefficients,
            motion,
            (intervals, step_s),
            &start,
            end_mm,
        );
        for look in 0..intervals * 20 {
            let z = f64::from(u32::try_from(look % 20).unwrap()) / 20.0;
            let [_, speed, ..] = evaluate(&coefficients, look / 20, z, step_s);
            assert!(speed >= -1e-12, "{speed} at {look}");
        }
        let [end, ..] = evaluate(&coefficients, intervals - 1, 1.0, step_s);
        assert!((end - end_mm).abs() < 1e-12);
    }
}
