//! The path ahead: blocks as chords, and where the machine comes to rest.

use std::collections::VecDeque;

use tandem_motion::tube::Lanes;
use tandem_sdk::{Block, BlockKind};

use crate::flatten::{Flat, SAGITTA_SHARE};
use crate::frame::{Frame, along, dot, minus, plus};

/// Way behind the present place that still counts, mm.
const BEHIND: f64 = 2.0;
/// Chords stepped over before the search for one begins.
const STEPS: usize = 16;
/// Chords of one block for which there is room to be made at once: no more than they take.
const MANY: usize = 16_384;
/// Share of the tolerance that may lie between two samples on a curve; the rest is for what the motion stands off it.
const BETWEEN_SAMPLES: f64 = 0.5;
/// Direction cosine between blocks below which the path turns back: it rests there (a quarter of a degree off).
const TURNS_BACK: f64 = -0.999_99;

/// Cosine of the angle beyond which the path turns back: the chord behind the vertex then gets away from the plane that halves the angle
/// by less than a tenth of its length. Up to there that plane is what is asked; with 0 in place of this number a hard program of the
/// conformance kit has a sample that is 0.04 % faster than its block may be.
const TURNED_BACK: f64 = -0.9;

/// A straight piece of the path.
#[derive(Clone, Copy, Debug)]
pub struct Chord<const L: usize> {
    /// Where it starts.
    pub start: Lanes<L>,
    /// Of unit length.
    pub direction: Lanes<L>,
    /// Path coordinate of its start: lengths of chords, in lanes, since the last reset.
    pub s: f64,
    /// Length.
    pub length: f64,
    /// Path speed that may be driven, as path speed counts, mm/s or rad/s; infinite for rapids.
    pub feed: f64,
    /// The feed, or where a curve bends less: with half of the tolerance lying between two samples.
    pub pace: f64,
    /// What the motion may stand off the chord.
    pub tolerance: f64,
    /// Speed of the lanes along it at most, and the time in which the slowest of them builds that up, s.
    pub speed: f64,
    pub turn_s: f64,
    /// Size of the turn at its start: the change of direction; zero behind a rest.
    pub turn: f64,
}

impl<const L: usize> Chord<L> {
    /// Whether the path turns nearly round from here to `next`.
    #[inline]
    pub fn turns_back_to(&self, next: &Self) -> bool {
        dot(&self.direction, &next.direction) < TURNED_BACK
    }
}

impl<const L: usize> Chord<L> {
    /// The point at path coordinate `s`.
    #[inline(always)]
    pub fn at(&self, s: f64) -> Lanes<L> {
        plus(&self.start, s - self.s, &self.direction)
    }

    /// Path coordinate of its end.
    #[inline(always)]
    pub fn end(&self) -> f64 {
        self.s + self.length
    }
}

/// A block with a path that is not driven to its end yet.
#[derive(Clone, Debug)]
pub struct QueuedBlock {
    pub block: Block,
    /// Path coordinates of its ends.
    pub start: f64,
    pub end: f64,
    /// Path speed counts rotary axes.
    pub rotary: bool,
    /// The machine rests at its end.
    pub rests: bool,
    /// The time it takes at its feed, s.
    pub min_s: f64,
    /// Its chords, counted from the first ever.
    pub first_chord: u64,
    pub chords: u32,
}

/// What comes next.
#[derive(Clone, Debug)]
pub enum Item {
    /// Rest.
    Dwell(Block),
    /// Motion.
    Motion(QueuedBlock),
}

/// Where a block ends, and which way the path goes on there.
#[derive(Clone, Copy, Debug)]
pub struct BlockEnd<const L: usize> {
    pub vertex: Lanes<L>,
    /// A direction in which a motion passes it: across the plane that halves the angle between both blocks. None where the path turns
    /// back: a motion that cuts the corner may never pass that plane.
    pub direction: Option<Lanes<L>>,
}

