//! What the planner knows of one block.

use tandem_motion::Path;
use tandem_sdk::{AxisVector, Block, BlockKind, JointLanes, LimitedBy};

use crate::rows::{Rows, lesser, min_ratio};

/// A block with everything that does not change while feeds are raised.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Index of the block and its program line.
    pub index: u64,
    /// Program line.
    pub line: u32,
    /// The kind of path.
    pub kind: BlockKind,
    /// The machine rests at the start for the program's sake.
    pub starts_at_rest: bool,
    /// The machine rests at the end for the program's sake.
    pub ends_at_rest: bool,
    /// What set the highest feed.
    pub feed_reason: LimitedBy,
    /// The programmed feed under the policy's cap, mm/s.
    pub command_mm_per_s: f64,
    /// Highest feed, mm/s, from command and axis speeds.
    pub feed_mm_per_s: f64,
    /// Highest feed the start junction's rule allows, before the blocks' own limits, mm/s.
    pub junction_mm_per_s: f64,
    /// Square of the highest speed inside, from the feed and what turning may take; known with the end junction.
    pub own_square: f64,
    /// Half the change of direction at the start junction; zero where the machine rests there.
    pub half_step: AxisVector,
    /// Limits inside the block; filled in when its end junction is known.
    pub rows: Rows,
    /// Its path; `None` for a dwell.
    pub path: Option<Path>,
    /// Place and duration, s, of a dwell.
    pub dwell: (AxisVector, f64),
}

/// What caps the feed of every block.
#[derive(Clone, Copy, Debug)]
pub struct FeedCaps<'a> {
    /// The programmed feed is planned at this multiple.
    pub feed_ratio: f64,
    /// Axis speeds, mm/s.
    pub axis_mm_per_s: &'a [f64],
    /// The joints that are sums of axes, where there are any.
    pub joint_lanes: Option<&'static JointLanes>,
    /// Most blocks a second: the fine loop looks at a bounded number of segments a period.
    pub max_blocks_per_s: f64,
}

impl Entry {
    /// A dwell of no duration.
    pub fn blank() -> Self {
        Self {
            index: 0,
            line: 0,
            kind: BlockKind::Dwell,
            starts_at_rest: true,
            ends_at_rest: true,
            feed_reason: LimitedBy::Feed,
            command_mm_per_s: 0.0,
            feed_mm_per_s: 0.0,
            junction_mm_per_s: 0.0,
            own_square: 0.0,
            half_step: AxisVector::ZERO,
            rows: Rows::default(),
            path: None,
            dwell: (AxisVector::ZERO, 0.0),
        }
    }

    /// Takes what `block` says by itself under the `caps` of the planner.
    ///
    /// In place, field by field: entries are large, and moving them costs more than computing them.
    pub fn set(&mut self, block: &Block, caps: &FeedCaps<'_>) {
        self.index = block.index;
        self.line = block.line;
        self.kind = block.kind;
        self.starts_at_rest = block.starts_at_rest();
        self.ends_at_rest = block.ends_at_rest();
        self.command_mm_per_s = block.command_feed_mm_per_s();
        self.junction_mm_per_s = 0.0;
        self.half_step = AxisVector::ZERO;
        self.rows.clear();
        self.path = Path::with_lanes(block, caps.joint_lanes);
        if self.path.is_none() {
            self.dwell = (block.end, block.dwell_s);
        }
        self.set_feed(block, caps);
        self.own_square = self.feed_mm_per_s.powi(2);
    }

    fn set_feed(&mut self, block: &Block, caps: &FeedCaps<'_>) {
        self.feed_mm_per_s = 0.0;
        self.feed_reason = LimitedBy::Feed;
        let Some(path) = &self.path else { return };
        let command = block.feed_mm_per_s * caps.feed_ratio;
        let policy = block.feed_cap_mm_per_s;
        let most = path.max_direction();
        let axes = caps
            .axis_mm_per_s
            .iter()
            .zip(&most.0)
            .map(|(v, most)| (*v, *most));
        let buffer = path.length_mm() * caps.max_blocks_per_s;
        self.feed_mm_per_s = lesser(min_ratio(lesser(command, policy), axes), buffer);
        self.feed_reason = match self.feed_mm_per_s {
            feed if feed >= command || block.kind == BlockKind::Rapid => LimitedBy::Feed,
            feed if feed >= policy => LimitedBy::Policy,
            feed if feed >= buffer => LimitedBy::Buffer,
            _ => LimitedBy::Velocity,
        };
    }

    /// Length of the path, mm; zero for a dwell.
    pub fn length_mm(&self) -> f64 {
        self.path.as_ref().map_or(0.0, Path::length_mm)
    }

    /// Direction at the start and at the end, axis units per mm; zero for a dwell.
    pub fn direction(&self, at_end: bool) -> AxisVector {
        let place = |path: &Path| if at_end { path.length_mm() } else { 0.0 };
        self.path
            .as_ref()
            .map_or(AxisVector::ZERO, |path| path.direction(place(path)))
    }

    /// Whether the machine rests between this block and `next`.
    pub fn rests_before(&self, next: &Self) -> bool {
        self.ends_at_rest || next.starts_at_rest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_feed_of_a_block_is_the_lowest_that_anything_allows_and_its_reason_is_who_did() {
        // 10 mm along X; an axis may go 100 mm/s, and 8 blocks a second make 80 mm/s.
        for (kind, programmed, cap, axis, feed, reason) in [
            (
                BlockKind::Line,
                50.0,
                f64::INFINITY,
                100.0,
                50.0,
                LimitedBy::Feed,
            ),
            (BlockKind::Line, 50.0, 30.0, 100.0, 30.0, LimitedBy::Policy),
            (BlockKind::Line, 50.0, 50.0, 100.0, 50.0, LimitedBy::Feed),
            (BlockKind::Line, 90.0, 85.0, 100.0, 80.0, LimitedBy::Buffer),
            (BlockKind::Line, 90.0, 80.0, 100.0, 80.0, LimitedBy::Policy),
            (BlockKind::Line, 60.0, 55.0, 40.0, 40.0, LimitedBy::Velocity),
            (
                BlockKind::Rapid,
                60.0,
                f64::INFINITY,
                40.0,
                40.0,
                LimitedBy::Feed,
            ),
        ] {
            let line = tandem_rig::line(
                &AxisVector::ZERO,
                &AxisVector::from_slice(&[10.0]),
                programmed,
            );
            let block = Block {
                kind,
                feed_cap_mm_per_s: cap,
                ..line
            };
            let caps = FeedCaps {
                feed_ratio: 1.0,
                axis_mm_per_s: &[axis],
                joint_lanes: None,
                max_blocks_per_s: 8.0,
            };
            let mut entry = Entry::blank();
            entry.set(&block, &caps);
            let what = format!("{programmed} mm/s, cap {cap}, axis {axis}");
            assert!(
                (entry.feed_mm_per_s - feed).abs() < 1e-9,
                "{what}: {}",
                entry.feed_mm_per_s
            );
            assert_eq!(entry.feed_reason, reason, "{what}");
        }
    }
}
