//! The buffered blocks and their junction feeds: the two-array form of the look-ahead.

use crate::geometry::Entry;
use crate::rows::Transfer;

/// One block's numbers for the update, all in squares of speeds, mm²/s².
#[derive(Clone, Copy, Debug)]
struct Node {
    /// What the start junction and the blocks on both sides of it allow.
    cap: f64,
    /// Highest start from which all that follows can be kept.
    reach: f64,
    /// The start: `reach`, as far as the blocks before can bring the machine to it.
    start: f64,
    /// From one end of the block to the other.
    transfer: Transfer,
}

/// Blocks in order; the first one is the next to be driven.
#[derive(Debug)]
pub struct Buffer {
    nodes: Vec<Node>,
    entries: Vec<Entry>,
    /// Blocks before this one are gone; both vectors are shifted down from time to time.
    first: usize,
    /// Blocks from this one on have not been looked at.
    dirty: usize,
    capacity: usize,
    /// Square of what the last block itself allows.
    last_own: f64,
}

impl Buffer {
    /// An empty buffer for `capacity` blocks. Allocates for good.
    pub fn new(capacity: usize) -> Self {
        let room = 2 * capacity;
        Self {
            nodes: Vec::with_capacity(room),
            entries: Vec::with_capacity(room),
            first: 0,
            dirty: 0,
            capacity,
            last_own: 0.0,
        }
    }

    /// Blocks waiting.
    pub fn len(&self) -> usize {
        self.nodes.len() - self.first
    }

    /// Whether no further block fits.
    pub fn is_full(&self) -> bool {
        self.len() >= self.capacity
    }

    /// Forgets all blocks.
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.entries.clear();
        (self.first, self.dirty) = (0, 0);
    }

    /// Adds a block. An empty buffer starts at rest: the block driven before it ends there.
    pub fn push(&mut self, entry: Entry) {
        if self.nodes.len() == 2 * self.capacity {
            self.shift();
        }
        let own = entry.feed_mm_per_s.powi(2).min(entry.rows.turning_cap());
        let cap = entry.junction_mm_per_s.powi(2).min(own).min(self.last_own);
        self.last_own = own;
        let transfer = entry.rows.transfer(entry.length_mm());
        self.nodes.push(Node { cap, reach: 0.0, start: 0.0, transfer });
        self.entries.push(entry);
    }

    fn shift(&mut self) {
        self.nodes.drain(..self.first);
        self.entries.drain(..self.first);
        self.dirty -= self.first;
        self.first = 0;
    }

    /// Takes the first block with the squares of its start and end speed; `None` where there is no block.
    pub fn pop(&mut self) -> Option<(&Entry, f64, f64)> {
        self.update();
        let index = self.first;
        let start = self.nodes.get(index)?.start;
        let end = self.nodes.get(index + 1).map_or(0.0, |next| next.start);
        self.first += 1;
        Some((&self.entries[index], start, end))
    }

    /// Raises junction feeds for the blocks that have come: backward as far as anything changes, then forward.
    ///
    /// The start of the first block is frozen: it is the speed at which the block before it ends.
    fn update(&mut self) {
        let count = self.nodes.len();
        let dirty = self.dirty.max(self.first);
        if dirty >= count {
            return;
        }
        let mut changed = count;
        let mut next = 0.0;
        for index in (self.first + 1..count).rev() {
            let reach = self.nodes[index].cap.min(self.nodes[index].transfer.apply(next));
            if index < dirty && reach <= self.nodes[index].reach {
                break;
            }
            self.nodes[index].reach = reach;
            next = reach;
            changed = index;
        }
        for index in changed..count {
            let before = self.nodes[index - 1];
            self.nodes[index].start = self.nodes[index].reach.min(before.transfer.apply(before.start));
        }
        self.dirty = count;
    }
}
