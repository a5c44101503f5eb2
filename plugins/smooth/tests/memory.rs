//! What the planner holds is bounded by what a window may hold, however small the features of a program are and however many
//! windows it takes.

#[path = "../../../tests/counting_allocator.rs"]
mod counting_allocator;

mod common;

use common::{Point, context, lines};
use counting_allocator::peak_bytes_of;
use tandem_rig::{Away, Random, stream};
use tandem_sdk::{Block, BlockKind};
use tandem_smooth::{BUFFER_CHORDS, Options, SmoothPlanner};

/// Bytes held at most where few blocks are.
const MAX_BYTES: usize = 16_000_000;
/// And where as many are held as may be: a block takes about 600 bytes with its chord and its waypoint.
const MAX_BYTES_FULL: usize = 900 * BUFFER_CHORDS;

fn peak_of(blocks: &[Block], options: &Options, tolerance_mm: f64) -> usize {
    let context = context(&[0.0; 3], tolerance_mm);
    peak_bytes_of(|| {
        let mut planner = SmoothPlanner::new(options, &context).unwrap();
        stream(&mut planner, blocks, 0.008, &mut Away::default());
    })
}

/// `points` again and again, as lines.
fn repeated(points: &[Point], times: usize, feed_mm_per_s: f64) -> Vec<Block> {
    let all: Vec<Point> = std::iter::repeat_n(points, times)
        .flatten()
        .copied()
        .collect();
    lines(&all, feed_mm_per_s)
}

#[test]
fn memory_does_not_grow_with_the_number_of_windows() {
    let there_and_back: [Point; 4] = [[0.0; 3], [0.04, 0.0, 0.0], [0.0; 3], [0.04, 0.04, 0.0]];
    let bytes = peak_of(
        &repeated(&there_and_back, 60, 150.0),
        &Options::default(),
        0.05,
    );
    assert!(bytes < MAX_BYTES, "{bytes} bytes for there and back");
    let mut marks: Vec<Point> = Vec::new();
    for n in 0..300 {
        let x = 0.1 * f64::from(n);
        marks.extend([[x, 0.0, 0.0], [x, 0.0, 0.03]]);
    }
    let mut blocks = lines(&marks, 150.0);
    for block in blocks.iter_mut().skip(1).step_by(2) {
        (block.kind, block.feed_mm_per_s) = (BlockKind::Rapid, f64::INFINITY);
    }
    let bytes = peak_of(&blocks, &Options::default(), 0.01);
    assert!(
        bytes < MAX_BYTES,
        "{bytes} bytes for marks with rapids between"
    );
}

#[test]
fn memory_is_bounded_for_features_of_any_size() {
    for seed in 0..24 {
        let mut random = Random::new(seed);
        let (feature, tolerance_mm) = (random.length(1e-4, 0.1), random.length(1e-3, 1.0));
        let mut at = [0.0; 3];
        let mut points = vec![at];
        for _ in 0..3000 {
            at = at.map(|v| v + random.between(-feature, feature));
            points.push(at);
        }
        let options = Options {
            window_ms: random.between(100.0, 2000.0),
            ..Options::default()
        };
        let bytes = peak_of(
            &lines(&points, random.length(0.1, 200.0)),
            &options,
            tolerance_mm,
        );
        println!(
            "seed {seed}: features of {feature} mm, tolerance {tolerance_mm} mm: {bytes} bytes"
        );
        assert!(bytes < MAX_BYTES, "seed {seed}: {bytes} bytes");
    }
}

/// Blocks that take no time do not make the planner take all of the program.
#[test]
fn no_more_blocks_are_held_than_there_is_room_for() {
    let program = |dwells: bool| {
        let points: Vec<Point> = (0..3 * BUFFER_CHORDS)
            .map(|n| [f64::from(n as u32 % 2) * 1e-13, 0.0, 0.0])
            .collect();
        let mut blocks = lines(&points, 100.0);
        for block in blocks.iter_mut().filter(|_| dwells) {
            (block.kind, block.dwell_s) = (BlockKind::Dwell, 0.0);
        }
        blocks
    };
    for dwells in [false, true] {
        let bytes = peak_of(&program(dwells), &Options::default(), 0.01);
        assert!(bytes < MAX_BYTES_FULL, "{bytes} bytes, dwells: {dwells}");
    }
}
