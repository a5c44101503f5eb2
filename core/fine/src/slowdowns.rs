//! What lies ahead on the path that the plan does not slow down for by itself: a lower feed at a ratio below 1, and the
//! end of a line in single-block operation.
//!
//! The queue is looked at once, a bounded number of entries in a period, ahead of the place that moves.

use tandem_rings::{MAX_ENTRIES, Queued};
use tandem_sdk::{Segment, SegmentFlags};

use crate::cursor::Cursor;
use crate::plan_ahead::ends;

/// A place on the path from which on the programmed feed is lower.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slowdown {
    /// Path coordinate, mm.
    pub path_mm: f64,
    /// Programmed feed from there, mm/s.
    pub feed_mm_per_s: f64,
    /// Planned path speed there, mm/s.
    pub speed_mm_per_s: f64,
    /// Path acceleration planned from there on, mm/s².
    pub acceleration_mm_per_s2: f64,
    /// Least path deceleration that the plan leaves on the way there from the place before, mm/s². What lies behind the place, a rotary
    /// axis that turns on next to no path, says nothing of it.
    pub stop_deceleration_mm_per_s2: f64,
    /// Path coordinate of the last rest of the plan before it, mm; infinitely far behind where none was seen.
    pub rest_mm: f64,
}

impl Slowdown {
    /// The speed to arrive with, mm/s, where `ratio` of the feed is asked for. A corner, which the plan leaves getting
    /// faster, lies inside a period in which the governor cannot yet take that back: its rise is left out, up to the half.
    pub fn speed_to_meet_mm_per_s(&self, ratio: f64, period_s: f64) -> f64 {
        let asked = ratio * self.feed_mm_per_s;
        let sigma = if self.speed_mm_per_s > asked {
            asked / self.speed_mm_per_s
        } else {
            1.0
        };
        let rise = sigma * sigma * self.acceleration_mm_per_s2.max(0.0) * period_s;
        (asked - rise).max(asked / 2.0)
    }
}

/// Entries looked at in a period: more than may be driven in one.
const ENTRIES: usize = 2 * MAX_ENTRIES;
/// Most marks; where there are more, neighbours are merged to the earlier place and the lower feed.
const MARKS: usize = 64;

/// The marks ahead.
#[derive(Debug)]
pub struct Slowdowns {
    /// Number of the entry to look at next.
    next: u64,
    /// Programmed feed up to there, mm/s.
    feed_mm_per_s: f64,
    /// Least deceleration that the plan leaves since the last mark, mm/s².
    stop_deceleration_mm_per_s2: f64,
    /// Path coordinate of the last rest, mm.
    rest_mm: f64,
    marks: Box<[Slowdown]>,
    first: usize,
    count: usize,
}

impl Slowdowns {
    /// Nothing seen. Allocates.
    pub fn new() -> Self {
        Self {
            next: 0,
            feed_mm_per_s: 0.0,
            stop_deceleration_mm_per_s2: f64::INFINITY,
            rest_mm: f64::NEG_INFINITY,
            marks: vec![Slowdown::default(); MARKS].into_boxed_slice(),
            first: 0,
            count: 0,
        }
    }

    /// Looks further ahead, up to program time `until_s`; forgets what has been passed.
    pub fn extend(&mut self, cursor: &mut Cursor, until_s: f64) {
        let here_mm = cursor.path_mm();
        if self.next < cursor.next_number() {
            // At a rest the feed before it says nothing of what follows.
            let rests = cursor.segment().flags.contains(SegmentFlags::ENDS_AT_REST);
            let before = cursor.segment().feed_mm_per_s;
            (self.next, self.feed_mm_per_s) =
                (cursor.next_number(), if rests { 0.0 } else { before });
            self.stop_deceleration_mm_per_s2 = f64::INFINITY;
            self.rest_mm = f64::NEG_INFINITY;
        }
        while self.count > 0 && self.marks[self.first].path_mm <= here_mm {
            self.first = (self.first + 1) % MARKS;
            self.count -= 1;
        }
        for queued in cursor.ahead().entries_from(self.next).take(ENTRIES) {
            if let Queued::Segment { start_s, segment } = queued {
                if *start_s > until_s {
                    break;
                }
                self.see(segment);
            }
            self.next += 1;
        }
    }

