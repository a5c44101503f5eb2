//! Planner: every line by itself, from rest to rest, with constant acceleration.
//!
//! The simplest planner that keeps all limits: nothing is looked ahead, so nothing has to be. Good for machines that
//! position (drilling, probing), and a start for a planner of one's own.

mod drive;

use std::collections::VecDeque;

use drive::Drive;
use tandem_sdk::{
    Accepted, Advanced, AxisVector, Block, BlockKind, Curve, Planner, PlannerContext, PlannerDescription, PluginError,
    SegmentSink,
};

tandem_sdk::options! {
    pub struct Options {
        /// Share of the acceleration limits that is used, 0.01 to 1.
        pub acceleration_share: f64 = 1.0,
        /// Blocks taken ahead of the one that moves.
        pub buffer_blocks: usize = 64,
    }
}

/// The planner.
pub struct OneBlock {
    context: PlannerContext,
    options: Options,
    waiting: VecDeque<Drive>,
    path_mm: f64,
    finished: bool,
}

tandem_sdk::plugin!(planner "one-block" = OneBlock::open);

impl OneBlock {
    pub fn open(options: &Options, context: &PlannerContext) -> Result<Self, PluginError> {
        if !(0.01..=1.0).contains(&options.acceleration_share) {
            return Err(PluginError::of_option("acceleration_share", "must be 0.01 to 1"));
        }
        if !(1..=10_000).contains(&options.buffer_blocks) {
            return Err(PluginError::of_option("buffer_blocks", "must be 1 to 10000"));
        }
        let waiting = VecDeque::with_capacity(options.buffer_blocks);
        Ok(Self { context: *context, options: options.clone(), waiting, path_mm: 0.0, finished: false })
    }
}

impl Planner for OneBlock {
    fn describe(&self) -> PlannerDescription {
        PlannerDescription::order_2()
    }

    fn check(&self, block: &Block, _curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        let sound = block.start.is_finite() && block.end.is_finite() && block.length_mm > 0.0;
        match block.kind {
            BlockKind::Dwell if block.dwell_s >= 0.0 && block.dwell_s.is_finite() => Ok(()),
            BlockKind::Dwell => Err(PluginError::fixed("a dwell needs a duration of zero or more")),
            BlockKind::Line | BlockKind::Rapid if sound && block.command_feed_mm_per_s() > 0.0 => Ok(()),
            BlockKind::Line | BlockKind::Rapid => {
                Err(PluginError::fixed("a line needs a length and a feed above zero"))
            }
            _ => Err(PluginError::fixed("one-block drives lines and dwells")),
        }
    }

    fn accept(&mut self, block: &Block, curve: Option<Curve<'_>>) -> Result<Accepted, PluginError> {
        if self.waiting.len() == self.options.buffer_blocks {
            return Ok(Accepted::Full);
        }
        self.check(block, curve)?;
        self.finished = false;
        self.waiting.push_back(Drive::new(block, &self.context, self.options.acceleration_share));
        Ok(Accepted::Accepted)
    }

    fn finish(&mut self) {
        self.finished = true;
    }

    fn advance(&mut self, duration_s: f64, sink: &mut dyn SegmentSink) -> Result<Advanced, PluginError> {
        let mut emitted_s = 0.0;
        while emitted_s < duration_s {
            let Some(drive) = self.waiting.front_mut() else { break };
            emitted_s += drive.advance(duration_s - emitted_s, self.path_mm, sink);
            if drive.is_over() {
                self.path_mm += drive.length_mm();
                self.waiting.pop_front();
            }
        }
        Ok(Advanced { duration_s: emitted_s, done: u32::from(self.finished && self.waiting.is_empty()) })
    }

    fn reset(&mut self, position: &AxisVector) {
        self.context.position = *position;
        self.waiting.clear();
        (self.path_mm, self.finished) = (0.0, false);
    }
}
