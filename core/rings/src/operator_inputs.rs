//! The operator's commands as one fine period takes them.

use std::sync::atomic::Ordering::Relaxed;

use crate::Controls;

/// What the operator asks for. The fine loop reads it once, at the start of a period, so that the sample of that period
/// says what acted in it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(clippy::struct_excessive_bools)] // independent keys and switches of a panel
pub struct OperatorInputs {
    /// Feed override, 1 for the programmed feed.
    pub feed_override: f64,
    /// Rapid override, 1 for the machine's rapid feed.
    pub rapid_override: f64,
    /// Feed hold.
    pub hold: bool,
    /// The program waits for the operator.
    pub program_hold: bool,
    /// Optional stop.
    pub optional_stop: bool,
    /// Single block.
    pub single_block: bool,
    /// Emergency stop.
    pub emergency_stop: bool,
    /// Abort, until the machine rests.
    pub abort: bool,
}

impl OperatorInputs {
    /// What `controls` hold now. Any loop; does not allocate.
    pub fn of(controls: &Controls) -> Self {
        Self {
            feed_override: controls.feed_override.load(),
            rapid_override: controls.rapid_override.load(),
            hold: controls.hold.load(Relaxed),
            program_hold: controls.program_hold.load(Relaxed),
            optional_stop: controls.optional_stop.load(Relaxed),
            single_block: controls.single_block.load(Relaxed),
            emergency_stop: controls.emergency_stop.load(Relaxed),
            abort: controls.abort.load(Relaxed),
        }
    }
}

impl Default for OperatorInputs {
    /// Nothing is asked for.
    fn default() -> Self {
        Self::of(&Controls::default())
    }
}
