//! From joints that hold to drives without torque: the exchange goes on until their brakes are closed.

use tandem_sdk::JointState;

use super::drives::Drives;

/// Whether the drives are to let go, and how far that has come.
#[derive(Debug, Default)]
pub(super) struct Release {
    /// The drives stay enabled when the program has ended: another job may follow.
    stays: bool,
    /// The program had ended before this period.
    had_ended: bool,
    /// Fine periods since the drives were told to let go.
    periods: u64,
    /// They have, or their time for it is over.
    is_over: bool,
}

impl Release {
    /// Another job may follow: the drives stay enabled when the program has ended.
    pub(super) fn stay(&mut self) {
        self.stays = true;
    }

    /// Nothing is let go yet: the drives are about to be enabled once more.
    pub(super) fn forget(&mut self) {
        *self = Self {
            stays: self.stays,
            ..Self::default()
        };
    }

    /// Before a period: the program has ended or has not.
    pub(super) fn begin_period(&mut self, has_ended: bool) {
        self.had_ended = has_ended;
    }

    /// The program has ended: the drives are told to let go from the next exchange on, or have been.
    pub(super) fn begin(&mut self) {
        self.had_ended = true;
        self.periods = self.periods.max(1);
    }

    /// Whether another job may follow.
    pub(super) fn may_be_followed(&self) -> bool {
        self.stays
    }

    /// Whether the drives are to stay enabled though the program has ended, unless `told_to_let_go`. What has begun to let go is
    /// enabled by the next job alone, from where the joints are then.
    pub(super) fn stays_enabled(&self, told_to_let_go: bool) -> bool {
        self.stays && self.periods == 0 && !told_to_let_go
    }

    /// Whether the drives let go because the program had ended before this period and no other job may follow.
    pub(super) fn is_due(&self, told_to_let_go: bool) -> bool {
        self.had_ended && !self.stays_enabled(told_to_let_go)
    }

    /// Whether the drives have let go.
    pub(super) fn is_over(&self) -> bool {
        self.is_over
    }

    /// After an exchange in which the drives were to let go: whether it was the last. A driver that `failed` knows of no brakes.
    pub(super) fn watch(&mut self, drives: &Drives, failed: bool, max_periods: u64) {
        if drives.setpoint().enable != 0 {
            return;
        }
        self.periods += 1;
        let holds = |state: &JointState| {
            [
                JointState::Enabling,
                JointState::Enabled,
                JointState::Homing,
                JointState::QuickStop,
            ]
            .contains(state)
        };
        let closed = failed || !drives.states().iter().any(holds);
        self.is_over |= closed || self.periods >= max_periods;
    }
}
