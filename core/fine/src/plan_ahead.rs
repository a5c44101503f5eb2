//! The plan ahead as it is queued, without moving on it: the pieces of it from here on, one after the other ([`Ahead::pieces`]),
//! or a place that moves on along it ([`PlanCursor`]), on which changes of σ are tried before they are begun.

use std::slice::Iter;

use rtrb::chunks::ReadChunk;
use tandem_rings::{MAX_ENTRIES, Queued};
use tandem_sdk::{MAX_AXES, Segment, SegmentFlags, derivatives};

use crate::steps::Steps;

/// Most entries that one look from piece to piece passes: those that are driven in a period, and the ones at its ends.
pub const LOOK_ENTRIES: usize = MAX_ENTRIES + 4;
/// Most entries that a place on the plan ahead reaches over. A feed that a plan for a higher ratio goes beyond is to be seen as long
/// before as the rate takes to come down to it: with a quarter of this, entries of a period each and a jerk of 90 mm/s³, it was seen too
/// late, and exceeded by 16 %. A longer reach costs time where such a feed is far ahead, and nothing elsewhere.
const PLACE_ENTRIES: usize = 2048;

/// What is queued, from where the machine is in the plan.
#[derive(Debug)]
pub struct Ahead<'a> {
    segment: &'a Segment,
    /// Time in that segment, s; none where it rests at its end.
    local_s: Option<f64>,
    /// Number of the first entry, counted from the start.
    first: u64,
    queued: Option<ReadChunk<'a, Queued>>,
}

/// A piece of the plan ahead: what is left of a segment.
#[derive(Clone, Copy, Debug)]
pub struct Piece<'a> {
    /// Number of the segment's entry, counted from the start: no other segment has it.
    pub number: u64,
    /// The segment.
    pub segment: &'a Segment,
    /// Where the piece begins in it, s; it ends where the segment does.
    pub from_s: f64,
    /// Program time from the machine to there, s.
    pub offset_s: f64,
}

impl Piece<'_> {
    /// Its duration, s.
    #[inline]
    pub fn duration_s(&self) -> f64 {
        self.segment.duration_s - self.from_s
    }

    /// Whether the plan rests at its end.
    #[inline]
    pub fn ends_at_rest(&self) -> bool {
        ends(self.segment)
    }
}

/// The pieces of the plan ahead, nearest first.
#[derive(Debug)]
pub struct Pieces<'a> {
    /// Number of the entry that was looked at last.
    number: u64,
    here: Option<(&'a Segment, f64)>,
    first: Iter<'a, Queued>,
    second: Iter<'a, Queued>,
    offset_s: f64,
    /// The last piece ends at rest.
    over: bool,
}

impl<'a> Iterator for Pieces<'a> {
    type Item = Piece<'a>;

    #[inline]
    fn next(&mut self) -> Option<Piece<'a>> {
        if self.over {
            return None;
        }
        let (segment, from_s) = match self.here.take() {
            Some(here) => here,
            None => loop {
                let queued = self.first.next().or_else(|| self.second.next())?;
                self.number = self.number.wrapping_add(1);
                match queued {
                    Queued::Segment { segment, .. } => break (segment, 0.0),
                    Queued::Event(_) => {}
                }
            },
        };
        let piece = Piece {
            number: self.number,
            segment,
            from_s,
            offset_s: self.offset_s,
        };
        self.offset_s += piece.duration_s();
        self.over = piece.ends_at_rest();
        Some(piece)
    }
}

impl<'a> Ahead<'a> {
    /// The machine is in `segment`, at `local_s` or at rest at its end; `queued` follows, beginning with entry `first`.
    pub fn new(
        segment: &'a Segment,
        local_s: Option<f64>,
        first: u64,
        queued: Option<ReadChunk<'a, Queued>>,
    ) -> Self {
        Self {
            segment,
            local_s,
            first,
            queued,
        }
    }

    /// Whether the machine rests in the plan, before what is queued.
    pub fn is_at_rest(&self) -> bool {
        self.local_s.is_none()
    }

