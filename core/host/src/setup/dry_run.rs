//! A dry run's feed: the program's motion at one feed of the operator's.

use tandem_gcode::Item;
use tandem_rings::Rest;
use tandem_rough::Source;
use tandem_sdk::{Axes, Block, BlockKind, Edge};

/// A stream whose feed motion is driven at the dry-run feed.
pub struct DryRun<S> {
    source: S,
    axes: Axes,
    feed_mm_per_s: f64,
}

impl<S: Source> DryRun<S> {
    /// `source` at `feed_mm_per_s`.
    pub fn new(source: S, axes: Axes, feed_mm_per_s: f64) -> Self {
        Self {
            source,
            axes,
            feed_mm_per_s,
        }
    }

    /// Rapids and dwells are as they are; so is what a feed in mm/s says nothing of, and motion towards a probe or a
    /// switch, whose feed is chosen for what it may touch.
    fn set_feed(&self, block: &mut Block) {
        let way = block.end - block.start;
        let slides =
            (0..self.axes.count()).any(|axis| !self.axes.is_rotary(axis) && way[axis] != 0.0);
        let feeds = match block.kind {
            BlockKind::Rapid | BlockKind::Dwell => false,
            BlockKind::Line => slides,
            BlockKind::Arc | BlockKind::Nurbs => true,
        };
        if feeds && block.stop_on.edge == Edge::None {
            block.feed_mm_per_s = self.feed_mm_per_s;
        }
    }
}

impl<S: Source> Source for DryRun<S> {
    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        let before = items.len();
        let more = self.source.next_items(items)?;
        for item in &mut items[before..] {
            if let Item::Block(block, _) = item {
                self.set_feed(block);
            }
        }
        Ok(more)
    }

    fn may_go_on(&mut self, driven: bool) -> bool {
        self.source.may_go_on(driven)
    }

    fn streams(&self) -> bool {
        self.source.streams()
    }

    fn period(&mut self) {
        self.source.period();
    }

    fn is_waiting(&self) -> bool {
        self.source.is_waiting()
    }

    fn provide_input(&mut self, value: f64) {
        self.source.provide_input(value);
    }

    fn provide_rest(&mut self, rest: &Rest) -> bool {
        self.source.provide_rest(rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::{AxisVector, StopOn};

    struct Nothing;

    impl Source for Nothing {
        fn next_items(&mut self, _items: &mut Vec<Item>) -> Result<bool, String> {
            Ok(false)
        }

        fn provide_input(&mut self, _value: f64) {}

        fn provide_rest(&mut self, _rest: &Rest) -> bool {
            true
        }
    }

    #[test]
    fn feed_motion_of_linear_axes_is_driven_at_it_and_nothing_else() {
        let axes = Axes::new(&[('X', false), ('A', true)]).unwrap();
        let dry = DryRun::new(Nothing, axes, 50.0);
        let feed = |kind, end: [f64; 2], edge| {
            let end = AxisVector::from_slice(&end);
            let mut block = Block {
                kind,
                end,
                feed_mm_per_s: 3.0,
                ..Block::at(AxisVector::ZERO)
            };
            block.stop_on = StopOn {
                edge,
                ..StopOn::default()
            };
            dry.set_feed(&mut block);
            block.feed_mm_per_s
        };
        assert_eq!(feed(BlockKind::Line, [1.0, 0.0], Edge::None), 50.0);
        assert_eq!(
            feed(BlockKind::Arc, [0.0, 0.0], Edge::None),
            50.0,
            "a full circle"
        );
        assert_eq!(
            feed(BlockKind::Line, [0.0, 1.0], Edge::None),
            3.0,
            "only A turns"
        );
        assert_eq!(feed(BlockKind::Rapid, [1.0, 0.0], Edge::None), 3.0);
        assert_eq!(
            feed(BlockKind::Line, [1.0, 0.0], Edge::Rising),
            3.0,
            "a probe"
        );
    }
}
