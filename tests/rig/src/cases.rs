//! The reference cases of `tests/fixtures/cases`.

use serde_json::Value;
use tandem_sdk::{AxisVector, NurbsData};

/// The case called `name`.
///
/// # Panics
/// There is no such case, or it is no JSON.
pub fn case(name: &str) -> Value {
    let path = format!(
        "{}/../fixtures/cases/{name}.json",
        env!("CARGO_MANIFEST_DIR")
    );
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// A list of numbers.
///
/// # Panics
/// It is something else.
pub fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|number| number.as_f64().unwrap())
        .collect()
}

/// A list of points.
///
/// # Panics
/// It is something else.
pub fn points(value: &Value) -> Vec<AxisVector> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|point| AxisVector::from_slice(&numbers(point)))
        .collect()
}

/// Compares number by number.
///
/// # Panics
/// One differs by more than `tolerance`, or there are more of one than of the other.
pub fn assert_close(actual: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(actual.len(), expected.len());
    for (index, (a, e)) in actual.iter().zip(expected).enumerate() {
        assert!(
            (a - e).abs() <= tolerance,
            "entry {index}: {a} instead of {e}"
        );
    }
}

/// The curve of an entry of the case `002_nurbs_eval`.
///
/// # Panics
/// It is something else.
pub fn curve(entry: &Value) -> NurbsData {
    NurbsData {
        degree: entry["degree"].as_u64().unwrap() as usize,
        control_points: points(&entry["control_points"]),
        weights: numbers(&entry["weights"]),
        knots: numbers(&entry["knots"]),
    }
}

/// The entry `name` of the case `002_nurbs_eval`.
///
/// # Panics
/// There is none.
pub fn canonical_curve(name: &str) -> Value {
    let case = case("002_nurbs_eval");
    let curves = case["curves"].as_array().unwrap();
    curves.iter().find(|c| c["name"] == name).unwrap().clone()
}
