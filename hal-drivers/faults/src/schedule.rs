//! Which exchanges a fault hits.

use tandem_random::Random;

/// How often, within the window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rate {
    /// Every exchange of the window.
    Always,
    /// Begins at an exchange with this probability.
    Probability(f64),
    /// Begins at every n-th exchange of the window: the n-th, the 2n-th and so on.
    Every(u64),
    /// Begins at the n-th exchange of the run, from 1, once.
    AtCall(u64),
}

/// When a fault begins and how long it lasts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct When {
    /// First tick of the window.
    pub from_tick: u64,
    /// First tick after the window.
    pub until_tick: u64,
    /// How often.
    pub rate: Rate,
    /// How many exchanges it lasts once begun, at least 1; it ends with the window.
    pub periods: u64,
}

/// Counts exchanges and says which are hit.
#[derive(Clone, Copy, Debug)]
pub struct Schedule {
    when: When,
    random: Random,
    calls: u64,
    left: u64,
}

impl Schedule {
    /// Before the first exchange.
    pub fn new(when: When, random: Random) -> Self {
        Self {
            when,
            random,
            calls: 0,
            left: 0,
        }
    }

    /// Whether the exchange with this tick, the next one, is hit. Fine loop; does not allocate.
    pub fn hits(&mut self, tick: u64) -> bool {
        if !(self.when.from_tick..self.when.until_tick).contains(&tick) {
            self.left = 0;
            return false;
        }
        self.calls += 1;
        if self.begins() {
            self.left = self.when.periods;
        }
        let hit = self.left > 0;
        self.left = self.left.saturating_sub(1);
        hit
    }

    fn begins(&mut self) -> bool {
        match self.when.rate {
            Rate::Always => true,
            Rate::Probability(probability) => self.random.share() < probability,
            Rate::Every(count) => self.calls.is_multiple_of(count),
            Rate::AtCall(call) => self.calls == call,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hits(rate: Rate, periods: u64, window: (u64, u64), seed: u64) -> Vec<u64> {
        let when = When {
            from_tick: window.0,
            until_tick: window.1,
            rate,
            periods,
        };
        let mut schedule = Schedule::new(when, Random::of(seed, 0));
        (0..1000).filter(|tick| schedule.hits(*tick)).collect()
    }

    #[test]
    fn rates_and_windows() {
        let all = (0, u64::MAX);
        assert_eq!(
            hits(Rate::AtCall(120), 1, all, 0),
            [119],
            "calls are counted from 1, ticks from 0"
        );
        assert_eq!(hits(Rate::AtCall(120), 3, all, 0), [119, 120, 121]);
        assert_eq!(hits(Rate::Every(400), 2, all, 0), [399, 400, 799, 800]);
        assert_eq!(
            hits(Rate::Every(3), 1, (100, 108), 0),
            [102, 105],
            "counted within the window"
        );
        assert_eq!(hits(Rate::Always, 1, (10, 13), 0), [10, 11, 12]);
        assert_eq!(
            hits(Rate::Every(5), 4, (100, 106), 0),
            [104, 105],
            "ends with the window"
        );
        assert_eq!(hits(Rate::Probability(0.0), 1, all, 0), [0; 0]);
    }

    #[test]
    fn probability_is_seeded() {
        let of = |seed| hits(Rate::Probability(0.1), 1, (0, u64::MAX), seed);
        assert_eq!(of(7), of(7));
        assert_ne!(of(7), of(8));
        assert!((70..130).contains(&of(7).len()), "{}", of(7).len());
    }
}
