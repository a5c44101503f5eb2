//! A block: one path element of a part program, in machine coordinates, with what the program says about it.

use crate::abi::layout::{layout, layout_of_enum};
use std::sync::Arc;

use crate::{AxisVector, Edge, JointLanes, RawSlice, StopOn, size_of_contract};

/// What kind of path a block follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum BlockKind {
    /// G0: a straight line at the rapid feed; starts and ends at rest.
    Rapid = 0,
    /// A straight line in axis space.
    Line = 1,
    /// A circular arc in a plane of two axes; any further axes move in proportion to the swept angle (a helix).
    Arc = 2,
    /// A NURBS curve.
    Nurbs = 3,
    /// No path: the machine rests for [`Block::dwell_s`], which may be zero (the program needs rest here).
    Dwell = 4,
}

layout_of_enum!(BlockKind { Rapid, Line, Arc, Nurbs, Dwell });

/// How exactly the path is to be followed where this block meets the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum PathMode {
    /// G64: keep moving, within [`Block::path_tolerance_mm`].
    Continuous = 0,
    /// G61 (exact path) and G61.1 (exact stop): come to rest at the end of the block.
    ExactStop = 1,
}

layout_of_enum!(PathMode { Continuous, ExactStop });

/// A circular arc or helix. The plane is spanned by two axes; the turn from the first to the second is positive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct ArcGeometry {
    /// Indices of the two axes that span the plane.
    pub plane: [u32; 2],
    /// Centre in the plane, mm.
    pub center_mm: [f64; 2],
    /// Radius, mm. Start and end lie on the circle to rounding: the interpreter moves the centre so that they do.
    pub radius_mm: f64,
    /// Angle of the start point, rad.
    pub start_angle_rad: f64,
    /// Swept angle, rad; positive is counter-clockwise (G3). Beyond 2π for several turns.
    pub sweep_rad: f64,
}

layout!(ArcGeometry { plane, center_mm, radius_mm, start_angle_rad, sweep_rad });

/// A NURBS curve of degree `degree` over the machine's axes. Valid for the call only.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub struct NurbsGeometry {
    /// Degree, 1 to 5.
    pub degree: u32,
    /// Control points.
    pub control_points: RawSlice<AxisVector>,
    /// Weights, one a control point, positive.
    pub weights: RawSlice<f64>,
    /// Knots, non-decreasing, `control points + degree + 1` of them.
    pub knots: RawSlice<f64>,
}

layout!(NurbsGeometry { degree, control_points, weights, knots });

/// The data of a NURBS curve, owned: what outlives the call that hands over a [`NurbsGeometry`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NurbsData {
    /// Degree, 1 to 5.
    pub degree: usize,
    /// Control points, mm or rad.
    pub control_points: Vec<AxisVector>,
    /// Weights, one a control point.
    pub weights: Vec<f64>,
    /// Knots, `control points + degree + 1` of them.
    pub knots: Vec<f64>,
}

impl NurbsData {
    /// A description of this data, for a call during which it lives. Does not allocate.
    pub fn geometry(&self) -> NurbsGeometry {
        NurbsGeometry {
            degree: self.degree as u32,
            control_points: RawSlice::new(&self.control_points),
            weights: RawSlice::new(&self.weights),
            knots: RawSlice::new(&self.knots),
        }
    }
}

impl NurbsGeometry {
    /// A copy of the data. Allocates.
    ///
    /// # Safety
    /// Only during the call in which the geometry was handed over: its owner may free the data afterwards.
    pub unsafe fn to_data(&self) -> NurbsData {
        // SAFETY: passed on to the caller.
        unsafe {
            NurbsData {
                degree: self.degree as usize,
                control_points: self.control_points.as_slice().to_vec(),
                weights: self.weights.as_slice().to_vec(),
                knots: self.knots.as_slice().to_vec(),
            }
        }
    }
}

/// A block that owns its curve: what a queue of blocks holds.
#[derive(Clone, Debug)]
pub struct OwnedBlock {
    block: Block,
    curve: Option<Arc<NurbsData>>,
}

impl OwnedBlock {
    /// `block` with the data of its curve, where it has one.
    pub fn new(mut block: Block, curve: Option<Arc<NurbsData>>) -> Self {
        block.nurbs = NurbsGeometry::default();
        Self { block, curve }
    }

    /// Hands the block to `call`; the slices of its curve are valid there and no longer.
    pub fn with<T>(&self, call: impl FnOnce(&Block) -> T) -> T {
        match &self.curve {
            None => call(&self.block),
            Some(curve) => call(&Block { nurbs: curve.geometry(), ..self.block }),
        }
    }

    /// The block's plain facts, without its curve.
    pub fn facts(&self) -> &Block {
        &self.block
    }

    /// The same, to be changed.
    pub fn facts_mut(&mut self) -> &mut Block {
        &mut self.block
    }

    /// The data of its curve.
    pub fn curve(&self) -> Option<&Arc<NurbsData>> {
        self.curve.as_ref()
    }
}

