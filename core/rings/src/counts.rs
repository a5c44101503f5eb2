//! What the fine loop counts, for looking at while it runs.

use std::sync::atomic::AtomicU64;

/// The fine loop's counters as it last published them, once a fine period. Each is exact; a reader may see one of them
/// a period before the next.
#[derive(Debug, Default)]
pub struct Counts {
    /// Samples handed out.
    pub samples: AtomicU64,
    /// Samples the guard stopped.
    pub guard_stops: AtomicU64,
    /// Samples beyond a limit that were sent all the same.
    pub limit_violations: AtomicU64,
    /// Samples with σ < 1 though nothing asked for it.
    pub governed_samples: AtomicU64,
    /// How often the queue ran low.
    pub starvations: AtomicU64,
    /// Ratios that came after the tick they were meant for.
    pub late_ratios: AtomicU64,
    /// Fine periods that passed without a sample.
    pub missed_periods: AtomicU64,
}
