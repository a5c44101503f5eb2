//! What the ring is given, and what the fine loop is told with it.

use tandem_rings::{FineEnd, RestCause, Sizes, bridge};
use tandem_sdk::{AxisVector, Curve, MAX_AXES};

use super::*;
use crate::doubles::{block_of, report, rest};
use crate::easing::Easing;
use crate::junction_steps::ROUNDING;

const PERIOD_S: f64 = 0.01;

fn queue() -> (Queue, FineEnd) {
    let (rough, fine, _host) = bridge(Sizes::default());
    let depth = QueueDepth::new(PERIOD_S, 0.001, 1.0, Easing::NONE);
    (
        Queue::new(rough, depth, JunctionSteps::new(MAX_AXES, ROUNDING)),
        fine,
    )
}

/// A segment of a block at 50 mm/s along the first axis that leaves 100 mm/s², with a jerk limit.
fn moving(block: u64, duration_s: f64) -> Segment {
    let mut segment = Segment::rest(&AxisVector::ZERO, duration_s);
    (segment.block, segment.order) = (block, 3);
    segment.flags = SegmentFlags::default();
    (segment.coefficients[0][1], segment.path[1]) = (50.0, 50.0);
    segment.stop_deceleration_mm_per_s2 = 100.0;
    segment
}

/// The segment that the fine loop takes next.
fn next(fine: &mut FineEnd) -> Segment {
    match fine.segments.pop() {
        Ok(Queued::Segment { segment, .. }) => segment,
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_end_of_the_queue_is_a_wall_but_where_it_rests() {
    let (mut queue, fine) = queue();
    queue.segment(&moving(0, 0.5));
    queue.flush(false, false);
    assert_eq!(fine.depth.wall_s.load(), 0.5);
    queue.segment(&Segment {
        flags: SegmentFlags::ENDS_AT_REST,
        ..moving(0, 0.25)
    });
    queue.flush(false, false);
    assert_eq!(fine.depth.wall_s.load(), f64::INFINITY);
    queue.segment(&moving(1, 0.25));
    queue.flush(false, false);
    assert_eq!(fine.depth.wall_s.load(), 1.0);
}

/// What is short and full is as deep as it gets: motion starts, at a rate from which it stops inside. What is over is not waited for.
#[test]
fn a_depth_is_asked_for_only_where_the_queue_can_get_deeper() {
    let (mut queue, fine) = queue();
    queue.segment(&moving(0, 0.1));
    queue.flush(false, false);
    assert!(fine.depth.required_s.load() > 0.5);
    assert_eq!(fine.depth.max_rate.load(), 1.0);
    assert!(!fine.depth.may_start(0.0));
    queue.flush(true, false);
    assert_eq!(fine.depth.required_s.load(), 0.0);
    assert_eq!(fine.depth.max_rate.load(), 1.0);
    queue.flush(false, true);
    assert_eq!(fine.depth.required_s.load(), 0.0);
    let rate = fine.depth.max_rate.load();
    assert!(rate < 0.7, "{rate}");
}

#[test]
fn nothing_of_the_epoch_before_marks_what_comes_after_a_rest() {
    let (mut queue, mut fine) = queue();
    let waits = Block {
        stop_on: StopOn {
            edge: Edge::Rising,
            ..StopOn::default()
        },
        ..block_of(1)
    };
    for block in [&block_of(0), &waits, &block_of(2)] {
        queue.accepted(block, None);
    }
    queue.segment(&moving(0, 0.5));
    queue.block(&report(0));
    queue.flush(false, false);
    assert_eq!(next(&mut fine).stop_on.edge, Edge::None);
    // It goes on twice as fast, and waits for an edge.
    let mut faster = moving(1, 0.5);
    faster.coefficients[0][1] = 100.0;
    queue.segment(&faster);
    queue.block(&report(1));
    queue.flush(false, false);
    let second = next(&mut fine);
    assert!(second.flags.contains(SegmentFlags::STEPS));
    assert_eq!(second.stop_on.edge, Edge::Rising);
    let rest = rest(RestCause::Abort);
    queue.restart(&rest);
    for number in 0..3 {
        queue.accepted(&block_of(number), None);
    }
    queue.segment(&moving(1, 0.5));
    queue.block(&report(0));
    queue.flush(false, false);
    let first = next(&mut fine);
    assert_eq!((first.epoch, first.path[0]), (1, rest.path_mm));
    assert!(
        !first.flags.contains(SegmentFlags::STEPS),
        "it begins at rest"
    );
    assert_eq!(first.stop_on.edge, Edge::None, "no block given since waits");
    assert_eq!(queue.defect(), None);
}

#[derive(Default)]
struct Told(Vec<u64>);

impl Observer for Told {
    fn block(&mut self, block: &Block, _curve: Option<Curve<'_>>, report: &BlockReport) {
        assert_eq!(block.index, report.block);
        self.0.push(block.index);
    }
}

#[test]
fn a_block_without_a_report_is_not_told_of() {
    let (mut queue, _fine) = queue();
    for number in 0..5 {
        queue.accepted(&block_of(number), None);
    }
    let mut told = Told::default();
    queue.block(&report(1));
    queue.block(&report(2));
    queue.tell_of_blocks(&mut told);
    queue.block(&report(4));
    queue.tell_of_blocks(&mut told);
    assert_eq!((told.0, queue.defect()), (vec![1, 2, 4], None));
}
