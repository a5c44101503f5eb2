//! How densely blocks follow each other in a program: how many of them the queue has to hold.

use std::collections::VecDeque;

use tandem_machine::Machine;
use tandem_rings::Sizes;
use tandem_sdk::{Block, BlockKind};

/// Entries of the ring that a block makes at most with the built-in planners, cuts at the ends of an advance aside:
/// speeding up, cruising and slowing down, or two overlaps and what lies between, and an event.
const ENTRIES_A_BLOCK: usize = 4;

/// Counts, block by block, the most of them that are driven within the depth of the queue at their programmed feeds.
pub(crate) struct Density {
    depth_s: f64,
    max_feed_ratio: f64,
    fastest_mm_per_s: f64,
    /// Shortest times of the last blocks, s, and their sum.
    times_s: VecDeque<f64>,
    sum_s: f64,
    most: usize,
}

impl Density {
    /// No block yet; the queue is to hold `depth_s`.
    pub fn new(machine: &Machine, depth_s: f64) -> Self {
        let rapids = machine
            .limits
            .axes()
            .iter()
            .map(|axis| axis.rapid_mm_per_s.powi(2));
        Self {
            depth_s,
            max_feed_ratio: machine.motion.max_feed_ratio,
            fastest_mm_per_s: rapids.sum::<f64>().sqrt(),
            times_s: VecDeque::new(),
            sum_s: 0.0,
            most: 0,
        }
    }

    /// The next block of the program.
    pub fn block(&mut self, block: &Block) {
        // More than the largest ring holds need not be known.
        if self.most * ENTRIES_A_BLOCK >= Sizes::SEGMENTS[1] {
            return;
        }
        let speed = (self.max_feed_ratio * block.feed_mm_per_s).min(self.fastest_mm_per_s);
        let time_s = if block.kind == BlockKind::Dwell {
            block.dwell_s
        } else {
            block.length_mm / speed
        };
        self.times_s.push_back(time_s);
        self.sum_s += time_s;
        while self.sum_s > self.depth_s
            && let Some(first_s) = self.times_s.pop_front()
        {
            // What rounding leaves of a sum ends with the blocks that it was made of.
            self.sum_s = if self.times_s.is_empty() {
                0.0
            } else {
                self.sum_s - first_s
            };
        }
        self.most = self.most.max(self.times_s.len());
    }

    /// Entries of the ring that hold the depth anywhere in the program.
    pub fn entries(&self) -> usize {
        ENTRIES_A_BLOCK * self.most
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::AxisVector;

    fn density(lengths_mm: impl IntoIterator<Item = f64>) -> usize {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../examples/machines/mill-3axis.toml"
        );
        let machine = Machine::read(path.as_ref(), &[]).unwrap();
        let mut density = Density::new(&machine, 0.501);
        for length_mm in lengths_mm {
            let kind = BlockKind::Line;
            density.block(&Block {
                kind,
                length_mm,
                feed_mm_per_s: 50.0,
                ..Block::at(AxisVector::ZERO)
            });
        }
        density.entries()
    }

    #[test]
    fn the_densest_part_of_a_program_counts_and_a_long_one_makes_no_more_of_it() {
        let dense = || std::iter::repeat_n(0.125, 5000);
        assert_eq!(density(dense()), 4 * 200);
        let mixed = dense().chain(std::iter::repeat_n(40.0, 100)).chain(dense());
        assert_eq!(density(mixed), 4 * 200);
        assert_eq!(density([40.0; 50]), 0);
        assert!(density(std::iter::repeat_n(1e-4, 200_000)) >= Sizes::SEGMENTS[1]);
    }
}
