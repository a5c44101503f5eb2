//! The moves of a program written out, one a line.

use std::fmt::Write as _;
use std::path::Path;

use tandem_gcode::{Config, Item, Program, Stream, check};
use tandem_sdk::{Block, BlockKind, PathMode};

/// The blocks of a program in both passes; none where it is refused.
pub fn blocks(path: &Path, config: &Config) -> Option<Vec<Block>> {
    let mut program = Program::open(path).unwrap();
    let mut first = Vec::new();
    let mut keep = |block: &Block, _: Option<tandem_sdk::Curve<'_>>| {
        first.push(*block);
        Ok(())
    };
    let report = check(&mut program, config, &mut keep).unwrap();
    if !report.is_ok() {
        return None;
    }
    let mut stream = Stream::new(program, config).unwrap();
    let (mut items, mut second) = (Vec::new(), Vec::new());
    while stream.next_items(&mut items).unwrap() {
        let blocks = items.drain(..).filter_map(|item| match item {
            Item::Block(block, _) => Some(block),
            _ => None,
        });
        second.extend(blocks);
    }
    assert_eq!(shown(&first), shown(&second), "both passes make the same");
    Some(second)
}

/// All that blocks say, with their numbers bit for bit.
pub fn shown(blocks: &[Block]) -> String {
    format!("{blocks:?}")
}

/// A program of these blocks.
pub fn written_out(blocks: &[Block]) -> String {
    let mut text = "G21 G90 G94 G64\n".to_owned();
    for block in blocks {
        let [x, y, z] = [0, 1, 2].map(|axis| block.end[axis]);
        let feed = block.feed_mm_per_s * 60.0;
        let line = match block.kind {
            BlockKind::Rapid => format!("G0 X{x:.12} Y{y:.12} Z{z:.12}"),
            BlockKind::Dwell => format!("G4 P{:.12}", block.dwell_s),
            BlockKind::Arc => arc(block),
            _ => format!("G1 X{x:.12} Y{y:.12} Z{z:.12} F{feed:.12}"),
        };
        let control = match block.path_mode {
            PathMode::ExactStop => "G61.1",
            PathMode::Continuous => "G64",
        };
        let _ = writeln!(text, "{control}\n{line}");
    }
    text
}

fn arc(block: &Block) -> String {
    let [a, b] = block.arc.plane.map(|axis| axis as usize);
    let plane = ["G17", "G19", "G18"][a];
    let word = if block.arc.sweep_rad > 0.0 {
        "G3"
    } else {
        "G2"
    };
    let turns = (block.arc.sweep_rad.abs() / std::f64::consts::TAU - 1e-9).floor() + 1.0;
    let center = [a, b].map(|axis| (["I", "J", "K"][axis], axis));
    let mut text = format!(
        "{plane} {word} P{turns} F{:.12}",
        block.feed_mm_per_s * 60.0
    );
    for (letter, axis) in ["X", "Y", "Z"].iter().zip(0..) {
        let _ = write!(text, " {letter}{:.12}", block.end[axis]);
    }
    for ((letter, axis), at) in center.into_iter().zip(block.arc.center_mm) {
        let _ = write!(text, " {letter}{:.12}", at - block.start[axis]);
    }
    text
}

/// Where two programs part, if what a planner plans by is not the same.
pub fn parting(one: &[Block], other: &[Block]) -> Option<String> {
    let same = |a: &Block, b: &Block| {
        let near = (0..3).all(|axis| (a.end[axis] - b.end[axis]).abs() < 1e-8);
        let feeds = a.feed_mm_per_s == b.feed_mm_per_s
            || (a.feed_mm_per_s - b.feed_mm_per_s).abs() < 1e-9 * a.feed_mm_per_s;
        a.kind == b.kind
            && near
            && feeds
            && a.path_mode == b.path_mode
            && (a.length_mm - b.length_mm).abs() < 1e-8
            && (a.dwell_s - b.dwell_s).abs() < 1e-9
    };
    let alike = one
        .iter()
        .zip(other)
        .take_while(|(a, b)| same(a, b))
        .count();
    (alike < one.len().max(other.len())).then(|| {
        format!(
            "block {alike}: {:?} and {:?}",
            one.get(alike),
            other.get(alike)
        )
    })
}
