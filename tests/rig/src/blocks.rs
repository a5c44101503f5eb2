//! Blocks without a part program.

use tandem_sdk::{ArcGeometry, AxisVector, Block, BlockKind};

/// A line; its length is that of X, Y and Z, or of A where only A moves.
pub fn line(from: &AxisVector, to: &AxisVector, feed_mm_per_s: f64) -> Block {
    let mut block = Block::at(*from);
    (block.kind, block.end) = (BlockKind::Line, *to);
    let way = *to - *from;
    let linear_mm = way.0[..3].iter().map(|d| d * d).sum::<f64>().sqrt();
    block.length_mm = if linear_mm > 0.0 {
        linear_mm
    } else {
        way[3].abs()
    };
    block.feed_mm_per_s = feed_mm_per_s;
    block
}

/// Numbered lines through `points`; `feed_mm_per_min` is asked for each by its index.
pub fn lines(points: &[AxisVector], feed_mm_per_min: impl Fn(usize) -> f64) -> Vec<Block> {
    let feed_mm_per_s = |index| feed_mm_per_min(index) / crate::MM_PER_MIN;
    let pairs = points.windows(2).enumerate();
    numbered(
        pairs
            .map(|(index, pair)| line(&pair[0], &pair[1], feed_mm_per_s(index)))
            .collect(),
    )
}

/// An arc in XY around `center_mm`, from `from` on its circle.
pub fn arc(from: &AxisVector, center_mm: [f64; 2], sweep_rad: f64, feed_mm_per_s: f64) -> Block {
    let (x, y) = (from[0] - center_mm[0], from[1] - center_mm[1]);
    let (radius_mm, start_angle_rad) = (x.hypot(y), y.atan2(x));
    let (sin, cos) = (start_angle_rad + sweep_rad).sin_cos();
    let mut block = Block::at(*from);
    block.kind = BlockKind::Arc;
    block.end[0] = center_mm[0] + radius_mm * cos;
    block.end[1] = center_mm[1] + radius_mm * sin;
    block.length_mm = radius_mm * sweep_rad.abs();
    block.feed_mm_per_s = feed_mm_per_s;
    block.arc = ArcGeometry {
        plane: [0, 1],
        center_mm,
        radius_mm,
        start_angle_rad,
        sweep_rad,
    };
    block
}

/// The blocks with their indices and lines.
pub fn numbered(mut blocks: Vec<Block>) -> Vec<Block> {
    for (index, block) in (0_u32..).zip(&mut blocks) {
        (block.index, block.line) = (index.into(), index + 1);
    }
    blocks
}

/// The G1 lines of `examples/programs/NAME.ngc`, which has nothing but X, Y, Z words, from zero at 3000 mm/min.
///
/// # Panics
/// There is no such program, or it has other words.
pub fn program(name: &str) -> Vec<Block> {
    let path = format!(
        "{}/../../examples/programs/{name}.ngc",
        env!("CARGO_MANIFEST_DIR")
    );
    let text = std::fs::read_to_string(path).unwrap();
    let mut points = vec![AxisVector::ZERO];
    points.extend(
        text.lines()
            .filter_map(|line| line.strip_prefix("G1"))
            .map(coordinates),
    );
    lines(&points, |_| 3000.0)
}

fn coordinates(line: &str) -> AxisVector {
    let values: Vec<f64> = line
        .split(['X', 'Y', 'Z'])
        .skip(1)
        .map(|value| value.trim().parse().unwrap())
        .collect();
    AxisVector::from_slice(&values)
}
