//! Derivatives by the parameter and by arc length.

use tandem_sdk::AxisVector;

use super::Nurbs;

/// Position and derivatives by the parameter u.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Derivatives {
    /// Position, mm.
    pub position: AxisVector,
    /// First derivative, mm per unit of u.
    pub first: AxisVector,
    /// Second derivative.
    pub second: AxisVector,
    /// Third derivative.
    pub third: AxisVector,
}

/// Position and derivatives by the arc length s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AlongPath {
    /// Position, mm.
    pub position: AxisVector,
    /// dC/ds: of unit length over the axes that path speed counts.
    pub direction: AxisVector,
    /// d²C/ds², 1/mm. Its length is the curvature.
    pub curvature: AxisVector,
    /// d³C/ds³, 1/mm².
    pub third: AxisVector,
    /// du/ds and its first two derivatives by s.
    pub parameter: [f64; 3],
}

impl Nurbs {
    /// Derivatives by arc length from those by the parameter; `None` where the curve stands still in its parameter.
    ///
    /// `u_s = 1/σ`, `u_ss = −(C′·C″)/σ⁴`, `u_sss = u_s·(−(C″·C″ + C′·C‴)/σ⁴ + 4(C′·C″)²/σ⁶)` with σ = |C′|, and the chain
    /// rule. Does not allocate.
    #[inline]
    pub fn along_path(&self, at: &Derivatives) -> Option<AlongPath> {
        let squared = self.counted_product(&at.first, &at.first);
        let u_s = 1.0 / squared.sqrt();
        if !u_s.is_finite() {
            return None;
        }
        let inverse = 1.0 / squared;
        let mixed = self.counted_product(&at.first, &at.second);
        let rate = self.counted_product(&at.second, &at.second) + self.counted_product(&at.first, &at.third);
        let u_ss = -mixed * inverse * inverse;
        let u_sss = u_s * inverse * inverse * (4.0 * mixed * mixed * inverse - rate);
        Some(AlongPath {
            position: at.position,
            direction: at.first * u_s,
            curvature: at.second * (u_s * u_s) + at.first * u_ss,
            third: at.third * (u_s * u_s * u_s) + at.second * (3.0 * u_s * u_ss) + at.first * u_sss,
            parameter: [u_s, u_ss, u_sss],
        })
    }

    /// Curvature at a point with these derivatives, 1/mm: `|C′ × C″|/|C′|³` by the part of C″ across C′, in any number of
    /// axes. `None` where the curve stands still in its parameter.
    #[inline]
    pub fn curvature(&self, at: &Derivatives) -> Option<f64> {
        let squared = self.counted_product(&at.first, &at.first);
        let across = at.second - at.first * (self.counted_product(&at.first, &at.second) / squared);
        let curvature = self.counted_length(&across) / squared;
        curvature.is_finite().then_some(curvature)
    }
}
