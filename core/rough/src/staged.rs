//! What was emitted, on its way into the ring.

use tandem_rings::Queued;
use tandem_sdk::{AxisVector, Event, Segment};

/// What a slot holds before a segment.
#[cold]
fn rest() -> Queued {
    Queued::Segment {
        start_s: 0.0,
        segment: Segment::rest(&AxisVector::ZERO, 0.0),
    }
}

/// Entries in the order in which they were emitted. A segment is large: its slot is there before it, so that it is copied once.
#[derive(Debug, Default)]
pub struct Staged {
    slots: Vec<Queued>,
    /// Slots before it are in the ring.
    sent: usize,
    /// Slots before it hold an entry; what lies behind is left over.
    filled: usize,
}

impl Staged {
    /// Whether nothing is on its way.
    pub fn is_empty(&self) -> bool {
        self.filled == 0
    }

    /// Forgets all entries.
    pub fn clear(&mut self) {
        self.sent = 0;
        self.filled = 0;
    }

    /// Adds an event.
    pub fn event(&mut self, event: Event) {
        *self.next_slot() = Queued::Event(event);
    }

    /// Adds a segment that starts at `start_s`, s of program time; `mark` may change what it says.
    #[inline]
    pub fn segment(&mut self, start_s: f64, segment: &Segment, mark: impl FnOnce(&mut Segment)) {
        let slot = self.next_slot();
        if matches!(slot, Queued::Event(_)) {
            *slot = rest();
        }
        if let Queued::Segment {
            start_s: starts,
            segment: place,
        } = slot
        {
            *starts = start_s;
            place.clone_from(segment);
            mark(place);
        }
    }

    #[inline]
    fn next_slot(&mut self) -> &mut Queued {
        if self.filled == self.slots.len() {
            self.grow();
        }
        self.filled += 1;
        &mut self.slots[self.filled - 1]
    }

    #[cold]
    fn grow(&mut self) {
        self.slots.push(rest());
    }

    /// What is not in the ring yet.
    pub fn waiting(&self) -> &[Queued] {
        &self.slots[self.sent..self.filled]
    }

    /// The first `count` of those have been moved into the ring.
    pub fn moved(&mut self, count: usize) {
        self.sent += count;
        if self.sent == self.filled {
            self.clear();
        } else if self.sent > self.filled / 2 {
            // What is left moves to the front no more often than it doubles: it may be long.
            self.slots.copy_within(self.sent..self.filled, 0);
            self.filled -= self.sent;
            self.sent = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::EventKind;

    /// What waits, in numbers: the line of a segment, and the negative index of an event.
    fn waiting(staged: &Staged) -> Vec<i32> {
        let number = |queued: &Queued| match queued {
            Queued::Segment { start_s, segment } => {
                assert_eq!(*start_s, f64::from(segment.line));
                segment.line.cast_signed()
            }
            Queued::Event(event) => -event.index,
        };
        staged.waiting().iter().map(number).collect()
    }

    fn add(staged: &mut Staged, number: i32) {
        if number < 0 {
            let event = Event::new(EventKind::DigitalOutput, 0, 0, -number, 0.0);
            staged.event(event);
        } else {
            let segment = Segment::rest(&AxisVector::ZERO, 1.0);
            staged.segment(f64::from(number), &segment, |marked| {
                marked.line = number.unsigned_abs();
            });
        }
    }

    /// Slots are used again and again, by segments and events in turn, and entries leave in the order in which they came.
    #[test]
    fn entries_leave_in_their_order_whatever_their_slots_held_before() {
        let (mut staged, mut expected) = (Staged::default(), Vec::new());
        for round in 1..200 {
            for step in 0..round % 5 {
                let number = 10 * round + step;
                let number = if number % 3 == 0 { -number } else { number };
                add(&mut staged, number);
                expected.push(number);
            }
            let leave = (round as usize * 7 % 6).min(expected.len());
            staged.moved(leave);
            expected.drain(..leave);
            assert_eq!(waiting(&staged), expected);
            assert_eq!(staged.is_empty(), expected.is_empty());
        }
        assert!(staged.slots.len() < 50, "{}", staged.slots.len());
        staged.clear();
        assert!(staged.is_empty() && staged.waiting().is_empty());
    }
}