    /// Forgets the marks: what is queued counts no more.
    pub fn clear(&mut self) {
        self.count = 0;
        self.stop_deceleration_mm_per_s2 = f64::INFINITY;
        self.rest_mm = f64::NEG_INFINITY;
    }

    /// The marks ahead, nearest first.
    fn marks(&self) -> impl Iterator<Item = &Slowdown> {
        (0..self.count).map(|n| &self.marks[(self.first + n) % MARKS])
    }

    /// The marks to be met from `here_mm` on, nearest first, each with the least deceleration that the plan leaves on the way there, mm/s²,
    /// where the segment that is driven leaves `here_mm_per_s2`. A mark behind a rest of the plan is met from that rest.
    pub fn to_meet(
        &self,
        here_mm: f64,
        here_mm_per_s2: f64,
    ) -> impl Iterator<Item = (&Slowdown, f64)> {
        let mut least_mm_per_s2 = here_mm_per_s2;
        self.marks()
            .take_while(move |mark| mark.rest_mm <= here_mm)
            .map(move |mark| {
                least_mm_per_s2 = least_mm_per_s2.min(mark.stop_deceleration_mm_per_s2);
                (mark, least_mm_per_s2)
            })
    }

    fn see(&mut self, segment: &Segment) {
        let moves = moves(segment);
        if moves && segment.feed_mm_per_s < self.feed_mm_per_s {
            self.mark(Slowdown {
                path_mm: segment.path[0],
                feed_mm_per_s: segment.feed_mm_per_s,
                speed_mm_per_s: segment.path[1],
                acceleration_mm_per_s2: 2.0 * segment.path[2],
                stop_deceleration_mm_per_s2: self.stop_deceleration_mm_per_s2,
                rest_mm: self.rest_mm,
            });
            self.stop_deceleration_mm_per_s2 = f64::INFINITY;
        }
        if moves {
            self.stop_deceleration_mm_per_s2 = self
                .stop_deceleration_mm_per_s2
                .min(segment.stop_deceleration_mm_per_s2);
        }
        if segment.flags.contains(SegmentFlags::ENDS_AT_REST) {
            // A feed behind a rest is met from nothing; and it may be one of rotary axes, in other units.
            self.feed_mm_per_s = 0.0;
            self.rest_mm = segment.path_mm(segment.duration_s);
        } else if moves {
            self.feed_mm_per_s = segment.feed_mm_per_s;
        }
    }

    fn mark(&mut self, mark: Slowdown) {
        if self.count < MARKS {
            self.marks[(self.first + self.count) % MARKS] = mark;
            self.count += 1;
        } else {
            let last = &mut self.marks[(self.first + self.count - 1) % MARKS];
            last.feed_mm_per_s = last.feed_mm_per_s.min(mark.feed_mm_per_s);
            last.speed_mm_per_s = last.speed_mm_per_s.min(mark.speed_mm_per_s);
            last.acceleration_mm_per_s2 =
                last.acceleration_mm_per_s2.max(mark.acceleration_mm_per_s2);
            last.stop_deceleration_mm_per_s2 = last
                .stop_deceleration_mm_per_s2
                .min(mark.stop_deceleration_mm_per_s2);
        }
    }
}

/// The end of a line at which single-block operation stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EndOfLine {
    /// Path coordinate, mm.
    pub path_mm: f64,
    /// Least path deceleration that the plan leaves on the way there, mm/s².
    pub stop_deceleration_mm_per_s2: f64,
}

