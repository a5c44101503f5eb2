//! The path ahead, by its coordinate.

use std::collections::VecDeque;

use tandem_motion::nurbs::{AlongPath, Place};

use super::queue::Item;
use super::{Bounds, Leg};

/// Path coordinates that are the same but for rounding, mm.
pub const SAME_MM: f64 = 1e-9;
/// How far beside a knot derivatives are taken, mm.
pub const BESIDE_MM: f64 = 1e-7;
/// So far behind a knot the next one is looked for, mm: path coordinates round.
pub const PAST_MM: f64 = 2.0 * BESIDE_MM;

/// Where a look-up was.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cursor {
    leg: usize,
    place: Place,
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
        Self { front, first: 0, items }
    }

    /// The path from the next leg on; none where no leg follows.
    pub fn behind_front(&self) -> Option<Self> {
        let front = self.leg(1)?;
        Some(Self { front, first: self.first + 1, items: self.items })
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
        let (route, mut goes_on) = (*self, true);
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
            let Some(next) = self.leg(way) else { return leg };
            (leg, *cursor) = (next, Cursor { leg: way, place: Place::default() });
        }
    }

    /// Position and derivatives at `s_mm`, and the leg.
    pub fn at(&self, s_mm: f64, cursor: &mut Cursor) -> (AlongPath, &'a Leg) {
        let leg = self.find(s_mm, cursor);
        (leg.at(s_mm, &mut cursor.place), leg)
    }

    /// Position and derivatives at `s_mm` as they are towards `beside_mm`, which is signed: at a knot the curvature may jump,
    /// and where legs join the direction too.
    pub fn at_side(&self, s_mm: f64, beside_mm: f64, cursor: &mut Cursor) -> AlongPath {
        let (at, leg) = self.at(s_mm, cursor);
        if leg.next_break_mm(s_mm - SAME_MM) > s_mm + SAME_MM {
            return at;
        }
        let beside = self.at(s_mm + beside_mm, cursor).0;
        let direction = if s_mm > leg.end_mm - SAME_MM { beside.direction } else { at.direction };
        AlongPath { position: at.position, direction, ..beside }
    }

    /// How far the path goes on from `s_mm` without a feature of its own, mm.
    pub fn smooth_for_mm(&self, s_mm: f64, cursor: &mut Cursor) -> f64 {
        let leg = self.find(s_mm, cursor);
        leg.smooth_for_mm(s_mm, &mut cursor.place)
    }

    /// The first knot between two path coordinates, mm, and the path on both sides of it.
    pub fn knot(&self, [from_mm, to_mm]: [f64; 2], cursor: &mut Cursor) -> Option<(f64, [AlongPath; 2])> {
        let break_mm = self.find(from_mm, cursor).next_break_mm(from_mm);
        let sides = || [-BESIDE_MM, BESIDE_MM].map(|off| self.at(break_mm + off, cursor).0);
        (from_mm < break_mm && break_mm < to_mm).then(sides).map(|sides| (break_mm, sides))
    }

    /// Highest speed at `s_mm` for a jump of the derivatives there, infinite where there is none, and how far the next place
    /// is where there may be one, mm.
    pub fn step_cap_mm_per_s(&self, s_mm: f64, bounds: &Bounds, cursor: &mut Cursor) -> (f64, f64) {
        let break_mm = self.find(s_mm, cursor).next_break_mm(s_mm - PAST_MM);
        if break_mm >= s_mm + PAST_MM {
            return (f64::INFINITY, break_mm - s_mm);
        }
        let knot = self.knot([s_mm - PAST_MM, s_mm + PAST_MM], cursor);
        let next_mm = self.find(s_mm, cursor).next_break_mm(s_mm + PAST_MM) - s_mm;
        let cap = knot.map_or(f64::INFINITY, |(_, sides)| Leg::step_cap_mm_per_s(&sides, bounds));
        (cap, next_mm)
    }
}
