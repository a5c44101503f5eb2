//! From the rate of pseudo-time to time.

/// Abscissae and weights of Gauss-Legendre with five points on 0 to 1.
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668_0, 0.118_463_442_528_094_54),
    (0.230_765_344_947_158_45, 0.239_314_335_249_683_23),
    (0.5, 0.284_444_444_444_444_45),
    (0.769_234_655_052_841_6, 0.239_314_335_249_683_23),
    (0.953_089_922_969_332, 0.118_463_442_528_094_54),
];

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
    [[y * y / 2.0, 0.5 + z - z * z, z * z / 2.0], [-y, 1.0 - 2.0 * z, z], [1.0, -2.0, 1.0]]
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

    /// Time that the stretch from 0 to `z` of interval `k` takes, s. Does not allocate.
    #[inline]
    pub fn time_s(&self, k: usize, z: f64, step_s: f64) -> f64 {
        let inverse = |(at, weight): &(f64, f64)| weight / self.at(k, at * z, step_s)[0].sqrt();
        step_s * z * GAUSS.iter().map(inverse).sum::<f64>()
    }

    /// The place in interval `k` that is reached `time_s` after its start, 0 to 1. Does not allocate.
    pub fn place(&self, k: usize, time_s: f64, step_s: f64) -> f64 {
        let [b, slope, _] = self.at(k, 0.0, step_s);
        let x = time_s * b.sqrt() / step_s;
        // From the rate and its slope at the start: two Newton steps leave rounding.
        let mut z = (x + slope * step_s / (4.0 * b) * x * x).clamp(0.0, 1.0);
        for _ in 0..2 {
            let rate = self.at(k, z, step_s)[0].sqrt();
            z -= (self.time_s(k, z, step_s) - time_s) * rate / step_s;
        }
        z.clamp(0.0, 1.0)
    }
}
