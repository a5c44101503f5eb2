//! Reading cases, and making blocks of points.

use serde_json::Value;
use tandem_estimate::{Element, Estimate, Model, Spent};
use tandem_sdk::{AxisLimits, AxisVector, Block, BlockKind, Limits};

pub use tandem_rig::{MM_PER_MIN, case, numbers, points};

pub fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is not a number"))
}

pub fn array<const N: usize>(value: &Value) -> [f64; N] {
    numbers(value).try_into().unwrap()
}

/// The program of the tie test.
pub fn zigzag() -> Vec<AxisVector> {
    let path = format!(
        "{}/../../tests/fixtures/cases/tie_zigzag_points.csv",
        env!("CARGO_MANIFEST_DIR")
    );
    let text = std::fs::read_to_string(path).unwrap();
    let point = |line: &str| {
        AxisVector::from_slice(
            &line
                .split(',')
                .map(|n| n.parse().unwrap())
                .collect::<Vec<_>>(),
        )
    };
    text.lines().skip(1).map(point).collect()
}

pub fn limits(acceleration_mm_per_s2: f64) -> Limits {
    let axis = AxisLimits {
        speed_difference_mm_per_s: 100.0 / MM_PER_MIN,
        ..tandem_rig::axis(acceleration_mm_per_s2)
    };
    Limits::new(&[axis; 3]).unwrap()
}

/// Straight blocks through `points`.
pub fn elements(points: &[AxisVector], feed_mm_per_min: f64, limits: &Limits) -> Vec<Element> {
    let line = |(index, pair): (usize, &[AxisVector])| {
        let mut block = Block::at(pair[0]);
        (block.kind, block.line, block.end) = (BlockKind::Line, index as u32 + 1, pair[1]);
        block.length_mm = (pair[1] - pair[0])
            .0
            .iter()
            .map(|d| d * d)
            .sum::<f64>()
            .sqrt();
        block.feed_mm_per_s = feed_mm_per_min / MM_PER_MIN;
        Element::new(&block, None, limits)
    };
    points.windows(2).enumerate().map(line).collect()
}

/// The times of all blocks.
pub fn spent(model: &mut dyn Model, elements: &[Element]) -> Vec<Spent> {
    let mut all = vec![];
    let mut take = |_: &Element, spent: &Spent| all.push(*spent);
    for element in elements {
        model.block(element, &mut take);
    }
    model.finish(&mut take);
    all
}

/// By how much an estimate differs from `true_s`, as a share.
pub fn error(estimate: &Estimate, true_s: f64) -> f64 {
    estimate.estimated_s / true_s - 1.0
}

pub fn assert_near(actual: f64, expected: f64, tolerance: f64, what: &str) {
    assert!(
        (actual - expected).abs() <= tolerance,
        "{what}: {actual} instead of {expected} ± {tolerance}"
    );
}
