//! What the planner knows of one block.

use tandem_motion::Path;
use tandem_sdk::{AxisVector, Block, BlockKind, LimitedBy};

use crate::rows::Rows;

/// A block with everything that does not change while feeds are raised.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Index of the block and its program line.
    pub index: u64,
    /// Program line.
    pub line: u32,
    /// The kind of path.
    pub kind: BlockKind,
    /// The machine rests at the end for the program's sake.
    pub ends_at_rest: bool,
    /// What set the highest feed.
    pub feed_reason: LimitedBy,
    /// Its path; `None` for a dwell.
    pub path: Option<Path>,
    /// Where it ends.
    pub end: AxisVector,
    /// Half the change of direction at the start and at the end junction; zero where the machine rests there.
    pub half_steps: [AxisVector; 2],
    /// The programmed feed under the policy's cap, mm/s.
    pub command_mm_per_s: f64,
    /// Highest feed, mm/s, from command and axis speeds.
    pub feed_mm_per_s: f64,
    /// Duration of a dwell, s.
    pub dwell_s: f64,
    /// Highest feed the start junction's rule allows, before the blocks' own limits, mm/s.
    pub junction_mm_per_s: f64,
    /// Limits inside the block; filled in when its end junction is known.
    pub rows: Rows,
}

impl Entry {
    /// A dwell of no duration.
    pub fn blank() -> Self {
        Self::new(&Block::at(AxisVector::ZERO), 1.0, &[])
    }

    /// What `block` says by itself, planned at `feed_ratio` times its feed, with the axis speeds `axis_mm_per_s`.
    pub fn new(block: &Block, feed_ratio: f64, axis_mm_per_s: &[f64]) -> Self {
        let mut entry = Self {
            index: block.index,
            line: block.line,
            kind: block.kind,
            ends_at_rest: block.ends_at_rest(),
            feed_reason: LimitedBy::Feed,
            path: Path::new(block),
            end: block.end,
            half_steps: [AxisVector::ZERO; 2],
            command_mm_per_s: block.command_feed_mm_per_s(),
            feed_mm_per_s: 0.0,
            dwell_s: block.dwell_s,
            junction_mm_per_s: 0.0,
            rows: Rows::default(),
        };
        entry.set_feed(block, feed_ratio, axis_mm_per_s);
        entry
    }

    fn set_feed(&mut self, block: &Block, feed_ratio: f64, axis_mm_per_s: &[f64]) {
        let Some(path) = &self.path else { return };
        let command = block.feed_mm_per_s * feed_ratio;
        let policy = block.feed_cap_mm_per_s;
        let most = path.max_direction();
        let moving = axis_mm_per_s.iter().enumerate().filter(|(axis, _)| most[*axis] > 0.0);
        let axes = moving.map(|(axis, v)| v / most[axis]).fold(f64::INFINITY, f64::min);
        self.feed_mm_per_s = command.min(policy).min(axes);
        self.feed_reason = match self.feed_mm_per_s {
            feed if feed >= command || block.kind == BlockKind::Rapid => LimitedBy::Feed,
            feed if feed >= policy => LimitedBy::Policy,
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
        self.path.as_ref().map_or(AxisVector::ZERO, |path| path.direction(place(path)))
    }

    /// Whether the machine rests between this block and `next`.
    pub fn rests_before(&self, next: &Self) -> bool {
        self.ends_at_rest || matches!(next.kind, BlockKind::Dwell | BlockKind::Rapid)
    }
}
