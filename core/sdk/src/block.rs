//! A block: one path element of a part program, in machine coordinates, with what the program says about it.

use crate::abi::layout::{layout, layout_of_enum};

use crate::{AxisVector, Edge, Slice, StopOn};

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

layout_of_enum!(BlockKind {
    Rapid,
    Line,
    Arc,
    Nurbs,
    Dwell
});

/// How exactly the path is to be followed where this block meets the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum PathMode {
    /// G64: keep moving, within [`Block::path_tolerance_mm`].
    Continuous = 0,
    /// G61 (exact path) and G61.1 (exact stop): come to rest at the end of the block.
    ExactStop = 1,
}

layout_of_enum!(PathMode {
    Continuous,
    ExactStop
});

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

layout!(ArcGeometry {
    plane,
    center_mm,
    radius_mm,
    start_angle_rad,
    sweep_rad
});

/// The curve of a [`BlockKind::Nurbs`], of degree `degree` over the machine's axes, borrowed from who hands the block over.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Curve<'a> {
    /// Degree, 1 to 5.
    pub degree: u32,
    /// Control points, mm or rad.
    pub control_points: Slice<'a, AxisVector>,
    /// Weights, one a control point, positive.
    pub weights: Slice<'a, f64>,
    /// Knots, non-decreasing, `control points + degree + 1` of them.
    pub knots: Slice<'a, f64>,
}

layout!(Curve<'a> { degree, control_points, weights, knots });

impl Curve<'_> {
    /// A copy that owns its data. Allocates.
    pub fn to_data(&self) -> NurbsData {
        NurbsData {
            degree: self.degree as usize,
            control_points: self.control_points.to_vec(),
            weights: self.weights.to_vec(),
            knots: self.knots.to_vec(),
        }
    }
}

/// The data of a NURBS curve, owned: what a queue of blocks keeps beside a block.
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
    /// The curve as it is handed over with its block. Does not allocate.
    pub fn curve(&self) -> Curve<'_> {
        Curve {
            degree: self.degree as u32,
            control_points: Slice::new(&self.control_points),
            weights: Slice::new(&self.weights),
            knots: Slice::new(&self.knots),
        }
    }
}

/// One path element: plain data. Coordinates are machine coordinates in axis space with all offsets applied. The curve of a
/// [`BlockKind::Nurbs`] goes beside it, as a [`Curve`].
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Block {
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
    /// The origin of the program in machine coordinates, mm or rad, from all that is in force (work, G92, tool length): program
    /// coordinate = machine coordinate − offset. In a rotated coordinate system (G10 L2 R) X and Y of that difference are
    /// still to be turned back by its angle, which blocks do not bear.
    pub offset: AxisVector,
    /// Tool in the spindle.
    pub tool: u32,
    /// 1 where the operator's feed override applies (M48–M53), else 0.
    pub override_enabled: u32,
    /// Spindle speed commanded, rad/s; positive clockwise (M3), zero when stopped.
    pub spindle_rad_per_s: f64,
}

layout!(Block {
    kind,
    path_mode,
    line,
    index,
    start,
    end,
    arc,
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
    spindle_rad_per_s
});

impl Block {
    /// A dwell of zero duration at `position`: the blank from which readers and tests build blocks.
    #[inline]
    pub fn at(position: AxisVector) -> Self {
        Self {
            kind: BlockKind::Dwell,
            path_mode: PathMode::Continuous,
            line: 0,
            index: 0,
            start: position,
            end: position,
            arc: ArcGeometry::default(),
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
        }
    }

    /// The feed that may be driven: the programmed feed under the policy's cap, mm/s. A programmed feed that is not a
    /// number stays none.
    pub fn command_feed_mm_per_s(&self) -> f64 {
        if self.feed_cap_mm_per_s < self.feed_mm_per_s {
            self.feed_cap_mm_per_s
        } else {
            self.feed_mm_per_s
        }
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
        let mut block = Block {
            kind: BlockKind::Line,
            ..Block::at(AxisVector::ZERO)
        };
        assert!(!block.starts_at_rest() && !block.ends_at_rest());
        block.stop_on.edge = Edge::Rising;
        assert!(block.starts_at_rest() && block.ends_at_rest());
    }
}