    /// The pieces of the plan from here on, up to the one that ends at rest: as many as a period looks at.
    #[inline]
    pub fn pieces(&self) -> Pieces<'_> {
        let [first, second] = self.at_most(LOOK_ENTRIES);
        Pieces {
            // The entry taken out last is the segment that moves, or an event behind it: then nobody else has that number either.
            number: self.first.wrapping_sub(1),
            here: self.local_s.map(|local_s| (self.segment, local_s)),
            first: first.iter(),
            second: second.iter(),
            offset_s: 0.0,
            over: false,
        }
    }

    /// The queued entries from `number` on, counted from the start; events are among them.
    pub fn entries_from(&self, number: u64) -> impl Iterator<Item = &Queued> {
        let (first, second) = self.slices();
        let passed = number.saturating_sub(self.first) as usize;
        first.iter().chain(second).skip(passed)
    }

    fn slices(&self) -> (&[Queued], &[Queued]) {
        self.queued
            .as_ref()
            .map_or((&[], &[]), ReadChunk::as_slices)
    }

    /// The first `most` entries, or all of them.
    #[inline]
    fn at_most(&self, most: usize) -> [&[Queued]; 2] {
        let (first, second) = self.slices();
        let in_first = first.len().min(most);
        let in_second = second.len().min(most - in_first);
        [&first[..in_first], &second[..in_second]]
    }

    /// The next segment queued of `epoch` or a later one.
    pub fn next_segment(&self, epoch: u32) -> Option<&Segment> {
        let mut entries = self.entries_from(self.first).take(LOOK_ENTRIES);
        entries.find_map(|queued| match queued {
            Queued::Segment { segment, .. } if segment.epoch >= epoch => Some(segment),
            _ => None,
        })
    }

    /// A place on the plan, where the machine is; `axes` are looked at.
    pub fn place(&self, axes: Axes) -> PlanCursor<'_> {
        let queued = self.at_most(PLACE_ENTRIES);
        PlanAhead::new(self.segment, queued, axes)
            .begin(self.local_s.unwrap_or(self.segment.duration_s))
    }

    /// Path speed planned `ahead_s` from here, with the programmed feed and whether it is a rapid.
    pub fn planned_after(&self, ahead_s: f64) -> PlannedSpeed {
        let mut planned = PlannedSpeed::at(self.segment, self.segment.duration_s);
        let (mut left_s, mut max_feed_mm_per_s) = (ahead_s, 0.0);
        for piece in self.pieces() {
            let at = PlannedSpeed::at(piece.segment, piece.from_s + left_s.min(piece.duration_s()));
            planned = if piece.segment.duration_s > 0.0 {
                max_feed_mm_per_s = piece.segment.feed_mm_per_s.max(max_feed_mm_per_s);
                PlannedSpeed {
                    max_feed_mm_per_s,
                    ..at
                }
            } else {
                // A rest has no feed of its own: that of what is driven to it counts.
                PlannedSpeed {
                    speed_mm_per_s: at.speed_mm_per_s,
                    path_mm: at.path_mm,
                    ..planned
                }
            };
            if left_s < piece.duration_s() {
                break;
            }
            left_s -= piece.duration_s();
        }
        planned
    }
}

/// The plan a little ahead.
#[derive(Clone, Copy, Debug)]
pub struct PlannedSpeed {
    /// Planned path speed, mm/s.
    pub speed_mm_per_s: f64,
    /// Path coordinate, mm.
    pub path_mm: f64,
    /// Programmed feed, mm/s.
    pub feed_mm_per_s: f64,
    /// Highest programmed feed on the way there, mm/s.
    pub max_feed_mm_per_s: f64,
    /// Rapid motion.
    pub rapid: bool,
}

impl PlannedSpeed {
    fn at(segment: &Segment, local_s: f64) -> Self {
        Self {
            speed_mm_per_s: segment.path_speed_mm_per_s(local_s),
            path_mm: segment.path_mm(local_s),
            feed_mm_per_s: segment.feed_mm_per_s,
            max_feed_mm_per_s: segment.feed_mm_per_s,
            rapid: segment.flags.contains(SegmentFlags::RAPID),
        }
    }
}

/// The plan from here on: the segment that moves, and what is queued behind it.
#[derive(Clone, Copy, Debug)]
pub struct PlanAhead<'a> {
    segment: &'a Segment,
    queued: [&'a [Queued]; 2],
    axes: Axes,
}

/// The axes that are looked at.
#[derive(Clone, Copy, Debug)]
pub struct Axes {
    /// Number of entries that are limited: the axes, and sums of them that are joints.
    pub count: usize,
    /// Bit per linear axis: where any of them moves, a feed is their speed alone.
    pub linear: u32,
    /// Bit per rotary axis: a feed is their speed where no linear one moves.
    pub rotary: u32,
}

