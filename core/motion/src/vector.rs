//! Between the contracts' axis vectors and nalgebra.

use nalgebra::SVector;
use tandem_sdk::{AxisVector, MAX_AXES};

/// An axis vector as a nalgebra vector.
pub fn to_nalgebra(vector: &AxisVector) -> SVector<f64, MAX_AXES> {
    SVector::from(vector.0)
}

/// A nalgebra vector as an axis vector.
pub fn from_nalgebra(vector: &SVector<f64, MAX_AXES>) -> AxisVector {
    AxisVector((*vector).into())
}
