//! What is to be driven: stretches and dwells, one behind the other.

use std::collections::VecDeque;
use std::sync::Arc;

use tandem_motion::nurbs::Place;
use tandem_sdk::{Block, BlockKind};

use super::leg::Least;
use super::{Bounds, Leg, Route};
use crate::course::Course;

/// What comes next.
#[derive(Clone, Debug)]
pub enum Item {
    Leg(Leg),
    Dwell(Block),
}

/// The queue of stretches and dwells.
#[derive(Debug, Default)]
pub struct Queue {
    pub items: VecDeque<Item>,
    /// Path coordinate where the next leg begins, mm.
    pub end_mm: f64,
}

impl Queue {
    /// Appends the stretches of `block`, or the dwell. Allocates.
    pub fn push(&mut self, block: &Block, course: Option<Course>, bounds: &Bounds) {
        let Some(course) = course.map(Arc::new) else {
            self.items.push_back(Item::Dwell(*block));
            return;
        };
        let count = course.stretches().len();
        let feed_mm_per_s = feed_mm_per_s(block, &course, bounds);
        for stretch in 0..count {
            let length_mm = course.stretches()[stretch].length_mm;
            let leg = Leg {
                block: *block,
                course: Arc::clone(&course),
                stretch,
                start_mm: self.end_mm,
                end_mm: self.end_mm + length_mm,
                begins: stretch == 0,
                ends: stretch + 1 == count,
                joined: false,
                feed_mm_per_s,
                least: Least::on(
                    &course,
                    stretch,
                    bounds,
                    block.kind == BlockKind::Rapid,
                    feed_mm_per_s,
                ),
            };
            self.end_mm = leg.end_mm;
            if let Some(Item::Leg(before)) = self.items.back_mut() {
                let turns = before.course.stretches()[before.stretch].turns;
                let rests =
                    turns || leg.begins && (before.block.ends_at_rest() || block.starts_at_rest());
                before.joined = !rests && before.runs_into(&leg, bounds);
            }
            self.items.push_back(Item::Leg(leg));
        }
    }

    /// Moves the path coordinates so that the leg at the front begins at zero, and sums them up anew; gives by how much. Does
    /// not allocate.
    pub fn begin_at_zero(&mut self) -> f64 {
        let Some(behind_mm) = self.front().map(|leg| leg.start_mm) else {
            return 0.0;
        };
        self.end_mm = 0.0;
        for item in &mut self.items {
            if let Item::Leg(leg) = item {
                leg.start_mm = self.end_mm;
                leg.end_mm = self.end_mm + leg.course.stretches()[leg.stretch].length_mm;
                self.end_mm = leg.end_mm;
            }
        }
        behind_mm
    }

    /// The leg at the front.
    pub fn front(&self) -> Option<&Leg> {
        self.leg(0)
    }

    fn leg(&self, index: usize) -> Option<&Leg> {
        match self.items.get(index) {
            Some(Item::Leg(leg)) => Some(leg),
            _ => None,
        }
    }

    /// The path from the leg at the front on.
    pub fn route(&self) -> Option<Route<'_>> {
        self.front().map(|front| Route::new(front, &self.items))
    }

    /// Where the run from the front ends, mm, and whether it is known to end there.
    pub fn run_end(&self, finished: bool) -> (f64, bool) {
        let mut end_mm = 0.0;
        let mut index = 0;
        while let Some(leg) = self.leg(index) {
            end_mm = leg.end_mm;
            index += 1;
            if !leg.joined {
                break;
            }
        }
        (end_mm, finished || index < self.items.len())
    }
}

/// The speed to be driven where no other limit counts, mm/s.
fn feed_mm_per_s(block: &Block, course: &Course, bounds: &Bounds) -> f64 {
    if block.kind == BlockKind::Rapid {
        let direction = course.at(0, 0.0, &mut Place::default()).direction;
        return bounds.context.limits.along(&direction).rapid_mm_per_s;
    }
    block.command_feed_mm_per_s() * bounds.context.max_feed_ratio
}
