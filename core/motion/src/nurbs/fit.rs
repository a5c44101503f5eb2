//! The parameter as a polynomial of the arc length, over a part of a span.

use super::Nurbs;

/// u(s) on `start_mm ≤ s ≤ start_mm + length_mm` as a polynomial of degree 7 in x = (s − start)/length.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    pub start_mm: f64,
    pub length_mm: f64,
    pub from: f64,
    pub to: f64,
    pub span: usize,
    coefficients: [f64; 8],
}

/// Where a fit is compared with the curve, in x. The error of a Hermite fit goes as x⁴(1 − x)⁴, its rate is largest near
/// 0.3 and 0.7.
const CHECKED: [f64; 5] = [0.15, 0.31, 0.5, 0.69, 0.85];
/// Largest relative error of the path speed that a fit may make.
const RATE: f64 = 2e-8;
/// Largest error of the path coordinate that a fit may make, mm.
const OFF_MM: f64 = 2e-9;
/// Parts this short are taken as straight in u, mm: at a cusp no polynomial fits.
const SHORTEST_MM: f64 = 1e-9;

impl Fit {
    /// The fit over the part of `span` from `from` to `to`, of length `length_mm`, where it keeps its tolerance.
    pub fn new(
        curve: &Nurbs,
        span: usize,
        (from, to): (f64, f64),
        start_mm: f64,
        length_mm: f64,
    ) -> Option<Self> {
        let mut fit = Self {
            start_mm,
            length_mm,
            from,
            to,
            span,
            coefficients: [0.0; 8],
        };
        fit.coefficients[1] = to - from;
        if length_mm <= SHORTEST_MM {
            return Some(fit);
        }
        fit.coefficients = hermite(curve, span, (from, to), length_mm)?;
        fit.holds(curve).then_some(fit)
    }

    /// The parameter at `s_mm`.
    #[inline]
    pub fn parameter(&self, s_mm: f64) -> f64 {
        if self.length_mm <= 0.0 {
            return self.to;
        }
        let x = ((s_mm - self.start_mm) / self.length_mm).clamp(0.0, 1.0);
        if x >= 1.0 {
            return self.to;
        }
        let c = &self.coefficients;
        let sum =
            x * (c[1] + x * (c[2] + x * (c[3] + x * (c[4] + x * (c[5] + x * (c[6] + x * c[7]))))));
        (self.from + sum).clamp(self.from, self.to)
    }

    /// Whether the speed along the curve is that of s: |dC/du|·du/ds = 1 within the tolerances.
    fn holds(&self, curve: &Nurbs) -> bool {
        let most = RATE.min(4.0 * OFF_MM / self.length_mm);
        CHECKED.iter().all(|x| {
            let u = self.parameter(self.start_mm + x * self.length_mm);
            let speed = curve.speed_in(self.span, u);
            (speed * self.rate(*x) / self.length_mm - 1.0).abs() <= most
        })
    }

    fn rate(&self, x: f64) -> f64 {
        let c = &self.coefficients;
        (1..8).rev().fold(0.0, |sum, n| sum * x + n as f64 * c[n])
    }
}

/// Coefficients of the polynomial that meets u and its three derivatives by s at both ends, without its constant term.
fn hermite(curve: &Nurbs, span: usize, (from, to): (f64, f64), length: f64) -> Option<[f64; 8]> {
    let [a, b] = [
        curve.along_path_in(span, from)?.parameter,
        curve.along_path_in(span, to)?.parameter,
    ];
    let width = to - from;
    let l2 = length * length;
    let l3 = length * length * length;
    let c = [a[0] * length, a[1] * l2 / 2.0, a[2] * l3 / 6.0];
    let r0 = width - (c[0] + c[1] + c[2]);
    let r1 = b[0] * length - (c[0] + 2.0 * c[1] + 3.0 * c[2]);
    let r2 = b[1] * l2 - (2.0 * c[1] + 6.0 * c[2]);
    let r3 = b[2] * l3 - 6.0 * c[2];
    let c4 = 35.0 * r0 - 15.0 * r1 + 2.5 * r2 - r3 / 6.0;
    let c5 = -84.0 * r0 + 39.0 * r1 - 7.0 * r2 + r3 / 2.0;
    let c6 = 70.0 * r0 - 34.0 * r1 + 6.5 * r2 - r3 / 2.0;
    let c7 = -20.0 * r0 + 10.0 * r1 - 2.0 * r2 + r3 / 6.0;
    let all = [0.0, c[0], c[1], c[2], c4, c5, c6, c7];
    all.iter().all(|v| v.is_finite()).then_some(all)
}
