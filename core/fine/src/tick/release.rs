//! From joints that hold to drives without torque: the exchange goes on until their brakes are closed.

use tandem_sdk::JointState;

use super::{FineLoop, Phase};

/// How far letting go has come.
#[derive(Debug, Default)]
pub(super) struct Release {
    /// The program had ended before this period.
    pub(super) had_ended: bool,
    /// Fine periods since the drives were told to let go.
    periods: u64,
    /// They have, or their time for it is over.
    pub(super) is_over: bool,
}

impl Release {
    /// The drives are told to let go from the next exchange on, or have been.
    pub(super) fn begin(&mut self) {
        self.periods = self.periods.max(1);
    }

    /// Whether the drives have been told to let go.
    pub(super) fn has_begun(&self) -> bool {
        self.periods > 0
    }
}

impl FineLoop {
    /// Whether the drives are to let go: the program had ended before this period and no other job may follow, or a fault has
    /// brought the machine to rest.
    pub(super) fn is_letting_go(&self) -> bool {
        (self.release.had_ended && !self.stays_enabled()) || matches!(self.phase, Phase::Faulted)
    }

    /// Behind an exchange: whether it was the last. A driver that `failed` knows of no brakes.
    pub(super) fn watch_release(&mut self, failed: bool) {
        if self.drives.setpoint.enable != 0 || !self.is_letting_go() {
            return;
        }
        self.release.periods += 1;
        let holds = |state: &JointState| {
            [
                JointState::Enabling,
                JointState::Enabled,
                JointState::Homing,
                JointState::QuickStop,
            ]
            .contains(state)
        };
        let closed = failed
            || !self.drives.feedback.state[..self.drives.joints]
                .iter()
                .any(holds);
        self.release.is_over |= closed || self.release.periods >= self.config.disable_periods;
    }
}
