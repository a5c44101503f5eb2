//! The planner on a machine with three linear axes and a rotary one.
#![allow(dead_code, reason = "each test file uses its part")]

use tandem_rig::{Collected, axis, numbered};
use tandem_sdk::{AxisVector, Block, Planner, PlannerContext};

pub const FILTERS: [&str; 3] = ["linear", "exponential", "bell"];

pub fn context(fine_period_s: f64) -> PlannerContext {
    tandem_rig::context(&[axis(1000.0); 4], fine_period_s)
}

pub fn open(filter: &str, time_constant_ms: f64, context: &PlannerContext) -> Box<dyn Planner> {
    let options = format!("filter = \"{filter}\"\ntime_constant_ms = {time_constant_ms:?}");
    tandem_after_interpolation::PLUGIN
        .planner(&options, context)
        .unwrap()
}

pub fn line(from: &AxisVector, to: &[f64], feed_mm_per_s: f64) -> Block {
    tandem_rig::line(from, &AxisVector::from_slice(to), feed_mm_per_s)
}

/// Lines through the points, from zero.
pub fn polyline(points: &[[f64; 3]], feed_mm_per_s: f64) -> Vec<Block> {
    let mut at = AxisVector::ZERO;
    let mut blocks = Vec::new();
    for point in points {
        blocks.push(line(&at, point, feed_mm_per_s));
        at = AxisVector::from_slice(point);
    }
    numbered(blocks)
}

/// Drives a whole program by rough periods.
pub fn drive(planner: &mut dyn Planner, blocks: &[Block]) -> Collected {
    tandem_rig::drive(planner, blocks, 0.008)
}

pub fn norm(v: &AxisVector) -> f64 {
    v.0.iter().map(|x| x * x).sum::<f64>().sqrt()
}
