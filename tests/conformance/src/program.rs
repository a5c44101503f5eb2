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
            block.dwell_s = if random.once_in(2) {
                0.0
            } else {
                random.magnitude(0.0001, 0.1)
            };
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
        way = AxisVector(std::array::from_fn(|axis| {
            if axis == kept { way[axis] } else { 0.0 }
        }));
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
    let center_mm = [
        block.start[0] - radius_mm * cos,
        block.start[1] - radius_mm * sin,
    ];
    if center_mm
        .iter()
        .any(|center| center.abs() + radius_mm > REACH_MM)
    {
        return line(random, block, BlockKind::Line);
    }
    let (sin, cos) = (start_angle_rad + sweep_rad).sin_cos();
    (block.end[0], block.end[1]) = (
        center_mm[0] + radius_mm * cos,
        center_mm[1] + radius_mm * sin,
    );
    let rise_mm = if random.once_in(4) {
        random.between(-3.0, 3.0)
    } else {
        0.0
    };
    if (block.start[2] + rise_mm).abs() < REACH_MM {
        block.end[2] += rise_mm;
    }
    block.kind = BlockKind::Arc;
    block.length_mm = (radius_mm * sweep_rad).hypot(block.end[2] - block.start[2]);
    block.arc = ArcGeometry {
        plane: [0, 1],
        center_mm,
        radius_mm,
        start_angle_rad,
        sweep_rad,
    };
}

/// Euclidean length, mm.
pub fn norm(vector: &AxisVector) -> f64 {
    vector.0.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Distance of a place from the path of a block, mm.
pub fn distance_mm(block: &Block, place: &AxisVector) -> f64 {
    if block.kind == BlockKind::Arc {
        from_arc(block, place)
    } else {
        from_line(block, place)
    }
}

fn from_line(block: &Block, place: &AxisVector) -> f64 {
    let (way, offset) = (block.end - block.start, *place - block.start);
    let square: f64 = way.0.iter().map(|v| v * v).sum();
    let along: f64 = way.0.iter().zip(offset.0).map(|(a, b)| a * b).sum();
    let share = if square > 0.0 {
        (along / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    norm(&(offset - way * share))
}

/// A place that is so near to the helix at its own angle is on it, mm: no nearer one is looked for, which would take the distances of
/// a hundred and fifty. Planners are held to two thousand times as much, and rounding moves a place by a hundredth of it.
const ON_HELIX_MM: f64 = 1e-9;

fn from_arc(block: &Block, place: &AxisVector) -> f64 {
    let arc = &block.arc;
    let (x, y) = (place[0] - arc.center_mm[0], place[1] - arc.center_mm[1]);
    let angle = (y.atan2(x) - arc.start_angle_rad) * arc.sweep_rad.signum();
    // The turn from the start, taken a little before it as zero so that rounding there is no whole turn.
    let turned = (angle + 0.1).rem_euclid(std::f64::consts::TAU) - 0.1;
    let share = (turned / arc.sweep_rad.abs()).clamp(0.0, 1.0);
    let rise_mm = block.end[2] - block.start[2];
    let distance = |share: f64| {
        let (sin, cos) = (arc.start_angle_rad + share * arc.sweep_rad).sin_cos();
        let across = (x - arc.radius_mm * cos).hypot(y - arc.radius_mm * sin);
        across.hypot(place[2] - block.start[2] - share * rise_mm)
    };
    let beside_mm = distance(share);
    if rise_mm == 0.0 || beside_mm <= ON_HELIX_MM {
        beside_mm
    } else {
        beside_mm.min(least(distance))
    }
}

/// The least value of `of` between 0 and 1, where it has few minima: the nearest place on a helix is not at the same angle.
fn least(of: impl Fn(f64) -> f64) -> f64 {
    const PLACES: u32 = 64;
    let at = |place: u32| f64::from(place) / f64::from(PLACES);
    let values = (0..=PLACES).map(|place| (place, of(at(place))));
    let best = values.min_by(|(_, a), (_, b)| a.total_cmp(b));
    let best = best.map_or(0, |(place, _)| place);
    let (mut from, mut to) = (at(best.saturating_sub(1)), at((best + 1).min(PLACES)));
    for _ in 0..40 {
        let (low, high) = (from + (to - from) / 3.0, to - (to - from) / 3.0);
        (from, to) = if of(low) < of(high) {
            (from, high)
        } else {
            (low, to)
        };
    }
    of(f64::midpoint(from, to))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beside_a_steep_helix_the_nearest_place_counts() {
        let arc = ArcGeometry {
            plane: [0, 1],
            center_mm: [0.0; 2],
            radius_mm: 0.5,
            start_angle_rad: -0.05,
            sweep_rad: 0.1,
        };
        let at =
            |angle: f64, z: f64| AxisVector::from_slice(&[0.5 * angle.cos(), 0.5 * angle.sin(), z]);
        let helix = Block {
            kind: BlockKind::Arc,
            end: at(0.05, 3.0),
            arc,
            ..Block::at(at(-0.05, 0.0))
        };
        let beside = |offset: [f64; 3]| {
            distance_mm(&helix, &(at(0.0, 1.5) + AxisVector::from_slice(&offset)))
        };
        assert!(beside([0.0; 3]) < 1e-9);
        assert!(
            (beside([0.01, 0.0, 0.0]) - 0.01).abs() < 1e-6,
            "outwards: {}",
            beside([0.01, 0.0, 0.0])
        );
        assert!(
            (beside([0.0, 0.01, 0.0]) - 0.01).abs() < 1e-5,
            "across: {}",
            beside([0.0, 0.01, 0.0])
        );
        assert!(
            beside([0.0, 0.0, 0.01]) < 2e-4,
            "along: {}",
            beside([0.0, 0.0, 0.01])
        );
    }
}
