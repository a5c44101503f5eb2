//! Blocks so short that many of them are driven in a fine period, some in less time than a segment may have.

mod common;

use common::run;
use tandem_rig::line;
use tandem_sdk::{AxisLimits, AxisVector, OwnedBlock, PlannerContext, SegmentFlags};

/// A machine that drives a tenth of a micrometre in a fraction of a microsecond.
fn fast() -> PlannerContext {
    let axis = AxisLimits { feed_mm_per_s: 600.0, jerk_mm_per_s3: 2e7, ..tandem_rig::axis(1e5) };
    tandem_rig::context(&[axis; 2], 1e-3)
}

#[test]
fn blocks_that_take_less_time_than_a_segment_are_driven_and_reported() {
    for form in ["scan", "windowed"] {
        for count in [3, 40, 63, 400] {
            for length in [1e-4, 3e-4, 2e-3] {
                let at = |n: usize| AxisVector::from_slice(&[0.6 * length * n as f64, 0.8 * length * n as f64]);
                let blocks: Vec<_> = (0..count)
                    .map(|n| {
                        let mut block = line(&at(n), &at(n + 1), 500.0);
                        (block.index, block.line) = (n as u64, n as u32 + 1);
                        OwnedBlock::new(block, None)
                    })
                    .collect();
                let driven = run(&format!("form = \"{form}\""), &fast(), &blocks);
                let what = format!("{form}, {count} of {length} mm");
                let last = driven.segments.last().unwrap();
                assert!(last.flags.contains(SegmentFlags::ENDS_AT_REST), "{what}");
                assert_eq!(last.position(0.0), at(count), "{what}");
                assert_eq!(driven.reports.len(), count, "{what}");
            }
        }
    }
}
