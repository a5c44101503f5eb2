//! A planner on a machine whose joints are not its axes.

use std::sync::Arc;

use tandem_machine::Machine;
use tandem_sdk::{
    Accepted, Advanced, AxisVector, Block, BlockReport, Curve, JointLanes, Planner,
    PlannerDescription, PluginError, Segment, SegmentSink, Slice,
};

use super::curved::CurvedJoints;
use super::space::JointSpace;
use super::travel::Travel;

/// Hands blocks on with the lanes of the joints filled, refuses those in which a joint leaves its travel, and fills the
/// lanes of every segment from its axes.
pub struct CoupledJoints {
    planner: Box<dyn Planner>,
    lanes: Option<&'static JointLanes>,
    travel: Travel,
    /// Control points with lanes; kept from curve to curve.
    points: Vec<AxisVector>,
}

impl CoupledJoints {
    /// `planner` as it is where the joints are the axes; else one that keeps their travel too, and carries their lanes. Host;
    /// allocates.
    pub fn around(
        planner: Box<dyn Planner>,
        joints: &Arc<JointSpace>,
        machine: &Machine,
    ) -> Box<dyn Planner> {
        if joints.are_axes() {
            return planner;
        }
        if joints.are_curved() {
            return Box::new(CurvedJoints::around(planner, joints, machine));
        }
        let lanes = joints.lanes();
        Box::new(Self {
            planner,
            lanes,
            travel: Travel::new(Arc::clone(joints), machine.axes),
            points: Vec::new(),
        })
    }
}

/// `block` with its lanes filled.
fn filled(block: &Block, lanes: &JointLanes) -> Block {
    let mut block = *block;
    lanes.fill(&mut block.start);
    lanes.fill(&mut block.end);
    block
}

/// `curve` with the lanes of its control points filled; `points` holds them meanwhile.
fn filled_curve<'a>(
    curve: Curve<'a>,
    lanes: &JointLanes,
    points: &'a mut Vec<AxisVector>,
) -> Curve<'a> {
    points.clear();
    points.extend_from_slice(&curve.control_points);
    for point in points.iter_mut() {
        lanes.fill(point);
    }
    Curve {
        control_points: Slice::new(points),
        ..curve
    }
}

impl Planner for CoupledJoints {
    fn describe(&self) -> PlannerDescription {
        self.planner.describe()
    }

    fn check(&self, block: &Block, curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        let Some(lanes) = self.lanes else {
            self.planner.check(block, curve)?;
            return self.travel.check(block, curve);
        };
        let mut points = Vec::new();
        let with_lanes = curve.map(|curve| filled_curve(curve, lanes, &mut points));
        self.planner.check(&filled(block, lanes), with_lanes)?;
        self.travel.check(block, curve)
    }

    fn accept(&mut self, block: &Block, curve: Option<Curve<'_>>) -> Result<Accepted, PluginError> {
        let Some(lanes) = self.lanes else {
            return self.planner.accept(block, curve);
        };
        let curve = curve.map(|curve| filled_curve(curve, lanes, &mut self.points));
        self.planner.accept(&filled(block, lanes), curve)
    }

    fn finish(&mut self) {
        self.planner.finish();
    }

    fn advance(
        &mut self,
        duration_s: f64,
        sink: &mut dyn SegmentSink,
    ) -> Result<Advanced, PluginError> {
        match self.lanes {
            None => self.planner.advance(duration_s, sink),
            Some(lanes) => self
                .planner
                .advance(duration_s, &mut Filling { sink, lanes }),
        }
    }

    fn reset(&mut self, position: &AxisVector) {
        let mut position = *position;
        if let Some(lanes) = self.lanes {
            lanes.fill(&mut position);
        }
        self.planner.reset(&position);
    }
}

struct Filling<'a> {
    sink: &'a mut dyn SegmentSink,
    lanes: &'static JointLanes,
}

impl SegmentSink for Filling<'_> {
    fn segment(&mut self, segment: &Segment) {
        let mut segment = *segment;
        self.lanes.fill_polynomials(&mut segment.coefficients);
        self.lanes.fill(&mut segment.step_velocity);
        self.lanes.fill(&mut segment.step_acceleration);
        self.sink.segment(&segment);
    }

    fn block(&mut self, report: &BlockReport) {
        self.sink.block(report);
    }
}
