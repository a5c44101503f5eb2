//! A machine, blocks and a recorder for the tests of the planner.
#![allow(dead_code)] // every test file uses its part

use tandem_sdk::{
    Accepted, ArcGeometry, Axes, AxisLimits, AxisVector, Block, BlockKind, BlockReport, Limits, Planner,
    PlannerContext, Segment, SegmentSink,
};

pub const FILTERS: [&str; 3] = ["linear", "exponential", "bell"];

pub fn context(fine_period_s: f64) -> PlannerContext {
    let axis = AxisLimits {
        min_mm: -1e4,
        max_mm: 1e4,
        feed_mm_per_s: 250.0,
        rapid_mm_per_s: 250.0,
        acceleration_mm_per_s2: 1000.0,
        jerk_mm_per_s3: f64::INFINITY,
        speed_difference_mm_per_s: 0.0,
    };
    PlannerContext {
        size: tandem_sdk::size_of_contract::<PlannerContext>(),
        axes: Axes::new(&[('X', false), ('Y', false), ('Z', false), ('A', true)]).unwrap(),
        limits: Limits::new(&[axis; 4]).unwrap(),
        fine_period_s,
        rough_period_s: 0.008,
        path_tolerance_mm: 0.01,
        time_constant_s: 0.05,
        max_feed_ratio: 1.0,
        position: AxisVector::ZERO,
        joint_lanes: None,
    }
}

pub fn open(filter: &str, time_constant_ms: f64, context: &PlannerContext) -> Box<dyn Planner> {
    let options = format!("filter = \"{filter}\"\ntime_constant_ms = {time_constant_ms:?}");
    tandem_after_interpolation::PLUGIN.planner(&options, context).unwrap()
}

pub fn line(from: &AxisVector, to: &[f64], feed_mm_per_s: f64) -> Block {
    let mut block = Block::at(*from);
    block.kind = BlockKind::Line;
    block.end = AxisVector::from_slice(to);
    block.length_mm = context(0.001).axes.path_length(&(block.end - *from));
    block.feed_mm_per_s = feed_mm_per_s;
    block
}

/// An arc in XY around `center`, from `from` on its circle.
pub fn arc(from: &AxisVector, center: [f64; 2], sweep_rad: f64, feed_mm_per_s: f64) -> Block {
    let (x, y) = (from[0] - center[0], from[1] - center[1]);
    let (radius_mm, start_angle_rad) = (x.hypot(y), y.atan2(x));
    let (sin, cos) = (start_angle_rad + sweep_rad).sin_cos();
    let mut block = Block::at(*from);
    block.kind = BlockKind::Arc;
    block.end[0] = center[0] + radius_mm * cos;
    block.end[1] = center[1] + radius_mm * sin;
    block.length_mm = radius_mm * sweep_rad.abs();
    block.feed_mm_per_s = feed_mm_per_s;
    block.arc = ArcGeometry { plane: [0, 1], center_mm: center, radius_mm, start_angle_rad, sweep_rad };
    block
}

/// Gives the blocks their numbers.
pub fn numbered(mut blocks: Vec<Block>) -> Vec<Block> {
    for (index, block) in (0..).zip(&mut blocks) {
        block.index = index;
        block.line = index as u32 + 1;
    }
    blocks
}

/// Lines through the points, from zero.
pub fn polyline(points: &[[f64; 3]], feed_mm_per_s: f64) -> Vec<Block> {
    let mut at = AxisVector::ZERO;
    let mut blocks = Vec::new();
    for point in points {
        blocks.push(line(&at, point, feed_mm_per_s));
        at = AxisVector::from_slice(point);
    }
    numbered(blocks)
}

/// What a planner emitted.
#[derive(Default)]
pub struct Recorder {
    pub segments: Vec<Segment>,
    pub reports: Vec<BlockReport>,
}

impl SegmentSink for Recorder {
    fn segment(&mut self, segment: &Segment) {
        let known = self.reports.iter().any(|report| report.block == segment.block);
        assert!(known, "block {} moves before it is reported", segment.block);
        self.segments.push(*segment);
    }

    fn block(&mut self, report: &BlockReport) {
        self.reports.push(*report);
    }
}

impl Recorder {
    pub fn duration_s(&self) -> f64 {
        self.segments.iter().map(|s| s.duration_s).sum()
    }

    pub fn end(&self) -> AxisVector {
        let last = self.segments.last().unwrap();
        last.position(last.duration_s)
    }

    /// Every segment with its start time.
    pub fn timed(&self) -> impl Iterator<Item = (f64, &Segment)> {
        self.segments.iter().scan(0.0, |clock, segment| {
            let start = *clock;
            *clock += segment.duration_s;
            Some((start, segment))
        })
    }

    pub fn at(&self, t_s: f64) -> AxisVector {
        let (start, segment) = self.timed().take_while(|(start, _)| *start <= t_s).last().unwrap();
        segment.position((t_s - start).min(segment.duration_s))
    }
}

/// Drives a whole program by rough periods, offering blocks until the planner is full; gives the recording.
pub fn drive(planner: &mut dyn Planner, blocks: &[Block]) -> Recorder {
    let mut recorder = Recorder::default();
    let mut next = 0;
    for _ in 0..1_000_000 {
        while next < blocks.len() && planner.accept(&blocks[next]).unwrap() == Accepted::Accepted {
            next += 1;
        }
        if next == blocks.len() {
            planner.finish();
        }
        if planner.advance(0.008, &mut recorder).unwrap().done != 0 {
            return recorder;
        }
    }
    panic!("the planner never comes to an end");
}

pub fn norm(v: &AxisVector) -> f64 {
    v.0.iter().map(|x| x * x).sum::<f64>().sqrt()
}
