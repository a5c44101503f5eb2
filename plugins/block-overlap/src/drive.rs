//! The motion of at most two blocks, and the segments of it.

use tandem_motion::{Path, SpeedPiece, hermite, state};
use tandem_sdk::{AxisVector, MAX_AXES, Segment, SegmentFlags, SegmentSink};

use crate::buffer::{Ring, Taken};
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
}

impl Drive {
    /// Nothing moves.
    pub fn new() -> Self {
        Self {
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
        (self.older, self.newer, self.next_at, self.path_mm) = (None, None, None, 0.0);
    }

    /// Whether a block moves.
    pub fn is_moving(&self) -> bool {
        self.newer.is_some()
    }

    /// Whether the next block starts now.
    pub fn wants_next(&self) -> bool {
        self.newer.as_ref().is_none_or(|newer| self.next_at.is_some_and(|at| newer.at >= at))
    }

    /// Where the blocks driven so far end on the path of the run, mm.
    pub fn path_mm(&self) -> f64 {
        self.path_mm + self.newer.as_ref().map_or(0.0, Mover::length_mm)
    }

    /// Starts `mover`, which is driven as `taken` says.
    pub fn start(&mut self, mover: Mover, taken: &Taken) {
        self.path_mm = self.path_mm();
        self.older = self.newer.take();
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
        let Some(path) = ring.path(newer.number) else { return 0.0 };
        let older_path = self.older.as_ref().and_then(|older| ring.path(older.number));
        if let Some((older, older_path)) = self.older.as_ref().zip(older_path) {
            ticks = older.fitted(older_path, lesser(ticks, older.left()));
        }
        ticks = newer.fitted(path, ticks);
        if ticks > SAME_TICKS {
            self.emit([older_path, Some(path)], ticks, sink);
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
        let Some(newer) = self.newer.take() else { return };
        let Some(path) = ring.path(newer.number) else { return };
        let mut rest = Segment::rest(path.end(), 0.0);
        (rest.block, rest.line, rest.feed_mm_per_s) = (newer.index, newer.line, feed(&newer));
        rest.flags = rest.flags.with(flags(&newer));
        rest.path[0] = self.path_mm;
        sink.segment(&rest);
    }

    fn emit(&mut self, [older_path, path]: [Option<&Path>; 2], ticks: f64, sink: &mut dyn SegmentSink) {
        let Some((newer, path)) = self.newer.as_ref().zip(path) else { return };
        let piece = newer.piece(ticks);
        let older = self.older.as_ref().map(|older| (older, older.piece(ticks)));
        let segment = &mut self.segment;
        segment.duration_s = piece.duration_s;
        (segment.block, segment.line, segment.feed_mm_per_s) = (newer.index, newer.line, feed(newer));
        segment.stop_deceleration_mm_per_s2 = newer.stop_mm_per_s2;
        segment.flags = flags(newer);
        if self.begins {
            segment.flags = segment.flags.with(SegmentFlags::BLOCK_BEGINS);
        }
        let until = newer.at + ticks + SAME_TICKS;
        if until >= self.next_at.unwrap_or(newer.end()) {
            segment.flags = segment.flags.with(SegmentFlags::BLOCK_ENDS);
        }
        let start_mm = self.path_mm + piece.start_mm;
        segment.path = [start_mm, piece.speed_mm_per_s, piece.acceleration_mm_per_s2 / 2.0, 0.0, 0.0, 0.0];
        if let Some((older, second)) = &older {
            segment.feed_mm_per_s = greater(segment.feed_mm_per_s, older.command_mm_per_s);
            segment.stop_deceleration_mm_per_s2 = self.overlap_stop[0];
            segment.path[0] -= older.length_mm() - second.start_mm;
            segment.path[1] += second.speed_mm_per_s;
            segment.path[2] += second.acceleration_mm_per_s2 / 2.0;
        }
        let curved = !newer.straight || older.as_ref().is_some_and(|(o, _)| !o.straight);
        let moving = [older_path.zip(older.as_ref().map(|(_, piece)| piece)), Some((path, &piece))];
        if curved {
            quintic(&moving, piece.duration_s, &mut segment.coefficients);
        } else {
            parabola(&moving, self.curved, &mut segment.coefficients);
        }
        self.curved = curved;
        self.begins = false;
        sink.segment(segment);
    }
}

type Moving<'a> = [Option<(&'a Path, &'a SpeedPiece)>; 2];

fn feed(mover: &Mover) -> f64 {
    if mover.rapid { f64::INFINITY } else { mover.command_mm_per_s }
}

fn flags(mover: &Mover) -> SegmentFlags {
    if mover.rapid { SegmentFlags::RAPID } else { SegmentFlags::default() }
}

/// Straight blocks: what moves adds up. What is left of the older block is negative and ends in exactly nothing.
#[inline]
fn parabola(moving: &Moving<'_>, clear: bool, coefficients: &mut [[f64; 6]; MAX_AXES]) {
    let [older, Some((path, piece))] = moving else { return };
    let (start, direction) = (path.start(), path.direction(0.0));
    let [mm, speed, half] = [piece.start_mm, piece.speed_mm_per_s, piece.acceleration_mm_per_s2 / 2.0];
    for (axis, c) in coefficients.iter_mut().enumerate() {
        (c[0], c[1], c[2]) = (start[axis] + direction[axis] * mm, direction[axis] * speed, direction[axis] * half);
    }
    if let Some((path, piece)) = older {
        let direction = path.direction(0.0);
        let left_mm = path.length_mm() - piece.start_mm;
        let [speed, half] = [piece.speed_mm_per_s, piece.acceleration_mm_per_s2 / 2.0];
        for (axis, c) in coefficients.iter_mut().enumerate() {
            c[0] -= direction[axis] * left_mm;
            c[1] += direction[axis] * speed;
            c[2] += direction[axis] * half;
        }
    }
    if clear {
        for c in coefficients.iter_mut() {
            c[3..].fill(0.0);
        }
    }
}

/// With an arc among them: through position, velocity and acceleration at both ends.
fn quintic(moving: &Moving<'_>, duration_s: f64, coefficients: &mut [[f64; 6]; MAX_AXES]) {
    let mut ends = [[AxisVector::ZERO; 3]; 2];
    for (index, (path, piece)) in moving.iter().enumerate().filter_map(|(i, m)| m.map(|m| (i, m))) {
        for (end, t_s) in ends.iter_mut().zip([0.0, duration_s]) {
            let [at, velocity, acceleration] = state(path, piece, t_s);
            end[0] += if index == 0 { at - *path.end() } else { at };
            end[1] += velocity;
            end[2] += acceleration;
        }
    }
    for (axis, c) in coefficients.iter_mut().enumerate() {
        *c = hermite(ends[0].map(|v| v[axis]), ends[1].map(|v| v[axis]), duration_s);
    }
}
