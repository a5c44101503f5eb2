//! Driving one block: its profile, and the segments of it.

use tandem_motion::{Builder, Profile, SpeedPiece};
use tandem_sdk::{AxisVector, BlockKind, BlockReport, LimitedBy, Segment, SegmentFlags, SegmentSink, size_of_contract};

use crate::geometry::Entry;
use crate::options::Junction;

/// A block that is being emitted.
#[derive(Clone, Debug)]
pub struct Drive {
    builder: Builder,
    pieces: [SpeedPiece; 3],
    piece: usize,
    /// Time gone in the current piece and in the block, s.
    in_piece_s: f64,
    in_block_s: f64,
    length_mm: f64,
    lead: AxisVector,
    takeback: AxisVector,
    report: BlockReport,
    rests: bool,
    end: AxisVector,
}

impl Drive {
    /// Drives `entry` between the squares of its end speeds. `path_start_mm` counts from the start of the run.
    pub fn new(entry: &Entry, squares: (f64, f64), rule: Junction, path_start_mm: f64) -> Option<Self> {
        let path = entry.path.as_ref()?;
        let profile = profile(entry, squares);
        let mut builder = Builder::new(path, path_start_mm);
        let blank = builder.blank();
        (blank.block, blank.line, blank.feed_mm_per_s) = (entry.index, entry.line, entry.command_mm_per_s);
        if entry.kind == BlockKind::Rapid {
            blank.flags = SegmentFlags::RAPID;
        }
        blank.stop_deceleration_mm_per_s2 = profile.acceleration_mm_per_s2;
        let duration_s = profile.duration_s();
        let [lead, end_lead] = steps(entry, &profile, rule);
        Some(Self {
            builder,
            pieces: profile.pieces(),
            piece: 0,
            in_piece_s: 0.0,
            in_block_s: 0.0,
            length_mm: profile.length_mm,
            lead,
            takeback: (lead + end_lead) * (1.0 / duration_s),
            report: report(entry, &profile, squares, duration_s),
            rests: squares.1 == 0.0,
            end: entry.end,
        })
    }

    /// The block's row of the report.
    pub fn report(&self) -> &BlockReport {
        &self.report
    }

    /// Length of the block, mm.
    pub fn length_mm(&self) -> f64 {
        self.length_mm
    }

    /// Emits at most `duration_s`; gives what it emitted, s, and whether the block is over.
    pub fn advance(&mut self, duration_s: f64, sink: &mut dyn SegmentSink) -> (f64, bool) {
        let mut emitted_s = 0.0;
        while self.piece < self.pieces.len() {
            if emitted_s >= duration_s {
                return (emitted_s, false);
            }
            emitted_s += self.step(duration_s - emitted_s, sink);
        }
        if self.rests {
            self.rest(sink);
        }
        (emitted_s, true)
    }

    /// One segment of at most `duration_s` from the current piece.
    fn step(&mut self, duration_s: f64, sink: &mut dyn SegmentSink) -> f64 {
        let piece = self.pieces[self.piece];
        let mut part = SpeedPiece {
            start_mm: piece.path_mm(self.in_piece_s),
            speed_mm_per_s: piece.speed(self.in_piece_s),
            duration_s: piece.duration_s - self.in_piece_s,
            ..piece
        };
        let most = duration_s.min(self.builder.longest_s(&part));
        let last = part.duration_s <= most + 1e-12;
        if !last {
            part.duration_s = most;
        }
        if part.duration_s > 0.0 {
            sink.segment(&self.segment(&part, last));
        }
        self.in_block_s += part.duration_s;
        self.in_piece_s = if last { 0.0 } else { self.in_piece_s + part.duration_s };
        self.piece += usize::from(last);
        part.duration_s
    }

    fn segment(&self, part: &SpeedPiece, last_of_piece: bool) -> Segment {
        let mut segment = self.builder.segment(part);
        segment.step_velocity = self.lead + self.takeback * -self.in_block_s;
        segment.step_acceleration = self.takeback;
        if self.in_block_s == 0.0 {
            segment.flags = segment.flags.with(SegmentFlags::BLOCK_BEGINS);
        }
        if last_of_piece && self.pieces[self.piece + 1..].iter().all(|p| p.duration_s == 0.0) {
            segment.flags = segment.flags.with(SegmentFlags::BLOCK_ENDS);
        }
        segment
    }

    /// The programmed position itself, for the sample at rest.
    fn rest(&mut self, sink: &mut dyn SegmentSink) {
        let mut rest = Segment::rest(&self.end, 0.0);
        let blank = *self.builder.blank();
        (rest.block, rest.line, rest.feed_mm_per_s) = (blank.block, blank.line, blank.feed_mm_per_s);
        rest.flags = blank.flags.with(SegmentFlags::ENDS_AT_REST);
        rest.path[0] = self.builder.path_start_mm() + self.length_mm;
        sink.segment(&rest);
    }
}

/// The profile between the squares of the end speeds: up to the feed, the turning cap, or what the length allows.
fn profile(entry: &Entry, (start, end): (f64, f64)) -> Profile {
    let length_mm = entry.length_mm();
    let most = entry.rows.peak(f64::midpoint(start, end), length_mm);
    let peak = most.min(entry.feed_mm_per_s.powi(2)).min(entry.rows.turning_cap()).max(start).max(end);
    Profile {
        length_mm,
        start_mm_per_s: start.sqrt(),
        peak_mm_per_s: peak.sqrt(),
        end_mm_per_s: end.sqrt(),
        acceleration_mm_per_s2: entry.rows.acceleration(peak),
    }
}

/// Half the velocity steps at the start and at the end, mm/s; none under the tangent rule, which bounds nothing.
fn steps(entry: &Entry, profile: &Profile, rule: Junction) -> [AxisVector; 2] {
    match rule {
        Junction::Tangent => [AxisVector::ZERO; 2],
        Junction::Axis => [entry.half_steps[0] * profile.start_mm_per_s, entry.half_steps[1] * profile.end_mm_per_s],
    }
}

fn report(entry: &Entry, profile: &Profile, (start, end): (f64, f64), time_s: f64) -> BlockReport {
    let peak = profile.peak_mm_per_s.powi(2);
    let reached = |limit: f64| peak >= limit * (1.0 - 1e-9);
    let limited_by = if reached(entry.feed_mm_per_s.powi(2)) {
        entry.feed_reason
    } else if reached(entry.rows.turning_cap()) {
        LimitedBy::Curvature
    } else if start > 0.0 && end > 0.0 && profile.durations_s()[0].min(profile.durations_s()[2]) > 0.0 {
        LimitedBy::Junction
    } else {
        LimitedBy::Acceleration
    };
    BlockReport {
        size: size_of_contract::<BlockReport>(),
        limited_by,
        block: entry.index,
        start_feed_mm_per_s: profile.start_mm_per_s,
        peak_feed_mm_per_s: profile.peak_mm_per_s,
        end_feed_mm_per_s: profile.end_mm_per_s,
        time_s,
        time_constant_s: f64::NAN,
    }
}
