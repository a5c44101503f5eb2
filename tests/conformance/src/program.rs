//! Random programs.

use tandem_sdk::{ArcGeometry, AxisVector, Block, BlockKind, PathMode};

use crate::machine::REACH_MM;
use crate::random::Random;

/// `count` blocks, each from where the one before ends: lines of all lengths, arcs and helices, dwells, rapids, exact stops.
/// Blocks that `takes` refuses are left out.
pub fn random(
    random: &mut Random,
    start: AxisVector,
    count: usize,
    mut takes: impl FnMut(&Block) -> bool,
) -> Vec<Block> {
    let mut blocks: Vec<Block> = vec![];
    let mut position = start;
    let mut feed_mm_per_s = 50.0;
    for _ in 0..count * 4 {
        if blocks.len() == count {
            break;
        }
        if random.once_in(8) {
            feed_mm_per_s = random.magnitude(4.0, 300.0);
        }
        let mut block = one(random, position, feed_mm_per_s);
        (block.index, block.line) = (blocks.len() as u64, blocks.len() as u32 + 1);
        if takes(&block) {
            position = block.end;
            blocks.push(block);
        }
    }
    blocks
}

fn one(random: &mut Random, from: AxisVector, feed_mm_per_s: f64) -> Block {
    let mut block = Block::at(from);
    block.feed_mm_per_s = feed_mm_per_s;
    if random.once_in(10) {
        block.path_mode = PathMode::ExactStop;
    }
    match random.share() {
        share if share < 0.03 => {
            block.dwell_s = if random.once_in(2) { 0.0 } else { random.magnitude(0.0001, 0.1) };
        }
        share if share < 0.3 => arc(random, &mut block),
        share if share < 0.35 => {
            block.feed_mm_per_s = f64::INFINITY;
            line(random, &mut block, BlockKind::Rapid);
        }
        _ => line(random, &mut block, BlockKind::Line),
    }
    block
}

/// A line of 0.01 to 100 mm in a random direction, often along one axis; turned back where it would leave the reach.
fn line(random: &mut Random, block: &mut Block, kind: BlockKind) {
    block.kind = kind;
    let length_mm = random.magnitude(0.01, 100.0);
    let mut way = AxisVector::from_slice(&[0, 1, 2].map(|_| random.between(-1.0, 1.0)));
    if random.once_in(3) {
        let kept = [0, 1, 2][(random.share() * 3.0) as usize % 3];
        way = AxisVector(std::array::from_fn(|axis| if axis == kept { way[axis] } else { 0.0 }));
    }
    way = way * (length_mm / norm(&way));
    for axis in 0..3 {
        if (block.start[axis] + way[axis]).abs() > REACH_MM {
            way[axis] = -way[axis];
        }
    }
    block.end = block.start + way;
    block.length_mm = norm(&(block.end - block.start));
}

/// An arc of 0.5 to 20 mm radius in XY, every fourth a helix; a line where it would leave the reach.
fn arc(random: &mut Random, block: &mut Block) {
    let radius_mm = random.magnitude(0.5, 20.0);
    let start_angle_rad = random.between(-3.0, 3.0);
    let sweep_rad = random.between(0.1, 6.0) * if random.once_in(2) { 1.0 } else { -1.0 };
    let (sin, cos) = start_angle_rad.sin_cos();
    let center_mm = [block.start[0] - radius_mm * cos, block.start[1] - radius_mm * sin];
    if center_mm.iter().any(|center| center.abs() + radius_mm > REACH_MM) {
        return line(random, block, BlockKind::Line);
    }
    let (sin, cos) = (start_angle_rad + sweep_rad).sin_cos();
    (block.end[0], block.end[1]) = (center_mm[0] + radius_mm * cos, center_mm[1] + radius_mm * sin);
    let rise_mm = if random.once_in(4) { random.between(-3.0, 3.0) } else { 0.0 };
    if (block.start[2] + rise_mm).abs() < REACH_MM {
        block.end[2] += rise_mm;
    }
    block.kind = BlockKind::Arc;
    block.length_mm = (radius_mm * sweep_rad).hypot(block.end[2] - block.start[2]);
    block.arc = ArcGeometry { plane: [0, 1], center_mm, radius_mm, start_angle_rad, sweep_rad };
}

/// Euclidean length, mm.
pub fn norm(vector: &AxisVector) -> f64 {
    vector.0.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Distance of a place from the path of a block, mm.
pub fn distance_mm(block: &Block, place: &AxisVector) -> f64 {
    if block.kind == BlockKind::Arc { from_arc(block, place) } else { from_line(block, place) }
}

fn from_line(block: &Block, place: &AxisVector) -> f64 {
    let (way, offset) = (block.end - block.start, *place - block.start);
    let square: f64 = way.0.iter().map(|v| v * v).sum();
    let along: f64 = way.0.iter().zip(offset.0).map(|(a, b)| a * b).sum();
    let share = if square > 0.0 { (along / square).clamp(0.0, 1.0) } else { 0.0 };
    norm(&(offset - way * share))
}

fn from_arc(block: &Block, place: &AxisVector) -> f64 {
    let arc = &block.arc;
    let (x, y) = (place[0] - arc.center_mm[0], place[1] - arc.center_mm[1]);
    let angle = (y.atan2(x) - arc.start_angle_rad) * arc.sweep_rad.signum();
    // The turn from the start, taken a little before it as zero so that rounding there is no whole turn.
    let turned = (angle + 0.1).rem_euclid(std::f64::consts::TAU) - 0.1;
    let share = (turned / arc.sweep_rad.abs()).clamp(0.0, 1.0);
    let (sin, cos) = (arc.start_angle_rad + share * arc.sweep_rad).sin_cos();
    let (near_x, near_y) = (arc.radius_mm * cos, arc.radius_mm * sin);
    let near_z = block.start[2] + share * (block.end[2] - block.start[2]);
    (x - near_x).hypot(y - near_y).hypot(place[2] - near_z)
}
