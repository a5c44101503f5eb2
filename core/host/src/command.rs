//! The operator's commands.

use std::sync::atomic::Ordering::Relaxed;

use tandem_rings::Controls;

/// One command. It acts in the next fine period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Feed hold, on the path.
    Hold,
    /// Goes on after a hold.
    Resume,
    /// Feed override, 1 for the programmed feed.
    FeedOverride(f64),
    /// Rapid override, 1 for the rapid feed.
    RapidOverride(f64),
    /// Emergency stop: ramps out off the path.
    EmergencyStop,
    /// Stop on the path and end the run.
    Abort,
}

impl Command {
    /// Gives the command to the fine loop.
    pub fn give(self, controls: &Controls) {
        match self {
            Self::Hold => controls.hold.store(true, Relaxed),
            Self::Resume => controls.hold.store(false, Relaxed),
            Self::FeedOverride(ratio) => controls.feed_override.store(ratio.max(0.0)),
            Self::RapidOverride(ratio) => controls.rapid_override.store(ratio.clamp(0.0, 1.0)),
            Self::EmergencyStop => controls.emergency_stop.store(true, Relaxed),
            Self::Abort => controls.soft_fault.store(true, Relaxed),
        }
    }
}

/// A command with the tick before which it is given: how a run's commands are recorded and replayed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timed {
    /// The command acts in this tick.
    pub tick: u64,
    /// The command.
    pub command: Command,
}