/// Two linear axes and nothing else.
#[cfg(test)]
pub const TWO_LINEAR: Axes = Axes {
    count: 2,
    linear: 0b11,
    rotary: 0,
};

impl Axes {
    /// Those whose speed a feed is in `segment`.
    fn counted(&self, segment: &Segment) -> u32 {
        let moves = |axis: usize| {
            let c = &segment.coefficients[axis];
            self.linear >> axis & 1 == 1 && c[1..].iter().any(|c| *c != 0.0)
        };
        if self.rotary == 0 || (0..self.count).any(moves) {
            self.linear
        } else {
            self.rotary
        }
    }
}

/// Where the plan is on its path, and how fast.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Path coordinate, mm.
    pub path_mm: f64,
    /// Position of the axes whose speed a feed is here, mm or rad.
    position: [f64; MAX_AXES],
    /// Bit for each of them.
    counted: u32,
    /// Path speed, mm/s of program time.
    pub speed: f64,
    /// Its rate of change, mm/s².
    pub rise: f64,
}

impl Pace {
    /// How far it is to `other`, mm: on the path, or straight on, whichever is more.
    pub fn way_to_mm(&self, other: &Self) -> f64 {
        let both = self.counted & other.counted;
        let mut squares = 0.0;
        for axis in 0..MAX_AXES {
            if both >> axis & 1 == 1 {
                let way = other.position[axis] - self.position[axis];
                squares += way * way;
            }
        }
        squares.sqrt().max(other.path_mm - self.path_mm)
    }
}

/// Derivatives of the plan at a place by program time, per axis.
#[derive(Clone, Copy, Debug, Default)]
pub struct Motion {
    /// Velocity, mm/s.
    pub velocity: [f64; MAX_AXES],
    /// Acceleration, mm/s².
    pub acceleration: [f64; MAX_AXES],
    /// Jerk, mm/s³.
    pub jerk: [f64; MAX_AXES],
}

impl Motion {
    /// That of `segment` at local time `local_s`, for its first `axes` axes; others stay as they are.
    fn look_at(&mut self, segment: &Segment, local_s: f64, axes: usize) {
        for axis in 0..axes {
            let [velocity, acceleration, jerk] = derivatives(&segment.coefficients[axis], local_s);
            (
                self.velocity[axis],
                self.acceleration[axis],
                self.jerk[axis],
            ) = (velocity, acceleration, jerk);
        }
    }
}

/// A place on a [`PlanAhead`].
#[derive(Clone, Copy, Debug)]
pub struct PlanCursor<'a> {
    plan: PlanAhead<'a>,
    /// The segment here; none after a rest and after what is queued, where nothing moves.
    segment: Option<&'a Segment>,
    /// Entries passed.
    passed: usize,
    local_s: f64,
    /// The place lies within what is queued, or at a rest that ends it.
    known: bool,
}

impl<'a> PlanAhead<'a> {
    /// `segment` moves, `queued` follows; `axes` are looked at.
    pub fn new(segment: &'a Segment, queued: [&'a [Queued]; 2], axes: Axes) -> Self {
        Self {
            segment,
            queued,
            axes,
        }
    }

    /// The place at local time `local_s` of the segment that moves.
    pub fn begin(&self, local_s: f64) -> PlanCursor<'a> {
        PlanCursor {
            plan: *self,
            segment: Some(self.segment),
            passed: 0,
            local_s,
            known: true,
        }
    }

    fn entry(&self, n: usize) -> Option<&'a Queued> {
        let [first, second] = self.queued;
        first.get(n).or_else(|| second.get(n - first.len()))
    }
}

impl<'a> PlanCursor<'a> {
    /// The segment here and the time in it, s; `None` where nothing moves.
    pub fn segment(&self) -> Option<(&'a Segment, f64)> {
        self.segment.map(|segment| (segment, self.local_s))
    }

    /// How the plan moves here.
    pub fn motion(&self) -> Motion {
        let mut motion = Motion::default();
        if let Some(segment) = self.segment {
            motion.look_at(segment, self.local_s, self.plan.axes.count);
        }
        motion
    }

