//! Which junctions are passed in full overlap, and where the next block starts late.
//!
//! A block has one feed. Passing a sharp corner in full overlap holds both its blocks to a low feed; starting the next
//! block late costs half of each ramp instead. Whichever takes less time over all blocks is found by the shortest way
//! through two states a junction; where full overlap holds nothing down there is nothing to choose.

use crate::corner::Corner;
use crate::entry::Entry;
use crate::join::{Mode, late_overlap_s};
use crate::rules::{Rules, lesser};

/// What is known of one block for the choice.
#[derive(Clone, Copy, Debug)]
pub struct Item<'a> {
    /// The block.
    pub block: &'a Entry,
    /// Highest feed by itself, mm/s.
    pub own_mm_per_s: f64,
    /// Highest feed in full overlap as far as its neighbours are known, mm/s.
    pub reach_mm_per_s: f64,
    /// Highest feed where one of its ends is late or at rest, mm/s.
    pub ramped_mm_per_s: f64,
    /// The feed is no longer open: the block has been joined to the one before.
    pub fixed: bool,
}

impl Item<'_> {
    /// Whether the block may be joined to the next one in full overlap at most at `flow_mm_per_s`, and otherwise.
    fn possible(&self, corner: &Corner, flow_mm_per_s: f64) -> [bool; 2] {
        let kept = |feed: f64| !self.fixed || feed >= self.own_mm_per_s * (1.0 - ROUNDING);
        [
            !corner.rest && corner.cap_mm_per_s > 0.0 && kept(flow_mm_per_s),
            kept(self.ramped_mm_per_s),
        ]
    }
}

/// Feeds that differ by less are the same.
pub const ROUNDING: f64 = 1e-12;

#[allow(
    clippy::struct_field_names,
    reason = "all of them are named after their unit"
)]
/// The state of the way at one junction: what both modes have cost so far, s; infinite where a mode is impossible.
#[derive(Clone, Copy, Debug)]
pub struct Way {
    cost_s: [f64; 2],
    highest_mm_per_s: f64,
    lent_s: f64,
}

/// Index of the two modes in a [`Way`].
const FLOW: usize = 0;
const LATE: usize = 1;

impl Way {
    /// At rest, or where the feed of the next block is fixed already.
    pub const START: Self = Self {
        cost_s: [f64::INFINITY, 0.0],
        highest_mm_per_s: 0.0,
        lent_s: 0.0,
    };

    /// The way over `item` to `corner`, which leads to `next`; gives it and, for each mode there, the better mode at the
    /// junction before.
    pub fn over(
        &self,
        rules: &Rules,
        item: &Item<'_>,
        corner: &Corner,
        next: Option<&Item<'_>>,
    ) -> (Self, [Mode; 2]) {
        if item.block.is_dwell() {
            return (Self::START, [Mode::Late; 2]);
        }
        let Some(next) = next.filter(|_| !corner.rest) else {
            return self.further(item, item.possible(corner, 0.0), [0.0; 2], 0.0);
        };
        let flow_mm_per_s = flow_mm_per_s(item, corner, next);
        if is_free(item, next, flow_mm_per_s) {
            return self.freely(item);
        }
        let possible = item.possible(corner, flow_mm_per_s[0]);
        let ramp = |item: &Item<'_>| item.ramped_mm_per_s * item.block.slope_s2_per_mm;
        let overlap_s = late_overlap_s(
            rules,
            corner,
            [item.block, next.block],
            lesser(ramp(item), ramp(next)),
        );
        self.further(item, possible, flow_mm_per_s, overlap_s)
    }

    /// Full overlap holds neither block down: it is taken, and what came before no longer matters.
    fn freely(&self, item: &Item<'_>) -> (Self, [Mode; 2]) {
        let way = Self {
            cost_s: [0.0, f64::INFINITY],
            highest_mm_per_s: f64::INFINITY,
            lent_s: 0.0,
        };
        let open = self.cost_s[FLOW] < f64::INFINITY && self.cost_s[LATE] < f64::INFINITY;
        let further_s = |from: usize| self.time_s(item, [from, FLOW], item.own_mm_per_s, 0.0);
        let ways_s =
            [FLOW, LATE].map(|from| self.cost_s[from] + if open { further_s(from) } else { 0.0 });
        (
            way,
            [if ways_s[FLOW] <= ways_s[LATE] {
                Mode::Flow
            } else {
                Mode::Late
            }; 2],
        )
    }

    fn further(
        &self,
        item: &Item<'_>,
        possible: [bool; 2],
        flow: [f64; 2],
        overlap_s: f64,
    ) -> (Self, [Mode; 2]) {
        let mut way = Self {
            cost_s: [f64::INFINITY; 2],
            highest_mm_per_s: flow[1],
            lent_s: overlap_s,
        };
        let mut before = [Mode::Flow; 2];
        for to in [FLOW, LATE] {
            for from in [FLOW, LATE] {
                if !possible[to] || self.cost_s[from] == f64::INFINITY {
                    continue;
                }
                let cost_s = self.cost_s[from] + self.time_s(item, [from, to], flow[0], overlap_s);
                if cost_s < way.cost_s[to] {
                    way.cost_s[to] = cost_s;
                    before[to] = if from == FLOW { Mode::Flow } else { Mode::Late };
                }
            }
        }
        (way, before)
    }

