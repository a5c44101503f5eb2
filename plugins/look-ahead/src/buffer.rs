//! The buffered blocks and their junction feeds: the two-array form of the look-ahead.

use crate::geometry::Entry;
use crate::junction::{End, Rule};
use crate::rows::{Transfer, lesser};

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
    const BLANK: Self = Self {
        cap: 0.0,
        reach: 0.0,
        start: 0.0,
        transfer: Transfer::BLANK,
    };
}

/// A block taken out of the buffer. Its entry stays where it is until the next one is taken.
#[derive(Clone, Copy, Debug, Default)]
pub struct Taken {
    /// Squares of its start and end speed.
    pub squares: [f64; 2],
    /// Running number.
    number: usize,
}

/// Blocks in order; the first one is the next to be driven. A ring, so that nothing is moved: a block is written into
/// its slot when it comes and stays there until it has been driven.
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
    /// The last block whose start the cap alone bounds: no block that comes raises it, nor those before.
    capped: usize,
    /// Whether the slot at `end` holds a block whose end junction is not known yet.
    open: bool,
    /// Square of what the last block itself allows.
    last_own: f64,
}

impl Buffer {
    /// An empty buffer for `capacity` blocks. Allocates for good.
    pub fn new(capacity: usize) -> Self {
        // Two more than the capacity: the block being driven, and the one whose successor is not known.
        let room = (capacity + 2).next_power_of_two();
        Self {
            nodes: vec![Node::BLANK; room],
            entries: vec![Entry::blank(); room],
            mask: room - 1,
            capacity,
            first: 0,
            dirty: 0,
            end: 0,
            capped: 0,
            open: false,
            last_own: 0.0,
        }
    }

    /// Blocks waiting whose end junction is known.
    pub fn len(&self) -> usize {
        self.end - self.first
    }

    /// Whether no further block fits.
    pub fn is_full(&self) -> bool {
        self.len() >= self.capacity
    }

    /// Forgets all blocks.
    pub fn clear(&mut self) {
        self.first = 0;
        self.dirty = 0;
        self.end = 0;
        self.capped = 0;
        self.open = false;
    }

    /// Adds the block that `write` puts into its slot; with it the one before becomes ready to be planned.
    pub fn push(&mut self, rule: &Rule, write: impl FnOnce(&mut Entry)) {
        if !self.open {
            write(&mut self.entries[self.end & self.mask]);
            self.open = true;
            return;
        }
        let slots = [self.end & self.mask, (self.end + 1) & self.mask];
        let Ok([before, after]) = self.entries.get_disjoint_mut(slots) else {
            unreachable!("there are two slots")
        };
        write(after);
        rule.join(before, after);
        let end = End {
            junction_mm_per_s: after.junction_mm_per_s,
            half_step: &after.half_step,
        };
        rule.limit(before, &end, &mut self.nodes[self.end & self.mask].transfer);
        self.close();
    }

    /// Nothing follows for now: the last block ends at rest.
    pub fn finish(&mut self, rule: &Rule) {
        if self.open {
            let slot = self.end & self.mask;
            rule.limit(
                &mut self.entries[slot],
                &End::REST,
                &mut self.nodes[slot].transfer,
            );
            self.close();
            self.open = false;
        }
    }

    /// The end junction of the block at `end` is known. An empty buffer starts at rest: the block driven before ends so.
    fn close(&mut self) {
        let entry = &self.entries[self.end & self.mask];
        let own = entry.own_square;
        let node = &mut self.nodes[self.end & self.mask];
        node.cap = lesser(lesser(entry.junction_mm_per_s.powi(2), own), self.last_own);
        node.reach = 0.0;
        node.start = 0.0;
        self.last_own = own;
        self.end += 1;
    }

    /// Takes the first block; `None` where there is none.
    pub fn pop(&mut self) -> Option<Taken> {
        if !self.is_settled() {
            self.update();
        }
        if self.len() == 0 {
            return None;
        }
        let number = self.first;
        let end = if self.len() > 1 {
            self.nodes[(number + 1) & self.mask].start
        } else {
            0.0
        };
        self.first += 1;
        Some(Taken {
            squares: [self.nodes[number & self.mask].start, end],
            number,
        })
    }

    /// Whether there is room for blocks that may raise the end of the first one, which is frozen when it is taken.
    pub fn would_gain(&mut self) -> bool {
        if self.is_full() || self.len() == 0 || self.is_final() {
            return false;
        }
        self.update();
        !self.is_final()
    }

    /// Whether no block that may come raises the end of the first one.
    fn is_final(&self) -> bool {
        self.first < self.capped || self.is_settled()
    }

    /// What is known of a block that was taken.
    pub fn entry(&self, taken: &Taken) -> &Entry {
        &self.entries[taken.number & self.mask]
    }

    /// Half the change of direction at the end of a block that was taken.
    pub fn end_half_step(&self, taken: &Taken) -> &tandem_sdk::AxisVector {
        &self.entries[(taken.number + 1) & self.mask].half_step
    }

    /// Whether the end of the first block is as fast as its junction and its start allow: no block that has come since
    /// the last update can raise it. While the machine cruises, this puts the update off until a bufferful has come,
    /// and the blocks near the end are not planned again with each that follows.
    fn is_settled(&self) -> bool {
        if self.first + 1 >= self.dirty {
            return false;
        }
        let first = &self.nodes[self.first & self.mask];
        let next = &self.nodes[(self.first + 1) & self.mask];
        next.start >= lesser(next.cap, first.transfer.apply(first.start))
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
            let from_end = node.transfer.apply(next);
            let reach = lesser(node.cap, from_end);
            if node.cap <= from_end {
                self.capped = self.capped.max(number);
            }
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
            node.start = lesser(node.reach, reached);
        }
        self.dirty = self.end;
    }
}
