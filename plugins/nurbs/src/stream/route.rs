//! The path ahead, by its coordinate.

use std::collections::VecDeque;

use tandem_motion::nurbs::{AlongPath, Place};

use super::queue::Item;
use super::{Bounds, Leg};

/// Path coordinates that are the same but for rounding, mm.
pub const SAME_MM: f64 = 1e-9;
/// How far beside a knot derivatives are taken at most, mm.
pub const BESIDE_MM: f64 = 1e-7;

/// Where a look-up was.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cursor {
    leg: usize,
    place: Place,
}

/// A side of a place on the path.
#[derive(Clone, Copy, Debug)]
pub enum Side {
    Before,
    Behind,
}

/// The path from a leg on, over those that join it.
#[derive(Clone, Copy, Debug)]
pub struct Route<'a> {
    front: &'a Leg,
    /// Where that leg stands in `items`.
    first: usize,
    /// The leg at the front, and what comes behind it.
    items: &'a VecDeque<Item>,
}

impl<'a> Route<'a> {
    /// Of `items`, which begin with the leg `front`.
    pub fn new(front: &'a Leg, items: &'a VecDeque<Item>) -> Self {
        Self {
            front,
            first: 0,
            items,
        }
    }

    /// The path from the next leg on; none where no leg follows.
    pub fn behind_front(&self) -> Option<Self> {
        let front = self.leg(1)?;
        Some(Self {
            front,
            first: self.first + 1,
            items: self.items,
        })
    }