/// Where single-block operation stops next.
#[derive(Debug)]
pub struct LineEnd {
    /// Number of the entry to look at next.
    next: u64,
    /// Line of the entries up to there.
    line: u32,
    /// Whether the plan rests there by itself.
    rests: bool,
    /// Least deceleration that the plan leaves in the entries up to there since the last end, mm/s².
    stop_deceleration_mm_per_s2: f64,
    /// The end chosen.
    chosen: Option<EndOfLine>,
}

impl Default for LineEnd {
    fn default() -> Self {
        Self {
            next: 0,
            line: 0,
            rests: false,
            stop_deceleration_mm_per_s2: f64::INFINITY,
            chosen: None,
        }
    }
}

impl LineEnd {
    /// Forgets the end chosen: the next one is looked for.
    pub fn forget(&mut self) {
        self.chosen = None;
    }

    /// Whether the end chosen lies behind the machine, which did not come to rest there.
    pub fn is_passed(&self, cursor: &Cursor) -> bool {
        self.chosen
            .is_some_and(|end| end.path_mm < cursor.path_mm())
    }

    /// The nearest end of a line at which the plan goes on and the machine can stop. `way_mm` says how long the way is that it needs for
    /// that with a path deceleration, mm/s².
    pub fn look(&mut self, cursor: &mut Cursor, way_mm: impl Fn(f64) -> f64) -> Option<EndOfLine> {
        let here_mm = cursor.path_mm();
        if self.chosen.is_none_or(|end| end.path_mm < here_mm) {
            self.chosen = None;
            let overtaken = self.next < cursor.next_number();
            if overtaken {
                self.next = cursor.next_number();
                self.line = cursor.segment().line;
                self.stop_deceleration_mm_per_s2 = f64::INFINITY;
            }
            let here_mm_per_s2 = cursor.segment().stop_deceleration_mm_per_s2;
            for queued in cursor.ahead().entries_from(self.next).take(ENTRIES) {
                if let Queued::Segment { segment, .. } = queued {
                    let end = EndOfLine {
                        path_mm: segment.path[0],
                        stop_deceleration_mm_per_s2: here_mm_per_s2
                            .min(self.stop_deceleration_mm_per_s2),
                    };
                    let ended = segment.line != self.line
                        && !self.rests
                        && end.path_mm >= here_mm + way_mm(end.stop_deceleration_mm_per_s2);
                    self.line = segment.line;
                    self.rests = ends(segment);
                    if ended {
                        self.chosen = Some(end);
                        self.stop_deceleration_mm_per_s2 = f64::INFINITY;
                        break;
                    }
                    if moves(segment) {
                        self.stop_deceleration_mm_per_s2 = self
                            .stop_deceleration_mm_per_s2
                            .min(segment.stop_deceleration_mm_per_s2);
                    }
                }
                self.next += 1;
            }
        }
        self.chosen
    }
}

