//! A spindle on its way to its speed: what is in progress goes on, and no cut begins before it is there.

use super::FineLoop;
use crate::fault::FaultKind;

/// Exchanges behind which a driver without delay has answered to a speed: the one that tells it, and one.
const ANSWERED: u64 = 2;

/// What is known of the speed that the spindle was told last.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SpinUp {
    /// Exchanges since it was told; none where it was reached.
    exchanges: Option<u64>,
    /// The motion of this period waits for it.
    pub(super) waits: bool,
}

impl SpinUp {
    /// The spindle is told a speed from this period on.
    pub(super) fn begin() -> Self {
        Self {
            exchanges: Some(0),
            waits: false,
        }
    }

    /// Whether the spindle may not be at its speed.
    pub(super) fn is_awaited(self) -> bool {
        self.exchanges.is_some()
    }
}

impl FineLoop {
    /// Behind an exchange: the spindle may have come to its speed, or is told to stand, which nothing waits for.
    pub(super) fn hear_spindle(&mut self) {
        let Some(exchanges) = self.spin_up.exchanges else {
            return;
        };
        self.spin_up.exchanges = Some(exchanges + 1);
        let is_there = self.has_answered() && self.drives.feedback.spindle_at_speed != 0;
        if is_there || self.drives.setpoint.spindle_rad_per_s == 0.0 {
            self.spin_up = SpinUp::default();
        }
    }

    /// Whether what the driver says of the spindle is of the speed that it was told last. A spindle has no delay of its own: that
    /// of the slowest joint is its.
    fn has_answered(&self) -> bool {
        let delay = self.config.attached.delay_periods[..self.drives.joints]
            .iter()
            .max()
            .map_or(0, |most| u64::from(*most));
        self.spin_up
            .exchanges
            .is_none_or(|exchanges| exchanges >= ANSWERED + delay)
    }

    /// Whether the motion of this period waits for the spindle: a cut does, from its start or in its midst. As long as the driver
    /// has not answered, what moves goes on, and what stands stays ([`crate::cursor::Cursor::advance`] at a rest).
    pub(super) fn waits_for_spindle(&mut self) -> bool {
        if !self.spin_up.is_awaited() {
            return false;
        }
        let stands_inside = !self.plan.cursor.is_resting() && self.plan.governor.sigma() == 0.0;
        self.spin_up.waits =
            (self.has_answered() || stands_inside) && self.plan.cursor.is_cutting();
        self.spin_up.waits
    }

    /// Whether a cut waits for longer than the spindle may take: then that is the fault.
    pub(super) fn is_spindle_slow(&mut self) -> bool {
        let waited_s = self.spin_up.exchanges.unwrap_or_default() as f64 * self.config.period_s;
        let is_slow = self.spin_up.waits && waited_s > self.config.at_speed_within_s;
        if is_slow {
            self.fail(FaultKind::SpindleSlow {
                within_s: self.config.at_speed_within_s,
                told_rad_per_s: self.drives.setpoint.spindle_rad_per_s,
                turns_rad_per_s: self.drives.feedback.spindle_rad_per_s,
            });
        }
        is_slow
    }
}
