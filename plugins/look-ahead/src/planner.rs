//! The planner itself: blocks in, segments out.

use tandem_motion::blocks::{self, BlockId, BlockWriter};
use tandem_sdk::{
    Accepted, Advanced, AxisVector, Block, BlockKind, Curve, MAX_AXES, Planner, PlannerContext,
    PlannerDescription, PluginError, Segment, SegmentSink,
};

use crate::buffer::Buffer;
use crate::drive::{Drive, begin};
use crate::geometry::FeedCaps;
use crate::junction::Rule;
use crate::options::{Junction, Options};
use crate::plan::Plan;

/// Largest buffer, blocks: about a gigabyte.
const MAX_BUFFER_BLOCKS: usize = 1_000_000;

/// Most blocks that are driven in one fine period; each has up to three segments and the fine loop looks at 64.
const BLOCKS_PER_FINE_PERIOD: f64 = 16.0;

/// The look-ahead planner.
#[derive(Debug)]
pub struct LookAhead {
    context: PlannerContext,
    options: Options,
    rule: Rule,
    max_blocks_per_s: f64,
    feed_axis_mm_per_s: Vec<f64>,
    rapid_axis_mm_per_s: Vec<f64>,
    buffer: Buffer,
    writer: BlockWriter,
    /// Whether `drive` drives a block.
    driving: bool,
    drive: Drive,
    /// The segment that goes out: written over and over, because it is large.
    segment: Segment,
    path_mm: f64,
    /// Speed at the end of the last block taken, mm/s.
    speed_mm_per_s: f64,
    finished: bool,
}

impl LookAhead {
    /// A planner at rest. Allocates its buffer for good.
    ///
    /// # Errors
    /// A buffer of fewer than two blocks, or beyond reason.
    pub fn new(options: &Options, context: &PlannerContext) -> Result<Self, PluginError> {
        if !(2..=MAX_BUFFER_BLOCKS).contains(&options.buffer_blocks) {
            let asked = options.buffer_blocks;
            let range = format!("{asked}: must be from 2 to {MAX_BUFFER_BLOCKS}");
            return Err(PluginError::of_option("buffer_blocks", range));
        }
        let axes = context.limits.axes();
        Ok(Self {
            context: *context,
            max_blocks_per_s: BLOCKS_PER_FINE_PERIOD / context.fine_period_s,
            rule: Rule::new(options.junction, &context.axes, axes, context.fine_period_s),
            feed_axis_mm_per_s: axes.iter().map(|a| a.feed_mm_per_s).collect(),
            rapid_axis_mm_per_s: axes.iter().map(|a| a.rapid_mm_per_s).collect(),
            buffer: Buffer::new(options.buffer_blocks),
            writer: BlockWriter::new(2),
            driving: false,
            drive: Drive::default(),
            segment: Segment::rest(&AxisVector::ZERO, 0.0),
            path_mm: 0.0,
            speed_mm_per_s: 0.0,
            finished: false,
            options: options.clone(),
        })
    }

    /// Takes the next block out of the buffer; `false` where there is none.
    fn start_block(&mut self, sink: &mut dyn SegmentSink) -> bool {
        let Some(taken) = self.buffer.pop() else {
            return false;
        };
        let entry = self.buffer.entry(&taken);
        let Some(path) = &entry.path else {
            let id = BlockId {
                index: entry.index,
                line: entry.line,
            };
            let (position, duration_s) = entry.dwell;
            self.writer
                .begin_dwell(id, &position, duration_s, self.path_mm, sink);
            return true;
        };
        let half_step = self.buffer.end_half_step(&taken);
        let plan = Plan::new(
            entry,
            half_step,
            taken.squares,
            self.speed_mm_per_s,
            self.options.junction,
        );
        self.speed_mm_per_s = plan.profile.end_mm_per_s;
        sink.block(&plan.report(entry));
        begin(&mut self.segment, entry, &plan);
        self.drive.start(taken, path, &plan, self.path_mm);
        self.driving = true;
        true
    }

    fn emit(&mut self, duration_s: f64, sink: &mut dyn SegmentSink) -> Option<f64> {
        if self.driving {
            let entry = self.buffer.entry(self.drive.taken());
            let Some(path) = &entry.path else {
                unreachable!("a dwell is not driven")
            };
            let (emitted_s, over) = self
                .drive
                .advance(path, duration_s, &mut self.segment, sink);
            if over {
                self.path_mm += path.length_mm();
                self.driving = false;
            }
            return Some(emitted_s);
        }
        if let Some(emitted_s) = self.writer.emit_dwell(duration_s, sink) {
            return Some(emitted_s);
        }
        self.start_block(sink).then_some(0.0)
    }
}

impl Planner for LookAhead {
    fn describe(&self) -> PlannerDescription {
        let mut description = PlannerDescription::order_2();
        let axes = self.context.limits.axes();
        for (step, axis) in description.speed_difference_mm_per_s[..MAX_AXES]
            .iter_mut()
            .zip(axes)
        {
            *step = axis.speed_difference_mm_per_s;
        }
        description.breaks_limits = u32::from(self.options.junction == Junction::Tangent);
        description
    }

    fn check(&self, block: &Block, _curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        if block.kind == BlockKind::Nurbs {
            return Err(PluginError::fixed(
                "the look-ahead planner drives lines and arcs; for NURBS use planner nurbs",
            ));
        }
        blocks::check(block, &self.context.axes)
    }

    fn accept(&mut self, block: &Block, curve: Option<Curve<'_>>) -> Result<Accepted, PluginError> {
        if self.buffer.is_full() {
            return Ok(Accepted::Full);
        }
        self.check(block, curve)?;
        self.finished = false;
        let rapid = block.kind == BlockKind::Rapid;
        let axes = if rapid {
            &self.rapid_axis_mm_per_s
        } else {
            &self.feed_axis_mm_per_s
        };
        let caps = FeedCaps {
            feed_ratio: self.context.max_feed_ratio,
            axis_mm_per_s: axes,
            joint_lanes: self.context.joint_lanes,
            max_blocks_per_s: self.max_blocks_per_s,
        };
        self.buffer
            .push(&self.rule, |entry| entry.set(block, &caps));
        Ok(Accepted::Accepted)
    }

    fn finish(&mut self) {
        self.buffer.finish(&self.rule);
        self.finished = true;
    }

    fn advance(
        &mut self,
        duration_s: f64,
        sink: &mut dyn SegmentSink,
    ) -> Result<Advanced, PluginError> {
        let mut emitted_s = 0.0;
        let had_room = !self.buffer.is_full();
        while emitted_s < duration_s {
            // A block that a full buffer could end faster waits for it, so that its end does not depend on how much is asked for at
            // once, nor on when blocks come.
            let between = !self.driving && !self.writer.is_dwelling();
            let waits = had_room || emitted_s > 0.0;
            if waits && between && !self.finished && self.buffer.would_gain() {
                break;
            }
            match self.emit(duration_s - emitted_s, sink) {
                Some(part_s) => emitted_s += part_s,
                None => break,
            }
        }
        let empty = self.buffer.len() == 0 && !self.driving && !self.writer.is_dwelling();
        Ok(Advanced {
            duration_s: emitted_s,
            done: u32::from(empty && self.finished),
        })
    }

    fn reset(&mut self, position: &AxisVector) {
        self.context.position = *position;
        self.buffer.clear();
        self.writer.reset();
        self.driving = false;
        self.path_mm = 0.0;
        self.speed_mm_per_s = 0.0;
        self.finished = false;
    }
}