/// One path element. Coordinates are machine coordinates in axis space with all offsets applied.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Block {
    /// Size of this structure in bytes.
    pub size: u32,
    /// The kind of path.
    pub kind: BlockKind,
    /// How the end of the block is passed.
    pub path_mode: PathMode,
    /// Line of the part program, from 1.
    pub line: u32,
    /// Number of the block in the run, from 0, without gaps.
    pub index: u64,
    /// Where the block starts, mm or rad.
    pub start: AxisVector,
    /// Where the block ends: the programmed position.
    pub end: AxisVector,
    /// The circle of an [`BlockKind::Arc`].
    pub arc: ArcGeometry,
    /// The curve of a [`BlockKind::Nurbs`].
    pub nurbs: NurbsGeometry,
    /// Length of the path as path speed counts it, mm (rad where only rotary axes move).
    pub length_mm: f64,
    /// Programmed feed along the path, mm/s (rad/s where only rotary axes move); for a rapid the machine's limits alone
    /// decide and this is infinite. A feed by duration (G93) is already converted.
    pub feed_mm_per_s: f64,
    /// A feed cap laid on the block by a policy, mm/s; infinite where there is none.
    pub feed_cap_mm_per_s: f64,
    /// Time constant (`TA`) in force, s; NaN where neither program nor policy gave one.
    pub time_constant_s: f64,
    /// Path tolerance in force (G64 P or a policy), mm; NaN: the machine's.
    pub path_tolerance_mm: f64,
    /// Duration of a [`BlockKind::Dwell`], s.
    pub dwell_s: f64,
    /// What ends the motion early (probing, homing); such a block starts and ends at rest. Planners need not look at it:
    /// the host marks the segments of the block.
    pub stop_on: StopOn,
    /// Sum of the offsets in force (work, G92, tool length), mm or rad: program coordinate = machine coordinate − offset.
    pub offset: AxisVector,
    /// Tool in the spindle.
    pub tool: u32,
    /// 1 where the operator's feed override applies (M48–M53), else 0.
    pub override_enabled: u32,
    /// Spindle speed commanded, rad/s; positive clockwise (M3), zero when stopped.
    pub spindle_rad_per_s: f64,
    /// What the lanes behind the axes are; none where every joint is an axis of its own. It lives as long as the process.
    pub joint_lanes: Option<&'static JointLanes>,
}

layout!(Block {
    size,
    kind,
    path_mode,
    line,
    index,
    start,
    end,
    arc,
    nurbs,
    length_mm,
    feed_mm_per_s,
    feed_cap_mm_per_s,
    time_constant_s,
    path_tolerance_mm,
    dwell_s,
    stop_on,
    offset,
    tool,
    override_enabled,
    spindle_rad_per_s,
    joint_lanes
});

impl Block {
    /// A dwell of zero duration at `position`: the blank from which readers and tests build blocks.
    pub fn at(position: AxisVector) -> Self {
        Self {
            size: size_of_contract::<Self>(),
            kind: BlockKind::Dwell,
            path_mode: PathMode::Continuous,
            line: 0,
            index: 0,
            start: position,
            end: position,
            arc: ArcGeometry::default(),
            nurbs: NurbsGeometry::default(),
            length_mm: 0.0,
            feed_mm_per_s: f64::INFINITY,
            feed_cap_mm_per_s: f64::INFINITY,
            time_constant_s: f64::NAN,
            path_tolerance_mm: f64::NAN,
            dwell_s: 0.0,
            stop_on: StopOn::default(),
            offset: AxisVector::ZERO,
            tool: 0,
            override_enabled: 1,
            spindle_rad_per_s: 0.0,
            joint_lanes: None,
        }
    }

    /// The feed that may be driven: the programmed feed under the policy's cap, mm/s. A programmed feed that is not a
    /// number stays none.
    pub fn command_feed_mm_per_s(&self) -> f64 {
        if self.feed_cap_mm_per_s < self.feed_mm_per_s { self.feed_cap_mm_per_s } else { self.feed_mm_per_s }
    }

    /// Whether the machine must be at rest at the end of this block for the program's sake.
    pub fn ends_at_rest(&self) -> bool {
        self.path_mode == PathMode::ExactStop || self.starts_at_rest()
    }

    /// Whether the machine must be at rest at the start of this block: dwells, rapids, and motion that an input ends.
    pub fn starts_at_rest(&self) -> bool {
        matches!(self.kind, BlockKind::Dwell | BlockKind::Rapid) || self.stop_on.edge != Edge::None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motion_that_an_input_ends_stands_between_two_rests() {
        let mut block = Block { kind: BlockKind::Line, ..Block::at(AxisVector::ZERO) };
        assert!(!block.starts_at_rest() && !block.ends_at_rest());
        block.stop_on.edge = Edge::Rising;
        assert!(block.starts_at_rest() && block.ends_at_rest());
    }
}
