//! A planner that drives every block at a tenth of what is possible, as one polynomial, until it does not.

use std::collections::VecDeque;

use tandem_sdk::{
    Accepted, Advanced, AxisVector, Block, BlockKind, BlockReport, Curve, LimitedBy, Planner, PlannerContext,
    PlannerDescription, PluginError, Segment, SegmentFlags, SegmentSink
};

use crate::mischief::{Misbehave, Mischief, Options};

/// Blocks taken ahead.
const MAX_BLOCKS: usize = 8;

pub struct Hostile {
    mischief: Mischief,
    blocks: VecDeque<Block>,
    path_mm: f64,
    finished: bool,
}

/// How long a block takes: half as fast again in its middle as in the mean.
fn time_s(block: &Block) -> f64 {
    (1.6 * block.length_mm / block.command_feed_mm_per_s()).max(4.0)
}

impl Hostile {
    pub fn open(options: &Options, _context: &PlannerContext) -> Result<Self, PluginError> {
        Ok(Self {
            mischief: Mischief::new(options)?,
            blocks: VecDeque::with_capacity(MAX_BLOCKS),
            path_mm: 0.0,
            finished: false,
        })
    }

    /// The whole block in 4 s or, at its feed, longer, as 3t² − 2t³ of its way; a dwell as it is.
    fn segment(&self, block: &Block) -> Segment {
        let time_s = time_s(block);
        let mut segment =
            Segment::rest(&block.start, if block.kind == BlockKind::Dwell { block.dwell_s } else { time_s });
        (segment.block, segment.line, segment.feed_mm_per_s) = (block.index, block.line, block.command_feed_mm_per_s());
        segment.flags = SegmentFlags::BLOCK_BEGINS;
        segment.stop_deceleration_mm_per_s2 = 100.0;
        let (square, cube) = (3.0 / time_s.powi(2), -2.0 / time_s.powi(3));
        let shape = |start: f64, way: f64| [start, 0.0, way * square, way * cube, 0.0, 0.0];
        segment.path = shape(self.path_mm, block.length_mm);
        for (axis, coefficients) in segment.coefficients.iter_mut().enumerate() {
            *coefficients = shape(block.start[axis], block.end[axis] - block.start[axis]);
        }
        segment
    }

    fn emit(&mut self, block: &Block, what: Misbehave, sink: &mut dyn SegmentSink) -> f64 {
        let mut report = BlockReport {
            limited_by: LimitedBy::Feed,
            block: block.index,
            start_feed_mm_per_s: 0.0,
            peak_feed_mm_per_s: block.length_mm / time_s(block) * 1.5,
            end_feed_mm_per_s: 0.0,
            time_s: time_s(block),
            time_constant_s: f64::NAN,
        };
        report.block += if what == Misbehave::Order { 7 } else { 0 };
        sink.block(&report);
        let mut segment = self.segment(block);
        segment.coefficients[0][0] = Mischief::number(what, segment.coefficients[0][0]);
        sink.segment(&segment);
        while what == Misbehave::Endless {
            sink.segment(&segment);
        }
        let mut rest = Segment::rest(&block.end, 0.0);
        (rest.block, rest.line, rest.feed_mm_per_s) = (block.index, block.line, block.command_feed_mm_per_s());
        rest.flags = rest.flags.with(SegmentFlags::BLOCK_ENDS);
        self.path_mm += block.length_mm;
        rest.path[0] = self.path_mm;
        sink.segment(&rest);
        segment.duration_s
    }
}

impl Drop for Hostile {
    fn drop(&mut self) {
        self.mischief.quietly("drop");
    }
}

impl Planner for Hostile {
    fn describe(&self) -> PlannerDescription {
        self.mischief.quietly("describe");
        PlannerDescription::order_2()
    }

    fn check(&self, block: &Block, _curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        self.mischief.of("check")?;
        let sound = block.start.is_finite() && block.end.is_finite() && block.command_feed_mm_per_s() > 0.0;
        match block.kind {
            BlockKind::Dwell if block.dwell_s >= 0.0 => Ok(()),
            BlockKind::Line | BlockKind::Rapid if sound && block.length_mm > 0.0 => Ok(()),
            _ => Err(PluginError::fixed("it drives lines and dwells")),
        }
    }

    fn accept(&mut self, block: &Block, _curve: Option<Curve<'_>>) -> Result<Accepted, PluginError> {
        let what = self.mischief.of("accept")?;
        if self.blocks.len() == MAX_BLOCKS || what == Misbehave::Dawdle {
            return Ok(Accepted::Full);
        }
        self.blocks.push_back(*block);
        self.finished = false;
        Ok(Accepted::Accepted)
    }

    fn finish(&mut self) {
        self.mischief.quietly("finish");
        self.finished = true;
    }

    fn advance(&mut self, wanted_s: f64, sink: &mut dyn SegmentSink) -> Result<Advanced, PluginError> {
        let what = self.mischief.of("advance")?;
        let mut duration_s = 0.0;
        if what == Misbehave::Dawdle {
            return Ok(Advanced { duration_s: 1e-12, done: 0 });
        }
        while duration_s < wanted_s {
            let Some(block) = self.blocks.pop_front() else { break };
            duration_s += self.emit(&block, what, sink);
        }
        Ok(Advanced { duration_s, done: u32::from(self.finished && self.blocks.is_empty()) })
    }

    fn reset(&mut self, _position: &AxisVector) {
        self.mischief.quietly("reset");
        self.blocks.clear();
        (self.path_mm, self.finished) = (0.0, false);
    }
}