/// The path that is known and not driven yet.
#[derive(Debug)]
pub struct Route<const L: usize> {
    /// Blocks in order.
    pub items: VecDeque<Item>,
    chords: Vec<Chord<L>>,
    /// Number of the first chord kept.
    first: u64,
    /// Number of the first chord behind the last rest.
    run_first: u64,
    end: f64,
}

impl<const L: usize> Default for Route<L> {
    fn default() -> Self {
        Self {
            items: VecDeque::new(),
            chords: Vec::new(),
            first: 0,
            run_first: 0,
            end: 0.0,
        }
    }
}

/// A stretch of path from rest to rest, or as far as it is known.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a, const L: usize> {
    /// Its chords.
    pub chords: &'a [Chord<L>],
    /// Its end is a rest of the program.
    pub closed: bool,
    /// Path speed counts rotary axes.
    pub rotary: bool,
    /// It is a rapid.
    pub rapid: bool,
}

impl<const L: usize> Run<'_, L> {
    /// Path coordinate of its end.
    pub fn end(&self) -> f64 {
        self.chords.last().map_or(0.0, Chord::end)
    }

    /// The chord that `s` lies in, the later one at a vertex; `near` is where the last look-up was.
    #[inline(always)]
    pub fn chord_at(&self, s: f64, near: usize) -> usize {
        chord_at(self.chords, s, near)
    }
}

/// The chord of `chords` that `s` lies in, the later one at a vertex; `near` is where the last look-up was: from there it goes
/// a few steps, and then halves what is left, since a way may cross any number of chords.
#[inline(always)]
pub fn chord_at<const L: usize>(chords: &[Chord<L>], s: f64, near: usize) -> usize {
    let mut i = near.min(chords.len() - 1);
    for _ in 0..STEPS {
        if i + 1 < chords.len() && chords[i + 1].s <= s {
            i += 1;
        } else if i > 0 && chords[i].s > s {
            i -= 1;
        } else {
            return i;
        }
    }
    chords.partition_point(|chord| chord.s <= s).max(1) - 1
}

impl<const L: usize> Route<L> {
    /// Chords kept.
    pub fn chord_count(&self) -> usize {
        self.chords.len()
    }

    /// The block in front.
    pub fn front(&self) -> Option<&QueuedBlock> {
        match self.items.front() {
            Some(Item::Motion(queued)) => Some(queued),
            _ => None,
        }
    }

    /// The end of the block in front, where the block behind it has another feed.
    pub fn end_before_other_feed(&self) -> Option<BlockEnd<L>> {
        let queued = self.front()?;
        let Some(Item::Motion(next)) = self.items.get(1) else {
            return None;
        };
        if next.block.command_feed_mm_per_s() == queued.block.command_feed_mm_per_s() {
            return None;
        }
        let behind =
            (queued.first_chord + u64::from(queued.chords)).checked_sub(self.first)? as usize;
        let last = self.chords.get(behind.checked_sub(1)?)?;
        let next = self.chords.get(behind)?;
        Some(BlockEnd {
            vertex: next.start,
            direction: (!last.turns_back_to(next))
                .then(|| plus(&last.direction, 1.0, &next.direction)),
        })
    }

    /// Takes a rest.
    pub fn push_dwell(&mut self, block: &Block) {
        self.rest_behind_last();
        self.items.push_back(Item::Dwell(*block));
    }

    fn rest_behind_last(&mut self) {
        if let Some(Item::Motion(last)) = self.items.back_mut() {
            last.rests = true;
        }
    }

