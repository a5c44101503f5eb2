//! Vectors in axis space.

use crate::axis::Position;

pub fn minus(a: &Position, b: &Position) -> Position {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

/// `a + scale · b`.
pub fn plus_scaled(a: &Position, scale: f64, b: &Position) -> Position {
    std::array::from_fn(|axis| a[axis] + scale * b[axis])
}

pub fn dot(a: &Position, b: &Position) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub fn distance(a: &Position, b: &Position) -> f64 {
    let between = minus(a, b);
    dot(&between, &between).sqrt()
}

/// Distance of a point from the straight piece between two others.
pub fn distance_to_chord(point: &Position, from: &Position, to: &Position) -> f64 {
    let along = minus(to, from);
    let length_squared = dot(&along, &along);
    if length_squared == 0.0 {
        return distance(point, from);
    }
    let fraction = (dot(&minus(point, from), &along) / length_squared).clamp(0.0, 1.0);
    distance(point, &plus_scaled(from, fraction, &along))
}
