//! What a policy did, as exact numbers.

use crate::error::Trouble;

/// Counts of one run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Windows of blocks handed over.
    pub windows: u64,
    /// Blocks in them.
    pub blocks: u64,
    /// Rough periods handed over.
    pub periods: u64,
    /// Blocks whose time constant the script set.
    pub time_constants: u64,
    /// Blocks whose path tolerance it set.
    pub tolerances: u64,
    /// Blocks whose feed it capped.
    pub feed_caps: u64,
    /// Rough periods for which it asked for a ratio other than 1.
    pub ratios: u64,
    /// Requests that were changed to stay within bounds, or dropped where nothing is to be tuned.
    pub limited: u64,
    /// Blocks whose tuning the planner refused: they were driven as programmed.
    pub refused_by_planner: u64,
    /// Calls that ran out of fuel.
    pub out_of_fuel: u64,
    /// Calls that asked for too much memory.
    pub memory_refusals: u64,
    /// Calls that recursed too deeply.
    pub stack_overflows: u64,
    /// Calls that trapped otherwise.
    pub traps: u64,
    /// Calls that answered with an infinite number.
    pub not_finite: u64,
    /// Times the script was loaded anew while running.
    pub reloads: u64,
    /// Times a new script was refused and the old one kept.
    pub refused_reloads: u64,
    /// Most fuel that a window used.
    pub max_window_fuel: u64,
    /// Most fuel that a rough period used.
    pub max_period_fuel: u64,
}

impl Counters {
    /// Calls that went wrong.
    pub fn troubles(&self) -> u64 {
        self.out_of_fuel
            + self.memory_refusals
            + self.stack_overflows
            + self.traps
            + self.not_finite
    }

    pub(crate) fn count(&mut self, trouble: &Trouble) {
        *match trouble {
            Trouble::Fuel(_) => &mut self.out_of_fuel,
            Trouble::Memory(_) => &mut self.memory_refusals,
            Trouble::Stack => &mut self.stack_overflows,
            Trouble::Trap(_) => &mut self.traps,
            Trouble::NotFinite { .. } => &mut self.not_finite,
        } += 1;
    }
}
