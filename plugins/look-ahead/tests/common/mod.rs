//! Driving the planner without the loops.
#![allow(dead_code, missing_docs)]

use serde_json::Value;
use tandem_look_ahead::{Junction, LookAhead, Options};
use tandem_sdk::{
    Accepted, Axes, AxisLimits, AxisVector, Block, BlockKind, BlockReport, Limits, Planner, PlannerContext, Segment,
    SegmentSink, size_of_contract,
};

pub const MM_PER_MIN: f64 = 60.0;

#[derive(Default)]
pub struct Collected {
    pub segments: Vec<Segment>,
    pub reports: Vec<BlockReport>,
}

impl SegmentSink for Collected {
    fn segment(&mut self, segment: &Segment) {
        self.segments.push(*segment);
    }
    fn block(&mut self, report: &BlockReport) {
        self.reports.push(*report);
    }
}

impl Collected {
    pub fn duration_s(&self) -> f64 {
        self.segments.iter().map(|s| s.duration_s).sum()
    }

    /// Start feeds of all blocks and the end feed of the last, mm/min.
    pub fn junction_feeds(&self) -> Vec<f64> {
        let starts = self.reports.iter().map(|r| r.start_feed_mm_per_s * MM_PER_MIN);
        starts.chain(self.reports.last().map(|r| r.end_feed_mm_per_s * MM_PER_MIN)).collect()
    }

    /// Position and feed at program time `t_s`.
    pub fn at(&self, t_s: f64) -> (AxisVector, f64) {
        let mut left = t_s;
        for segment in &self.segments {
            if left <= segment.duration_s {
                return (segment.position(left), segment.path_speed_mm_per_s(left));
            }
            left -= segment.duration_s;
        }
        let last = self.segments.last().unwrap();
        (last.position(last.duration_s), 0.0)
    }
}

pub fn context(accelerations: &[f64], speed_difference_mm_per_min: f64, fine_period_s: f64) -> PlannerContext {
    let names: Vec<(char, bool)> = "XYZ".chars().take(accelerations.len()).map(|c| (c, false)).collect();
    let limits: Vec<AxisLimits> = accelerations
        .iter()
        .map(|a| AxisLimits {
            min_mm: -1e6,
            max_mm: 1e6,
            feed_mm_per_s: 250.0,
            rapid_mm_per_s: 250.0,
            acceleration_mm_per_s2: *a,
            jerk_mm_per_s3: f64::INFINITY,
            speed_difference_mm_per_s: speed_difference_mm_per_min / MM_PER_MIN,
        })
        .collect();
    PlannerContext {
        size: size_of_contract::<PlannerContext>(),
        axes: Axes::new(&names).unwrap(),
        limits: Limits::new(&limits).unwrap(),
        fine_period_s,
        rough_period_s: 10.0 * fine_period_s,
        path_tolerance_mm: 0.01,
        time_constant_s: 0.05,
        max_feed_ratio: 1.0,
        position: AxisVector::ZERO,
        joint_lanes: None,
    }
}

pub fn lines(points: &[AxisVector], feed_mm_per_min: impl Fn(usize) -> f64) -> Vec<Block> {
    points.windows(2).enumerate().map(|(index, pair)| line(index, pair, feed_mm_per_min(index))).collect()
}

fn line(index: usize, pair: &[AxisVector], feed_mm_per_min: f64) -> Block {
    let mut block = Block::at(pair[0]);
    block.kind = BlockKind::Line;
    block.index = index as u64;
    block.line = index as u32 + 1;
    block.end = pair[1];
    block.length_mm = (pair[1] - pair[0]).0.iter().map(|d| d * d).sum::<f64>().sqrt();
    block.feed_mm_per_s = feed_mm_per_min / MM_PER_MIN;
    block
}

/// Runs `blocks` through a planner, offering new blocks after every `step_s` of program time.
pub fn run(context: &PlannerContext, options: &Options, blocks: &[Block], step_s: f64) -> Collected {
    let mut planner = LookAhead::new(options, context).unwrap();
    let mut collected = Collected::default();
    let mut waiting = blocks.iter();
    let mut next = waiting.next();
    loop {
        while let Some(block) = next {
            if planner.accept(block).unwrap() == Accepted::Full {
                break;
            }
            next = waiting.next();
        }
        if next.is_none() {
            planner.finish();
        }
        if planner.advance(step_s, &mut collected).unwrap().done != 0 {
            return collected;
        }
    }
}

pub fn tangent(buffer_blocks: usize) -> Options {
    Options { buffer_blocks, junction: Junction::Tangent }
}

pub fn case(name: &str) -> Value {
    let path = format!("{}/../../tests/fixtures/cases/{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

pub fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

pub fn points(value: &Value) -> Vec<AxisVector> {
    value.as_array().unwrap().iter().map(|p| AxisVector::from_slice(&numbers(p))).collect()
}

pub fn assert_close(actual: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(actual.len(), expected.len());
    for (index, (a, e)) in actual.iter().zip(expected).enumerate() {
        assert!((a - e).abs() <= tolerance, "entry {index}: {a} instead of {e}");
    }
}