    /// Takes a block with a path; `flat` are the ends of its chords behind `block.start`. Gives the time that it takes at
    /// its feed, s. Allocates.
    pub fn push(
        &mut self,
        block: &Block,
        flat: &Flat<L>,
        frame: &Frame<L>,
        feed_ratio: f64,
        tolerance_mm: f64,
    ) -> f64 {
        let rotary = frame.counts_rotary(block);
        let counted = frame.counted(rotary);
        let joins = match self.items.back() {
            Some(Item::Motion(last)) => {
                !last.rests && last.rotary == rotary && !block.starts_at_rest()
            }
            _ => false,
        };
        if !joins {
            // Also where the block, a small loop, has no chord of its own: a run counts either linear or rotary axes.
            self.rest_behind_last();
        }
        let mut before = self
            .chords
            .last()
            .filter(|_| joins)
            .map(|chord| chord.direction);
        let start = self.end;
        let first_chord = self.first + self.chords.len() as u64;
        let limits = &frame.speed[usize::from(block.kind == BlockKind::Rapid)];
        let least = |limits: &Lanes<L>| {
            limits[..frame.count]
                .iter()
                .fold(f64::INFINITY, |least, v| v.min(least))
        };
        let jerk = least(&frame.jerk);
        let acceleration = least(&frame.acceleration);
        let mut from = frame.lanes(&block.start);
        if flat.points.len() > MANY {
            self.chords.reserve_exact(flat.points.len());
        }
        for point in &flat.points {
            let way = minus(point, &from);
            let length = dot(&way, &way).sqrt();
            if length < 1e-12 {
                continue;
            }
            let direction: Lanes<L> = way.map(|v| v / length);
            let cosine = before.as_ref().map_or(1.0, |b| dot(b, &direction));
            if cosine < TURNS_BACK {
                before = None;
            }
            let turned = before.as_ref().map(|b| minus(&direction, b));
            let turn = turned.map_or(0.0, |d| dot(&d, &d).sqrt());
            if first_chord == self.first + self.chords.len() as u64 && before.is_none() {
                self.rest_behind_last();
            }
            let speed: f64 = (0..L)
                .map(|l| (counted[l] * direction[l]).powi(2))
                .sum::<f64>();
            // A vertex of a chord whose direction path speed does not count takes no feed: axis limits alone hold.
            let feed = if speed > 0.0 {
                block.command_feed_mm_per_s() * feed_ratio
            } else {
                f64::INFINITY
            };
            let tolerance = tolerance_mm * (1.0 - if flat.curved { SAGITTA_SHARE } else { 0.0 });
            let fastest = along(limits, &direction);
            let fastest = if speed > 0.0 {
                fastest.min(feed / speed.sqrt())
            } else {
                fastest
            };
            let turn_s = 2.0 * (fastest / jerk).sqrt() + fastest / acceleration;
            let start = from;
            let s = self.end;
            let speed = fastest;
            if flat.curved && self.first + (self.chords.len() as u64) > first_chord {
                self.pace_last(turn, &counted, frame.period_s);
            }
            self.chords.push(Chord {
                start,
                direction,
                s,
                length,
                feed,
                pace: feed,
                tolerance,
                speed,
                turn_s,
                turn,
            });
            self.end += length;
            from = *point;
            before = Some(direction);
        }
        let chords = (self.first + self.chords.len() as u64 - first_chord) as u32;
        let rests = block.ends_at_rest();
        let fastest = before.map_or(f64::INFINITY, |direction| along(limits, &direction));
        let min_s = (block.length_mm / (block.command_feed_mm_per_s() * feed_ratio))
            .max((self.end - start) / fastest);
        self.items.push_back(Item::Motion(QueuedBlock {
            block: *block,
            start,
            end: self.end,
            rotary,
            rests,
            min_s,
            first_chord,
            chords,
        }));
        min_s
    }

    /// Paces the last chord of a curve, behind which the path turns by `turn`: where it bends at both of its ends it does so for longer
    /// than a sample.
    fn pace_last(&mut self, turn: f64, counted: &Lanes<L>, period_s: f64) {
        let Some(chord) = self.chords.last_mut() else {
            return;
        };
        let bend = turn.min(chord.turn) / chord.length;
        let speed = (8.0 * BETWEEN_SAMPLES * chord.tolerance / bend).sqrt() / period_s;
        let per: Lanes<L> = std::array::from_fn(|l| counted[l] * chord.direction[l]);
        chord.pace = chord.feed.min(speed * dot(&per, &per).sqrt());
    }

    /// The machine rests at `s`: what lies before it belongs to no run any more.
    pub fn begin_run(&mut self, s: f64) {
        self.run_first =
            self.first + self.chords.partition_point(|chord| chord.end() <= s + 1e-9) as u64;
    }

