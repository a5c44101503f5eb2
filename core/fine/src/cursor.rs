//! Where the fine loop is in the queue of segments.

use rtrb::Consumer;
use tandem_rings::Queued;
use tandem_sdk::{AxisVector, Edge, Segment, SegmentFlags, StopOn, derivatives, polynomial};

use crate::plan_ahead::{Ahead, ends};
use crate::steps::{Recent, Steps};

/// What a move lacks to the end of a segment, as a share of its time, that is rounding: the move reaches the end, and owes it. A
/// sum of pieces is a rounding off itself, which is no time to spend a period on.
const ROUNDING: f64 = 1e-12;
/// The same for a rest of the plan, near which nothing moves: what many pieces of a dwell are off together.
const REST_ROUNDING: f64 = 1e-9;
/// Entries of older epochs that are dropped in one fine period: each may be a cache miss.
const DROPS: usize = 256;

/// A place in the queue: a segment and the time in it.
#[derive(Debug)]
pub struct Cursor {
    entries: Consumer<Queued>,
    segment: Segment,
    start_s: f64,
    /// Time in the segment: less than its duration but at a rest, and where the queue ends in motion.
    local_s: f64,
    /// What rounding has left out of the moves so far, s: none is lost in it, however short.
    owed_s: f64,
    /// Path coordinate here, mm, and path speed, mm/s of program time: asked for more often than the place moves.
    path_mm: f64,
    path_speed_mm_per_s: f64,
    /// Steps met on the way of this period, and those that samples still show.
    crossed: Option<Steps>,
    recent: Recent,
    epoch: u32,
    /// Entries taken out of the queue since the start.
    taken: u64,
    /// At the end of a segment that ends at rest: the next move starts with the next segment.
    resting: bool,
}

/// What a move met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reached {
    /// A place inside the queue.
    Inside,
    /// A rest: what was left of the time is not used.
    Rest,
    /// The end of the queue, in motion.
    Wall,
}

impl Cursor {
    /// At rest at `position`, in front of an empty queue.
    pub fn new(entries: Consumer<Queued>, position: &AxisVector) -> Self {
        Self {
            entries,
            segment: Segment::rest(position, 0.0),
            start_s: 0.0,
            local_s: 0.0,
            owed_s: 0.0,
            path_mm: 0.0,
            path_speed_mm_per_s: 0.0,
            crossed: None,
            recent: Recent::default(),
            epoch: 0,
            taken: 0,
            resting: true,
        }
    }

    /// The segment that the place lies in.
    pub fn segment(&self) -> &Segment {
        &self.segment
    }

    /// Program time of the place, s.
    pub fn program_time_s(&self) -> f64 {
        self.start_s + self.local_s
    }

    /// Planned position here of the first `lanes` axes; the others are 0.
    #[inline]
    pub fn position(&self, lanes: usize) -> AxisVector {
        let mut position = AxisVector::ZERO;
        let each = position.0[..lanes].iter_mut();
        each.zip(&self.segment.coefficients)
            .for_each(|(value, c)| *value = polynomial(c, self.local_s));
        position
    }

    /// Planned path speed here, mm/s of program time.
    pub fn path_speed_mm_per_s(&self) -> f64 {
        self.path_speed_mm_per_s
    }

    /// Path coordinate here, mm.
    pub fn path_mm(&self) -> f64 {
        self.path_mm
    }

    /// Whether the place is a rest of the plan.
    pub fn is_resting(&self) -> bool {
        self.resting
    }

    /// The epoch of the entries that count.
    pub fn epoch(&self) -> u32 {
        self.epoch
    }

    /// Rests at `position` from here on, in the next epoch: older entries no longer count.
    pub fn end_epoch(&mut self, position: &AxisVector) {
        let mut rest = Segment::rest(position, 0.0);
        rest.block = self.segment.block;
        rest.line = self.segment.line;
        rest.feed_mm_per_s = self.segment.feed_mm_per_s;
        rest.path[0] = self.path_mm;
        self.start_s = self.program_time_s();
        self.local_s = 0.0;
        self.owed_s = 0.0;
        self.segment = rest;
        self.resting = true;
        self.epoch += 1;
        self.look_at_path();
    }

