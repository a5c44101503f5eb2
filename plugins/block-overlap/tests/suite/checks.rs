//! What the planner refuses before anything moves.

use tandem_block_overlap::{BlockOverlap, CornerControl, LimitMode, Options};
use tandem_sdk::{AxisVector, Block, BlockKind, Planner, PlannerContext};

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

#[test]
fn a_machine_without_a_time_constant_is_refused() {
    for (time_constant_s, is_taken) in [(0.0, false), (f64::INFINITY, false), (0.05, true)] {
        let machine = PlannerContext {
            time_constant_s,
            ..context(&[1000.0; 3], 0.001)
        };
        let opened = BlockOverlap::new(&Options::default(), &machine);
        assert_eq!(opened.is_ok(), is_taken, "{time_constant_s}");
    }
}

#[test]
fn a_planner_says_of_itself_what_its_options_give_up() {
    let described = |corner_control, limits| {
        let options = Options {
            corner_control,
            limits,
            ..Options::default()
        };
        let planner = BlockOverlap::new(&options, &context(&[1000.0; 3], 0.001)).unwrap();
        let description = planner.describe();
        (description.leaves_path, description.breaks_limits)
    };
    let kept = Options::default();
    assert_eq!(described(kept.corner_control, kept.limits), (0, 0));
    assert_eq!(described(CornerControl::Off, kept.limits), (1, 0));
    assert_eq!(described(kept.corner_control, LimitMode::Off), (0, 1));
}
