//! The planner itself: blocks in, filtered motion out.

use std::collections::VecDeque;

use tandem_motion::Path;
use tandem_motion::blocks::{self, BlockId, BlockWriter, limited_by_feed};
use tandem_sdk::{
    Accepted, Advanced, AxisVector, Block, BlockKind, BlockReport, Curve, LimitedBy, Planner,
    PlannerContext, PlannerDescription, PluginError, Segment, SegmentSink,
};

use crate::motion::Motion;
use crate::options::Options;

/// Most blocks that wait to be driven. The filter does not look ahead, so there is no use in more.
pub const BUFFER_BLOCKS: usize = 256;

/// Share of an axis limit that a feed may reach. With half and with twice as much a rapid is not at the limits of its axes
/// (`blocks_are_planned_at_the_highest_ratio_and_within_axis_speeds`).
const AIM: f64 = 0.999;

/// A block that has not begun.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    block: Block,
    /// Whether the machine rests after it; unknown until the next block or the end of the program is seen.
    stops: Option<bool>,
}

/// The planner: command feeds as steps, then one filter per axis. Rough loop; in a steady state nothing allocates, and
/// it holds at most [`BUFFER_BLOCKS`] blocks and those that the filter looks back on.
#[derive(Debug)]
pub struct AfterInterpolation {
    context: PlannerContext,
    waiting: VecDeque<Waiting>,
    motion: Motion,
    writer: BlockWriter,
    finished: bool,
}

impl AfterInterpolation {
    /// A planner at rest. Allocates its buffers.
    ///
    /// # Errors
    /// A machine with a speed or acceleration limit that is no positive number.
    pub fn new(options: &Options, context: &PlannerContext) -> Result<Self, PluginError> {
        let axes = context.limits.axes();
        let values = axes
            .iter()
            .flat_map(|a| [a.feed_mm_per_s, a.rapid_mm_per_s, a.acceleration_mm_per_s2]);
        if !values
            .into_iter()
            .all(|value| value > 0.0 && value.is_finite())
        {
            return Err(PluginError::fixed(
                "after-interpolation needs finite speed and acceleration limits of all axes",
            ));
        }
        Ok(Self {
            context: *context,
            waiting: VecDeque::with_capacity(BUFFER_BLOCKS),
            motion: Motion::new(options, context),
            writer: BlockWriter::new(2),
            finished: false,
        })
    }

    /// Blocks and rests held: those waiting and those that the filter still sees.
    pub fn held(&self) -> usize {
        self.waiting.len() + self.motion.held()
    }

    /// Begins the next block; `false` where there is none, or it is not known yet whether it stops.
    fn begin(&mut self, sink: &mut dyn SegmentSink) -> bool {
        let Some(Waiting {
            block,
            stops: Some(stops),
        }) = self.waiting.front().copied()
        else {
            return false;
        };
        self.waiting.pop_front();
        if let Some(path) = Path::with_lanes(&block, self.context.joint_lanes) {
            self.begin_motion(&block, &path, stops, sink);
        } else {
            let path_mm = self.motion.path_mm();
            self.writer.begin_dwell(
                BlockId::from(&block),
                &block.end,
                block.dwell_s,
                path_mm,
                sink,
            );
        }
        true
    }

    fn begin_motion(
        &mut self,
        block: &Block,
        path: &Path,
        stops: bool,
        sink: &mut dyn SegmentSink,
    ) {
        let (feed, limited_by) = self.feed_mm_per_s(block, path);
        let time_s = self.motion.begin(&self.blank(block), path, feed, stops);
        let report = blocks::report(block.index, limited_by, [feed; 3], time_s);
        sink.block(&BlockReport {
            time_constant_s: self.motion.time_constant_s(),
            ..report
        });
    }

    /// The feed of a block's step, mm/s: the command at the highest ratio that may be asked, within the axis speeds.
    fn feed_mm_per_s(&self, block: &Block, path: &Path) -> (f64, LimitedBy) {
        let limits = self.context.limits.along(&path.max_direction());
        if block.kind == BlockKind::Rapid {
            return (AIM * limits.rapid_mm_per_s, LimitedBy::Feed);
        }
        let asked = block.command_feed_mm_per_s() * self.context.max_feed_ratio;
        let most = AIM * limits.feed_mm_per_s;
        if asked > most {
            return (most, LimitedBy::Velocity);
        }
        (asked, limited_by_feed(block))
    }

    fn blank(&self, block: &Block) -> Segment {
        let mut blank = self.writer.blank(block);
        let axes = self.context.limits.axes();
        let weakest = axes
            .iter()
            .map(|axis| axis.acceleration_mm_per_s2)
            .fold(f64::INFINITY, f64::min);
        // A path deceleration that no axis exceeds, whatever the direction. The plan's own accelerations follow from feed
        // and time constant and leave nothing by design; this one serves simulated drives only.
        blank.stop_deceleration_mm_per_s2 = weakest;
        blank
    }

    /// Emits the next piece, at most `left_s` long; `None` where nothing can be emitted for now.
    fn emit(&mut self, left_s: f64, sink: &mut dyn SegmentSink) -> Option<f64> {
        if let Some(emitted_s) = self.writer.emit_dwell(left_s, sink) {
            return Some(emitted_s);
        }
        if let Some(segment) = self.motion.emit(left_s) {
            sink.segment(&segment);
            return Some(segment.duration_s);
        }
        self.begin(sink).then_some(0.0)
    }
}

impl Planner for AfterInterpolation {
    fn describe(&self) -> PlannerDescription {
        PlannerDescription {
            breaks_limits: 1,
            leaves_path: 1,
            ..PlannerDescription::order_2()
        }
    }

    fn check(&self, block: &Block, _curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        if block.kind == BlockKind::Nurbs {
            return Err(PluginError::fixed(
                "after-interpolation drives lines and arcs; for NURBS use planner nurbs",
            ));
        }
        blocks::check(block, &self.context.axes)
    }

    fn accept(&mut self, block: &Block, curve: Option<Curve<'_>>) -> Result<Accepted, PluginError> {
        self.check(block, curve)?;
        if self.waiting.len() >= BUFFER_BLOCKS {
            return Ok(Accepted::Full);
        }
        if let Some(Waiting {
            stops: stops @ None,
            ..
        }) = self.waiting.back_mut()
        {
            *stops = Some(block.starts_at_rest());
        }
        let stops = block.ends_at_rest().then_some(true);
        self.waiting.push_back(Waiting {
            block: *block,
            stops,
        });
        self.finished = false;
        Ok(Accepted::Accepted)
    }

    fn finish(&mut self) {
        if let Some(last) = self.waiting.back_mut() {
            last.stops = Some(true);
        }
        self.finished = true;
    }

    fn advance(
        &mut self,
        duration_s: f64,
        sink: &mut dyn SegmentSink,
    ) -> Result<Advanced, PluginError> {
        let mut emitted_s = 0.0;
        while emitted_s < duration_s {
            match self.emit(duration_s - emitted_s, sink) {
                Some(part_s) => emitted_s += part_s,
                None => break,
            }
        }
        let empty =
            self.waiting.is_empty() && !self.motion.is_driving() && !self.writer.is_dwelling();
        Ok(Advanced {
            duration_s: emitted_s,
            done: u32::from(empty && self.finished),
        })
    }

    fn reset(&mut self, position: &AxisVector) {
        self.waiting.clear();
        self.motion.reset(position);
        self.writer.reset();
        self.finished = false;
    }
}
