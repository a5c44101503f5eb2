//! Windows as segments.

use tandem_motion::blocks::{BlockId, BlockWriter};
use tandem_sdk::{AxisVector, Block, MAX_AXES, Segment, SegmentFlags, SegmentSink};

use crate::core::Core;
use crate::report::{of_leg, path};
use crate::route::{Item, Leg};

/// Share of the jerk limits on which a stop counts: the plan takes the rest.
const STOP_JERK: f64 = 0.5;
/// Least duration of a segment, s: the derivatives of a shorter one are rounding.
const MIN_S: f64 = 5e-5;

/// What segments say beside their motion.
#[derive(Debug)]
pub struct Emitter {
    /// What segments of the present block say.
    blank: Segment,
    /// The block whose report was given last.
    reported: Option<u64>,
    pub(crate) writer: BlockWriter,
    /// Length driven, mm.
    path_mm: f64,
    /// Path coordinate polynomial of the piece at `piece`, mm.
    path: [f64; 6],
    piece: Option<usize>,
    /// Where the last rest is.
    pub position: AxisVector,
}

impl Emitter {
    /// At rest at `position`.
    pub fn new(position: &AxisVector) -> Self {
        Self {
            blank: Segment::rest(position, 0.0),
            reported: None,
            writer: BlockWriter::new(3),
            path_mm: 0.0,
            path: [0.0; 6],
            piece: None,
            position: *position,
        }
    }

    /// Whether the report of `block` was given.
    pub fn knows(&self, block: &Block) -> bool {
        self.reported == Some(block.index)
    }

    /// Another window begins.
    pub fn begin_window(&mut self) {
        self.piece = None;
    }

    /// Begins a rest of the program.
    pub fn begin_dwell(&mut self, block: &Block, sink: &mut dyn SegmentSink) {
        self.position = block.end;
        self.reported = Some(block.index);
        self.writer.begin_dwell(BlockId::from(block), &block.end, block.dwell_s, self.path_mm, sink);
    }

    /// Rest at `position`, in or at the end of `block`.
    pub fn rest(&mut self, block: BlockId, position: &AxisVector, sink: &mut dyn SegmentSink) {
        self.position = *position;
        self.reported = Some(block.index);
        sink.segment(&self.writer.rest(block, position, self.path_mm));
    }
}

impl<const L: usize> Core<L> {
    /// Least time of the driven part of the leg in front, s.
    pub(crate) fn front_driven_s(&self) -> f64 {
        let (Some(leg), Some(t)) = (self.route.front(), self.driven_s) else { return 0.0 };
        let share = (self.window.along(t) - leg.start) / (leg.end - leg.start).max(1e-12);
        leg.least_s * share.clamp(0.0, 1.0)
    }

    /// Emits a segment: to the end of the piece, of the block, or of `left_s`.
    pub(crate) fn emit_motion(&mut self, from_s: f64, left_s: f64, sink: &mut dyn SegmentSink) -> f64 {
        let period_s = self.frame.period_s;
        let k = self.window.piece_at(from_s);
        let mut until_s = self.window.pieces[k].end_s().min(self.window.commit_s);
        if from_s + left_s < until_s - MIN_S {
            until_s = from_s + left_s.max(MIN_S);
        }
        let mut merged_feed = 0.0f64;
        let mut ends = false;
        while let Some(leg) = self.route.front() {
            let end_s = if leg.end < self.window.end() - 1e-9 { self.window.time_of(leg.end) } else { f64::INFINITY };
            self.begin_leg(from_s, end_s, sink);
            // Blocks of which less than a fine period is left share a segment: it is named by the last of them, and has the
            // highest of their feeds.
            let another = self.route.items.len() > 1;
            if end_s < from_s + period_s && another {
                merged_feed = merged_feed.max(self.emitter.blank.feed_mm_per_s);
                self.pop_leg();
                continue;
            }
            if end_s < until_s - period_s / 4.0 || end_s <= until_s {
                until_s = end_s.min(until_s);
                ends = true;
            }
            break;
        }
        let mut segment = self.draw(k, from_s, until_s);
        segment.feed_mm_per_s = segment.feed_mm_per_s.max(merged_feed);
        if ends {
            segment.flags = segment.flags.with(SegmentFlags::BLOCK_ENDS);
            self.pop_leg();
        }
        self.emitter.blank.flags = self.emitter.blank.flags.without(SegmentFlags::BLOCK_BEGINS);
        self.driven_s = Some(until_s);
        segment.duration_s = until_s - from_s;
        sink.segment(&segment);
        segment.duration_s
    }