    /// Where the plan is on its path here, per s of program time; `None` where nothing moves.
    ///
    /// The path coordinate of a planner is a polynomial of its own, which may fall short of the way that the axes drive: the
    /// greater speed counts. Below zero it is the rounding of a polynomial at a rest.
    pub fn pace(&self) -> Option<Pace> {
        let segment = self.segment?;
        let [speed, rise, _] = derivatives(&segment.path, self.local_s);
        let mut pace = Pace {
            path_mm: segment.path_mm(self.local_s),
            position: [0.0; MAX_AXES],
            counted: self.plan.axes.counted(segment),
            speed: speed.max(0.0),
            rise,
        };
        let (mut squares, mut product) = (0.0, 0.0);
        let position = segment.position(self.local_s);
        for axis in 0..self.plan.axes.count {
            if pace.counted >> axis & 1 == 0 {
                continue;
            }
            let [velocity, acceleration, _] =
                derivatives(&segment.coefficients[axis], self.local_s);
            pace.position[axis] = position[axis];
            squares += velocity * velocity;
            product += velocity * acceleration;
        }
        if squares > speed * speed {
            (pace.speed, pace.rise) = (squares.sqrt(), product / squares.sqrt());
        }
        Some(pace)
    }

    /// Programmed feed here, mm/s; infinite in a rapid, and where nothing moves.
    pub fn feed_mm_per_s(&self) -> f64 {
        self.segment
            .filter(|it| !it.flags.contains(SegmentFlags::RAPID))
            .map_or(f64::INFINITY, |it| it.feed_mm_per_s)
    }

    /// Moves on by `time_s`, over the ends of segments.
    pub fn go(&mut self, time_s: f64) {
        let mut left_s = self.advance(time_s);
        while left_s > 0.0 && self.segment.is_some() {
            self.step();
            left_s = self.advance(left_s);
        }
    }

    /// Whether what follows the place is known: `false` beyond what is queued, unless that ends at rest.
    pub fn is_known(&self) -> bool {
        self.known
    }

    /// How much of `max_s` lies in the segment here, s; all of it where nothing moves.
    pub fn stretch_s(&self, max_s: f64) -> f64 {
        self.segment.map_or(max_s, |segment| {
            (segment.duration_s - self.local_s).clamp(0.0, max_s)
        })
    }

    /// Moves on to the end of the segment, and by no more than `max_s`; gives what is left of it.
    pub fn advance(&mut self, max_s: f64) -> f64 {
        let Some(segment) = self.segment else {
            return 0.0;
        };
        let left_s = segment.duration_s - self.local_s;
        self.local_s += left_s.min(max_s);
        (max_s - left_s).max(0.0)
    }

    /// From the end of a segment to the start of the next one that moves; gives what steps there.
    pub fn step(&mut self) -> Option<Steps> {
        let before = self.segment;
        let mut rests = self.segment.is_none_or(ends);
        self.segment = None;
        while !rests && self.segment.is_none() {
            match self.plan.entry(self.passed) {
                Some(Queued::Segment { segment, .. }) if segment.duration_s == 0.0 => {
                    rests = ends(segment);
                }
                Some(Queued::Segment { segment, .. }) => self.segment = Some(segment),
                Some(Queued::Event(_)) => {}
                None => (rests, self.known) = (true, false),
            }
            self.passed += 1;
        }
        self.local_s = 0.0;
        match (before, self.segment) {
            // A plan made of samples may come to rest with some acceleration left.
            (Some(before), None) if self.known => Some(Steps::to_rest(before)),
            (Some(before), Some(behind)) if behind.flags.contains(SegmentFlags::STEPS) => {
                Some(Steps::between(before, behind))
            }
            _ => None,
        }
    }

    /// Goes from a rest to the start of what moves next; whether the place was at a rest, and something moves after it.
    pub fn begin_after_rest(&mut self) -> bool {
        let is_at_rest = self
            .segment
            .is_some_and(|it| ends(it) && self.local_s >= it.duration_s);
        if !is_at_rest {
            return false;
        }
        let mut behind = *self;
        loop {
            match behind.plan.entry(behind.passed) {
                Some(Queued::Segment { segment, .. }) if segment.duration_s > 0.0 => {
                    behind.passed += 1;
                    (behind.segment, behind.local_s) = (Some(segment), 0.0);
                    *self = behind;
                    return true;
                }
                Some(_) => behind.passed += 1,
                None => return false,
            }
        }
    }

