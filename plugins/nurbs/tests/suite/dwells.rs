//! A dwell is cut into parts of any length, also one that rounding loses beside the dwell.

use crate::common;

use common::context;
use tandem_nurbs::{NurbsPlanner, Options};
use tandem_sdk::{AxisVector, Block, BlockReport, Planner, Segment, SegmentSink};

/// Sums durations; more than `left` segments are without end.
struct Few {
    left: u32,
    driven_s: f64,
}

impl SegmentSink for Few {
    fn segment(&mut self, segment: &Segment) {
        self.left = self.left.checked_sub(1).expect("segments without end");
        self.driven_s += segment.duration_s;
    }
    fn block(&mut self, _report: &BlockReport) {}
}

#[test]
fn a_part_below_the_rounding_of_a_dwell_is_emitted_once() {
    for form in ["adaptive", "windowed", "scan"] {
        let options = Options::parse(&format!("form = \"{form}\"")).unwrap();
        let mut planner = NurbsPlanner::new(&options, &context(AxisVector::ZERO)).unwrap();
        let dwell = Block {
            dwell_s: 1.0,
            ..Block::at(AxisVector::ZERO)
        };
        planner.accept(&dwell, None).unwrap();
        planner.finish();
        let mut sink = Few {
            left: 200,
            driven_s: 0.0,
        };
        planner.advance(1e-18, &mut sink).unwrap();
        while planner.advance(0.008, &mut sink).unwrap().done == 0 {}
        assert!(
            (sink.driven_s - 1.0).abs() < 1e-12,
            "{form}: {}",
            sink.driven_s
        );
    }
}
