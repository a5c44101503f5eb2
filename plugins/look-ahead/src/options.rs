//! `[planner.options]` of the look-ahead planner.

use serde::Deserialize;

/// The rule for the feed at which two blocks may meet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Junction {
    /// As published: the tangent feed, at least the allowable speed difference. It bounds only the velocity component
    /// along the block before, so axes exceed their acceleration: simulated drives with `guard.mode = "count"` only.
    Tangent,
    /// Every axis keeps its acceleration and allowable speed difference over every window of junctions.
    #[default]
    Axis,
}

/// The options.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Options {
    /// Blocks kept for looking ahead, from the one being driven. At least 2.
    pub buffer_blocks: usize,
    /// The junction rule.
    pub junction: Junction,
}

impl Default for Options {
    fn default() -> Self {
        // With the two slots that the buffer adds this fits a ring of 4096.
        Self { buffer_blocks: 1000, junction: Junction::default() }
    }
}