    /// Gives the report of the leg in front, where that was not done.
    fn begin_leg(&mut self, from_s: f64, end_s: f64, sink: &mut dyn SegmentSink) {
        let Some(leg) = self.route.front() else { return };
        if self.emitter.knows(&leg.block) {
            return;
        }
        let to_s = end_s.min(self.window.duration_s()).max(from_s);
        let start_s = self.window.time_of(leg.start).min(from_s).min(to_s);
        sink.block(&of_leg(&self.window, &self.frame.counted(leg.rotary), leg, (start_s, to_s)));
        let block = leg.block;
        self.emitter.reported = Some(block.index);
        self.emitter.blank = self.emitter.writer.blank(&block);
    }

    fn pop_leg(&mut self) {
        if let Some(Item::Leg(leg)) = self.route.pop() {
            self.held_s -= leg.least_s;
        }
    }

    /// The part of piece `k` from `from_s` to `until_s`.
    fn draw(&mut self, k: usize, from_s: f64, until_s: f64) -> Segment {
        let piece = &self.window.pieces[k];
        let rotary = self.route.front().is_some_and(|leg| leg.rotary);
        if self.emitter.piece != Some(k) {
            let counted = self.frame.counted(rotary);
            self.emitter.path_mm = path(&counted, piece, self.emitter.path_mm, &mut self.emitter.path);
            self.emitter.piece = Some(k);
        }
        let mut segment = self.emitter.blank;
        let t = from_s - piece.start_s;
        for axis in 0..self.frame.count {
            let lane: [f64; 6] = std::array::from_fn(|n| piece.c[n][axis] / self.frame.scale[axis]);
            segment.coefficients[axis] = shifted(&lane, t);
        }
        for axis in self.frame.count..MAX_AXES {
            segment.coefficients[axis] = [0.0; 6];
        }
        segment.path = shifted(&self.emitter.path, t);
        segment.duration_s = until_s - from_s;
        let a = self.window.stop.deceleration();
        let v = self.window.stop.speed.max(1e-9);
        segment.stop_deceleration_mm_per_s2 = a;
        segment.max_sigma_rate_per_s = a / v;
        segment.max_sigma_acceleration_per_s2 = STOP_JERK * self.window.stop.jerk_per_speed;
        segment
    }

    /// Rest where the window ends: exactly at the end of a block, where one ends there.
    pub(crate) fn emit_rest(&mut self, sink: &mut dyn SegmentSink) {
        let end = self.window.end();
        let end_state = self.window.state(self.window.duration_s());
        self.driven_s = None;
        self.at = end;
        self.position = end_state[0];
        let mut exact = self.frame.axes(&self.position);
        let mut named = BlockId { index: self.emitter.blank.block, line: self.emitter.blank.line };
        let mut ended = false;
        while let Some(leg) = self.route.front().filter(|leg| leg.end <= end + 1e-9) {
            exact = leg.block.end;
            ended = true;
            named = BlockId::from(&leg.block);
            self.report_last(&leg.clone(), sink);
            self.pop_leg();
        }
        if ended {
            self.position = self.frame.lanes(&exact);
        }
        self.emitter.rest(named, &exact, sink);
        if !ended {
            // The block in front goes on behind the rest, and its report is given.
            self.emitter.reported = Some(named.index);
        }
    }

    fn report_last(&mut self, leg: &Leg, sink: &mut dyn SegmentSink) {
        if !self.emitter.knows(&leg.block) {
            let to_s = self.window.duration_s();
            let from_s = self.window.time_of(leg.start).min(to_s);
            sink.block(&of_leg(&self.window, &self.frame.counted(leg.rotary), leg, (from_s, to_s)));
            self.emitter.reported = Some(leg.block.index);
        }
    }
}

/// The polynomial `c` as seen from `t` on.
fn shifted(c: &[f64; 6], t: f64) -> [f64; 6] {
    if t == 0.0 {
        return *c;
    }
    let mut shifted = *c;
    // Repeated synthetic division: Taylor's coefficients at t.
    for first in 0..5 {
        for n in (first..5).rev() {
            shifted[n] += t * shifted[n + 1];
        }
    }
    shifted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shifted_polynomial_has_the_same_values() {
        let c = [1.0, -2.0, 0.5, 3.0, -1.0, 0.25];
        let value = |c: &[f64; 6], t: f64| c.iter().rev().fold(0.0, |sum, c| sum * t + c);
        assert!((value(&shifted(&c, 0.7), 0.4) - value(&c, 1.1)).abs() < 1e-12);
    }
}
