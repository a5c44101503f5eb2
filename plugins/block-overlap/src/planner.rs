//! The planner itself: blocks in, segments out.

use tandem_motion::blocks::{self, BlockWriter};
use tandem_sdk::{
    Accepted, Advanced, AxisVector, Block, BlockKind, BlockReport, Curve, Planner, PlannerContext,
    PlannerDescription, PluginError, SegmentSink,
};

use crate::buffer::{Buffer, Taken};
use crate::drive::Drive;
use crate::mover::Mover;
use crate::options::{CornerControl, LimitMode, Options};
use crate::reason::limited_by;
use crate::rules::Rules;

/// Largest buffer, blocks: about a gigabyte.
const MAX_BUFFER_BLOCKS: usize = 1_000_000;

/// Program time that is nothing, s.
const NOTHING_S: f64 = 1e-12;

/// The block-overlap planner.
#[derive(Debug)]
pub struct BlockOverlap {
    context: PlannerContext,
    options: Options,
    rules: Rules,
    buffer: Buffer,
    drive: Drive,
    writer: BlockWriter,
    /// Speed along the path at the start of the next block, mm/s.
    start_mm_per_s: f64,
    /// Time constant of the last block with motion, s: the next one speeds up with it.
    last_tau_s: f64,
    /// The time constant last stated, and the same on a tick, s.
    stated_s: f64,
    on_tick_s: f64,
    finished: bool,
}

impl BlockOverlap {
    /// A planner at rest. Allocates its buffer for good.
    ///
    /// # Errors
    /// A buffer of fewer than four blocks, or beyond reason; no time constant.
    pub fn new(options: &Options, context: &PlannerContext) -> Result<Self, PluginError> {
        if !(4..=MAX_BUFFER_BLOCKS).contains(&options.buffer_blocks) {
            let asked = options.buffer_blocks;
            let most = MAX_BUFFER_BLOCKS;
            return Err(PluginError::new(format!(
                "buffer_blocks = {asked}: from 4 to {most}"
            )));
        }
        if !(context.time_constant_s > 0.0 && context.time_constant_s.is_finite()) {
            return Err(PluginError::fixed(
                "block-overlap needs motion.time_constant_ms above zero",
            ));
        }
        let rules = Rules::new(options, context);
        let tau_s = rules.on_tick_s(context.time_constant_s);
        Ok(Self {
            context: *context,
            options: options.clone(),
            buffer: Buffer::new(options.buffer_blocks, tau_s),
            drive: Drive::new(rules.axes),
            rules,
            writer: BlockWriter::new(2),
            start_mm_per_s: 0.0,
            last_tau_s: tau_s,
            stated_s: context.time_constant_s,
            on_tick_s: tau_s,
            finished: false,
        })
    }

    /// The time constant of a block, on a tick, s. Most blocks state the one of the block before.
    fn tau_s(&mut self, block: &Block) -> f64 {
        let stated = block.time_constant_s;
        let stated_s = if stated.is_nan() {
            self.context.time_constant_s
        } else {
            stated
        };
        if stated_s != self.stated_s {
            self.stated_s = stated_s;
            self.on_tick_s = self.rules.on_tick_s(stated_s);
        }
        self.on_tick_s
    }

    /// Takes the next block out of the buffer; `false` where there is none.
    fn begin(&mut self, sink: &mut dyn SegmentSink) -> bool {
        let Some(taken) = self.buffer.pop(&self.rules) else {
            return false;
        };
        let entry = self.buffer.ring().numbered(taken.number);
        let Some(mover) = Mover::new(&self.rules, entry, &taken) else {
            self.writer.begin_dwell(
                entry.id(),
                &entry.end,
                entry.dwell_s,
                self.drive.path_mm(),
                sink,
            );
            return true;
        };
        let time_s = mover.end() * self.rules.tick_s - taken.join.overlap_s;
        let end_mm_per_s = passing(
            taken.next_feed_mm_per_s,
            taken.join.overlap_s,
            taken.join.up_s,
        );
        let limited_by = limited_by(
            &self.rules,
            entry,
            self.buffer.ring().numbered(taken.number + 1),
            &taken,
        );
        let feeds_mm_per_s = [self.start_mm_per_s, taken.feed_mm_per_s, end_mm_per_s];
        let report = blocks::report(entry.index, limited_by, feeds_mm_per_s, time_s);
        sink.block(&BlockReport {
            time_constant_s: constant_s(&taken),
            ..report
        });
        self.start_mm_per_s = passing(taken.feed_mm_per_s, taken.join.overlap_s, taken.join.down_s);
        self.drive.start(mover, &taken);
        true
    }

