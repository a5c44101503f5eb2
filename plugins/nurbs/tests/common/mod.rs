//! The canonical curves as blocks, and a planner run as the rough loop runs it.
#![allow(dead_code, reason = "each test file uses its own part")]

pub mod measure;

use tandem_nurbs::{NurbsPlanner, Options};
pub use tandem_rig::Collected;
use tandem_rig::{Given, canonical_curve, curve};
use tandem_sdk::{AxisLimits, AxisVector, Block, BlockKind, NurbsData, PlannerContext};

pub fn canonical(name: &str) -> (NurbsData, f64) {
    let entry = canonical_curve(name);
    (curve(&entry), entry["length_mm"].as_f64().unwrap())
}

/// A block along `data`, at `feed_mm_per_s`.
pub fn curve_block(data: NurbsData, length_mm: f64, feed_mm_per_s: f64) -> Given {
    let mut block = Block::at(data.control_points[0]);
    block.end = data.control_points[data.control_points.len() - 1];
    (block.kind, block.line) = (BlockKind::Nurbs, 1);
    (block.length_mm, block.feed_mm_per_s) = (length_mm, feed_mm_per_s);
    (block, Some(data.into()))
}

/// A machine with two linear axes, 5000 mm/s² and 4e5 mm/s³, at a fine period of 2 ms.
pub fn context(position: AxisVector) -> PlannerContext {
    let axis = AxisLimits {
        feed_mm_per_s: 1000.0,
        rapid_mm_per_s: 1000.0,
        jerk_mm_per_s3: 4e5,
        ..tandem_rig::axis(5000.0)
    };
    PlannerContext {
        position,
        ..tandem_rig::context(&[axis; 2], 0.002)
    }
}

/// All motion of `blocks`.
pub fn run(options: &str, context: &PlannerContext, blocks: &[Given]) -> Collected {
    let mut planner = NurbsPlanner::new(&Options::parse(options).unwrap(), context).unwrap();
    tandem_rig::drive(&mut planner, blocks, 0.008)
}
