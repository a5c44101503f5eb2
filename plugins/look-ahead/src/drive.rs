//! Driving one block: its profile, and the segments of it.

use tandem_motion::{Builder, Path, SpeedPiece};
use tandem_sdk::{AxisVector, BlockKind, Segment, SegmentFlags, SegmentSink};

use crate::buffer::Taken;
use crate::geometry::Entry;
use crate::plan::Plan;

/// A block that is being emitted. Its entry stays in the buffer.
#[derive(Clone, Debug, Default)]
pub struct Drive {
    taken: Taken,
    builder: Builder,
    pieces: [SpeedPiece; 3],
    piece: usize,
    /// Time gone in the current piece and in the block, s.
    in_piece_s: f64,
    in_block_s: f64,
    lead: AxisVector,
}

impl Drive {
    /// Drives the block `taken` along `path` as planned.
    pub fn start(&mut self, taken: Taken, path: &Path, plan: &Plan, path_start_mm: f64) {
        self.taken = taken;
        self.builder = Builder::new(path, path_start_mm);
        self.pieces = plan.profile.pieces(plan.durations_s);
        self.piece = 0;
        self.in_piece_s = 0.0;
        self.in_block_s = 0.0;
        self.lead = plan.steps[0];
    }

    /// The block that is driven.
    pub fn taken(&self) -> &Taken {
        &self.taken
    }

    /// Emits at most `duration_s` in the scratch `segment`; gives what it emitted, s, and whether the block is over.
    pub fn advance(
        &mut self,
        path: &Path,
        duration_s: f64,
        segment: &mut Segment,
        sink: &mut dyn SegmentSink,
    ) -> (f64, bool) {
        let mut emitted_s = 0.0;
        while self.piece < self.pieces.len() {
            if emitted_s >= duration_s {
                return (emitted_s, false);
            }
            emitted_s += self.step(path, duration_s - emitted_s, segment, sink);
        }
        if self.taken.squares[1] == 0.0 {
            self.rest(path, segment, sink);
        }
        (emitted_s, true)
    }

    /// One segment of at most `duration_s` from the current piece.
    fn step(
        &mut self,
        path: &Path,
        duration_s: f64,
        segment: &mut Segment,
        sink: &mut dyn SegmentSink,
    ) -> f64 {
        let piece = &self.pieces[self.piece];
        if piece.duration_s == 0.0 {
            self.piece += 1;
            return 0.0;
        }
        // Short blocks are driven piece by piece, so the whole piece comes first.
        if self.in_piece_s == 0.0
            && piece.duration_s <= duration_s.min(self.builder.longest_s(path, piece))
        {
            let all_s = piece.duration_s;
            self.emit(path, piece, true, segment, sink);
            self.in_block_s += all_s;
            self.piece += 1;
            return all_s;
        }
        self.step_inside(path, duration_s, segment, sink)
    }

    /// One segment of at most `duration_s` from within the current piece.
    fn step_inside(
        &mut self,
        path: &Path,
        duration_s: f64,
        segment: &mut Segment,
        sink: &mut dyn SegmentSink,
    ) -> f64 {
        let piece = &self.pieces[self.piece];
        let mut part = SpeedPiece {
            start_mm: piece.path_mm(self.in_piece_s),
            speed_mm_per_s: piece.speed(self.in_piece_s),
            duration_s: piece.duration_s - self.in_piece_s,
            ..*piece
        };
        let most = duration_s.min(self.builder.longest_s(path, &part));
        let last = part.duration_s <= most + 1e-12;
        if !last {
            part.duration_s = most;
        }
        if part.duration_s > 0.0 {
            self.emit(path, &part, last, segment, sink);
        }
        self.in_block_s += part.duration_s;
        self.in_piece_s = if last {
            0.0
        } else {
            self.in_piece_s + part.duration_s
        };
        self.piece += usize::from(last);
        part.duration_s
    }

    fn emit(
        &self,
        path: &Path,
        part: &SpeedPiece,
        last_of_piece: bool,
        segment: &mut Segment,
        sink: &mut dyn SegmentSink,
    ) {
        self.builder.draw(path, part, segment);
        segment.step_velocity = self.lead + segment.step_acceleration * -self.in_block_s;
        if last_of_piece
            && self.pieces[self.piece + 1..]
                .iter()
                .all(|p| p.duration_s == 0.0)
        {
            segment.flags = segment.flags.with(SegmentFlags::BLOCK_ENDS);
        }
        sink.segment(segment);
        segment.flags = segment.flags.without(SegmentFlags::BLOCK_BEGINS);
    }

    /// The programmed position itself, for the sample at rest.
    fn rest(&self, path: &Path, segment: &mut Segment, sink: &mut dyn SegmentSink) {
        let mut rest = Segment::rest(path.end(), 0.0);
        rest.block = segment.block;
        rest.line = segment.line;
        rest.feed_mm_per_s = segment.feed_mm_per_s;
        rest.flags = segment
            .flags
            .without(SegmentFlags::BLOCK_ENDS)
            .with(SegmentFlags::ENDS_AT_REST);
        rest.path[0] = self.builder.path_start_mm() + path.length_mm();
        sink.segment(&rest);
    }
}

/// Writes into `segment` what all segments of a block share.
pub fn begin(segment: &mut Segment, entry: &Entry, plan: &Plan) {
    segment.block = entry.index;
    segment.line = entry.line;
    segment.feed_mm_per_s = entry.command_mm_per_s;
    segment.stop_deceleration_mm_per_s2 = plan.profile.acceleration_mm_per_s2;
    segment.step_acceleration = (plan.steps[0] + plan.steps[1]) * (1.0 / plan.duration_s());
    segment.flags = SegmentFlags::BLOCK_BEGINS;
    if entry.kind == BlockKind::Rapid {
        segment.flags = segment.flags.with(SegmentFlags::RAPID);
    }
}
