//! The form `adaptive`: blocks in, segments out.

use std::collections::VecDeque;

use tandem_motion::blocks::{BlockId, BlockWriter, limited_by_feed, report};
use tandem_motion::nurbs::Place;
use tandem_sdk::{
    AxisVector, Block, BlockKind, LimitedBy, PlannerContext, Segment, SegmentFlags, SegmentSink,
};

use crate::adaptive::{Adaptive, next_mm};
use crate::course::Course;
use crate::piece::Piece;
use crate::planner::BUFFER_BLOCKS;

/// Share of an axis limit that a feed may reach.
const AIM: f64 = 0.999;

/// A block that has not begun.
#[derive(Debug)]
struct Waiting {
    block: Block,
    course: Option<Course>,
}

/// The block being driven.
#[derive(Debug)]
struct Driving {
    course: Course,
    profile: Adaptive,
    stretch: usize,
    s_mm: f64,
    place: Place,
    /// What is left of the piece being drawn.
    piece: Option<Piece>,
}

/// Rough loop. A block allocates when it is accepted, driving it does not.
#[derive(Debug)]
pub struct Baseline {
    context: PlannerContext,
    chord_error_mm: f64,
    waiting: VecDeque<Waiting>,
    driving: Option<Driving>,
    writer: BlockWriter,
    /// The blank of the block being driven, and its next segment.
    segment: Segment,
    path_mm: f64,
    /// Where the block being driven ends.
    end: AxisVector,
    moving: bool,
    /// The block being driven ends at rest, whatever follows.
    ends_at_rest: bool,
    finished: bool,
}

impl Baseline {
    /// At rest.
    pub fn new(context: &PlannerContext, chord_error_mm: f64) -> Self {
        Self {
            context: *context,
            chord_error_mm,
            waiting: VecDeque::with_capacity(BUFFER_BLOCKS),
            driving: None,
            writer: BlockWriter::new(2),
            segment: Segment::rest(&context.position, 0.0),
            path_mm: 0.0,
            end: context.position,
            moving: false,
            ends_at_rest: false,
            finished: false,
        }
    }

    /// Number of blocks that wait.
    pub fn blocks(&self) -> usize {
        self.waiting.len()
    }

    /// Takes a block.
    pub fn accept(&mut self, block: &Block, course: Option<Course>) {
        self.waiting.push_back(Waiting {
            block: *block,
            course,
        });
        self.finished = false;
    }

    /// No block follows for now.
    pub fn finish(&mut self) {
        self.finished = true;
    }

    /// Whether all is emitted.
    pub fn is_done(&self) -> bool {
        let empty = self.waiting.is_empty()
            && self.driving.is_none()
            && !self.writer.is_dwelling()
            && !self.moving;
        empty && self.finished
    }

    /// Forgets everything.
    pub fn reset(&mut self, position: &AxisVector) {
        self.waiting.clear();
        self.driving = None;
        self.writer.reset();
        self.segment = Segment::rest(position, 0.0);
        self.path_mm = 0.0;
        self.moving = false;
        self.finished = false;
    }

    fn begin(&mut self, sink: &mut dyn SegmentSink) -> bool {
        let next_rests = self
            .waiting
            .front()
            .map_or(self.finished, |next| next.block.starts_at_rest());
        if self.moving && (self.ends_at_rest || next_rests) {
            self.rest(sink);
            return true;
        }
        let Some(Waiting { block, course }) = self.waiting.pop_front() else {
            return false;
        };
        match course {
            Some(course) => self.begin_motion(&block, course, sink),
            None => self.writer.begin_dwell(
                BlockId::from(&block),
                &block.end,
                block.dwell_s,
                self.path_mm,
                sink,
            ),
        }
        true
    }

    fn begin_motion(&mut self, block: &Block, course: Course, sink: &mut dyn SegmentSink) {
        let (feed_mm_per_s, limited_by) = self.feed_mm_per_s(block, &course);
        let chord_error_mm = self.chord_error_mm;
        let period_s = self.context.fine_period_s;
        let profile = Adaptive {
            feed_mm_per_s,
            chord_error_mm,
            period_s,
        };
        let (time_s, feeds) = profile.summary(&course);
        let slowed = feeds[1] < feed_mm_per_s;
        let limited_by = if slowed {
            LimitedBy::Tolerance
        } else {
            limited_by
        };
        sink.block(&report(block.index, limited_by, feeds, time_s));
        self.segment = self.blank(block);
        self.end = *course.end();
        self.ends_at_rest = block.ends_at_rest();
        self.driving = Some(Driving {
            course,
            profile,
            stretch: 0,
            s_mm: 0.0,
            place: Place::default(),
            piece: None,
        });
        self.moving = true;
    }