    /// The path around `s` from the last rest to the next.
    pub fn run(&self, s: f64, finished: bool) -> Run<'_, L> {
        let blocks = self.items.iter().map_while(|item| {
            if let Item::Motion(queued) = item {
                Some(queued)
            } else {
                None
            }
        });
        let mut end = self.first;
        let mut closed = false;
        let mut rotary = false;
        let mut rapid = false;
        for (n, queued) in blocks.enumerate() {
            end = queued.first_chord + u64::from(queued.chords);
            rotary = queued.rotary;
            rapid = queued.block.kind == BlockKind::Rapid || rapid && n > 0;
            if queued.rests {
                closed = true;
                break;
            }
        }
        let all = &self.chords
            [(self.run_first.max(self.first) - self.first) as usize..(end - self.first) as usize];
        let from = all.partition_point(|chord| chord.end() <= s - BEHIND);
        Run {
            chords: &all[from.min(all.len().saturating_sub(1))..],
            closed: closed || finished,
            rotary,
            rapid,
        }
    }

    /// Takes the block in front off.
    pub fn pop(&mut self) -> Option<Item> {
        self.items.pop_front()
    }

    /// Forgets chords that lie well behind `s`.
    pub fn forget(&mut self, s: f64) {
        let count = self
            .chords
            .partition_point(|chord| chord.end() < s - BEHIND);
        // Moving the rest down is worth it only where there is not much of it.
        if count > 256 && 2 * count > self.chords.len() {
            self.chords.drain(..count);
            self.first += count as u64;
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.items.clear();
        self.chords.clear();
        self.first = 0;
        self.run_first = 0;
        self.end = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::AxisVector;

    /// A quarter of a circle of 10 mm from the end of a line, at a feed that no sample could follow within 0.1 µm.
    #[test]
    fn a_curve_is_paced_so_that_half_of_its_tolerance_lies_between_samples_and_a_line_is_not() {
        const RADIUS: f64 = 10.0;
        const TOLERANCE: f64 = 1e-4;
        let context = tandem_rig::context(&[tandem_rig::axis(1e6); 2], 1e-3);
        let frame = Frame::<2>::new(&context);
        let mut route = Route::default();
        let feed = 500.0;
        let mut line = Block::at(AxisVector::from_slice(&[-1.0, 0.0]));
        line.end = AxisVector::from_slice(&[0.0, 0.0]);
        line.kind = BlockKind::Line;
        line.length_mm = 1.0;
        line.feed_mm_per_s = feed;
        let mut arc = line;
        arc.kind = BlockKind::Arc;
        arc.start = line.end;
        arc.end = AxisVector::from_slice(&[RADIUS, RADIUS]);
        let on_arc = |angle: f64| [RADIUS * angle.sin(), RADIUS - RADIUS * angle.cos()];
        let angles = (1..=200).map(|n| f64::from(n) / 200.0 * std::f64::consts::FRAC_PI_2);
        let mut flat = Flat {
            points: vec![[0.0, 0.0]],
            ..Flat::default()
        };
        route.push(&line, &flat, &frame, 1.0, TOLERANCE);
        (flat.points, flat.curved) = (angles.map(on_arc).collect(), true);
        route.push(&arc, &flat, &frame, 1.0, TOLERANCE);
        let run = route.run(0.0, true);
        assert_eq!(run.chords.len(), 201);
        for (n, chord) in run.chords.iter().enumerate() {
            let sagitta = chord.pace * chord.pace * 1e-6 / (8.0 * RADIUS);
            let share = sagitta / chord.tolerance;
            // The last chord does not know yet how the path goes on, the first of the curve begins with a corner of half its turn.
            match n {
                0 | 200 => assert_eq!(chord.pace, feed),
                1 => assert!((0.98..=1.02).contains(&share), "{share}"),
                _ => assert!((0.49..=0.51).contains(&share), "{n}: {share}"),
            }
            assert_eq!(chord.feed, feed);
        }
    }
}
