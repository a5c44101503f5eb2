//! Blocks that no planner drives.

use tandem_sdk::{AxisVector, Block, BlockKind, Planner};

use crate::report::Report;

/// Blocks with one thing wrong, and what that is.
fn blocks() -> Vec<(&'static str, Block)> {
    let mut line = Block {
        kind: BlockKind::Line,
        feed_mm_per_s: 10.0,
        ..Block::at(AxisVector::ZERO)
    };
    (line.end[0], line.length_mm) = (10.0, 10.0);
    let with = |change: &dyn Fn(&mut Block)| {
        let mut block = line;
        change(&mut block);
        block
    };
    vec![
        (
            "an end that is no number",
            with(&|block| block.end[1] = f64::NAN),
        ),
        (
            "a start at infinity",
            with(&|block| block.start[0] = f64::INFINITY),
        ),
        ("a length of zero", with(&|block| block.length_mm = 0.0)),
        (
            "a length that is no number",
            with(&|block| block.length_mm = f64::NAN),
        ),
        ("a feed of zero", with(&|block| block.feed_mm_per_s = 0.0)),
        (
            "a feed that is no number",
            with(&|block| block.feed_mm_per_s = f64::NAN),
        ),
        (
            "a negative dwell",
            Block {
                dwell_s: -1.0,
                ..Block::at(AxisVector::ZERO)
            },
        ),
        (
            "a dwell that is no number",
            Block {
                dwell_s: f64::NAN,
                ..Block::at(AxisVector::ZERO)
            },
        ),
    ]
}

/// Asks `check` about each of them.
pub fn judge(planner: &dyn Planner, report: &mut Report) {
    const CHECK: &str = "nonsense is refused";
    report.judged(CHECK);
    for (what, block) in blocks() {
        match planner.check(&block, None) {
            Ok(()) => report.find(CHECK, format!("check takes {what}")),
            Err(error) if error.is_panic() => report.find(CHECK, format!("{what}: {error}")),
            Err(_) => {}
        }
    }
}
