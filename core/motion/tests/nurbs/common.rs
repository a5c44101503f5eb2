//! Curves to test with.

use serde_json::Value;
use tandem_motion::nurbs::Nurbs;
use tandem_sdk::{Axes, AxisVector, NurbsData};

pub fn axes() -> Axes {
    Axes::new(&[('X', false), ('Y', false), ('Z', false)]).unwrap()
}

pub fn case(name: &str) -> Value {
    let path = format!(
        "{}/../../tests/fixtures/cases/{name}.json",
        env!("CARGO_MANIFEST_DIR")
    );
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

pub fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect()
}

/// The curve of a case.
pub fn data(curve: &Value) -> NurbsData {
    let points = curve["control_points"].as_array().unwrap();
    NurbsData {
        degree: curve["degree"].as_u64().unwrap() as usize,
        control_points: points
            .iter()
            .map(|p| AxisVector::from_slice(&numbers(p)))
            .collect(),
        weights: numbers(&curve["weights"]),
        knots: numbers(&curve["knots"]),
    }
}

/// The canonical curve `name`.
pub fn canonical(name: &str) -> Nurbs {
    let case = case("002_nurbs_eval");
    let curve = case["curves"]
        .as_array()
        .unwrap()
        .iter()
        .find(|c| c["name"] == name)
        .unwrap();
    Nurbs::new(&data(curve), &axes()).unwrap()
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