/// Whether the path goes on in a segment: what others leave to brake with says nothing.
fn moves(segment: &Segment) -> bool {
    !segment.flags.contains(SegmentFlags::DWELL) && segment.duration_s > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use rtrb::RingBuffer;
    use tandem_sdk::AxisVector;

    /// A segment of 1 s with a feed that ends at rest or goes on.
    fn fed(feed_mm_per_s: f64, rests: bool) -> Segment {
        let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
        segment.flags = if rests {
            SegmentFlags::ENDS_AT_REST
        } else {
            SegmentFlags::default()
        };
        segment.feed_mm_per_s = feed_mm_per_s;
        segment
    }

    /// The marks ahead of a place at rest behind which feeds follow; `true` where the segment ends at rest.
    fn marks(feeds: &[(f64, bool)]) -> Vec<(f64, f64)> {
        let (mut input, output) = RingBuffer::new(16);
        let mut path_mm = 0.0;
        for (feed_mm_per_s, rests) in feeds {
            let mut segment = fed(*feed_mm_per_s, *rests);
            segment.path = [path_mm, *feed_mm_per_s, 0.0, 0.0, 0.0, 0.0];
            path_mm += feed_mm_per_s;
            let start_s = 0.0;
            input.push(Queued::Segment { start_s, segment }).unwrap();
        }
        let mut cursor = Cursor::new(output, &AxisVector::ZERO);
        let mut slowdowns = Slowdowns::new();
        slowdowns.extend(&mut cursor, 10.0);
        slowdowns
            .marks()
            .map(|mark| (mark.path_mm, mark.feed_mm_per_s))
            .collect()
    }

    /// A rotary axis may follow there, whose feed is in rad/s: a line before it was driven at that many mm/s.
    #[test]
    fn a_lower_feed_behind_a_rest_is_nothing_to_slow_down_for() {
        assert_eq!(marks(&[(5.0, false), (2.0, false)]), [(5.0, 2.0)]);
        assert_eq!(marks(&[(5.0, true), (2.0, false)]), []);
        assert_eq!(
            marks(&[(5.0, true), (2.0, false), (1.0, true), (0.5, false)]),
            [(7.0, 1.0)]
        );
        assert_eq!(marks(&[(2.0, false), (5.0, false)]), []);
    }

    #[test]
    fn a_mark_says_how_the_plan_moves_at_its_place() {
        let mut slowdowns = Slowdowns::new();
        for (feed_mm_per_s, path) in [(9.0, [0.0, 9.0, 0.0]), (5.0, [2.0, 3.0, 4.0])] {
            let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
            segment.flags = SegmentFlags::default();
            segment.feed_mm_per_s = feed_mm_per_s;
            segment.path[..3].copy_from_slice(&path);
            slowdowns.see(&segment);
            segment.flags = SegmentFlags::DWELL;
            segment.feed_mm_per_s = 1.0;
            slowdowns.see(&segment);
        }
        let marks: Vec<_> = slowdowns.marks().collect();
        let [mark] = marks[..] else {
            panic!("{marks:?}")
        };
        assert_eq!((mark.path_mm, mark.feed_mm_per_s), (2.0, 5.0));
        assert_eq!(
            (mark.speed_mm_per_s, mark.acceleration_mm_per_s2),
            (3.0, 8.0)
        );
    }

    /// Segments of 1 mm, each with its feed, what it leaves to brake with, and whether it ends at rest; the marks to be met from
    /// `here_mm` on, and what is left on the way to each.
    fn to_meet(segments: &[(f64, f64, bool)], here_mm: f64) -> Vec<(f64, f64)> {
        let mut slowdowns = Slowdowns::new();
        for (number, (feed_mm_per_s, leaves_mm_per_s2, rests)) in segments.iter().enumerate() {
            let mut segment = fed(*feed_mm_per_s, *rests);
            segment.stop_deceleration_mm_per_s2 = *leaves_mm_per_s2;
            segment.path[0] = number as f64;
            segment.path[1] = 1.0;
            slowdowns.see(&segment);
        }
        slowdowns
            .to_meet(here_mm, 1000.0)
            .map(|(mark, leaves_mm_per_s2)| (mark.path_mm, leaves_mm_per_s2))
            .collect()
    }

    /// A rotary axis that turns on next to no path leaves next to nothing along it: behind a lower feed it must not have the machine crawl
    /// towards that.
    #[test]
    fn what_is_left_behind_a_place_says_nothing_of_the_way_there() {
        let slower_and_slower = [
            (9.0, 500.0, false),
            (9.0, 800.0, false),
            (8.0, 900.0, false),
            (7.0, 0.02, false),
        ];
        assert_eq!(
            to_meet(&slower_and_slower, 0.0),
            [(2.0, 500.0), (3.0, 500.0)]
        );
        let behind_what_leaves_little = [(9.0, 0.02, false), (8.0, 900.0, false)];
        assert_eq!(to_meet(&behind_what_leaves_little, 0.0), [(1.0, 0.02)]);
        let with_more_room = [(9.0, 4000.0, false), (8.0, 900.0, false)];
        assert_eq!(to_meet(&with_more_room, 0.0), [(1.0, 1000.0)]);
    }

    #[test]
    fn a_lower_feed_behind_a_rest_of_the_plan_is_met_from_that_rest() {
        let rests_between = [
            (9.0, 500.0, false),
            (8.0, 800.0, true),
            (9.0, 900.0, false),
            (7.0, 900.0, false),
        ];
        assert_eq!(to_meet(&rests_between, 0.5), [(1.0, 500.0)]);
        assert_eq!(
            to_meet(&rests_between, 2.0),
            [(1.0, 500.0), (3.0, 500.0)],
            "from the rest on"
        );
    }

    #[test]
    fn a_plan_that_gets_faster_behind_its_place_is_met_slower_but_not_below_half() {
        let slowdown = |acceleration_mm_per_s2: f64| Slowdown {
            path_mm: 0.0,
            feed_mm_per_s: 10.0,
            speed_mm_per_s: 100.0,
            acceleration_mm_per_s2,
            ..Slowdown::default()
        };
        // At a twentieth of the rate a period gains 0.0025 of a thousandth of the acceleration.
        for (acceleration, expected) in [(-1e6, 5.0), (0.0, 5.0), (4e5, 4.0), (4e6, 2.5)] {
            let speed = slowdown(acceleration).speed_to_meet_mm_per_s(0.5, 0.001);
            assert!((speed - expected).abs() < 1e-12, "{acceleration}: {speed}");
        }
    }

    #[test]
    fn more_marks_than_there_is_room_for_are_kept_as_the_worst_of_them() {
        let mut slowdowns = Slowdowns::new();
        for number in 0..MARKS + 3 {
            let high = number == MARKS + 1;
            slowdowns.mark(Slowdown {
                path_mm: number as f64,
                feed_mm_per_s: 1000.0 - number as f64,
                speed_mm_per_s: 50.0,
                acceleration_mm_per_s2: if high { 700.0 } else { 5.0 },
                stop_deceleration_mm_per_s2: if high { 3.0 } else { 9.0 },
                rest_mm: f64::NEG_INFINITY,
            });
        }
        let last = slowdowns.marks().last().unwrap();
        assert_eq!(slowdowns.marks().count(), MARKS);
        assert_eq!(
            (last.feed_mm_per_s, last.acceleration_mm_per_s2),
            (1000.0 - (MARKS + 2) as f64, 700.0)
        );
        assert_eq!(last.stop_deceleration_mm_per_s2, 3.0);
    }

    #[test]
    fn a_line_that_ends_at_rest_needs_no_stop_at_its_end() {
        for (rests, expected) in [(false, Some(5.0)), (true, Some(9.0))] {
            let (mut input, output) = RingBuffer::new(4);
            for (line, path_mm, length_mm) in
                [(1, 0.0, 2.0), (1, 2.0, 3.0), (2, 5.0, 4.0), (3, 9.0, 1.0)]
            {
                let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
                segment.line = line;
                segment.flags = if rests && path_mm == 2.0 {
                    SegmentFlags::ENDS_AT_REST
                } else {
                    SegmentFlags::default()
                };
                segment.path = [path_mm, length_mm, 0.0, 0.0, 0.0, 0.0];
                let start_s = 0.0;
                input.push(Queued::Segment { start_s, segment }).unwrap();
            }
            let mut cursor = Cursor::new(output, &AxisVector::ZERO);
            cursor.advance(0.5, |_| false);
            let end = LineEnd::default().look(&mut cursor, |_| 0.0);
            assert_eq!(end.map(|end| end.path_mm), expected);
        }
    }

    /// Lines of a mm each, at 1 mm/s: the end that is chosen stays until the machine is beyond it, and is passed from then on.
    #[test]
    fn the_end_of_a_line_is_passed_where_it_lies_behind_the_machine() {
        let (mut input, output) = RingBuffer::new(4);
        for line in 1..=3 {
            let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
            segment.line = line;
            segment.flags = SegmentFlags::default();
            segment.path = [f64::from(line - 1), 1.0, 0.0, 0.0, 0.0, 0.0];
            let start_s = 0.0;
            input.push(Queued::Segment { start_s, segment }).unwrap();
        }
        let mut cursor = Cursor::new(output, &AxisVector::ZERO);
        let mut line_end = LineEnd::default();
        cursor.advance(0.5, |_| false);
        assert!(!line_end.is_passed(&cursor), "none is chosen");
        assert_eq!(
            line_end.look(&mut cursor, |_| 9.0),
            None,
            "all are too near"
        );
        assert_eq!(
            line_end.look(&mut cursor, |_| 0.0),
            None,
            "each is looked at once"
        );
        let mut line_end = LineEnd::default();
        line_end.look(&mut cursor, |_| 0.0);
        for (passes_s, is_passed) in [(0.0, false), (0.25, false), (0.25, false), (0.25, true)] {
            cursor.advance(passes_s, |_| false);
            assert_eq!(line_end.is_passed(&cursor), is_passed);
        }
        line_end.forget();
        assert!(!line_end.is_passed(&cursor), "it is forgotten");
    }

    /// A machine at 2 mm/s that turns on next to no path behind the second line.
    #[test]
    fn what_is_left_behind_the_end_of_a_line_says_nothing_of_the_stop_there() {
        let (mut input, output) = RingBuffer::new(4);
        for (line, leaves_mm_per_s2) in [(1, 40.0), (2, 10.0), (3, 0.02), (4, 50.0)] {
            let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
            segment.line = line;
            segment.flags = SegmentFlags::default();
            segment.path = [f64::from(line - 1), 1.0, 0.0, 0.0, 0.0, 0.0];
            segment.stop_deceleration_mm_per_s2 = leaves_mm_per_s2;
            let start_s = 0.0;
            input.push(Queued::Segment { start_s, segment }).unwrap();
        }
        let mut cursor = Cursor::new(output, &AxisVector::ZERO);
        cursor.advance(0.97, |_| false);
        let mut line_end = LineEnd::default();
        let mut look = |way_mm: f64| {
            line_end
                .look(&mut cursor, |leaves_mm_per_s2| {
                    way_mm + 2.0 / leaves_mm_per_s2
                })
                .map(|end| (end.path_mm, end.stop_deceleration_mm_per_s2))
        };
        assert_eq!(look(0.0), Some((2.0, 10.0)), "the first end is too near");
        assert_eq!(look(9.0), Some((2.0, 10.0)), "what is chosen stays");
    }

    /// A feed that is lower with every mm, seen ten of them ahead: more marks come past than there is room for at once.
    #[test]
    fn the_marks_ahead_are_those_not_yet_passed_however_many_have_been() {
        const SEGMENTS: u32 = 200;
        let (mut input, output) = RingBuffer::new(SEGMENTS as usize);
        for number in 0..SEGMENTS {
            let start_s = f64::from(number);
            let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
            segment.flags = SegmentFlags::default();
            (segment.path[0], segment.path[1]) = (start_s, 1.0);
            segment.feed_mm_per_s = f64::from(2 * SEGMENTS - number);
            input.push(Queued::Segment { start_s, segment }).unwrap();
        }
        let mut cursor = Cursor::new(output, &AxisVector::ZERO);
        let mut slowdowns = Slowdowns::new();
        cursor.advance(0.5, |_| false);
        for number in 0..SEGMENTS - 10 {
            slowdowns.extend(&mut cursor, f64::from(number) + 10.0);
            let seen: Vec<_> = slowdowns.marks().map(|mark| mark.path_mm).collect();
            let expected: Vec<_> = (1..=10).map(|n| f64::from(number + n)).collect();
            assert_eq!(seen, expected);
            cursor.advance(1.0, |_| false);
        }
    }
}
