//! Planners on a machine whose joints are sums of axes: two belts that X and Y pull together.

use std::sync::OnceLock;

use tandem_sdk::{
    AxisLimits, AxisVector, Block, JointLanes, Limits, PlannerContext, Plugin, Segment,
};

use crate::limits;
use crate::machine;
use crate::motion::{Driven, Stuck, Timings, drive};
use crate::random::Random;
use crate::report::Report;
use crate::{Setup, program};

const CHECK: &str = "limits of joints";
/// Programs, and blocks of each.
const PROGRAMS: u64 = 3;
const BLOCKS: usize = 60;

/// Judges the limits of the joints, where the planner takes such a machine at all.
pub fn judge(plugin: Plugin, setup: &Setup, report: &mut Report, timings: &mut Timings) {
    for number in 0..PROGRAMS.min(setup.programs) {
        let seed = setup.seed.wrapping_add(number.wrapping_mul(0x3_0000_0001));
        match program(plugin, setup, seed, timings) {
            Err(Refused(words)) => return report.skip(CHECK, words),
            Ok(None) => report.judged(CHECK),
            Ok(Some(words)) => report.find(
                CHECK,
                format!("program seed {seed}, joints behind the axes: {words}"),
            ),
        }
    }
}

/// Why it is not judged.
struct Refused(String);

/// What is wrong with one program, if anything.
fn program(
    plugin: Plugin,
    setup: &Setup,
    seed: u64,
    timings: &mut Timings,
) -> Result<Option<String>, Refused> {
    let (context, lanes) = (context(), lanes());
    let opened = plugin.planner(&setup.options, &context);
    let mut planner =
        opened.map_err(|error| Refused(format!("it does not take such a machine: {error}")))?;
    let description = planner.describe();
    if description.breaks_limits != 0 {
        return Err(Refused("it declares that it breaks limits".to_string()));
    }
    let takes = |block: &Block| planner.check(&filled(block, lanes), None).is_ok();
    let blocks = program::random(&mut Random::new(seed), AxisVector::ZERO, BLOCKS, takes);
    if blocks.is_empty() {
        return Err(Refused(
            "it takes no block of a whole program there".to_string(),
        ));
    }
    let blocks: Vec<Block> = blocks.iter().map(|block| filled(block, lanes)).collect();
    let mut driven = Driven::default();
    if let Err(Stuck { words, .. }) =
        drive(planner.as_mut(), &blocks, usize::MAX, &mut driven, timings)
    {
        return Ok(Some(words));
    }
    let carried = |segment: &Segment| {
        let mut segment = *segment;
        lanes.fill_polynomials(&mut segment.coefficients);
        segment
    };
    let segments: Vec<Segment> = driven.segments.iter().map(carried).collect();
    Ok(limits::judge(
        &segments,
        &limits::samples(&segments),
        &context.limits,
        &description,
    ))
}

fn filled(block: &Block, lanes: &'static JointLanes) -> Block {
    let mut block = *block;
    lanes.fill(&mut block.start);
    lanes.fill(&mut block.end);
    block
}

/// X + Y and X − Y.
fn lanes() -> &'static JointLanes {
    static LANES: OnceLock<JointLanes> = OnceLock::new();
    let weights = [[1.0, 1.0], [1.0, -1.0]].map(|weights| AxisVector::from_slice(&weights));
    LANES.get_or_init(|| {
        JointLanes::new(3, &weights)
            .unwrap_or_else(|_| unreachable!("two joints behind three axes"))
    })
}

/// The machine that planners are judged on, with motors on the belts that are no faster than an axis.
fn context() -> PlannerContext {
    let plain = machine::context(AxisVector::ZERO);
    let belt = AxisLimits {
        min_mm: -500.0,
        max_mm: 500.0,
        ..plain.limits.axes[0]
    };
    let all: Vec<AxisLimits> = plain
        .limits
        .axes()
        .iter()
        .copied()
        .chain([belt; 2])
        .collect();
    let limits = Limits::new(&all).unwrap_or_else(|_| unreachable!("five entries"));
    PlannerContext {
        limits,
        joint_lanes: Some(lanes()),
        ..plain
    }
}
