//! What the planner refuses before anything moves.

use tandem_block_overlap::{BlockOverlap, Options};
use tandem_sdk::{AxisVector, Block, BlockKind, Planner};

use crate::common::context;

#[test]
fn curves_and_time_constants_that_are_none_are_refused_but_a_dwell_needs_no_time_constant() {
    let planner = BlockOverlap::new(&Options::default(), &context(&[1000.0; 3], 0.001)).unwrap();
    let line = tandem_rig::line(
        &AxisVector::ZERO,
        &AxisVector::from_slice(&[10.0, 0.0, 5.0]),
        50.0,
    );
    assert!(planner.check(&line, None).is_ok());
    let why = |block: Block| planner.check(&block, None).unwrap_err().to_string();
    let curve = Block {
        kind: BlockKind::Nurbs,
        ..line
    };
    assert!(why(curve).contains("use planner nurbs"));
    for time_constant_s in [0.0, -0.01, f64::INFINITY] {
        let without = Block {
            time_constant_s,
            ..line
        };
        assert!(why(without).contains("above zero"), "{time_constant_s}");
        let dwell = Block {
            kind: BlockKind::Dwell,
            dwell_s: 0.5,
            ..without
        };
        assert!(planner.check(&dwell, None).is_ok(), "{time_constant_s}");
    }
}
