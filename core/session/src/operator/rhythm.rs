//! When the status lines of a subscription are due.

use std::time::{Duration, Instant};

/// Share of the interval by which each client's lines come after those of the client before: the golden ratio keeps any
/// number of clients apart.
const APART: f64 = 0.618_034;

/// The times of a client's status lines. The first is due at once; those after it keep a place in the interval that is the
/// client's own, so that clients which came together are not served together, and nobody who asks waits behind all of them.
#[derive(Debug)]
pub struct Rhythm {
    every: Duration,
    due: Instant,
    /// How much sooner the second line is due than an interval after the first.
    sooner: Duration,
}

impl Rhythm {
    /// `rate_hz` lines a second for the client of this number, from `now` on.
    pub fn new(rate_hz: f64, client: u64, now: Instant) -> Self {
        let every = Duration::from_secs_f64(1.0 / rate_hz);
        let share = (client as f64 * APART).fract();
        Self {
            every,
            due: now,
            sooner: every.mul_f64(share),
        }
    }

    /// When the next line is due.
    pub fn due(&self) -> Instant {
        self.due
    }

    /// Whether a line is due now; then it is taken as sent. What was missed in a stall is not made up for, and the lines after
    /// it keep their place in the interval.
    pub fn is_due(&mut self, now: Instant) -> bool {
        let Some(late) = now.checked_duration_since(self.due) else {
            return false;
        };
        let sooner = std::mem::take(&mut self.sooner);
        let missed = late.div_duration_f64(self.every).floor();
        let ahead = self.every.mul_f64(missed + 1.0);
        self.due += ahead.saturating_sub(sooner);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EVERY: Duration = Duration::from_millis(20);

    #[test]
    fn clients_that_came_together_are_not_served_together() {
        let now = Instant::now();
        let mut places: Vec<f64> = (1..=16)
            .map(|client| {
                let mut rhythm = Rhythm::new(50.0, client, now);
                assert!(rhythm.is_due(now) && !rhythm.is_due(now));
                (rhythm.due() - now).div_duration_f64(EVERY)
            })
            .collect();
        places.sort_by(f64::total_cmp);
        assert!(places[0] > 0.0 && places[15] <= 1.0, "{places:?}");
        for pair in places.windows(2) {
            assert!(pair[1] - pair[0] > 0.02, "{places:?}");
        }
    }

    #[test]
    fn a_stall_is_not_made_up_for_and_moves_nobody_to_another_place() {
        let start = Instant::now();
        let mut rhythm = Rhythm::new(50.0, 3, start);
        assert!(rhythm.is_due(start));
        let second = rhythm.due();
        assert!(rhythm.is_due(second + EVERY.mul_f64(3.5)));
        assert!(!rhythm.is_due(second + EVERY.mul_f64(3.6)));
        let from = second + EVERY * 4;
        let apart = rhythm.due().max(from) - rhythm.due().min(from);
        assert!(apart < Duration::from_micros(1), "{apart:?}");
    }
}
