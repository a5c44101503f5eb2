//! The planner on a machine with up to three axes.
#![allow(dead_code, missing_docs, reason = "each test file uses its part")]

use tandem_look_ahead::{Junction, LookAhead, Options};
use tandem_rig::{Collected, axis, drive};
use tandem_sdk::{AxisLimits, Block, PlannerContext};

pub fn context(
    accelerations: &[f64],
    speed_difference_mm_per_min: f64,
    fine_period_s: f64,
) -> PlannerContext {
    let speed_difference_mm_per_s = speed_difference_mm_per_min / tandem_rig::MM_PER_MIN;
    let limits: Vec<_> = accelerations
        .iter()
        .map(|a| AxisLimits {
            speed_difference_mm_per_s,
            ..axis(*a)
        })
        .collect();
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
        &mut LookAhead::new(options, context).unwrap(),
        blocks,
        step_s,
    )
}

pub fn tangent(buffer_blocks: usize) -> Options {
    Options {
        buffer_blocks,
        junction: Junction::Tangent,
    }
}
