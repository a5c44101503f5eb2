//! What the feed strategy asks for beside the ratio.

/// A request of the feed strategy, with the tick in which it acts, as for a ratio.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StrategyRequest {
    /// The tick in which it acts. One that comes later acts at once and is counted.
    pub tick: u64,
    /// What is asked for.
    pub kind: RequestKind,
}

/// What a feed strategy can ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestKind {
    /// A feed hold; the operator resumes.
    Hold,
    /// A stop on the path, then a fault.
    Fault,
}
