//! The uniform cubic B-spline.

use crate::lanes::{Lanes, each};

/// A uniform cubic B-spline over pseudo-time from 0 to intervals × step.
#[derive(Clone, Debug)]
pub struct Spline<const L: usize> {
    /// Control points; on interval k those of k to k + 3 count.
    pub points: Vec<Lanes<L>>,
    /// Length of an interval, s.
    pub step_s: f64,
}

impl<const L: usize> Default for Spline<L> {
    fn default() -> Self {
        Self {
            points: Vec::new(),
            step_s: 1.0,
        }
    }
}

/// Weights of the four control points at `z` of an interval.
#[inline(always)]
pub fn weights(z: f64) -> [f64; 4] {
    let y = 1.0 - z;
    let zz = z * z;
    [
        y * y * y / 6.0,
        (3.0 * zz * z - 6.0 * zz + 4.0) / 6.0,
        (-3.0 * zz * z + 3.0 * zz + 3.0 * z + 1.0) / 6.0,
        zz * z / 6.0,
    ]
}

impl<const L: usize> Spline<L> {
    /// Number of intervals.
    pub fn intervals(&self) -> usize {
        self.points.len().saturating_sub(3)
    }

    /// Puts position, velocity and acceleration at the start into the first three control points.
    pub fn begin(&mut self, [p, v, a]: &[Lanes<L>; 3]) {
        let h = self.step_s;
        let middle: Lanes<L> = each(|l| p[l] - a[l] * h * h / 6.0);
        self.points[1] = middle;
        self.points[0] = each(|l| middle[l] + a[l] * h * h / 2.0 - v[l] * h);
        self.points[2] = each(|l| middle[l] + a[l] * h * h / 2.0 + v[l] * h);
    }

    /// Rests at `p` in the end.
    pub fn end(&mut self, p: &Lanes<L>) {
        let count = self.points.len();
        self.points[count - 3..].fill(*p);
    }

    /// Value and first to third derivative by pseudo-time at `z` of interval `k`. Does not allocate.
    #[inline(always)]
    pub fn at(&self, k: usize, z: f64) -> [Lanes<L>; 4] {
        let &[c0, c1, c2, c3] = self.points[k..].first_chunk().expect("the interval exists");
        let rate = 1.0 / self.step_s;
        let y = 1.0 - z;
        let w = weights(z);
        let f1 = 0.5 + z - z * z;
        let s1 = 3.0 * z - 2.0;
        let s2 = 1.0 - 3.0 * z;
        [
            each(|l| w[0] * c0[l] + w[1] * c1[l] + w[2] * c2[l] + w[3] * c3[l]),
            each(|l| {
                rate * (z * z / 2.0 * (c3[l] - c2[l])
                    + f1 * (c2[l] - c1[l])
                    + y * y / 2.0 * (c1[l] - c0[l]))
            }),
            each(|l| rate * rate * (y * c0[l] + s1 * c1[l] + s2 * c2[l] + z * c3[l])),
            each(|l| rate * rate * rate * (c3[l] - c0[l] + 3.0 * (c1[l] - c2[l]))),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_match_differences_and_the_start_is_met() {
        let points = (0..9)
            .map(|k| [f64::from(k * k % 7), 1.0 - f64::from(k)])
            .collect();
        let mut spline = Spline::<2> {
            points,
            step_s: 0.25,
        };
        spline.begin(&[[1.0, 2.0], [3.0, -4.0], [5.0, 6.0]]);
        let start = spline.at(0, 0.0);
        for (value, wanted) in start.iter().zip([[1.0, 2.0], [3.0, -4.0], [5.0, 6.0]]) {
            assert!((value[0] - wanted[0]).abs() < 1e-12 && (value[1] - wanted[1]).abs() < 1e-12);
        }
        let z = 0.4;
        let e = 1e-4;
        for order in 0..3 {
            let [low, here, high] = [z - e, z, z + e].map(|z| spline.at(3, z));
            for lane in 0..2 {
                let slope = (high[order][lane] - low[order][lane]) / (2.0 * e * spline.step_s);
                assert!(
                    (slope - here[order + 1][lane]).abs() < 1e-4,
                    "order {order}"
                );
            }
        }
    }
}
