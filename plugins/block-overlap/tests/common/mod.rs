//! The planner on a machine with up to three axes.
#![allow(dead_code, missing_docs, reason = "each test file uses its part")]

use tandem_block_overlap::{BlockOverlap, CornerControl, LimitMode, Options};
use tandem_rig::{Collected, axis, drive};
use tandem_sdk::{Block, PlannerContext};

pub fn context(accelerations: &[f64], fine_period_s: f64) -> PlannerContext {
    let limits: Vec<_> = accelerations.iter().map(|a| axis(*a)).collect();
    let context = tandem_rig::context(&limits, fine_period_s);
    PlannerContext {
        rough_period_s: 10.0 * fine_period_s,
        ..context
    }
}

/// Runs `blocks` through a planner, offering new blocks after every `step_s` of program time.
pub fn run(
    context: &PlannerContext,
    options: &Options,
    blocks: &[Block],
    step_s: f64,
) -> Collected {
    drive(
        &mut BlockOverlap::new(options, context).unwrap(),
        blocks,
        step_s,
    )
}

/// As published: `TA` decides, on whole ticks.
pub fn published() -> Options {
    Options {
        corner_control: CornerControl::Off,
        limits: LimitMode::Off,
        ..Options::default()
    }
}
