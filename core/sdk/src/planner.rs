//! The planner contract: blocks in, segments out.

use crate::abi::layout::{layout, layout_of_enum};
use crate::{Axes, AxisVector, Block, Curve, JointLanes, Limits, MAX_AXES, PluginError, Segment};

/// What a planner is told when it is opened.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct PlannerContext {
    /// The machine's axes.
    pub axes: Axes,
    /// The machine's limits. They are the limits themselves: planners aim at 0.999 of them.
    pub limits: Limits,
    /// Fine period, s: the period at which limits are judged.
    pub fine_period_s: f64,
    /// Rough period, s.
    pub rough_period_s: f64,
    /// Path tolerance where a block states none, mm.
    pub path_tolerance_mm: f64,
    /// Time constant where a block states none, s.
    pub time_constant_s: f64,
    /// Highest feed ratio that can be asked while running; blocks are planned at this multiple of their feed.
    pub max_feed_ratio: f64,
    /// Where the machine stands.
    pub position: AxisVector,
    /// The joints that are sums of axes, where there are any: what stands behind the axes in `limits` and in vectors.
    pub joint_lanes: Option<&'static JointLanes>,
}

layout!(PlannerContext {
    axes,
    limits,
    fine_period_s,
    rough_period_s,
    path_tolerance_mm,
    time_constant_s,
    max_feed_ratio,
    position,
    joint_lanes
});

impl PlannerContext {
    /// The same machine for a planner that looks at one axis at a time, and not at what stands behind the axes: the limits
    /// of the axes alone, and so narrow that every joint keeps its own, in whatever way the axes move. Along one axis that
    /// wastes what a joint has left: half of it on a `CoreXY` machine. Host and rough loop; does not allocate.
    #[must_use]
    pub fn axis_by_axis(&self) -> Self {
        let limits = self
            .joint_lanes
            .map_or(self.limits, |lanes| lanes.narrowed(&self.limits));
        Self {
            limits,
            joint_lanes: None,
            ..*self
        }
    }
}

/// What a planner says of itself, once, after it is opened.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct PlannerDescription {
    /// Order of the limits that it keeps: 2 velocity and acceleration, 3 also jerk.
    pub order: u32,
    /// Allowable speed difference that it makes use of, per axis, mm/s: zero for continuous velocity. Judge and guard
    /// allow no more than this.
    pub speed_difference_mm_per_s: [f64; MAX_AXES],
    /// 1 where this form breaks limits on purpose, as published: simulated drives with `guard.mode = "count"` only.
    pub breaks_limits: u32,
    /// 1 where the path left is not the path programmed (filters behind the interpolation, corner rounding).
    pub leaves_path: u32,
    /// 1 where [`Block::time_constant_s`] decides how a block is driven. For other planners the host says once that `TA`
    /// has no effect.
    pub uses_time_constants: u32,
}

layout!(PlannerDescription {
    order,
    speed_difference_mm_per_s,
    breaks_limits,
    leaves_path,
    uses_time_constants
});

impl PlannerDescription {
    /// A planner that keeps velocity and acceleration limits, continuous in velocity, on the path.
    pub fn order_2() -> Self {
        Self {
            order: 2,
            speed_difference_mm_per_s: [0.0; MAX_AXES],
            breaks_limits: 0,
            leaves_path: 0,
            uses_time_constants: 0,
        }
    }
}

/// Whether a block was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Accepted {
    /// Taken.
    Accepted = 0,
    /// The buffer is full: `advance`, then offer the same block again.
    Full = 1,
}

layout_of_enum!(Accepted { Accepted, Full });

/// How far `advance` came.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Advanced {
    /// Program time emitted by this call, s.
    pub duration_s: f64,
    /// 1 where all accepted blocks are emitted (and `finish` was called): the plan is at rest.
    pub done: u32,
}

layout!(Advanced { duration_s, done });

