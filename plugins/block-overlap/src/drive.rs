//! The motion of at most two blocks, and the segments of it.

use tandem_motion::{SpeedPiece, hermite, state};
use tandem_sdk::{AxisVector, BlockKind, Segment, SegmentFlags, SegmentSink};

use crate::buffer::{Ring, Taken};
use crate::entry::Entry;
use crate::mover::{Mover, SAME_TICKS};
use crate::rules::{greater, lesser};

/// What moves now.
#[derive(Debug)]
pub struct Drive {
    /// The block that slows down while the newer one speeds up.
    older: Option<Mover>,
    newer: Option<Mover>,
    /// When the next block starts, in the time of the newer one; `None` where this one ends at rest.
    next_at: Option<f64>,
    /// Path deceleration left while the two overlap, and after the next start, mm/s².
    overlap_stop: [f64; 2],
    /// Path coordinate of the start of the newer block, mm.
    path_mm: f64,
    /// The segment that goes out: written over and over, because it is large.
    segment: Segment,
    /// Whether the segment holds powers above two.
    curved: bool,
    begins: bool,
    /// Number of axes; what is past them stays zero.
    axes: usize,
}

impl Drive {
    /// Nothing moves on a machine of `axes` axes.
    pub fn new(axes: usize) -> Self {
        Self {
            axes,
            older: None,
            newer: None,
            next_at: None,
            overlap_stop: [f64::INFINITY; 2],
            path_mm: 0.0,
            segment: Segment::rest(&AxisVector::ZERO, 0.0),
            curved: false,
            begins: false,
        }
    }

    /// At rest at the start of the run's path.
    pub fn reset(&mut self) {
        self.older = None;
        self.newer = None;
        self.next_at = None;
        self.path_mm = 0.0;
    }

    /// Whether a block moves.
    pub fn is_moving(&self) -> bool {
        self.newer.is_some()
    }

    /// Whether the next block starts now.
    pub fn wants_next(&self) -> bool {
        self.newer
            .as_ref()
            .is_none_or(|newer| self.next_at.is_some_and(|at| newer.at >= at))
    }

    /// Where the blocks driven so far end on the path of the run, mm.
    pub fn path_mm(&self) -> f64 {
        self.path_mm + self.newer.as_ref().map_or(0.0, Mover::length_mm)
    }

    /// Starts `mover`, which is driven as `taken` says.
    pub fn start(&mut self, mover: Mover, taken: &Taken) {
        self.path_mm = self.path_mm();
        std::mem::swap(&mut self.older, &mut self.newer);
        self.overlap_stop = [self.overlap_stop[1], taken.join.stop_mm_per_s2];
        self.next_at = (taken.join.overlap_s > 0.0).then(|| mover.next_at(taken.join.overlap_s));
        self.begins = true;
        self.newer = Some(mover);
    }

    /// Emits at most `left` ticks, up to the next change of acceleration; gives how many.
    pub fn step(&mut self, ring: &Ring, left: f64, sink: &mut dyn SegmentSink) -> f64 {
        let Some(newer) = &self.newer else { return 0.0 };
        let to_next = self.next_at.map_or(f64::INFINITY, |at| at - newer.at);
        let mut ticks = lesser(lesser(left, to_next), newer.left());
        if let Some(older) = &self.older {
            ticks = older.fitted(ring.numbered(older.number), lesser(ticks, older.left()));
        }
        ticks = newer.fitted(ring.numbered(newer.number), ticks);
        if ticks > SAME_TICKS {
            self.emit(ring, ticks, sink);
        }
        self.advance(ring, ticks, sink);
        ticks
    }

    fn advance(&mut self, ring: &Ring, ticks: f64, sink: &mut dyn SegmentSink) {
        if let Some(older) = &mut self.older {
            older.advance(ticks);
            if older.is_over() {
                self.older = None;
            }
        }
        let Some(newer) = &mut self.newer else { return };
        newer.advance(ticks);
        match self.next_at {
            Some(at) if (newer.at - at).abs() < SAME_TICKS => newer.at = at,
            None if newer.is_over() => self.rest(ring, sink),
            _ => {}
        }
    }

    /// The programmed position itself, for the sample at rest.
    fn rest(&mut self, ring: &Ring, sink: &mut dyn SegmentSink) {
        self.path_mm = self.path_mm();
        let Some(newer) = self.newer.take() else {
            return;
        };
        let entry = ring.numbered(newer.number);
        let mut rest = Segment::rest(&entry.end, 0.0);
        rest.block = entry.index;
        rest.line = entry.line;
        rest.feed_mm_per_s = feed(entry);
        rest.flags = rest.flags.with(flags(entry));
        rest.path[0] = self.path_mm;
        sink.segment(&rest);
    }

