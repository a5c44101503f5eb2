//! What the planner refuses before anything moves.

use tandem_look_ahead::{Junction, LookAhead, Options};
use tandem_rig::Collected;
use tandem_sdk::{Accepted, AxisVector, Block, BlockKind, Planner, PlannerContext};

use crate::common::{context, run};

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

#[test]
fn only_the_published_junction_says_that_it_breaks_limits() {
    let context = context(&[1000.0; 3], 60.0, 0.001);
    for (junction, breaks_limits) in [(Junction::Axis, 0), (Junction::Tangent, 1)] {
        let options = Options {
            junction,
            ..Options::default()
        };
        let description = LookAhead::new(&options, &context).unwrap().describe();
        assert_eq!(description.breaks_limits, breaks_limits, "{junction:?}");
        assert_eq!(description.speed_difference_mm_per_s[..3], [1.0; 3]);
    }
}

/// A block waits for more room to be used before it begins, but what is being driven goes on, whatever may come.
#[test]
fn a_block_that_is_driven_does_not_wait_for_others() {
    let context = context(&[1000.0; 3], 0.0, 0.001);
    let options = Options {
        buffer_blocks: 4,
        ..Options::default()
    };
    let mut planner = LookAhead::new(&options, &context).unwrap();
    let points: Vec<_> = (0..8)
        .map(|n| AxisVector::from_slice(&[f64::from(n), 0.0, 0.0]))
        .collect();
    for block in tandem_rig::lines(&points, |_| 6000.0) {
        if planner.accept(&block, None).unwrap() == Accepted::Full {
            break;
        }
    }
    let mut collected = Collected::default();
    // Two of these blocks take 63 ms; the end of the third could be faster if others came.
    for call in 0..30 {
        let advanced = planner.advance(0.002, &mut collected).unwrap();
        assert!(
            (advanced.duration_s - 0.002).abs() < 1e-12,
            "call {call}: {advanced:?}"
        );
    }
}

/// Up to the highest feed ratio a line is planned, at the feed of the axes at most; a rapid has no part in it.
#[test]
fn a_line_is_planned_at_the_highest_ratio_of_its_feed() {
    let to = AxisVector::from_slice(&[50.0, 0.0, 0.0]);
    for (max_feed_ratio, feed, speed) in [(1.0, 10.0, 10.0), (2.0, 10.0, 20.0), (2.0, 200.0, 250.0)]
    {
        let machine = PlannerContext {
            max_feed_ratio,
            ..context(&[1000.0; 3], 0.0, 0.001)
        };
        let line = tandem_rig::line(&AxisVector::ZERO, &to, feed);
        let driven = run(&machine, &Options::default(), &[line], 0.01);
        let top = f64::min(speed, f64::sqrt(1000.0 * 50.0));
        let shortest_s = 50.0 / top + top / 1000.0;
        let took = driven.duration_s() / shortest_s;
        assert!(
            (took - 1.0).abs() < 0.01,
            "{max_feed_ratio}, {feed}: {took}"
        );
    }
}
