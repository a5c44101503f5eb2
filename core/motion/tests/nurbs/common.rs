//! Curves to test with.

use tandem_motion::nurbs::Nurbs;
use tandem_sdk::{Axes, AxisVector, NurbsData};

pub fn axes() -> Axes {
    Axes::new(&[('X', false), ('Y', false), ('Z', false)]).unwrap()
}

/// The canonical curve `name`.
pub fn canonical(name: &str) -> Nurbs {
    curve(&tandem_rig::curve(&tandem_rig::canonical_curve(name)))
}

/// A clamped curve over uniform knots.
pub fn clamped(degree: usize, points: &[[f64; 3]], weights: &[f64]) -> NurbsData {
    let count = points.len();
    NurbsData {
        degree,
        control_points: points.iter().map(|p| AxisVector::from_slice(p)).collect(),
        weights: weights.to_vec(),
        knots: (0..=count + degree)
            .map(|i| i.clamp(degree, count) as f64 - degree as f64)
            .collect(),
    }
}

pub fn curve(data: &NurbsData) -> Nurbs {
    Nurbs::new(data, &axes()).unwrap()
}

/// A full circle of radius `radius` as nine points of degree 2.
pub fn circle(radius: f64) -> NurbsData {
    let corners = [
        [1, 0],
        [1, 1],
        [0, 1],
        [-1, 1],
        [-1, 0],
        [-1, -1],
        [0, -1],
        [1, -1],
        [1, 0],
    ];
    let half = std::f64::consts::FRAC_1_SQRT_2;
    NurbsData {
        degree: 2,
        control_points: corners
            .iter()
            .map(|[x, y]| AxisVector::from_slice(&[radius * f64::from(*x), radius * f64::from(*y)]))
            .collect(),
        weights: (0..9)
            .map(|i| if i % 2 == 0 { 1.0 } else { half })
            .collect(),
        knots: vec![
            0.0, 0.0, 0.0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1.0, 1.0, 1.0,
        ],
    }
}

pub fn distance(a: &AxisVector, b: &AxisVector) -> f64 {
    (*a - *b).0.iter().map(|d| d * d).sum::<f64>().sqrt()
}