    /// Time of a block: length over feed, and half of each ramp that nothing overlaps.
    fn time_s(
        &self,
        item: &Item<'_>,
        [from, to]: [usize; 2],
        flow_mm_per_s: f64,
        overlap_s: f64,
    ) -> f64 {
        let late = (from == LATE) || (to == LATE);
        let mut feed = if late {
            item.ramped_mm_per_s
        } else {
            item.reach_mm_per_s
        };
        if from == FLOW {
            feed = lesser(feed, self.highest_mm_per_s);
        }
        if to == FLOW {
            feed = lesser(feed, flow_mm_per_s);
        }
        let ramp_s = feed * item.block.slope_s2_per_mm;
        let side = |late: bool, overlap_s: f64| {
            if late {
                (ramp_s - lesser(overlap_s, ramp_s)) / 2.0
            } else {
                0.0
            }
        };
        item.block.length_mm / feed + side(from == LATE, self.lent_s) + side(to == LATE, overlap_s)
    }

    /// Whether there is no way at all: a feed that is fixed allows neither.
    pub fn is_closed(&self) -> bool {
        self.cost_s == [f64::INFINITY; 2]
    }

    /// The better mode at the last junction.
    pub fn best(&self) -> Mode {
        if self.cost_s[FLOW] <= self.cost_s[LATE] {
            Mode::Flow
        } else {
            Mode::Late
        }
    }
}

/// The highest feeds of two blocks in full overlap: under the cap, and no further apart than the axes allow.
fn flow_mm_per_s(item: &Item<'_>, corner: &Corner, next: &Item<'_>) -> [f64; 2] {
    let mut feeds = [item, next].map(|of| lesser(of.reach_mm_per_s, corner.cap_mm_per_s));
    if feeds[0] == feeds[1] {
        return feeds;
    }
    if feeds[0] > feeds[1] {
        feeds[0] = lesser(
            feeds[0],
            corner.lift_mm_per_s(feeds[1], item.block.slope_s2_per_mm),
        );
    } else {
        feeds[1] = lesser(
            feeds[1],
            corner.lift_mm_per_s(feeds[0], next.block.slope_s2_per_mm),
        );
    }
    feeds
}

/// Whether full overlap holds neither of the two blocks down.
fn is_free(item: &Item<'_>, next: &Item<'_>, flow_mm_per_s: [f64; 2]) -> bool {
    flow_mm_per_s[0] >= item.own_mm_per_s && flow_mm_per_s[1] >= next.own_mm_per_s
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A block of this slope, s²/mm, that is as fast as `reach_mm_per_s`.
    fn block(slope_s2_per_mm: f64) -> Entry {
        Entry {
            slope_s2_per_mm,
            ..Entry::blank()
        }
    }

    fn item(block: &Entry, reach_mm_per_s: f64) -> Item<'_> {
        Item {
            block,
            own_mm_per_s: 50.0,
            reach_mm_per_s,
            ramped_mm_per_s: 40.0,
            fixed: false,
        }
    }

    /// 20 ms of overlap, and 5 mm of room, which 250 mm/s would take.
    fn corner() -> Corner {
        Corner {
            room_mm: 5.0,
            longest_s: 0.02,
            cap_mm_per_s: 100.0,
            spare: 1.0,
            ..Corner::default()
        }
    }

    #[test]
    fn the_faster_of_two_blocks_is_as_fast_as_its_axes_may_change_in_the_overlap() {
        // 1000 and 500 mm/s² change by 20 and by 10 mm/s in 20 ms.
        let (quick, slow) = (block(1e-3), block(2e-3));
        for (reach, expected) in [
            ([30.0, 90.0], [30.0, 40.0]),
            ([90.0, 30.0], [50.0, 30.0]),
            ([30.0, 33.0], [30.0, 33.0]),
            ([33.0, 30.0], [33.0, 30.0]),
            ([60.0, 60.0], [60.0, 60.0]),
            ([150.0, 120.0], [100.0, 100.0]),
        ] {
            let found = flow_mm_per_s(&item(&quick, reach[0]), &corner(), &item(&slow, reach[1]));
            for (found, expected) in found.into_iter().zip(expected) {
                assert!((found - expected).abs() < 1e-9, "{reach:?}: {found}");
            }
        }
    }

    #[test]
    fn full_overlap_needs_room_and_a_block_that_is_joined_its_feed() {
        let entry = block(1e-3);
        let (free, open) = (item(&entry, 50.0), corner());
        assert_eq!(free.possible(&open, 10.0), [true, true]);
        let rest = Corner { rest: true, ..open };
        let closed = Corner {
            cap_mm_per_s: 0.0,
            ..open
        };
        for corner in [rest, closed] {
            assert_eq!(free.possible(&corner, 50.0), [false, true]);
        }
        let fixed = Item {
            fixed: true,
            ..free
        };
        assert_eq!(fixed.possible(&open, 50.0), [true, false]);
        assert_eq!(fixed.possible(&open, 49.0), [false, false]);
        let ramped = Item {
            ramped_mm_per_s: 50.0,
            ..fixed
        };
        assert_eq!(ramped.possible(&open, 49.0), [false, true]);
    }
}
