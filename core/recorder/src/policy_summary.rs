//! What the policy script did, as the summary of a run says it.

use serde::Serialize;

/// The policy script of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PolicySummary {
    /// Name of the script's file, without its ending.
    pub name: String,
    /// Calls of `on_blocks`.
    pub windows: u64,
    /// Blocks in them.
    pub blocks: u64,
    /// Calls of `on_period`.
    pub periods: u64,
    /// Blocks whose time constant the script changed.
    pub time_constants_changed: u64,
    /// Blocks whose path tolerance it changed.
    pub tolerances_changed: u64,
    /// Blocks whose feed it capped.
    pub feeds_capped: u64,
    /// Rough periods for which it asked for a ratio other than 1.
    pub ratios_changed: u64,
    /// Requests that were changed to stay within what the machine file allows.
    pub requests_limited: u64,
    /// Blocks whose tuning the planner refused.
    pub requests_refused: u64,
    /// Calls that trapped, of whatever cause.
    pub traps: u64,
    /// Of these: calls that ran out of fuel.
    pub out_of_fuel: u64,
    /// Of these: calls that asked for too much memory.
    pub memory_refusals: u64,
    /// Of these: calls that recursed too deeply.
    pub stack_overflows: u64,
    /// Calls that answered with an infinite number; counted in `traps` too.
    pub not_finite: u64,
    /// Whether the script is not called any more.
    pub quarantined: bool,
    /// Times the script was loaded anew.
    pub reloads: u64,
    /// Times a new script was refused.
    pub refused_reloads: u64,
    /// Most fuel that a window used.
    #[serde(rename = "most_window_fuel")]
    pub max_window_fuel: u64,
    /// Most fuel that a rough period used.
    #[serde(rename = "most_period_fuel")]
    pub max_period_fuel: u64,
}
