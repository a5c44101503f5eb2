//! `[planner.options]` of the block-overlap planner.

use serde::{Deserialize, Serialize};

/// Whether the corner error is bounded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CornerControl {
    /// The path tolerance bounds it: the time constant is at most `TA`, and as much shorter as tolerance, axes and short
    /// blocks ask.
    #[default]
    On,
    /// The time constant is `TA`, and the corner loses what it loses.
    Off,
}

/// What keeps the axis limits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LimitMode {
    /// Lower feeds, or a later start of the next block, whichever costs less.
    #[default]
    Slow,
    /// The same, and blocks overlap for longer than `TA` where acceleration asks for it and the tolerance allows it.
    Stretch,
    /// Nothing: as published. Simulated drives with `guard.mode = "count"` only.
    Off,
}

tandem_sdk::options! {
    /// The options.
    #[derive(Eq)]
    pub struct Options {
        /// Whether the path tolerance bounds the corner error.
        pub corner_control: CornerControl = CornerControl::default(),
        /// What keeps the axis limits: lower feeds, longer overlaps too, or nothing, as published (simulated drives with
        /// `guard.mode = "count"` only).
        pub limits: LimitMode = LimitMode::default(),
        /// Blocks kept for looking ahead. At least 4.
        pub buffer_blocks: usize = 512,
    }
}
