//! Fine periods that went by without a sample. At rest they cost nothing and are counted; in motion the drives had to
//! bridge them, and can so only for a while.

use crate::config::FineConfig;
use crate::fault::FaultKind;

/// What the share of missed periods is looked at over, s.
const WINDOW_S: f64 = 1.0;
/// The same at most, in periods: 1 MHz, so that a period of nonsense asks for no nonsense of memory.
const MAX_WINDOW_PERIODS: f64 = 1e6;

/// What was missed in motion: in a row, and in the last second.
///
/// The last periods that were missed are remembered by their numbers, one more of them than the share allows in a window:
/// where the oldest of them is still in the window, there are too many. So a period that is kept costs nothing.
#[derive(Debug)]
pub(super) struct Missed {
    max_in_a_row: u64,
    in_a_row: u64,
    window_periods: u64,
    /// Numbers of the periods that were missed last, a ring; empty where the share allows all of them.
    last: Box<[u64]>,
    next: usize,
}

impl Missed {
    /// Nothing missed. Host; allocates.
    pub(super) fn new(config: &FineConfig) -> Self {
        let window = (WINDOW_S / config.period_s)
            .round()
            .clamp(1.0, MAX_WINDOW_PERIODS);
        // A share that was written as a decimal number is not to lose a period by its last bit.
        let most = (config.missed.share * window * (1.0 + 4.0 * f64::EPSILON)).floor();
        let remembered = if most < window { most as usize + 1 } else { 0 };
        Self {
            max_in_a_row: config.missed.in_a_row,
            in_a_row: 0,
            window_periods: window as u64,
            // Not zero: memory that is written to here is not mapped in a fine period.
            last: vec![u64::MAX; remembered].into_boxed_slice(),
            next: 0,
        }
    }

    /// What is missed next begins a row.
    pub(super) fn begin_row(&mut self) {
        self.in_a_row = 0;
    }

    /// The periods from `first` on were missed in motion, as part of a row. Bounded by the window.
    pub(super) fn count(&mut self, first: u64, periods: u64) -> Option<FaultKind> {
        self.in_a_row = self.in_a_row.saturating_add(periods);
        if self.in_a_row > self.max_in_a_row {
            let (missed, most) = (self.in_a_row, self.max_in_a_row);
            return Some(FaultKind::MissedPeriods {
                missed,
                most,
                of_last: None,
            });
        }
        // More than are remembered at once are too many anyway.
        let too_many = (first..first + periods.min(self.last.len() as u64))
            .any(|period| self.remember(period));
        let missed = self.last.len() as u64;
        let most = (self.last.len() as u64).saturating_sub(1);
        too_many.then_some(FaultKind::MissedPeriods {
            missed,
            most,
            of_last: Some(self.window_periods),
        })
    }

    /// Whether those remembered with `period` lie in one window.
    fn remember(&mut self, period: u64) -> bool {
        self.last[self.next] = period;
        self.next = (self.next + 1) % self.last.len();
        // What was never missed stands for a time that has not come.
        period
            .checked_sub(self.last[self.next])
            .is_some_and(|passed| passed < self.window_periods)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::{AxisLimits, Limits};

    /// How many periods of a window may be missed.
    fn allowed(share: f64, period_s: f64) -> usize {
        let limits = Limits::new(&[AxisLimits::unlimited(); 3]).unwrap();
        let mut config = FineConfig::new(period_s, limits);
        config.missed.share = share;
        Missed::new(&config).last.len() - 1
    }

    #[test]
    fn so_many_periods_of_a_second_may_be_missed_and_so_many_in_a_row() {
        let limits = Limits::new(&[AxisLimits::unlimited(); 3]).unwrap();
        let mut config = FineConfig::new(0.001, limits);
        (config.missed.share, config.missed.in_a_row) = (0.01, 4);
        let mut missed = Missed::new(&config);
        for number in 0..10 {
            assert_eq!(missed.count(100 * number, 1), None, "{number}");
            missed.begin_row();
        }
        let too_many = missed.count(999, 1);
        assert!(matches!(
            too_many,
            Some(FaultKind::MissedPeriods {
                missed: 11,
                most: 10,
                of_last: Some(1000)
            })
        ));
        let mut missed = Missed::new(&config);
        assert_eq!(missed.count(0, 3), None);
        assert_eq!(missed.count(3, 1), None);
        let in_a_row = missed.count(4, 1);
        assert!(matches!(
            in_a_row,
            Some(FaultKind::MissedPeriods {
                missed: 5,
                most: 4,
                of_last: None
            })
        ));
    }

    #[test]
    fn a_share_in_decimals_loses_no_period_by_its_last_bit() {
        // As numbers of the computer 0.29 of 100 is a little less than 29.
        assert_eq!(allowed(0.29, 0.01), 29);
        assert_eq!(allowed(0.295, 0.01), 29);
        assert_eq!(allowed(0.0, 0.001), 0);
    }
}
