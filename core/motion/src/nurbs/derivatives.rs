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
