//! Windows as segments.

use tandem_sdk::{AxisVector, Block, BlockKind, LimitedBy, MAX_AXES, Segment, SegmentFlags, SegmentSink};

use crate::core::Core;
use crate::report::{of_leg, path, report};
use crate::route::{Item, Leg};

/// Share of the jerk limits on which a stop counts: the plan takes the rest.
const STOP_JERK: f64 = 0.5;
/// Least duration of a segment, s: the derivatives of a shorter one are rounding.
const LEAST_S: f64 = 5e-5;

/// What segments say beside their motion.
#[derive(Debug)]
pub struct Emitter {
    /// What segments of the present block say.
    blank: Segment,
    /// The block whose report was given last.
    reported: Option<u64>,
    dwell: Option<Segment>,
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
            dwell: None,
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
        let mut rest = Segment::rest(&block.end, block.dwell_s);
        (rest.block, rest.line) = (block.index, block.line);
        rest.path[0] = self.path_mm;
        rest.flags = rest.flags.with(SegmentFlags::DWELL).with(SegmentFlags::BLOCK_BEGINS);
        self.position = block.end;
        self.reported = Some(block.index);
        sink.block(&report(block, LimitedBy::Feed, [0.0; 3], block.dwell_s));
        self.dwell = Some(rest);
    }

    /// Whether a rest of the program is under way.
    pub fn is_dwelling(&self) -> bool {
        self.dwell.is_some()
    }

    /// Emits at most `left_s` of the rest.
    pub fn dwell(&mut self, left_s: f64, sink: &mut dyn SegmentSink) -> f64 {
        let Some(mut rest) = self.dwell.take() else { return 0.0 };
        let later_s = (rest.duration_s - left_s).max(0.0);
        rest.duration_s -= later_s;
        if later_s > 0.0 {
            let flags = SegmentFlags(rest.flags.0 & !SegmentFlags::BLOCK_BEGINS.0);
            self.dwell = Some(Segment { duration_s: later_s, flags, ..rest });
        } else {
            rest.flags = rest.flags.with(SegmentFlags::BLOCK_ENDS);
        }
        sink.segment(&rest);
        rest.duration_s
    }

    /// Rest at `position`, in or at the end of `block`.
    pub fn rest(&mut self, block: &Block, position: &AxisVector, sink: &mut dyn SegmentSink) {
        let mut rest = Segment::rest(position, 0.0);
        (rest.block, rest.line, rest.order) = (block.index, block.line, 3);
        rest.path[0] = self.path_mm;
        self.position = *position;
        self.reported = Some(block.index);
        sink.segment(&rest);
    }

    /// Segments of `block` from here on.
    fn begin_block(&mut self, block: &Block) {
        self.blank = Segment::rest(&block.start, 0.0);
        (self.blank.block, self.blank.line, self.blank.order) = (block.index, block.line, 3);
        self.blank.flags = SegmentFlags::BLOCK_BEGINS;
        if block.kind == BlockKind::Rapid {
            self.blank.flags = self.blank.flags.with(SegmentFlags::RAPID);
        } else {
            self.blank.feed_mm_per_s = block.command_feed_mm_per_s();
        }
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
        if from_s + left_s < until_s - LEAST_S {
            until_s = from_s + left_s.max(LEAST_S);
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
        let flags = self.emitter.blank.flags.0 & !SegmentFlags::BLOCK_BEGINS.0;
        self.emitter.blank.flags = SegmentFlags(flags);
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
        self.emitter.begin_block(&block);
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
        let mut named = (self.emitter.blank.block, self.emitter.blank.line);
        let mut ended = false;
        while let Some(leg) = self.route.front().filter(|leg| leg.end <= end + 1e-9) {
            (exact, ended) = (leg.block.end, true);
            named = (leg.block.index, leg.block.line);
            self.report_last(&leg.clone(), sink);
            self.pop_leg();
        }
        if ended {
            self.position = self.frame.lanes(&exact);
        }
        let mut block = Block::at(exact);
        (block.index, block.line) = named;
        self.emitter.rest(&block, &exact, sink);
        if !ended {
            // The block in front goes on behind the rest, and its report is given.
            self.emitter.reported = Some(named.0);
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