    /// What steps within `horizon_s` from here.
    pub fn steps_within(mut self, horizon_s: f64) -> Steps {
        let (mut steps, mut left_s) = (Steps::default(), self.advance(horizon_s));
        while left_s > 0.0 && self.segment.is_some() {
            if let Some(more) = self.step() {
                steps.join(&more);
            }
            left_s = self.advance(left_s);
        }
        steps
    }
}

/// Whether the plan rests at the end of `segment`.
pub fn ends(segment: &Segment) -> bool {
    segment.flags.contains(SegmentFlags::ENDS_AT_REST)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cursor::Cursor;
    use rtrb::RingBuffer;
    use tandem_sdk::{AxisVector, Event, EventKind};

    /// A cursor at rest before segments of these durations, s, at feeds of 1, 2, … mm/s with an event after each; the last one
    /// but one ends at rest.
    fn cursor(durations_s: &[f64]) -> Cursor {
        let (mut input, output) = RingBuffer::new(64);
        for (number, duration_s) in durations_s.iter().enumerate() {
            let mut segment = Segment::rest(&AxisVector::ZERO, *duration_s);
            segment.feed_mm_per_s = number as f64 + 1.0;
            segment.path[1] = number as f64 + 1.0;
            segment.flags = if number + 2 == durations_s.len() {
                SegmentFlags::ENDS_AT_REST
            } else {
                SegmentFlags::default()
            };
            let start_s = 0.0;
            input.push(Queued::Segment { start_s, segment }).unwrap();
            let event = Event::new(EventKind::Mist, 0, 0, 0, 1.0);
            input.push(Queued::Event(event)).unwrap();
        }
        Cursor::new(output, &AxisVector::ZERO)
    }

    /// A quarter of the path coordinate is missing: it is a polynomial of its own.
    #[test]
    fn the_pace_is_that_of_rotary_axes_only_where_no_linear_one_moves() {
        let axes = Axes {
            count: 2,
            linear: 0b01,
            rotary: 0b10,
        };
        let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
        (segment.path[1], segment.coefficients[1][1]) = (3.0, 4.0);
        let seen = |segment: &Segment| {
            let mut place = PlanAhead::new(segment, [&[], &[]], axes).begin(0.0);
            let from = place.pace().unwrap();
            place.advance(0.5);
            (from.speed, from.way_to_mm(&place.pace().unwrap()))
        };
        assert_eq!(seen(&segment), (4.0, 2.0));
        segment.coefficients[0][1] = 1.0;
        assert_eq!(seen(&segment), (3.0, 1.5));
    }

    /// Speed and its rise are those of the axes together, on a course that bends too: the rise is what the speed gains.
    #[test]
    fn the_pace_of_axes_rises_as_their_speed_does() {
        let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
        segment.coefficients[0] = [0.0, 3.0, -2.0, 0.5, 0.0, 0.0];
        segment.coefficients[1] = [0.0, -4.0, 1.0, 2.0, 0.3, 0.0];
        let ahead = PlanAhead::new(&segment, [&[], &[]], TWO_LINEAR);
        let pace = |at_s: f64| ahead.begin(at_s).pace().unwrap();
        for at_s in [0.1, 0.4, 0.9] {
            let gains = (pace(at_s + 1e-5).speed - pace(at_s - 1e-5).speed) / 2e-5;
            let rise = pace(at_s).rise;
            assert!(gains.abs() > 1.0, "{gains}");
            assert!((rise - gains).abs() < 1e-6 * gains.abs(), "{rise}, {gains}");
        }
    }

    /// From a rest the plan goes on with what moves next: events and segments without duration lie between, and nothing else is skipped.
    #[test]
    fn from_a_rest_the_plan_goes_on_with_the_first_segment_that_has_a_duration() {
        let mut rests = Segment::rest(&AxisVector::ZERO, 1.0);
        rests.flags = SegmentFlags::ENDS_AT_REST;
        let event = Queued::Event(Event::new(EventKind::Mist, 0, 0, 0, 1.0));
        let lasts = |duration_s: f64| {
            let mut segment = rests;
            (segment.duration_s, segment.path[1]) = (duration_s, duration_s);
            Queued::Segment {
                start_s: 0.0,
                segment,
            }
        };
        let queued = [event, lasts(0.0), event, lasts(2.0), lasts(3.0)];
        for (in_queue, expected) in [(0, None), (3, None), (4, Some(2.0)), (5, Some(2.0))] {
            for in_first in 0..=in_queue {
                let (first, second) = queued[..in_queue].split_at(in_first);
                let plan = PlanAhead::new(&rests, [first, second], TWO_LINEAR);
                assert!(!plan.begin(0.5).begin_after_rest(), "it moves still");
                let mut place = plan.begin(1.0);
                assert_eq!(place.begin_after_rest(), expected.is_some());
                let found = place.pace().map(|pace| pace.speed);
                assert_eq!(found, Some(expected.unwrap_or(0.0)), "of {in_queue}");
            }
        }
    }

    #[test]
    fn the_pieces_begin_where_the_machine_is_and_end_with_the_rest() {
        let mut cursor = cursor(&[1.0, 2.0, 4.0, 8.0]);
        let seen = |cursor: &mut Cursor| -> Vec<[f64; 3]> {
            let ahead = cursor.ahead();
            let pieces = ahead.pieces();
            pieces
                .map(|piece| [piece.from_s, piece.offset_s, piece.duration_s()])
                .collect()
        };
        let all = [[0.0, 0.0, 1.0], [0.0, 1.0, 2.0], [0.0, 3.0, 4.0]];
        assert_eq!(seen(&mut cursor), all);
        cursor.advance(1.5, |_| false);
        assert_eq!(seen(&mut cursor), [[0.5, 0.0, 1.5], [0.0, 1.5, 4.0]]);
        let number = cursor.next_number();
        assert_eq!(cursor.ahead().entries_from(number + 1).count(), 4);
    }

    #[test]
    fn what_is_planned_a_while_ahead_is_that_of_the_piece_there() {
        let mut cursor = cursor(&[1.0, 2.0, 4.0, 8.0]);
        cursor.advance(0.5, |_| false);
        for (ahead_s, speed, max_feed) in [(0.25, 1.0, 1.0), (1.0, 2.0, 2.0), (99.0, 3.0, 3.0)] {
            let planned = cursor.ahead().planned_after(ahead_s);
            let found = (planned.speed_mm_per_s, planned.max_feed_mm_per_s);
            assert_eq!(found, (speed, max_feed), "{ahead_s}");
        }
    }

    /// Only axes whose speed the feed is at both places count in the way from one to the other.
    #[test]
    fn the_way_between_places_is_that_of_axes_which_count_at_both() {
        let place = |path_mm, position: [f64; 3], counted| {
            let mut all = [0.0; MAX_AXES];
            all[..3].copy_from_slice(&position);
            Pace {
                path_mm,
                position: all,
                counted,
                speed: 1.0,
                rise: 0.0,
            }
        };
        let from = place(10.0, [0.0; 3], 0b011);
        for (to, way_mm) in [
            (place(12.0, [3.0, 4.0, 90.0], 0b011), 5.0),
            (place(12.0, [3.0, 4.0, 90.0], 0b111), 5.0),
            (place(12.0, [3.0, 4.0, 90.0], 0b101), 3.0),
            (place(17.0, [3.0, 4.0, 90.0], 0b011), 7.0),
            (place(12.0, [3.0, 4.0, 90.0], 0b100), 2.0),
        ] {
            assert_eq!(from.way_to_mm(&to), way_mm);
        }
    }

    /// A ring hands its entries out in two pieces: the place goes on from the first into the second, and knows where that ends.
    #[test]
    fn a_place_goes_on_over_the_end_of_the_ring() {
        let segment = |speed: f64| {
            let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
            segment.flags = SegmentFlags::default();
            segment.path[1] = speed;
            segment
        };
        let queued = [1.0, 2.0, 3.0, 4.0, 5.0].map(|speed| Queued::Segment {
            start_s: 0.0,
            segment: segment(speed),
        });
        for in_first in 0..=queued.len() {
            let (first, second) = queued.split_at(in_first);
            let here = segment(0.0);
            let mut place = PlanAhead::new(&here, [first, second], TWO_LINEAR).begin(0.5);
            for speed in [1.0, 2.0, 3.0, 4.0, 5.0] {
                place.go(1.0);
                let found = place.pace().map(|pace| pace.speed);
                assert_eq!(found, Some(speed), "{in_first} in the first");
            }
            assert!(place.is_known());
            place.go(1.0);
            assert!(place.pace().is_none() && !place.is_known());
        }
    }
}
