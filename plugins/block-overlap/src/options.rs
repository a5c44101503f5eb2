//! `[planner.options]` of the block-overlap planner.

use serde::Deserialize;

/// Whether the corner error is bounded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
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

/// The options.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Options {
    /// Whether the corner error is bounded.
    pub corner_control: CornerControl,
    /// What keeps the axis limits.
    pub limits: LimitMode,
    /// Blocks kept for looking ahead. At least 4.
    pub buffer_blocks: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { corner_control: CornerControl::default(), limits: LimitMode::default(), buffer_blocks: 512 }
    }
}