    fn emit(&mut self, ring: &Ring, ticks: f64, sink: &mut dyn SegmentSink) {
        let Some(newer) = &self.newer else { return };
        let piece = newer.piece(ticks);
        let entry = ring.numbered(newer.number);
        let older = self
            .older
            .as_ref()
            .map(|older| (ring.numbered(older.number), older.piece(ticks)));
        let segment = &mut self.segment;
        segment.duration_s = piece.duration_s;
        segment.block = entry.index;
        segment.line = entry.line;
        segment.feed_mm_per_s = feed(entry);
        segment.stop_deceleration_mm_per_s2 = newer.stop_mm_per_s2;
        segment.flags = flags(entry);
        if self.begins {
            segment.flags = segment.flags.with(SegmentFlags::BLOCK_BEGINS);
        }
        let until = newer.at + ticks + SAME_TICKS;
        if until >= self.next_at.unwrap_or(newer.end()) {
            segment.flags = segment.flags.with(SegmentFlags::BLOCK_ENDS);
        }
        let start_mm = self.path_mm + piece.start_mm;
        segment.path[..3].copy_from_slice(&[
            start_mm,
            piece.speed_mm_per_s,
            piece.acceleration_mm_per_s2 / 2.0,
        ]);
        if let Some((older, second)) = &older {
            segment.feed_mm_per_s = greater(segment.feed_mm_per_s, older.command_mm_per_s);
            segment.stop_deceleration_mm_per_s2 = self.overlap_stop[0];
            segment.path[0] -= older.length_mm - second.start_mm;
            segment.path[1] += second.speed_mm_per_s;
            segment.path[2] += second.acceleration_mm_per_s2 / 2.0;
        }
        let curved =
            entry.arc.is_some() || older.as_ref().is_some_and(|(older, _)| older.arc.is_some());
        let moving = (older, (entry, piece));
        let coefficients = &mut segment.coefficients[..self.axes];
        if curved {
            quintic(&moving, segment.duration_s, coefficients);
        } else {
            parabola(&moving, self.curved, coefficients);
        }
        self.curved = curved;
        self.begins = false;
        sink.segment(segment);
    }
}

/// The block that slows down, where there is one, and the one that moves on, each with its piece of motion.
type Moving<'a> = (Option<(&'a Entry, SpeedPiece)>, (&'a Entry, SpeedPiece));

fn feed(entry: &Entry) -> f64 {
    if entry.kind == BlockKind::Rapid {
        f64::INFINITY
    } else {
        entry.command_mm_per_s
    }
}

fn flags(entry: &Entry) -> SegmentFlags {
    if entry.kind == BlockKind::Rapid {
        SegmentFlags::RAPID
    } else {
        SegmentFlags::default()
    }
}

/// Straight blocks: what moves adds up. What is left of the older block is negative and ends in exactly nothing.
#[inline]
fn parabola(moving: &Moving<'_>, clear: bool, coefficients: &mut [[f64; 6]]) {
    let (older, (entry, piece)) = moving;
    let direction = &entry.directions[0];
    let [mm, speed, half] = [
        piece.start_mm,
        piece.speed_mm_per_s,
        piece.acceleration_mm_per_s2 / 2.0,
    ];
    for (c, (start, direction)) in coefficients
        .iter_mut()
        .zip(entry.start.0.iter().zip(&direction.0))
    {
        c[0] = start + direction * mm;
        c[1] = direction * speed;
        c[2] = direction * half;
    }
    if let Some((entry, piece)) = older {
        let left_mm = entry.length_mm - piece.start_mm;
        let [speed, half] = [piece.speed_mm_per_s, piece.acceleration_mm_per_s2 / 2.0];
        for (c, direction) in coefficients.iter_mut().zip(&entry.directions[0].0) {
            c[0] -= direction * left_mm;
            c[1] += direction * speed;
            c[2] += direction * half;
        }
    }
    if clear {
        for c in coefficients.iter_mut() {
            c[3..].fill(0.0);
        }
    }
}

/// With an arc among them: through position, velocity and acceleration at both ends.
fn quintic((older, newer): &Moving<'_>, duration_s: f64, coefficients: &mut [[f64; 6]]) {
    let mut ends = [[AxisVector::ZERO; 3]; 2];
    let older = older.iter().map(|moving| (moving, moving.0.end));
    for ((entry, piece), origin) in older.chain([(newer, AxisVector::ZERO)]) {
        let path = entry.path();
        for (end, t_s) in ends.iter_mut().zip([0.0, duration_s]) {
            let [at, velocity, acceleration] = state(&path, piece, t_s);
            end[0] += at - origin;
            end[1] += velocity;
            end[2] += acceleration;
        }
    }
    for (axis, c) in coefficients.iter_mut().enumerate() {
        *c = hermite(
            ends[0].map(|v| v[axis]),
            ends[1].map(|v| v[axis]),
            duration_s,
        );
    }
}
