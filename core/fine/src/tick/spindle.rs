//! A spindle on its way to its speed: what is in progress goes on, and no cut begins before it is there.

use super::drives::Drives;
use crate::config::FineConfig;
use crate::fault::FaultKind;

/// Exchanges behind which a driver without delay has answered to a speed: the one that tells it, and one.
const ANSWERED: u64 = 2;

/// What is known of the speed that the spindle was told last.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SpinUp {
    /// Exchanges since it was told; none where it was reached.
    exchanges: Option<u64>,
    /// The motion of this period waits for it.
    waits: bool,
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

    /// Whether the motion of this period waits for it.
    pub(super) fn waits(self) -> bool {
        self.waits
    }

    /// Before a period: nothing waits for it yet.
    pub(super) fn begin_period(&mut self) {
        self.waits = false;
    }

    /// After an exchange: the spindle may have come to its speed, or is told to stand, which nothing waits for.
    #[inline]
    pub(super) fn hear(&mut self, drives: &Drives, config: &FineConfig) {
        let Some(exchanges) = self.exchanges else {
            return;
        };
        self.exchanges = Some(exchanges + 1);
        let is_there = self.has_answer(drives, config) && drives.feedback().spindle_at_speed != 0;
        if is_there || drives.setpoint().spindle_rad_per_s == 0.0 {
            *self = Self::default();
        }
    }

    /// Whether what the driver says of the spindle is of the speed that it was told last. A spindle has no delay of its own: that
    /// of the slowest joint is its.
    fn has_answer(self, drives: &Drives, config: &FineConfig) -> bool {
        let delay = config.attached.delay_periods[..drives.joints()]
            .iter()
            .max()
            .map_or(0, |most| u64::from(*most));
        self.exchanges
            .is_none_or(|exchanges| exchanges >= ANSWERED + delay)
    }

    /// Whether the motion of this period waits for the spindle: a cut does, from its start or in its midst, where the machine
    /// `stands_inside` it. As long as the driver has not answered, what moves goes on, and what stands stays
    /// ([`crate::cursor::Cursor::advance`] at a rest).
    pub(super) fn look(
        &mut self,
        drives: &Drives,
        config: &FineConfig,
        stands_inside: bool,
        is_cutting: impl FnOnce() -> bool,
    ) -> bool {
        if !self.is_awaited() {
            return false;
        }
        self.waits = (self.has_answer(drives, config) || stands_inside) && is_cutting();
        self.waits
    }

    /// The fault that it is where a cut waits for longer than the spindle may take.
    pub(super) fn fault(self, drives: &Drives, config: &FineConfig) -> Option<FaultKind> {
        let waited_s = self.exchanges.unwrap_or_default() as f64 * config.period_s;
        let is_slow = self.waits && waited_s > config.at_speed_within_s;
        is_slow.then(|| FaultKind::SpindleSlow {
            within_s: config.at_speed_within_s,
            told_rad_per_s: drives.setpoint().spindle_rad_per_s,
            turns_rad_per_s: drives.feedback().spindle_rad_per_s,
        })
    }
}
