//! What the planner refuses before anything moves.

use tandem_look_ahead::{LookAhead, Options};
use tandem_sdk::{AxisVector, Block, BlockKind, Planner};

use crate::common::context;

#[test]
fn curves_are_left_to_the_planner_that_drives_them() {
    let planner = LookAhead::new(&Options::default(), &context(&[1000.0; 3], 0.0, 0.001)).unwrap();
    let line = tandem_rig::line(
        &AxisVector::ZERO,
        &AxisVector::from_slice(&[10.0, 0.0, 5.0]),
        50.0,
    );
    assert!(planner.check(&line, None).is_ok());
    let curve = Block {
        kind: BlockKind::Nurbs,
        ..line
    };
    let why = planner.check(&curve, None).unwrap_err().to_string();
    assert!(why.contains("use planner nurbs"), "{why}");
    let still = Block {
        length_mm: 0.0,
        ..line
    };
    let why = planner.check(&still, None).unwrap_err().to_string();
    assert!(why.contains("length above zero"), "{why}");
}
