//! The canonical curves as blocks, and a planner run as the rough loop runs it.
#![allow(dead_code, reason = "each test file uses its own part")]

pub mod measure;

use serde_json::Value;
use tandem_nurbs::{NurbsPlanner, Options};
use tandem_sdk::{
    Accepted, Axes, AxisLimits, AxisVector, Block, BlockKind, BlockReport, Limits, NurbsData, OwnedBlock, Planner,
    PlannerContext, Segment, SegmentSink, size_of_contract,
};

pub fn case(name: &str) -> Value {
    let path = format!("{}/../../tests/fixtures/cases/{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

pub fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

pub fn canonical(name: &str) -> (NurbsData, f64) {
    let case = case("002_nurbs_eval");
    let curve = case["curves"].as_array().unwrap().iter().find(|c| c["name"] == name).unwrap();
    let points = curve["control_points"].as_array().unwrap();
    let data = NurbsData {
        degree: curve["degree"].as_u64().unwrap() as usize,
        control_points: points.iter().map(|p| AxisVector::from_slice(&numbers(p))).collect(),
        weights: numbers(&curve["weights"]),
        knots: numbers(&curve["knots"]),
    };
    (data, curve["length_mm"].as_f64().unwrap())
}

/// A block along `data`, at `feed_mm_per_s`.
pub fn curve_block(data: NurbsData, length_mm: f64, feed_mm_per_s: f64) -> OwnedBlock {
    let mut block = Block::at(data.control_points[0]);
    block.end = data.control_points[data.control_points.len() - 1];
    (block.kind, block.line) = (BlockKind::Nurbs, 1);
    (block.length_mm, block.feed_mm_per_s) = (length_mm, feed_mm_per_s);
    OwnedBlock::new(block, Some(data.into()))
}

/// A machine with two linear axes, 5000 mm/s² and 4e5 mm/s³, at a fine period of 2 ms.
pub fn context(position: AxisVector) -> PlannerContext {
    let axis = AxisLimits {
        min_mm: -1e4,
        max_mm: 1e4,
        feed_mm_per_s: 1000.0,
        rapid_mm_per_s: 1000.0,
        acceleration_mm_per_s2: 5000.0,
        jerk_mm_per_s3: 4e5,
        speed_difference_mm_per_s: 0.0,
    };
    PlannerContext {
        size: size_of_contract::<PlannerContext>(),
        axes: Axes::new(&[('X', false), ('Y', false)]).unwrap(),
        limits: Limits::new(&[axis; 2]).unwrap(),
        fine_period_s: 0.002,
        rough_period_s: 0.008,
        path_tolerance_mm: 0.01,
        time_constant_s: 0.05,
        max_feed_ratio: 1.0,
        position,
        joint_lanes: None,
    }
}

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
        self.segments.iter().map(|segment| segment.duration_s).sum()
    }

    /// Positions and path coordinates at multiples of `period_s`, and at the end.
    pub fn samples(&self, period_s: f64) -> Vec<(AxisVector, f64)> {
        let (mut samples, mut start_s) = (Vec::new(), 0.0);
        for segment in &self.segments {
            while samples.len() as f64 * period_s < start_s + segment.duration_s {
                let t = samples.len() as f64 * period_s - start_s;
                samples.push((segment.position(t), segment.path_mm(t)));
            }
            start_s += segment.duration_s;
        }
        let last = self.segments.last().unwrap();
        samples.push((last.position(last.duration_s), last.path_mm(last.duration_s)));
        samples
    }
}

/// All motion of `blocks`.
pub fn run(options: &str, context: &PlannerContext, blocks: &[OwnedBlock]) -> Collected {
    let mut planner = NurbsPlanner::new(&Options::parse(options).unwrap(), context).unwrap();
    let (mut collected, mut next) = (Collected::default(), 0);
    loop {
        while next < blocks.len() && blocks[next].with(|b| planner.accept(b)).unwrap() == Accepted::Accepted {
            next += 1;
        }
        if next == blocks.len() {
            planner.finish();
        }
        if planner.advance(0.008, &mut collected).unwrap().done != 0 {
            return collected;
        }
    }
}