    /// After every move: where the place is on the path.
    fn look_at_path(&mut self) {
        self.path_mm = self.segment.path_mm(self.local_s);
        self.path_speed_mm_per_s = if self.resting {
            0.0
        } else {
            self.segment.path_speed_mm_per_s(self.local_s)
        };
    }

    /// Drops entries of older epochs from the front of the queue, a bounded number; whether one that counts is in front.
    pub fn drop_older(&mut self) -> bool {
        for _ in 0..DROPS {
            let Ok(queued) = self.entries.peek() else {
                return false;
            };
            let epoch = match queued {
                Queued::Event(event) => event.epoch,
                Queued::Segment { segment, .. } => segment.epoch,
            };
            if epoch >= self.epoch {
                return true;
            }
            self.drop_front();
        }
        false
    }

    /// Whether nothing is queued behind the current segment.
    pub fn is_last(&self) -> bool {
        self.entries.is_empty()
    }

    /// Steps of the plan that the coming samples still show.
    pub fn recent_steps(&self) -> Recent {
        self.recent
    }

    /// First to third derivative of the path coordinate here by program time, mm/s and so on.
    pub fn path_derivatives(&self) -> [f64; 3] {
        if self.resting {
            [0.0; 3]
        } else {
            derivatives(&self.segment.path, self.local_s)
        }
    }

    /// What is queued from here on, for as long as nothing moves.
    pub fn ahead(&mut self) -> Ahead<'_> {
        let local_s = (!self.resting).then_some(self.local_s);
        let slots = self.entries.slots();
        let queued = self.entries.read_chunk(slots).ok();
        Ahead::new(&self.segment, local_s, self.taken, queued)
    }

    /// Number, counted from the start, of the entry that comes next.
    pub fn next_number(&self) -> u64 {
        self.taken
    }

    /// Line of the next segment queued.
    pub fn next_line(&mut self) -> Option<u32> {
        self.ahead().next_segment(0).map(|segment| segment.line)
    }

    /// What the motion that begins next at a rest waits for.
    pub fn next_stop_on(&mut self) -> StopOn {
        let epoch = self.epoch;
        let ahead = self.ahead();
        let next = ahead.next_segment(epoch);
        next.map_or_else(StopOn::default, |segment| segment.stop_on)
    }

    /// Whether what comes next, with nothing to switch before it, is a cut; elsewhere than at a rest, whether here is one.
    pub fn is_cutting(&mut self) -> bool {
        if !self.resting {
            return is_cut(&self.segment);
        }
        matches!(self.entries.peek(), Ok(Queued::Segment { segment, .. }) if segment.epoch >= self.epoch && is_cut(segment))
    }

    /// Moves on by `delta_s` of program time. Events on the way, and the segments that begin at a rest, are given to `meet`,
    /// which says whether the machine is to stay at the rest where it met one: behind the event, or in front of the segment.
    pub fn advance(&mut self, delta_s: f64, meet: impl FnMut(&Queued) -> bool) -> Reached {
        if delta_s == 0.0 {
            self.recent.pass(None);
            return if self.resting {
                Reached::Rest
            } else {
                Reached::Inside
            };
        }
        let reached = self.go(delta_s, meet);
        self.recent.pass(self.crossed.as_ref());
        if self.crossed.is_some() {
            self.crossed = None;
        }
        self.look_at_path();
        reached
    }

    fn go(&mut self, mut left_s: f64, mut meet: impl FnMut(&Queued) -> bool) -> Reached {
        let asked_s = left_s;
        loop {
            if !self.resting {
                // The place decides, not the time left: a time below its rounding would move it never, or onto the end.
                let duration_s = self.segment.duration_s;
                let wanted_s = left_s + self.owed_s;
                let to_s = (self.local_s + wanted_s).max(0.0);
                let rests = ends(&self.segment);
                if to_s < duration_s - asked_s * if rests { REST_ROUNDING } else { ROUNDING } {
                    self.owed_s = wanted_s - (to_s - self.local_s);
                    self.local_s = to_s;
                    return Reached::Inside;
                }
                if rests {
                    (self.local_s, self.owed_s) = (duration_s, 0.0);
                    self.resting = true;
                    return Reached::Rest;
                }
                let over_s = wanted_s - (duration_s - self.local_s);
                (left_s, self.owed_s) = (over_s.max(0.0), over_s.min(0.0));
            }
            if !self.next(&mut meet) {
                return if self.resting {
                    Reached::Rest
                } else {
                    Reached::Wall
                };
            }
        }
    }

    /// Steps to the start of the next segment; `false` where there is none, or something keeps the machine at its rest.
    fn next(&mut self, meet: &mut impl FnMut(&Queued) -> bool) -> bool {
        let (mut found, mut stay) = (false, false);
        while !found && !stay {
            // Looked at in its slot: a segment is large, and is copied once.
            let Ok(queued) = self.entries.peek() else {
                break;
            };
            match queued {
                Queued::Event(it) if it.epoch >= self.epoch => stay = meet(queued) && self.resting,
                Queued::Segment { start_s, segment } if segment.epoch >= self.epoch => {
                    if self.resting && meet(queued) {
                        return false;
                    }
                    self.epoch = segment.epoch;
                    (self.start_s, self.local_s) = (*start_s, 0.0);
                    if segment.flags.contains(SegmentFlags::STEPS) && !self.resting {
                        self.crossed
                            .get_or_insert_default()
                            .join(&Steps::between(&self.segment, segment));
                    }
                    self.segment.clone_from(segment);
                    self.resting = false;
                    found = true;
                }
                _ => {}
            }
            self.drop_front();
        }
        if !found && !self.resting {
            self.local_s = self.segment.duration_s;
        }
        found
    }

    /// Gives the slot of the next entry back.
    fn drop_front(&mut self) {
        if let Ok(front) = self.entries.read_chunk(1) {
            front.commit_all();
            self.taken += 1;
        }
    }
}

