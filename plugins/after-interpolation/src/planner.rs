//! The planner itself: blocks in, filtered motion out.

use std::collections::VecDeque;

use tandem_motion::Path;
use tandem_sdk::{
    Accepted, Advanced, AxisVector, Block, BlockKind, BlockReport, LimitedBy, Planner, PlannerContext,
    PlannerDescription, PluginError, Segment, SegmentFlags, SegmentSink, size_of_contract,
};

use crate::motion::{Motion, without_begin};
use crate::options::Options;

/// Most blocks that wait to be driven. The filter does not look ahead, so there is no use in more.
pub const BUFFER_BLOCKS: usize = 256;

/// Share of an axis limit that a feed may reach.
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
    /// What is left of a dwell.
    dwell: Option<Segment>,
    finished: bool,
}

impl AfterInterpolation {
    /// A planner at rest. Allocates its buffers.
    ///
    /// # Errors
    /// A machine with a speed or acceleration limit that is no positive number.
    pub fn new(options: &Options, context: &PlannerContext) -> Result<Self, PluginError> {
        let axes = context.limits.axes();
        let values = axes.iter().flat_map(|a| [a.feed_mm_per_s, a.rapid_mm_per_s, a.acceleration_mm_per_s2]);
        if !values.into_iter().all(|value| value > 0.0 && value.is_finite()) {
            return Err(PluginError::fixed(
                "after-interpolation needs finite speed and acceleration limits of all axes",
            ));
        }
        Ok(Self {
            context: *context,
            waiting: VecDeque::with_capacity(BUFFER_BLOCKS),
            motion: Motion::new(options, context),
            dwell: None,
            finished: false,
        })
    }

    /// Blocks and rests held: those waiting and those that the filter still sees.
    pub fn held(&self) -> usize {
        self.waiting.len() + self.motion.held()
    }

    /// Begins the next block; `false` where there is none, or it is not known yet whether it stops.
    fn begin(&mut self, sink: &mut dyn SegmentSink) -> bool {
        let Some(Waiting { block, stops: Some(stops) }) = self.waiting.front().copied() else { return false };
        self.waiting.pop_front();
        match Path::new(&block) {
            Some(path) => self.begin_motion(&block, &path, stops, sink),
            None => self.begin_dwell(&block, sink),
        }
        true
    }

    fn begin_motion(&mut self, block: &Block, path: &Path, stops: bool, sink: &mut dyn SegmentSink) {
        let (feed, limited_by) = self.feed_mm_per_s(block, path);
        let time_s = self.motion.begin(&self.blank(block), path, feed, stops);
        sink.block(&BlockReport { limited_by, ..self.report(block, feed, time_s) });
    }

    fn begin_dwell(&mut self, block: &Block, sink: &mut dyn SegmentSink) {
        let mut rest = Segment::rest(&block.end, block.dwell_s);
        (rest.block, rest.line) = (block.index, block.line);
        rest.path[0] = self.motion.path_mm();
        rest.flags = rest.flags.with(SegmentFlags::DWELL).with(SegmentFlags::BLOCK_BEGINS);
        self.dwell = Some(rest);
        sink.block(&BlockReport { time_constant_s: f64::NAN, ..self.report(block, 0.0, block.dwell_s) });
    }

    fn report(&self, block: &Block, feed_mm_per_s: f64, time_s: f64) -> BlockReport {
        BlockReport {
            size: size_of_contract::<BlockReport>(),
            limited_by: LimitedBy::Feed,
            block: block.index,
            start_feed_mm_per_s: feed_mm_per_s,
            peak_feed_mm_per_s: feed_mm_per_s,
            end_feed_mm_per_s: feed_mm_per_s,
            time_s,
            time_constant_s: self.motion.time_constant_s(),
        }
    }

    /// The feed of a block's step, mm/s: the command at the highest ratio that may be asked, within the axis speeds.
    fn feed_mm_per_s(&self, block: &Block, path: &Path) -> (f64, LimitedBy) {
        let limits = self.context.limits.along(&block.start, &path.max_direction());
        if block.kind == BlockKind::Rapid {
            return (AIM * limits.rapid_mm_per_s, LimitedBy::Feed);
        }
        let asked = block.command_feed_mm_per_s() * self.context.max_feed_ratio;
        let most = AIM * limits.feed_mm_per_s;
        if asked > most {
            return (most, LimitedBy::Velocity);
        }
        let capped = block.feed_cap_mm_per_s < block.feed_mm_per_s;
        (asked, if capped { LimitedBy::Policy } else { LimitedBy::Feed })
    }

