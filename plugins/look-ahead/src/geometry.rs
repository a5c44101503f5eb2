//! What the planner knows of one block.

use tandem_motion::Path;
use tandem_sdk::{AxisVector, Block, BlockKind, LimitedBy};

use crate::rows::Rows;

/// A block with everything that does not change while feeds are raised.
#[derive(Clone, Debug)]
pub struct Entry {
    /// The block as accepted.
    pub block: Block,
    /// Its path; `None` for a dwell.
    pub path: Option<Path>,
    /// Direction at the start and at the end, axis units per mm.
    pub directions: [AxisVector; 2],
    /// Half the change of direction at the start and at the end junction; zero where the machine rests there.
    pub half_steps: [AxisVector; 2],
    /// Highest feed, mm/s, from command and axis speeds.
    pub feed_mm_per_s: f64,
    /// What set that feed.
    pub feed_reason: LimitedBy,
    /// Limits inside the block; filled in when its end junction is known.
    pub rows: Rows,
    /// Highest feed the start junction's rule allows, before the blocks' own limits, mm/s.
    pub junction_mm_per_s: f64,
}

impl Entry {
    /// What `block` says by itself, planned at `feed_ratio` times its feed, with the axis speeds `axis_mm_per_s`.
    pub fn new(block: &Block, feed_ratio: f64, axis_mm_per_s: &[f64]) -> Self {
        let path = Path::new(block);
        let directions = path.map_or([AxisVector::ZERO; 2], |p| [p.direction(0.0), p.direction(p.length_mm())]);
        let mut entry = Self {
            block: *block,
            path,
            directions,
            half_steps: [AxisVector::ZERO; 2],
            feed_mm_per_s: 0.0,
            feed_reason: LimitedBy::Feed,
            rows: Rows::default(),
            junction_mm_per_s: 0.0,
        };
        if let Some(path) = &path {
            entry.set_feed(path, feed_ratio, axis_mm_per_s);
        }
        entry
    }

    fn set_feed(&mut self, path: &Path, feed_ratio: f64, axis_mm_per_s: &[f64]) {
        let command = self.block.feed_mm_per_s * feed_ratio;
        let policy = self.block.feed_cap_mm_per_s;
        let most = path.max_direction();
        let moving = axis_mm_per_s.iter().enumerate().filter(|(axis, _)| most[*axis] > 0.0);
        let axes = moving.map(|(axis, v)| v / most[axis]).fold(f64::INFINITY, f64::min);
        self.feed_mm_per_s = command.min(policy).min(axes);
        self.feed_reason = match self.feed_mm_per_s {
            feed if feed >= command || self.block.kind == BlockKind::Rapid => LimitedBy::Feed,
            feed if feed >= policy => LimitedBy::Policy,
            _ => LimitedBy::Velocity,
        };
    }

    /// Length of the path, mm; zero for a dwell.
    pub fn length_mm(&self) -> f64 {
        self.path.as_ref().map_or(0.0, Path::length_mm)
    }

    /// Whether the machine rests between this block and `next`.
    pub fn rests_before(&self, next: &Self) -> bool {
        self.block.ends_at_rest() || next.block.starts_at_rest()
    }
}
