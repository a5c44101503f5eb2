//! The buffered blocks and the plan for them.

use crate::corner::Corner;
use crate::entry::Entry;
use crate::feeds::{Before, Plan};
use crate::join::{Join, Mode, rest_ramp_s};
use crate::rules::Rules;

/// Blocks and junctions in order. A ring, so that nothing is moved: a block stays in its slot until it has been driven.
#[derive(Debug)]
pub struct Ring {
    entries: Vec<Entry>,
    corners: Vec<Corner>,
    mask: usize,
    first: usize,
    end: usize,
}

impl Ring {
    /// Number of blocks.
    pub fn len(&self) -> usize {
        self.end - self.first
    }

    /// The block at place `k` from the first.
    pub fn entry(&self, k: usize) -> &Entry {
        &self.entries[(self.first + k) & self.mask]
    }

    /// The junction after the block at place `k`; not known after the last.
    pub fn corner(&self, k: usize) -> &Corner {
        &self.corners[(self.first + k) & self.mask]
    }

    /// The block with the running number `number`; it stays until two more have been taken.
    pub fn numbered(&self, number: usize) -> &Entry {
        &self.entries[number & self.mask]
    }
}

/// A block taken out of the buffer, with everything decided.
#[derive(Clone, Copy, Debug, Default)]
pub struct Taken {
    /// Running number, for [`Ring::numbered`].
    pub number: usize,
    /// Feed, mm/s.
    pub feed_mm_per_s: f64,
    /// How long it speeds up, s.
    pub up_s: f64,
    /// How it meets the next block.
    pub join: Join,
    /// The same as it was chosen.
    pub mode: Mode,
    /// The junction after it.
    pub corner: Corner,
    /// The feed of the next block, mm/s, where the two overlap.
    pub next_feed_mm_per_s: f64,
}

/// A new plan is made when this part of the last one is left: each block is planned once and a third.
const KEPT: usize = 4;

/// The buffer.
#[derive(Debug)]
pub struct Buffer {
    ring: Ring,
    capacity: usize,
    plan: Plan,
    /// The plan in force, in the slots of its blocks, up to the running number `planned`; it ends at rest.
    feeds: Vec<f64>,
    modes: Vec<Mode>,
    planned: usize,
    finished: bool,
    before: Before,
    up_s: f64,
}

impl Buffer {
    /// An empty buffer for `capacity` blocks; the first block speeds up with `tau_s`. Allocates for good.
    pub fn new(capacity: usize, tau_s: f64) -> Self {
        // Three more than the capacity: two blocks that are being driven, and one to spare.
        let room = (capacity + 3).next_power_of_two();
        let entries = vec![Entry::blank(); room];
        let corners = vec![Corner::default(); room];
        Self {
            ring: Ring {
                entries,
                corners,
                mask: room - 1,
                first: 0,
                end: 0,
            },
            capacity,
            plan: Plan::new(capacity),
            feeds: vec![0.0; room],
            modes: vec![Mode::Rest; room],
            planned: 0,
            finished: false,
            before: Before {
                feed_mm_per_s: None,
                tau_s,
            },
            up_s: 0.0,
        }
    }

    /// The blocks.
    pub fn ring(&self) -> &Ring {
        &self.ring
    }

    /// Whether no further block fits.
    pub fn is_full(&self) -> bool {
        self.ring.len() >= self.capacity
    }

    /// Whether no block waits.
    pub fn is_empty(&self) -> bool {
        self.ring.len() == 0
    }

    /// Forgets all blocks; the next one speeds up with `tau_s`.
    pub fn clear(&mut self, tau_s: f64) {
        self.ring.first = 0;
        self.ring.end = 0;
        self.planned = 0;
        self.finished = false;
        self.before = Before {
            feed_mm_per_s: None,
            tau_s,
        };
    }

    /// Adds the block that `write` puts into its slot.
    pub fn push(&mut self, rules: &Rules, write: impl FnOnce(&mut Entry)) {
        let ring = &mut self.ring;
        let slot = ring.end & ring.mask;
        write(&mut ring.entries[slot]);
        if ring.end > ring.first {
            let last = (ring.end - 1) & ring.mask;
            ring.corners[last] = Corner::new(rules, &ring.entries[last], &ring.entries[slot]);
        }
        let tau_s = ring.entries[slot].tau_s;
        ring.corners[slot] = Corner {
            rest: true,
            tau_s,
            longest_s: tau_s,
            spare: 1.0,
            ..Corner::default()
        };
        ring.end += 1;
        self.finished = false;
    }

    /// Nothing follows for now: the last block ends at rest.
    pub fn finish(&mut self) {
        self.finished = true;
    }

    /// Takes the first block; `None` where there is none, or where what follows it is not known yet.
    pub fn pop(&mut self, rules: &Rules) -> Option<Taken> {
        if !self.finished && self.ring.len() < 2 {
            return None;
        }
        let left = self.planned.saturating_sub(self.ring.first);
        if self.ring.end > self.planned && left <= self.capacity / KEPT {
            self.update(rules);
        }
        (self.ring.first < self.planned).then(|| self.take(rules))
    }

    fn update(&mut self, rules: &Rules) {
        if !self.plan.make(rules, &self.ring, &self.before) {
            return;
        }
        let ring = &self.ring;
        for (k, (feed, mode)) in self.plan.feeds.iter().zip(&self.plan.modes).enumerate() {
            let slot = (ring.first + k) & ring.mask;
            self.feeds[slot] = *feed;
            self.modes[slot] = *mode;
        }
        self.planned = ring.end;
    }

    fn take(&mut self, rules: &Rules) -> Taken {
        let number = self.ring.first;
        let slots = [number & self.ring.mask, (number + 1) & self.ring.mask];
        let [block, next] = slots.map(|slot| &self.ring.entries[slot]);
        let mode = self.modes[slots[0]];
        let corner = self.ring.corners[slots[0]];
        let feed = self.feeds[slots[0]];
        let fixed = self.before.feed_mm_per_s.is_some();
        let mut taken = Taken {
            number,
            feed_mm_per_s: feed,
            mode,
            corner,
            ..Taken::default()
        };
        if !block.is_dwell() {
            taken.up_s = if fixed {
                self.up_s
            } else {
                rest_ramp_s(rules, block, feed, self.before.tau_s)
            };
            let feeds = [
                feed,
                if mode == Mode::Rest {
                    feed
                } else {
                    self.feeds[slots[1]]
                },
            ];
            let blocks = [block, if mode == Mode::Rest { block } else { next }];
            taken.join = Join::new(rules, &corner, blocks, feeds, mode);
            taken.next_feed_mm_per_s = feeds[1];
            self.before.tau_s = corner.tau_s;
        }
        self.before.feed_mm_per_s = (mode != Mode::Rest).then_some(taken.next_feed_mm_per_s);
        self.up_s = taken.join.up_s;
        self.ring.first += 1;
        taken
    }
}