    fn blank(&self, block: &Block) -> Segment {
        let mut blank = Segment::rest(&block.start, 0.0);
        (blank.block, blank.line) = (block.index, block.line);
        blank.flags = SegmentFlags::BLOCK_BEGINS;
        if block.kind == BlockKind::Rapid {
            blank.flags = blank.flags.with(SegmentFlags::RAPID);
        } else {
            blank.feed_mm_per_s = block.command_feed_mm_per_s();
        }
        let axes = self.context.limits.axes();
        let weakest = axes.iter().map(|axis| axis.acceleration_mm_per_s2).fold(f64::INFINITY, f64::min);
        // A path deceleration that no axis exceeds, whatever the direction. The plan's own accelerations follow from feed
        // and time constant and leave nothing by design; this one serves simulated drives only.
        blank.stop_deceleration_mm_per_s2 = weakest;
        blank
    }

    /// Emits the next piece, at most `left_s` long; `None` where nothing can be emitted for now.
    fn emit(&mut self, left_s: f64, sink: &mut dyn SegmentSink) -> Option<f64> {
        if let Some(rest) = self.dwell.take() {
            return Some(self.emit_dwell(rest, left_s, sink));
        }
        if let Some(segment) = self.motion.emit(left_s) {
            sink.segment(&segment);
            return Some(segment.duration_s);
        }
        self.begin(sink).then_some(0.0)
    }

    fn emit_dwell(&mut self, mut rest: Segment, left_s: f64, sink: &mut dyn SegmentSink) -> f64 {
        // What is left may be lost in rounding beside the dwell: the part comes from it, not from a difference.
        let part_s = rest.duration_s.min(left_s);
        let later_s = rest.duration_s - part_s;
        rest.duration_s = part_s;
        if later_s > 0.0 {
            self.dwell = Some(Segment { duration_s: later_s, flags: without_begin(rest.flags), ..rest });
        } else {
            rest.flags = rest.flags.with(SegmentFlags::BLOCK_ENDS);
        }
        sink.segment(&rest);
        rest.duration_s
    }
}

impl Planner for AfterInterpolation {
    fn describe(&self) -> PlannerDescription {
        PlannerDescription { breaks_limits: 1, leaves_path: 1, ..PlannerDescription::order_2() }
    }

    fn check(&self, block: &Block) -> Result<(), PluginError> {
        let refuse = |why| Err(PluginError::fixed(why));
        let axes = self.context.axes.count() as u32;
        let sound = block.start.is_finite() && block.end.is_finite();
        match block.kind {
            BlockKind::Nurbs => refuse("after-interpolation drives lines and arcs; for NURBS use planner nurbs"),
            BlockKind::Dwell if !(sound && block.dwell_s >= 0.0 && block.dwell_s.is_finite()) => {
                refuse("a dwell needs a place and a duration of zero or more")
            }
            BlockKind::Dwell => Ok(()),
            BlockKind::Arc if !block.arc.plane.iter().all(|axis| *axis < axes) => {
                refuse("an arc lies in a plane of axes that the machine lacks")
            }
            _ if !(sound && block.length_mm > 0.0 && block.length_mm.is_finite()) => {
                refuse("a block needs two ends and a length above zero")
            }
            // Both asked, because the smaller of a number and NaN is the number.
            _ if block.feed_mm_per_s > 0.0 && block.feed_cap_mm_per_s > 0.0 => Ok(()),
            _ => refuse("a block needs a feed above zero"),
        }
    }

    fn accept(&mut self, block: &Block) -> Result<Accepted, PluginError> {
        self.check(block)?;
        if self.waiting.len() >= BUFFER_BLOCKS {
            return Ok(Accepted::Full);
        }
        if let Some(Waiting { stops: stops @ None, .. }) = self.waiting.back_mut() {
            *stops = Some(block.starts_at_rest());
        }
        let stops = block.ends_at_rest().then_some(true);
        self.waiting.push_back(Waiting { block: *block, stops });
        self.finished = false;
        Ok(Accepted::Accepted)
    }

    fn finish(&mut self) {
        if let Some(last) = self.waiting.back_mut() {
            last.stops = Some(true);
        }
        self.finished = true;
    }

    fn advance(&mut self, duration_s: f64, sink: &mut dyn SegmentSink) -> Result<Advanced, PluginError> {
        let mut emitted_s = 0.0;
        while emitted_s < duration_s {
            match self.emit(duration_s - emitted_s, sink) {
                Some(part_s) => emitted_s += part_s,
                None => break,
            }
        }
        let empty = self.waiting.is_empty() && !self.motion.is_driving() && self.dwell.is_none();
        Ok(Advanced { duration_s: emitted_s, done: u32::from(empty && self.finished) })
    }

    fn reset(&mut self, position: &AxisVector) {
        self.waiting.clear();
        self.motion.reset(position);
        (self.dwell, self.finished) = (None, false);
    }
}
