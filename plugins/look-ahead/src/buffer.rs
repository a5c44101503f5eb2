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

impl Node {
    const BLANK: Self = Self { cap: 0.0, reach: 0.0, start: 0.0, transfer: Transfer::BLANK };
}

/// Blocks in order; the first one is the next to be driven. A ring, so that nothing is moved.
#[derive(Debug)]
pub struct Buffer {
    nodes: Vec<Node>,
    entries: Vec<Entry>,
    mask: usize,
    capacity: usize,
    /// Running number of the first block, of the first that has not been looked at, and of the next to come.
    first: usize,
    dirty: usize,
    end: usize,
    /// Square of what the last block itself allows.
    last_own: f64,
}

impl Buffer {
    /// An empty buffer for `capacity` blocks. Allocates for good.
    pub fn new(capacity: usize) -> Self {
        // One more than the capacity: the block whose successor is not known comes on top.
        let room = (capacity + 1).next_power_of_two();
        Self {
            nodes: vec![Node::BLANK; room],
            entries: vec![Entry::blank(); room],
            mask: room - 1,
            capacity,
            first: 0,
            dirty: 0,
            end: 0,
            last_own: 0.0,
        }
    }

    /// Blocks waiting.
    pub fn len(&self) -> usize {
        self.end - self.first
    }

    /// Whether no further block fits.
    pub fn is_full(&self) -> bool {
        self.len() >= self.capacity
    }

    /// Forgets all blocks.
    pub fn clear(&mut self) {
        (self.first, self.dirty, self.end) = (0, 0, 0);
    }

    /// Adds a block. An empty buffer starts at rest: the block driven before it ends there.
    pub fn push(&mut self, entry: &Entry) {
        let own = entry.feed_mm_per_s.powi(2).min(entry.rows.turning_cap());
        let cap = entry.junction_mm_per_s.powi(2).min(own).min(self.last_own);
        self.last_own = own;
        let transfer = entry.rows.transfer(entry.length_mm());
        self.nodes[self.end & self.mask] = Node { cap, reach: 0.0, start: 0.0, transfer };
        self.entries[self.end & self.mask].clone_from(entry);
        self.end += 1;
    }

    /// Takes the first block with the squares of its start and end speed; `None` where there is no block.
    pub fn pop(&mut self) -> Option<(&Entry, f64, f64)> {
        self.update();
        if self.len() == 0 {
            return None;
        }
        let index = self.first & self.mask;
        let end = if self.len() > 1 { self.nodes[(self.first + 1) & self.mask].start } else { 0.0 };
        self.first += 1;
        Some((&self.entries[index], self.nodes[index].start, end))
    }

    /// Raises junction feeds for the blocks that have come: backward as far as anything changes, then forward.
    ///
    /// The start of the first block is frozen: it is the speed at which the block before it ends.
    fn update(&mut self) {
        let dirty = self.dirty.max(self.first);
        if dirty >= self.end {
            return;
        }
        let mut changed = self.end;
        let mut next = 0.0;
        for number in (self.first + 1..self.end).rev() {
            let node = &mut self.nodes[number & self.mask];
            let reach = node.cap.min(node.transfer.apply(next));
            if number < dirty && reach <= node.reach {
                break;
            }
            node.reach = reach;
            next = reach;
            changed = number;
        }
        for number in changed..self.end {
            let before = &self.nodes[(number - 1) & self.mask];
            let reached = before.transfer.apply(before.start);
            let node = &mut self.nodes[number & self.mask];
            node.start = node.reach.min(reached);
        }
        self.dirty = self.end;
    }
}
