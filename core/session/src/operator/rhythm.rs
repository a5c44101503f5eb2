//! When the status lines of a subscription are due.

use std::sync::LazyLock;
use std::time::{Duration, Instant};

/// From here on the status lines of everybody are counted: those of one rate are due at the same moments, whenever their clients came.
static BEGAN: LazyLock<Instant> = LazyLock::new(Instant::now);

/// The times of a client's status lines. The first is due at once, those after it with the lines of all others of its rate: the
/// computer wakes once and looks at the machine once for all of them, where to each at its own time it would do so hundreds of times
/// a second.
#[derive(Debug)]
pub struct Rhythm {
    every: Duration,
    due: Instant,
}

impl Rhythm {
    /// `rate_hz` lines a second, from `now` on.
    pub fn new(rate_hz: f64, now: Instant) -> Self {
        Self {
            every: Duration::from_secs_f64(1.0 / rate_hz),
            due: now,
        }
    }

    /// When the next line is due.
    pub fn due(&self) -> Instant {
        self.due
    }

    /// Whether a line is due now; then it is taken as sent. What was missed in a stall is not made up for.
    pub fn is_due(&mut self, now: Instant) -> bool {
        if now < self.due {
            return false;
        }
        let rest =
            |apart: Duration| Duration::from_nanos_u128(apart.as_nanos() % self.every.as_nanos());
        // A moment that was taken before the first client came here may lie before all that is counted.
        let before = rest(BEGAN.saturating_duration_since(now));
        self.due = now
            + if before.is_zero() {
                let behind = rest(now.saturating_duration_since(*BEGAN));
                self.every.saturating_sub(behind)
            } else {
                before
            };
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EVERY: Duration = Duration::from_millis(20);

    #[test]
    fn clients_of_one_rate_are_served_together_whenever_they_came() {
        let start = Instant::now();
        let first_due = |late_us: u64| {
            let came = start + Duration::from_micros(late_us);
            let mut rhythm = Rhythm::new(50.0, came);
            assert!(rhythm.is_due(came) && !rhythm.is_due(came));
            assert!(rhythm.due() > came && rhythm.due() <= came + EVERY);
            rhythm.due()
        };
        let (first, second) = (first_due(0), first_due(7_301));
        assert!(second == first || second == first + EVERY);
        assert_eq!(first_due(20_000), first + EVERY);
    }

    #[test]
    fn a_stall_is_not_made_up_for_and_moves_nobody_to_another_place() {
        let start = Instant::now();
        let mut rhythm = Rhythm::new(50.0, start);
        assert!(rhythm.is_due(start));
        let second = rhythm.due();
        assert!(rhythm.is_due(second + EVERY.mul_f64(3.5)));
        assert!(!rhythm.is_due(second + EVERY.mul_f64(3.6)));
        assert_eq!(rhythm.due(), second + EVERY * 4);
    }
}
