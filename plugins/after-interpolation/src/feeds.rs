//! Which blocks move the machine at a time: those whose command is still in the filter.

use std::collections::VecDeque;

use tandem_sdk::{Axes, AxisVector};

/// The feeds of the blocks in the filter.
#[derive(Debug)]
pub(crate) struct Feeds {
    /// Feed and the time until which the block moves the machine. A block that an equal or faster one outlives is never
    /// the highest again and is left out, so the feeds fall from front to back.
    falling: VecDeque<(f64, f64)>,
    linear_until_s: f64,
}

impl Feeds {
    /// No block.
    pub fn new() -> Self {
        Self {
            falling: VecDeque::with_capacity(64),
            linear_until_s: f64::NEG_INFINITY,
        }
    }

    /// Forgets all blocks.
    pub fn clear(&mut self) {
        self.falling.clear();
        self.linear_until_s = f64::NEG_INFINITY;
    }

    /// A block with a command feed, which moves the machine until `until_s`; `linear` where it moves a linear axis.
    pub fn push(&mut self, feed_mm_per_s: f64, until_s: f64, linear: bool) {
        while self
            .falling
            .back()
            .is_some_and(|(feed, _)| *feed <= feed_mm_per_s)
        {
            self.falling.pop_back();
        }
        self.falling.push_back((feed_mm_per_s, until_s));
        if linear {
            self.linear_until_s = until_s;
        }
    }

    /// The highest command feed of the blocks that move the machine at `t_s` or later, mm/s.
    pub fn highest_mm_per_s(&mut self, t_s: f64) -> f64 {
        while self.falling.len() > 1 && self.falling[0].1 <= t_s {
            self.falling.pop_front();
        }
        self.falling.front().map_or(0.0, |(feed, _)| *feed)
    }

    /// The part of `velocity` that path speed counts at `t_s`: the linear axes while a block moves any, else the rotary.
    pub fn counted(&self, velocity: &AxisVector, axes: &Axes, t_s: f64) -> AxisVector {
        let rotary = t_s >= self.linear_until_s;
        let mut counted = AxisVector::ZERO;
        for axis in (0..axes.count()).filter(|axis| axes.is_rotary(*axis) == rotary) {
            counted[axis] = velocity[axis];
        }
        counted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_highest_feed_leaves_when_its_block_does() {
        let mut feeds = Feeds::new();
        feeds.push(5.0, 1.0, true);
        feeds.push(9.0, 2.0, true);
        feeds.push(7.0, 3.0, false);
        feeds.push(7.0, 4.0, false);
        assert_eq!(feeds.falling.len(), 2);
        assert_eq!(
            [0.0, 1.99, 2.0, 5.0].map(|t| feeds.highest_mm_per_s(t)),
            [9.0, 9.0, 7.0, 7.0]
        );
    }

    #[test]
    fn rotary_axes_count_once_no_linear_one_moves() {
        let axes = Axes::new(&[('X', false), ('A', true)]).unwrap();
        let velocity = AxisVector::from_slice(&[3.0, 4.0]);
        let mut feeds = Feeds::new();
        feeds.push(5.0, 1.0, true);
        feeds.push(5.0, 2.0, false);
        assert_eq!(
            feeds.counted(&velocity, &axes, 0.5),
            AxisVector::from_slice(&[3.0])
        );
        assert_eq!(
            feeds.counted(&velocity, &axes, 1.0),
            AxisVector::from_slice(&[0.0, 4.0])
        );
    }
}
