//! From the rate of pseudo-time to time.

/// The rate b = (dτ/dt)² on a grid: coefficients of a quadratic B-spline, one more interval end each.
#[derive(Clone, Debug, Default)]
pub struct Rate {
    /// Coefficients; on interval k those of k, k+1 and k+2 count.
    pub coefficients: Vec<f64>,
}

/// Weights of the three coefficients for b, b′·h and b″·h² at `z` of the interval.
#[inline]
pub fn weights(z: f64) -> [[f64; 3]; 3] {
    let y = 1.0 - z;
    [
        [y * y / 2.0, 0.5 + z - z * z, z * z / 2.0],
        [-y, 1.0 - 2.0 * z, z],
        [1.0, -2.0, 1.0],
    ]
}

impl Rate {
    /// Number of intervals.
    pub fn intervals(&self) -> usize {
        self.coefficients.len().saturating_sub(2)
    }

    /// b, b′ and b″ by τ at `z` of interval `k`, whose length is `step_s`. Does not allocate.
    #[inline]
    pub fn at(&self, k: usize, z: f64, step_s: f64) -> [f64; 3] {
        let c = &self.coefficients[k..k + 3];
        let scale = [1.0, 1.0 / step_s, 1.0 / (step_s * step_s)];
        let w = weights(z);
        let part = |n: usize| scale[n] * (w[n][0] * c[0] + w[n][1] * c[1] + w[n][2] * c[2]);
        [part(0), part(1), part(2)]
    }

    /// Where in interval `k` b is least, 0 to 1, and b there: not above zero it has no time. Does not allocate.
    pub fn least(&self, k: usize) -> (f64, f64) {
        let [first, slope, bend] = self.at(k, 0.0, 1.0);
        let inside = if bend > 0.0 {
            (-slope / bend).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let b = |z: f64| first + z * (slope + z * bend / 2.0);
        let least = [0.0, inside, 1.0]
            .into_iter()
            .min_by(|x, y| b(*x).total_cmp(&b(*y)))
            .unwrap_or(0.0);
        (least, b(least))
    }

    /// b, b′ and b″/2 by z of interval `k` at its start.
    #[inline]
    fn parabola(&self, k: usize) -> [f64; 3] {
        let [b, slope, bend] = self.at(k, 0.0, 1.0);
        [b, slope, bend / 2.0]
    }

    /// Time that the stretch from 0 to `z` of interval `k` takes, s: ∫dz/√b of a parabola in closed form,
    /// `2z/(√b₀ + √b₁)·atanh(√q)/√q` with q = b″/2·z²/(√b₀ + √b₁)². Does not allocate.
    #[inline]
    pub fn time_s(&self, k: usize, z: f64, step_s: f64) -> f64 {
        let [b, slope, half_bend] = self.parabola(k);
        let roots = b.sqrt() + (b + z * (slope + z * half_bend)).sqrt();
        let way = z / roots;
        2.0 * step_s * way * atanh_by_root(half_bend * way * way)
    }

    /// The place in interval `k` that is reached `time_s` after its start, 0 to 1: (dz/dt)² = b of a parabola is the linear
    /// d²z/dt² = b′/2 + b″/2·z, whose solutions are sinh and cosh, or sin and cos. Does not allocate.
    #[inline]
    pub fn place(&self, k: usize, time_s: f64, step_s: f64) -> f64 {
        let [b, slope, half_bend] = self.parabola(k);
        let t = time_s / step_s;
        let [first, second] = solutions(half_bend * t * t);
        (t * (b.sqrt() * first + t * slope / 2.0 * second)).clamp(0.0, 1.0)
    }
}

/// Below this a series is exact to rounding.
const SMALL: f64 = 0.02;

/// `atanh(√x)/√x`, for negative x `atan(√−x)/√−x`.
#[inline]
fn atanh_by_root(x: f64) -> f64 {
    if x.abs() < SMALL {
        return 1.0
            + x * (1.0 / 3.0
                + x * (0.2 + x * (1.0 / 7.0 + x * (1.0 / 9.0 + x * (1.0 / 11.0 + x / 13.0)))));
    }
    let root = x.abs().sqrt();
    if x > 0.0 {
        root.atanh() / root
    } else {
        root.atan() / root
    }
}

/// `sinh(√x)/√x` and `(cosh(√x) − 1)/x`, for negative x with sin and cos.
#[inline]
fn solutions(x: f64) -> [f64; 2] {
    if x.abs() < SMALL {
        let first = 1.0 + x / 6.0 * (1.0 + x / 20.0 * (1.0 + x / 42.0 * (1.0 + x / 72.0)));
        let second = 0.5 + x / 24.0 * (1.0 + x / 30.0 * (1.0 + x / 56.0 * (1.0 + x / 90.0)));
        return [first, second];
    }
    let root = x.abs().sqrt();
    if x > 0.0 {
        [root.sinh() / root, (root.cosh() - 1.0) / x]
    } else {
        [root.sin() / root, (root.cos() - 1.0) / x]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_and_place_of_a_parabola_answer_each_other() {
        let step_s = 0.004;
        for coefficients in [
            [1.0, 1.0, 1.0],
            [0.9, 1.0, 1.2],
            [4.0, 0.2, 0.9],
            [0.02, 0.01, 3.0],
            [1.0, 2.0, 1.0],
            [0.5, 3.0, 0.5],
        ] {
            let rate = Rate {
                coefficients: coefficients.to_vec(),
            };
            let mut sum_s = 0.0;
            for n in 0..2000 {
                let z = f64::from(n) / 2000.0;
                assert!(
                    (rate.place(0, rate.time_s(0, z, step_s), step_s) - z).abs() < 1e-12,
                    "{coefficients:?} {z}"
                );
                // Simpson's rule over a part so small that it is exact to 1e-12.
                let inverse = |z: f64| 1.0 / rate.at(0, z, step_s)[0].sqrt();
                let h = 1.0 / 2000.0;
                sum_s +=
                    step_s * h / 6.0 * (inverse(z) + 4.0 * inverse(z + h / 2.0) + inverse(z + h));
            }
            assert!(
                (rate.time_s(0, 1.0, step_s) / sum_s - 1.0).abs() < 1e-9,
                "{coefficients:?}"
            );
        }
    }

    #[test]
    fn the_least_rate_of_an_interval() {
        let rate = Rate {
            coefficients: vec![4.0, 0.2, 0.9],
        };
        let (z, b) = rate.least(0);
        let near = [-1e-3, 1e-3].map(|off| rate.at(0, z + off, 1.0)[0]);
        assert!(
            z > 0.0
                && z < 1.0
                && b < near[0]
                && b < near[1]
                && (rate.at(0, z, 1.0)[0] - b).abs() < 1e-12
        );
    }
}