/// Whether the tool may cut in it: a motion at a feed that waits for no input.
pub fn is_cut(segment: &Segment) -> bool {
    let moves = segment.path[1..]
        .iter()
        .any(|coefficient| *coefficient != 0.0);
    moves && !segment.flags.contains(SegmentFlags::RAPID) && segment.stop_on.edge == Edge::None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::period_points::PeriodPoints;
    use rtrb::RingBuffer;
    use tandem_sdk::{AxisLimits, Event, EventKind, MAX_AXES};

    /// A dwell of `dwell_s` as a planner emits it in rough periods of `rough_s`, behind a move that ends anywhere.
    fn dwell(dwell_s: f64, rough_s: f64, before_s: f64) -> Cursor {
        let (mut input, output) = RingBuffer::new(4096);
        let (mut start_s, mut left_s) = (before_s, dwell_s);
        while left_s > 0.0 {
            let piece_s = left_s.min(rough_s);
            left_s -= piece_s;
            let mut segment = Segment::rest(&AxisVector::ZERO, piece_s);
            segment.flags = if left_s > 0.0 {
                SegmentFlags::DWELL
            } else {
                SegmentFlags::ENDS_AT_REST
            };
            input.push(Queued::Segment { start_s, segment }).unwrap();
            start_s += piece_s;
        }
        Cursor::new(output, &AxisVector::ZERO)
    }

    /// Fine periods until the cursor rests at the end of the queue.
    fn periods(cursor: &mut Cursor, period_s: f64, rate: f64, most: u64) -> Option<u64> {
        let axis = AxisLimits {
            min_mm: -1.0,
            max_mm: 1.0,
            feed_mm_per_s: 1.0,
            rapid_mm_per_s: 1.0,
            acceleration_mm_per_s2: 1.0,
            jerk_mm_per_s3: f64::INFINITY,
            speed_difference_mm_per_s: 0.0,
        };
        let mut points = PeriodPoints::new(&[axis; MAX_AXES], 1);
        (1..=most).find(|_| {
            points.fill(&cursor.ahead(), rate * period_s);
            let covered_s = if cursor.is_resting() {
                f64::MAX
            } else {
                points.covered_s
            };
            cursor.advance((rate * period_s).min(covered_s), |_| false);
            cursor.is_resting() && cursor.is_last()
        })
    }

    #[test]
    fn a_dwell_takes_its_periods_whatever_the_pair_of_periods_and_the_rate_are() {
        for fine_ms in [
            0.125, 0.2, 0.25, 0.3, 0.37, 0.4, 0.5, 0.625, 0.75, 1.0, 1.25, 1.3, 2.0,
        ] {
            for ratio in 1..=21 {
                let (period_s, rough_s) = (fine_ms / 1000.0, fine_ms * f64::from(ratio) / 1000.0);
                for (dwell_s, rate) in [
                    (0.05, 1.0),
                    (0.1, 1.0),
                    (0.05, 0.3),
                    (0.013, 0.01),
                    (40.0 * period_s, 1.0),
                ] {
                    let exact = dwell_s / (rate * period_s);
                    let took = periods(
                        &mut dwell(dwell_s, rough_s, 0.3),
                        period_s,
                        rate,
                        2 * exact as u64 + 10,
                    );
                    // What the pieces' own rounding leaves is no period of its own.
                    let expected = (exact - 1e-6).ceil() as u64;
                    assert_eq!(
                        took,
                        Some(expected),
                        "{fine_ms} ms, {ratio} of them, {dwell_s} s at {rate}"
                    );
                }
            }
        }
    }

    /// The queue ran empty where the plan comes to rest, and what follows only says so.
    #[test]
    fn a_rest_without_duration_behind_a_wall_is_reached() {
        let (mut input, output) = RingBuffer::new(8);
        let mut segment = Segment::rest(&AxisVector::ZERO, 0.01);
        segment.flags = SegmentFlags::DWELL;
        input
            .push(Queued::Segment {
                start_s: 0.0,
                segment,
            })
            .unwrap();
        let mut cursor = Cursor::new(output, &AxisVector::ZERO);
        assert_eq!(cursor.advance(0.02, |_| false), Reached::Wall);
        input
            .push(Queued::Segment {
                start_s: 0.01,
                segment: Segment::rest(&AxisVector::ZERO, 0.0),
            })
            .unwrap();
        assert_eq!(periods(&mut cursor, 0.001, 1.0, 3), Some(1));
    }

    #[test]
    fn time_below_the_rounding_of_the_place_is_owed_and_not_lost() {
        let mut cursor = dwell(1e6, 2e6, 0.0);
        cursor.advance(9e5, |_| false);
        // An ulp there is 1.2e-10 s.
        for _ in 0..1_000_000 {
            cursor.advance(1e-11, |_| false);
        }
        assert!(
            (cursor.program_time_s() - 9e5 - 1e-5).abs() < 1e-9,
            "{}",
            cursor.program_time_s() - 9e5
        );
    }

    #[test]
    fn what_comes_next_is_known_before_it_is_driven() {
        let (mut input, output) = RingBuffer::new(8);
        for (line, epoch) in [(3, 0), (4, 1)] {
            let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
            segment.line = line;
            segment.epoch = epoch;
            segment.feed_mm_per_s = 10.0;
            segment.stop_on.input = line;
            let start_s = 0.0;
            input.push(Queued::Segment { start_s, segment }).unwrap();
        }
        let mut cursor = Cursor::new(output, &AxisVector::ZERO);
        assert_eq!((cursor.next_line(), cursor.next_number()), (Some(3), 0));
        assert_eq!(cursor.next_stop_on().input, 3);
        cursor.end_epoch(&AxisVector::ZERO);
        assert_eq!(cursor.next_stop_on().input, 4, "of this epoch");
        assert!(cursor.drop_older());
        assert_eq!((cursor.next_line(), cursor.next_number()), (Some(4), 1));
        cursor.advance(2.0, |_| false);
        assert_eq!((cursor.next_line(), cursor.next_number()), (None, 2));
        assert!(cursor.is_last() && !cursor.drop_older());
        assert_eq!(cursor.next_stop_on(), StopOn::default());
    }

    #[test]
    fn what_was_queued_before_the_epoch_ended_is_passed_over() {
        let (mut input, output) = RingBuffer::new(8);
        let mut push = |block: u64, epoch: u32, start_s: f64| {
            let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
            segment.flags = SegmentFlags::default();
            (segment.block, segment.epoch) = (block, epoch);
            input.push(Queued::Segment { start_s, segment }).unwrap();
        };
        (0..3).for_each(|block| push(block, 0, block as f64));
        let mut cursor = Cursor::new(output, &AxisVector::ZERO);
        assert_eq!(cursor.advance(0.5, |_| false), Reached::Inside);
        assert_eq!((cursor.segment().block, cursor.epoch()), (0, 0));
        cursor.end_epoch(&AxisVector::ZERO);
        push(7, 1, 0.5);
        assert_eq!(cursor.advance(0.25, |_| false), Reached::Inside);
        assert_eq!((cursor.segment().block, cursor.epoch()), (7, 1));
        assert_eq!(cursor.program_time_s(), 0.75);
    }

    /// What was to be switched on the way that has been given up is not: events of this epoch are met, those of the one before are not.
    #[test]
    fn an_event_is_met_in_its_own_epoch_only() {
        let (mut input, output) = RingBuffer::new(16);
        for (epoch, outputs) in [(0, [1, 2]), (1, [3, 4])] {
            for (block, output) in outputs.into_iter().enumerate() {
                let mut event = Event::new(EventKind::DigitalOutput, 0, 0, output, 1.0);
                event.epoch = epoch;
                let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
                segment.flags = SegmentFlags::default();
                (segment.epoch, segment.block) = (epoch, block as u64);
                let start_s = 0.0;
                input.push(Queued::Event(event)).unwrap();
                input.push(Queued::Segment { start_s, segment }).unwrap();
            }
        }
        let mut cursor = Cursor::new(output, &AxisVector::ZERO);
        let mut met = Vec::new();
        let mut meet = |queued: &Queued| {
            if let Queued::Event(event) = queued {
                met.push(event.index);
            }
            false
        };
        cursor.advance(0.5, &mut meet);
        cursor.end_epoch(&AxisVector::ZERO);
        cursor.advance(0.5, &mut meet);
        assert_eq!(cursor.epoch(), 1);
        cursor.advance(1.0, &mut meet);
        assert_eq!(met, [1, 3, 4]);
    }

    /// A motion at a feed that waits for no input is a cut; a dwell, a rapid and a probe are none.
    #[test]
    fn a_cut_moves_at_a_feed_and_waits_for_nothing() {
        let mut moving = Segment::rest(&AxisVector::ZERO, 1.0);
        moving.flags = SegmentFlags::default();
        assert!(!is_cut(&moving), "nothing moves");
        moving.path[3] = 1.0;
        assert!(is_cut(&moving));
        let mut rapid = moving;
        rapid.flags = SegmentFlags::RAPID;
        assert!(!is_cut(&rapid));
        let mut probe = moving;
        probe.stop_on.edge = Edge::Rising;
        assert!(!is_cut(&probe));
    }

    /// Samples show a step that the plan says is there, and that is passed in motion: none where it begins at a rest, and none where
    /// segments differ by what is no step.
    #[test]
    fn a_step_is_met_in_motion_and_where_the_plan_has_one() {
        let segment = |velocity: f64, flags: SegmentFlags| {
            let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
            segment.coefficients[0][1] = velocity;
            segment.flags = flags;
            segment
        };
        let plan = [
            segment(5.0, SegmentFlags::STEPS),
            segment(7.0, SegmentFlags::default()),
            segment(10.0, SegmentFlags::STEPS),
        ];
        let (mut input, output) = RingBuffer::new(8);
        for segment in plan {
            let start_s = 0.0;
            input.push(Queued::Segment { start_s, segment }).unwrap();
        }
        let mut cursor = Cursor::new(output, &AxisVector::ZERO);
        cursor.advance(0.5, |_| false);
        assert_eq!(cursor.recent_steps(), Recent::default(), "from rest");
        cursor.advance(1.0, |_| false);
        assert_eq!(cursor.recent_steps(), Recent::default(), "without a step");
        cursor.advance(1.0, |_| false);
        let met = Steps::between(&plan[1], &plan[2]);
        assert_eq!(cursor.recent_steps().steps(), met);
    }
}