    /// Emits the next piece, at most `left_s` long; `None` where nothing can be emitted for now.
    fn emit(&mut self, left_s: f64, sink: &mut dyn SegmentSink) -> Option<f64> {
        if let Some(emitted_s) = self.writer.emit_dwell(left_s, sink) {
            return Some(emitted_s);
        }
        if self.drive.wants_next() {
            return self.begin(sink).then_some(0.0);
        }
        Some(
            self.drive
                .step(self.buffer.ring(), left_s / self.rules.tick_s, sink)
                * self.rules.tick_s,
        )
    }
}

impl Planner for BlockOverlap {
    fn describe(&self) -> PlannerDescription {
        PlannerDescription {
            breaks_limits: u32::from(self.options.limits == LimitMode::Off),
            leaves_path: u32::from(self.options.corner_control == CornerControl::Off),
            uses_time_constants: 1,
            ..PlannerDescription::order_2()
        }
    }

    fn check(&self, block: &Block, _curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        if block.kind == BlockKind::Nurbs {
            return Err(PluginError::fixed(
                "block-overlap drives lines and arcs; for NURBS use planner nurbs",
            ));
        }
        blocks::check(block, &self.context.axes)?;
        let constant_s = block.time_constant_s;
        if block.kind != BlockKind::Dwell && (constant_s <= 0.0 || constant_s.is_infinite()) {
            return Err(PluginError::fixed("a time constant is above zero"));
        }
        Ok(())
    }

    fn accept(&mut self, block: &Block, curve: Option<Curve<'_>>) -> Result<Accepted, PluginError> {
        if self.buffer.is_full() {
            return Ok(Accepted::Full);
        }
        self.check(block, curve)?;
        self.finished = false;
        let taus_s = [self.last_tau_s, self.tau_s(block)];
        let rules = &self.rules;
        self.buffer
            .push(rules, |entry| entry.set(block, rules, taus_s));
        if block.kind != BlockKind::Dwell {
            self.last_tau_s = taus_s[1];
        }
        Ok(Accepted::Accepted)
    }

    fn finish(&mut self) {
        self.buffer.finish();
        self.finished = true;
    }

    fn advance(
        &mut self,
        duration_s: f64,
        sink: &mut dyn SegmentSink,
    ) -> Result<Advanced, PluginError> {
        let mut emitted_s = 0.0;
        while duration_s - emitted_s > NOTHING_S {
            match self.emit(duration_s - emitted_s, sink) {
                Some(part_s) => emitted_s += part_s,
                None => break,
            }
        }
        let empty = self.buffer.is_empty() && !self.drive.is_moving() && !self.writer.is_dwelling();
        Ok(Advanced {
            duration_s: emitted_s,
            done: u32::from(empty && self.finished),
        })
    }

    fn reset(&mut self, position: &AxisVector) {
        self.context.position = *position;
        self.last_tau_s = self.rules.on_tick_s(self.context.time_constant_s);
        self.buffer.clear(self.last_tau_s);
        self.drive.reset();
        self.writer.reset();
        self.start_mm_per_s = 0.0;
        self.finished = false;
    }
}

/// Speed of a block at the edge of an overlap inside its ramp, mm/s.
fn passing(feed_mm_per_s: f64, overlap_s: f64, ramp_s: f64) -> f64 {
    if ramp_s > 0.0 {
        feed_mm_per_s * overlap_s / ramp_s
    } else {
        0.0
    }
}

/// The time constant as it is reported: how long the block overlaps the next one, or its ramp where it ends at rest, s.
fn constant_s(taken: &Taken) -> f64 {
    if taken.join.overlap_s > 0.0 {
        taken.join.overlap_s
    } else {
        taken.join.down_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_is_passed_at_the_part_of_its_feed_that_its_ramp_has_come_to() {
        assert_eq!(passing(60.0, 0.01, 0.04), 15.0);
        assert_eq!(passing(60.0, 0.04, 0.04), 60.0);
        assert_eq!(passing(60.0, 0.0, 0.0), 0.0);
    }
}
