//! What the planner refuses before anything moves.

use tandem_block_overlap::{BlockOverlap, CornerControl, LimitMode, Options};
use tandem_rig::Collected;
use tandem_sdk::{Accepted, AxisVector, Block, BlockKind, Planner, PlannerContext};

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

/// Blocks end within what is asked for, and what follows takes the rest and no more.
#[test]
fn no_more_motion_comes_than_is_asked_for() {
    let machine = context(&[5000.0; 3], 0.001);
    let mut planner = BlockOverlap::new(&Options::default(), &machine).unwrap();
    let points: Vec<_> = (0..40)
        .map(|n| AxisVector::from_slice(&[0.3 * f64::from(n), 0.3 * f64::from(n % 2), 0.0]))
        .collect();
    let mut collected = Collected::default();
    let mut calls = 0;
    let mut ask = |planner: &mut BlockOverlap| {
        let advanced = planner.advance(0.007, &mut collected).unwrap();
        assert!(advanced.duration_s < 0.007 + 1e-9, "{advanced:?}");
        calls += 1;
        advanced.done == 1
    };
    for block in tandem_rig::lines(&points, |_| 3000.0) {
        while planner.accept(&block, None).unwrap() == Accepted::Full {
            ask(&mut planner);
        }
    }
    planner.finish();
    while !ask(&mut planner) {}
    assert!(calls > 40, "{calls}");
}