    /// The leg at the front.
    pub fn front(&self) -> &'a Leg {
        self.front
    }

    fn leg(&self, index: usize) -> Option<&'a Leg> {
        match self.items.get(self.first + index) {
            Some(Item::Leg(leg)) => Some(leg),
            _ => None,
        }
    }

    /// The legs from the front on that join each other.
    pub fn legs(&self) -> impl Iterator<Item = &'a Leg> {
        let route = *self;
        let mut goes_on = true;
        (0..).map_while(move |index| {
            let leg = route.leg(index).filter(|_| goes_on)?;
            goes_on = leg.joined;
            Some(leg)
        })
    }

    /// The leg on which `s_mm` lies, from the front over joined legs.
    pub fn find(&self, s_mm: f64, cursor: &mut Cursor) -> &'a Leg {
        let mut leg = self.leg(cursor.leg).unwrap_or_else(|| {
            // Only a cursor kept over the end of a leg: it starts again at the front.
            *cursor = Cursor::default();
            self.front
        });
        loop {
            let way = if s_mm > leg.end_mm && leg.joined {
                cursor.leg + 1
            } else if s_mm < leg.start_mm && cursor.leg > 0 {
                cursor.leg - 1
            } else {
                return leg;
            };
            let Some(next) = self.leg(way) else {
                return leg;
            };
            (leg, *cursor) = (
                next,
                Cursor {
                    leg: way,
                    place: Place::default(),
                },
            );
        }
    }

    /// Position and derivatives at `s_mm`, and the leg.
    pub fn at(&self, s_mm: f64, cursor: &mut Cursor) -> (AlongPath, &'a Leg) {
        let leg = self.find(s_mm, cursor);
        (leg.at(s_mm, &mut cursor.place), leg)
    }

    /// Position and derivatives at `s_mm` as they are on one side of it: at a knot the curvature may jump, and where legs join
    /// the direction too.
    pub fn at_side(&self, s_mm: f64, side: Side, cursor: &mut Cursor) -> AlongPath {
        let (at, leg) = self.at(s_mm, cursor);
        let near_mm = leg.near_mm();
        let starts = s_mm < leg.start_mm + near_mm;
        let ends = s_mm > leg.end_mm - near_mm;
        let joint = starts && cursor.leg > 0 || ends && leg.joined;
        // Beside a rest there is one side only, and where that is a cusp its very end says nothing of the way to it.
        let knot = !starts && !ends && leg.next_break_mm(s_mm - near_mm) <= s_mm + near_mm;
        if !joint && !knot {
            return at;
        }
        let beside = self.sides(s_mm, cursor)[side as usize];
        let direction = if joint {
            beside.direction
        } else {
            at.direction
        };
        AlongPath {
            position: at.position,
            direction,
            ..beside
        }
    }

    /// How far the path goes on from `s_mm` without a feature of its own, mm.
    pub fn smooth_for_mm(&self, s_mm: f64, cursor: &mut Cursor) -> f64 {
        let leg = self.find(s_mm, cursor);
        leg.smooth_for_mm(s_mm, &mut cursor.place)
    }

    /// The first knot behind one path coordinate and before another, mm, and the path on both sides of it.
    pub fn knot(
        &self,
        [from_mm, to_mm]: [f64; 2],
        cursor: &mut Cursor,
    ) -> Option<(f64, [AlongPath; 2])> {
        let leg = self.find(from_mm, cursor);
        let break_mm = if from_mm < leg.end_mm - leg.near_mm() {
            leg.next_break_mm(from_mm + leg.near_mm())
        } else {
            let next = self.leg(cursor.leg + 1).filter(|_| leg.joined)?;
            next.next_break_mm(from_mm + next.near_mm())
        };
        (break_mm < to_mm).then(|| (break_mm, self.sides(break_mm, cursor)))
    }

    /// The path on both sides of a knot or of where two legs join: beside it, but in the span or leg that is there.
    fn sides(&self, break_mm: f64, cursor: &mut Cursor) -> [AlongPath; 2] {
        let leg = self.find(break_mm, cursor);
        let before = cursor.leg.checked_sub(1).and_then(|index| self.leg(index));
        let behind = self.leg(cursor.leg + 1).filter(|_| leg.joined);
        let near = |leg: &Leg, s_mm: f64| leg.at(s_mm, &mut Place::default());
        let at_end = break_mm > leg.end_mm - leg.near_mm();
        let at_start = !at_end && break_mm < leg.start_mm + leg.near_mm();
        match (before.filter(|_| at_start), behind.filter(|_| at_end)) {
            (_, Some(next)) => [
                near(leg, leg.end_mm - leg.beside_mm()),
                near(next, next.start_mm + next.beside_mm()),
            ],
            (Some(last), _) => [
                near(last, last.end_mm - last.beside_mm()),
                near(leg, leg.start_mm + leg.beside_mm()),
            ],
            // At an end where none joins, both are the end itself.
            _ => {
                [-1.0, 1.0].map(|sign| leg.at(break_mm + sign * leg.beside_mm(), &mut cursor.place))
            }
        }
    }

    /// Highest speed at `s_mm` for a jump of the derivatives or of the speed there, infinite where there is none, and how far
    /// the next place is where there may be one, mm.
    pub fn step_cap_mm_per_s(&self, s_mm: f64, bounds: &Bounds, cursor: &mut Cursor) -> (f64, f64) {
        let leg = self.find(s_mm, cursor);
        let past_mm = 2.0 * leg.beside_mm();
        let starts = s_mm < leg.start_mm + past_mm && cursor.leg > 0;
        let break_mm = if starts {
            leg.start_mm
        } else {
            leg.next_break_mm(s_mm - past_mm)
        };
        if break_mm >= s_mm + past_mm {
            return (f64::INFINITY, break_mm - s_mm);
        }
        let ends = break_mm >= leg.end_mm;
        // At a rest nothing is passed. Where a curve turns back there, its very end lies across the way to it.
        if ends && !leg.joined {
            return (f64::INFINITY, f64::INFINITY);
        }
        let next = if ends {
            self.leg(cursor.leg + 1).filter(|_| leg.joined)
        } else {
            Some(leg)
        };
        let next_mm = next.map_or(f64::INFINITY, |leg| {
            leg.next_break_mm(s_mm.max(break_mm) + leg.beside_mm())
        });
        // Where legs join, the place has the lower of their speeds, whichever of them it is counted to.
        let beside = if starts {
            self.leg(cursor.leg - 1)
        } else {
            next.filter(|_| ends)
        };
        let cap = |leg: &Leg| leg.cap_mm_per_s(&leg.at(break_mm, &mut Place::default()), bounds);
        let cap = beside.map_or(f64::INFINITY, cap);
        (
            cap.min(Leg::step_cap_mm_per_s(
                &self.sides(break_mm, cursor),
                bounds,
            )),
            next_mm - s_mm,
        )
    }
}
