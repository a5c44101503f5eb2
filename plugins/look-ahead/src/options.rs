//! `[planner.options]` of the look-ahead planner.

use serde::{Deserialize, Serialize};

/// The rule for the feed at which two blocks may meet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Junction {
    /// As published: the tangent feed, at least the allowable speed difference. It bounds only the velocity component
    /// along the block before, so axes exceed their acceleration: simulated drives with `guard.mode = "count"` only.
    Tangent,
    /// Every axis keeps its acceleration and allowable speed difference over every window of junctions.
    #[default]
    Axis,
}

tandem_sdk::options! {
    /// The options.
    #[derive(Eq)]
    pub struct Options {
        /// Blocks kept for looking ahead, from the one being driven. At least 2; with the two slots that the buffer adds,
        /// the default fits a ring of 4096.
        pub buffer_blocks: usize = 1000,
        /// The rule for junctions: every axis keeps its limits, or as published, which breaks them (simulated drives with
        /// `guard.mode = "count"` only).
        pub junction: Junction = Junction::default(),
    }
}
