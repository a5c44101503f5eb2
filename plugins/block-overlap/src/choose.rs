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
    /// Highest feed where one of its ends is late or at rest, mm/s.
    pub ramped_mm_per_s: f64,
    /// The feed is no longer open: the block has been joined to the one before.
    pub fixed: bool,
}

impl Item<'_> {
    /// Whether the block may be joined to the next one in full overlap, and otherwise.
    fn possible(&self, corner: &Corner) -> [bool; 2] {
        let kept = |feed: f64| !self.fixed || feed >= self.own_mm_per_s * (1.0 - ROUNDING);
        [!corner.rest && corner.cap_mm_per_s > 0.0 && kept(corner.cap_mm_per_s), kept(self.ramped_mm_per_s)]
    }
}

/// Feeds that differ by less are the same.
pub const ROUNDING: f64 = 1e-12;

#[allow(clippy::struct_field_names, reason = "all of them are named after their unit")]
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
    pub const START: Self = Self { cost_s: [f64::INFINITY, 0.0], highest_mm_per_s: 0.0, lent_s: 0.0 };

    /// The way over `item` to `corner`, which leads to `next`; gives it and, for each mode there, the better mode at the
    /// junction before.
    pub fn over(&self, rules: &Rules, item: &Item<'_>, corner: &Corner, next: Option<&Item<'_>>) -> (Self, [Mode; 2]) {
        if item.block.path.is_none() {
            return (Self::START, [Mode::Late; 2]);
        }
        let possible = item.possible(corner);
        let Some(next) = next.filter(|_| !corner.rest) else { return self.further(item, possible, corner, 0.0) };
        if is_free(item, corner, next) {
            return self.freely();
        }
        let ramp = |item: &Item<'_>| item.ramped_mm_per_s * item.block.slope_s2_per_mm;
        let overlap_s = late_overlap_s(rules, corner, [item.block, next.block], lesser(ramp(item), ramp(next)));
        self.further(item, possible, corner, overlap_s)
    }

    /// Full overlap holds neither block down: it is taken, and how long the block takes no longer matters.
    fn freely(&self) -> (Self, [Mode; 2]) {
        let before = if self.cost_s[FLOW] <= self.cost_s[LATE] { Mode::Flow } else { Mode::Late };
        (Self { cost_s: [0.0, f64::INFINITY], highest_mm_per_s: f64::INFINITY, lent_s: 0.0 }, [before; 2])
    }

    fn further(&self, item: &Item<'_>, possible: [bool; 2], corner: &Corner, overlap_s: f64) -> (Self, [Mode; 2]) {
        let mut way = Self { cost_s: [f64::INFINITY; 2], highest_mm_per_s: corner.cap_mm_per_s, lent_s: overlap_s };
        let mut before = [Mode::Flow; 2];
        for to in [FLOW, LATE] {
            for from in [FLOW, LATE] {
                if !possible[to] || self.cost_s[from] == f64::INFINITY {
                    continue;
                }
                let cost_s = self.cost_s[from] + self.time_s(item, from, to, corner, overlap_s);
                if cost_s < way.cost_s[to] {
                    way.cost_s[to] = cost_s;
                    before[to] = if from == FLOW { Mode::Flow } else { Mode::Late };
                }
            }
        }
        (way, before)
    }

    /// Time of a block: length over feed, and half of each ramp that nothing overlaps.
    fn time_s(&self, item: &Item<'_>, from: usize, to: usize, corner: &Corner, overlap_s: f64) -> f64 {
        let late = (from == LATE) || (to == LATE);
        let mut feed = if late { item.ramped_mm_per_s } else { item.own_mm_per_s };
        if from == FLOW {
            feed = lesser(feed, self.highest_mm_per_s);
        }
        if to == FLOW {
            feed = lesser(feed, corner.cap_mm_per_s);
        }
        let ramp_s = feed * item.block.slope_s2_per_mm;
        let side = |late: bool, overlap_s: f64| if late { (ramp_s - lesser(overlap_s, ramp_s)) / 2.0 } else { 0.0 };
        item.block.length_mm / feed + side(from == LATE, self.lent_s) + side(to == LATE, overlap_s)
    }

    /// Whether there is no way at all: a feed that is fixed allows neither.
    pub fn is_closed(&self) -> bool {
        self.cost_s == [f64::INFINITY; 2]
    }

    /// The better mode at the last junction.
    pub fn best(&self) -> Mode {
        if self.cost_s[FLOW] <= self.cost_s[LATE] { Mode::Flow } else { Mode::Late }
    }
}

/// Whether full overlap holds neither of the two blocks down.
fn is_free(item: &Item<'_>, corner: &Corner, next: &Item<'_>) -> bool {
    corner.cap_mm_per_s >= item.own_mm_per_s && corner.cap_mm_per_s >= next.own_mm_per_s
}