    /// The feed to be driven where no chord limits it, mm/s.
    fn feed_mm_per_s(&self, block: &Block, course: &Course) -> (f64, LimitedBy) {
        if block.kind == BlockKind::Rapid {
            let direction = course.at(0, 0.0, &mut Place::default()).direction;
            let limits = self.context.limits.along(&direction);
            return (AIM * limits.rapid_mm_per_s, LimitedBy::Feed);
        }
        (
            block.command_feed_mm_per_s() * self.context.max_feed_ratio,
            limited_by_feed(block),
        )
    }

    fn blank(&self, block: &Block) -> Segment {
        let mut blank = self.writer.blank(block);
        // A path deceleration that no axis exceeds, whatever the direction; this form serves simulated drives only.
        let axes = self.context.limits.axes();
        blank.stop_deceleration_mm_per_s2 = axes
            .iter()
            .map(|axis| axis.acceleration_mm_per_s2)
            .fold(f64::INFINITY, f64::min);
        blank
    }

    /// Rest where the last block ended, exactly.
    fn rest(&mut self, sink: &mut dyn SegmentSink) {
        let id = BlockId {
            index: self.segment.block,
            line: self.segment.line,
        };
        self.moving = false;
        sink.segment(&self.writer.rest(id, &self.end, self.path_mm));
    }

    /// Emits the next piece, at most `left_s` long; none where there is nothing.
    pub fn emit(&mut self, left_s: f64, sink: &mut dyn SegmentSink) -> Option<f64> {
        if let Some(emitted_s) = self.writer.emit_dwell(left_s, sink) {
            return Some(emitted_s);
        }
        let Some(mut driving) = self.driving.take() else {
            return self.begin(sink).then_some(0.0);
        };
        let over = driving.draw(left_s, &mut self.segment);
        self.segment.path[0] += self.path_mm + driving.before_mm();
        if over {
            self.path_mm += driving.length_mm();
            self.segment.flags = self.segment.flags.with(SegmentFlags::BLOCK_ENDS);
        } else {
            self.driving = Some(driving);
        }
        sink.segment(&self.segment);
        self.segment.flags = self
            .segment
            .flags
            .without(SegmentFlags::BLOCK_BEGINS)
            .without(SegmentFlags::BLOCK_ENDS);
        Some(self.segment.duration_s)
    }
}

impl Driving {
    /// Draws the next segment, at most `left_s` long; true where it ends the block.
    fn draw(&mut self, left_s: f64, segment: &mut Segment) -> bool {
        let whole = self.piece.take();
        let piece = whole.unwrap_or_else(|| {
            self.profile
                .piece(&self.course, self.stretch, self.s_mm, &mut self.place)
        });
        if whole.is_none() {
            self.s_mm = next_mm(
                &piece,
                self.course.stretches()[self.stretch].length_mm,
                self.profile.period_s,
            );
        }
        let now = piece.part(0.0, piece.duration_s.min(left_s));
        let undrawn = now.draw(&self.course, self.stretch, &mut self.place, segment);
        let later_s = piece.duration_s - now.duration_s;
        let drawn_s = segment.duration_s;
        if undrawn.is_some() || later_s > 0.0 {
            self.piece = Some(piece.part(drawn_s, piece.duration_s - drawn_s));
            return false;
        }
        self.stretch_over()
    }

    /// Goes to the next stretch where this one has ended; true behind the last.
    fn stretch_over(&mut self) -> bool {
        if self.s_mm < self.course.stretches()[self.stretch].length_mm {
            return false;
        }
        if self.stretch + 1 == self.course.stretches().len() {
            return true;
        }
        self.stretch += 1;
        self.s_mm = 0.0;
        self.place = Place::default();
        false
    }

    fn before_mm(&self) -> f64 {
        self.course.stretches()[..self.stretch]
            .iter()
            .map(|stretch| stretch.length_mm)
            .sum()
    }

    fn length_mm(&self) -> f64 {
        self.course
            .stretches()
            .iter()
            .map(|stretch| stretch.length_mm)
            .sum()
    }
}