/// What held a block's feed down most.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum LimitedBy {
    /// The programmed feed (or the rapid feed) was reached.
    #[default]
    Feed = 0,
    /// Too short to reach it: acceleration from and to the ends.
    Acceleration = 1,
    /// Curvature of the path.
    Curvature = 2,
    /// The junctions at the ends.
    Junction = 3,
    /// An axis speed limit.
    Velocity = 4,
    /// So short that at its feed more blocks would pass in a fine period than one can drive.
    Buffer = 5,
    /// The time constant.
    TimeConstant = 6,
    /// The path tolerance.
    Tolerance = 7,
    /// Jerk.
    Jerk = 8,
    /// A policy's cap.
    Policy = 9,
}

layout_of_enum!(LimitedBy {
    Feed,
    Acceleration,
    Curvature,
    Junction,
    Velocity,
    Buffer,
    TimeConstant,
    Tolerance,
    Jerk,
    Policy,
});

/// How a block is driven; becomes a row of the blocks CSV.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct BlockReport {
    /// What held the feed down.
    pub limited_by: LimitedBy,
    /// Index of the block.
    pub block: u64,
    /// Feed at the start, mm/s.
    pub start_feed_mm_per_s: f64,
    /// Highest feed inside, mm/s.
    pub peak_feed_mm_per_s: f64,
    /// Feed at the end, mm/s.
    pub end_feed_mm_per_s: f64,
    /// Duration, s.
    pub time_s: f64,
    /// Time constant used, s; NaN for planners that know none.
    pub time_constant_s: f64,
}

layout!(BlockReport {
    limited_by,
    block,
    start_feed_mm_per_s,
    peak_feed_mm_per_s,
    end_feed_mm_per_s,
    time_s,
    time_constant_s
});

/// Takes what a planner emits.
pub trait SegmentSink {
    /// The next segment, in order of program time.
    fn segment(&mut self, segment: &Segment);
    /// A block is planned for good: called once a block, before its first segment.
    fn block(&mut self, report: &BlockReport);
}

/// Turns blocks into motion. All methods are called on the rough loop.
///
/// The life of a planner: opened at rest at [`PlannerContext::position`]; then `accept` until it says
/// [`Accepted::Full`] or the program ends (`finish`), `advance` by rough periods until done; then `accept` again (a new
/// stretch of program) or `reset`. In a steady state no method allocates.
///
/// Where somebody sends the blocks while they are driven, `advance` is also called while there is room for the next one, which has
/// not come yet: then the planner emits what does not depend on it, which may be nothing, and `accept` or `finish` follows.
///
/// What has been emitted can always be brought to rest on the path by the fine loop: each segment declares the path
/// deceleration it leaves ([`Segment::stop_deceleration_mm_per_s2`]).
pub trait Planner: Send {
    /// What it keeps and what it does not.
    fn describe(&self) -> PlannerDescription;

    /// Whether this planner can drive `block`, along `curve` where that is a NURBS. Pure: the first pass asks for every block before anything moves.
    ///
    /// # Errors
    /// Why not.
    fn check(&self, block: &Block, curve: Option<Curve<'_>>) -> Result<(), PluginError>;

    /// Takes the next block, with its curve where it is a NURBS. Blocks follow each other: `start` is the `end` of the one before.
    ///
    /// # Errors
    /// A block that `check` refuses.
    fn accept(&mut self, block: &Block, curve: Option<Curve<'_>>) -> Result<Accepted, PluginError>;

    /// No block follows for now: what is buffered ends at rest.
    fn finish(&mut self);

    /// Emits at least `duration_s` of program time (or all there is), cutting the last segment at `duration_s`.
    ///
    /// # Errors
    /// A defect of the planner: the machine comes to a controlled stop and names it.
    fn advance(
        &mut self,
        duration_s: f64,
        sink: &mut dyn SegmentSink,
    ) -> Result<Advanced, PluginError>;

    /// Forgets everything; the machine rests at `position`. Path coordinates begin at zero again.
    fn reset(&mut self, position: &AxisVector);
}
