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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::FineConfig;
    use tandem_rig::Echo;
    use tandem_sdk::{AxisLimits, Limits};

    /// The drives of two joints, told to hold or to let go, that answer with this state.
    fn drives(holds: bool, answered: JointState) -> Drives {
        let limits = Limits::new(&[AxisLimits::unlimited(); 2]).unwrap();
        let echo = Echo::new(move |_, feedback| {
            feedback.state[1] = answered;
            Ok(())
        });
        let mut drives = Drives::new(&FineConfig::new(0.001, limits), Box::new(echo), 2);
        drives.tell_to_hold(holds, false);
        drives.exchange(0, &mut None);
        drives
    }

    #[test]
    fn drives_let_go_behind_the_end_unless_another_job_may_follow() {
        let mut release = Release::default();
        assert!(!release.is_due(false) && !release.may_be_followed());
        release.begin_period(true);
        assert!(release.is_due(false));
        release.stay();
        assert!(!release.is_due(false) && release.stays_enabled(false));
        assert!(
            release.is_due(true) && !release.stays_enabled(true),
            "they are told to"
        );
        release.begin_period(false);
        assert!(!release.is_due(true), "the program goes on");
        release.begin();
        assert!(release.is_due(false), "what has begun goes on");
        release.forget();
        assert!(!release.is_due(true) && release.may_be_followed());
    }

    #[test]
    fn the_exchange_goes_on_until_no_drive_holds_or_its_time_is_over() {
        let open = drives(false, JointState::Disabled);
        let holding = [
            JointState::Enabling,
            JointState::Enabled,
            JointState::Homing,
            JointState::QuickStop,
        ];
        for state in holding {
            let (mut release, still) = (Release::default(), drives(false, state));
            release.watch(&drives(true, state), false, 1);
            assert!(!release.is_over(), "they are told to hold");
            release.watch(&still, false, 3);
            release.watch(&still, false, 3);
            assert!(!release.is_over(), "{state:?}");
            release.watch(&still, false, 3);
            assert!(release.is_over(), "{state:?}");
            let mut release = Release::default();
            release.watch(&still, true, 3);
            assert!(release.is_over(), "a driver that failed knows of no brakes");
        }
        let mut release = Release::default();
        release.watch(&open, false, 3);
        assert!(release.is_over());
    }
}
