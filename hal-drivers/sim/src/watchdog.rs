//! The heartbeat of the host as the drives see it.
//!
//! The tick of the setpoint is the heartbeat: it advances by one a fine period. In a run the drives live by the exchanges, so
//! silence shows in two ways: an exchange whose tick is not new (the drives lived through a period without
//! a word), and a tick that has run ahead of the periods that the drives have lived (they lived through the missing ones
//! without a word before this exchange). A host that is gone makes no exchange at all: then the drives live by a clock of
//! their own, which a test drives. Tick 0 is no heartbeat: the host repeats it until the program starts.

/// More periods than this are not made up for at once, so that an exchange takes bounded time.
const MAX_MISSED: u64 = 1000;

/// Counts silent periods; trips after more than `limit` of them in a row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Watchdog {
    limit: u32,
    /// The newest tick heard.
    heard: u64,
    /// The period that the drives live in, in the host's count.
    period: u64,
    silent: u32,
    tripped: bool,
}

/// What an exchange says of the time before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Heard {
    /// Periods that went by in silence before this one.
    pub missed: u64,
    /// Whether the setpoint of this period is new.
    pub fresh: bool,
}

impl Watchdog {
    /// A watchdog that has heard nothing yet and trips in the first silent period after `limit` ones; 0: never.
    pub fn new(limit: u32) -> Self {
        Self {
            limit,
            heard: 0,
            period: 0,
            silent: 0,
            tripped: false,
        }
    }

    /// An exchange with this tick. Fine loop; does not allocate.
    pub fn hear(&mut self, tick: u64) -> Heard {
        let begun = self.heard > 0;
        let fresh = tick > self.heard || !begun;
        let now = if begun {
            self.period.saturating_add(1)
        } else {
            tick
        };
        self.period = now.max(tick);
        self.heard = self.heard.max(tick);
        Heard {
            missed: tick.saturating_sub(now).min(MAX_MISSED),
            fresh,
        }
    }

    /// A period of the drives' own clock goes by without an exchange.
    pub fn pass(&mut self) {
        self.period = self.period.saturating_add(u64::from(self.heard > 0));
    }

    /// A period went by in silence. Fine loop.
    pub fn silence(&mut self) {
        self.silent = self.silent.saturating_add(1);
        self.tripped |= self.limit > 0 && self.silent > self.limit;
    }

    /// A period with a new setpoint. Fine loop.
    pub fn fed(&mut self) {
        self.silent = 0;
    }

    /// The host has reset the fault. Fine loop.
    pub fn reset(&mut self) {
        (self.silent, self.tripped) = (0, false);
    }

    /// Whether the drives stop, or have stopped, by themselves.
    pub fn is_tripped(&self) -> bool {
        self.tripped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heard(missed: u64, fresh: bool) -> Heard {
        Heard { missed, fresh }
    }

    #[test]
    fn ticks_tell_lost_and_late_setpoints_apart() {
        let mut watchdog = Watchdog::new(5);
        let hear = |watchdog: &mut Watchdog, ticks: &[u64]| {
            ticks.iter().map(|t| watchdog.hear(*t)).last().unwrap()
        };
        assert_eq!(
            hear(&mut watchdog, &[0, 0, 0, 1, 2]),
            heard(0, true),
            "waiting is no silence"
        );
        assert_eq!(
            hear(&mut watchdog, &[6]),
            heard(3, true),
            "three exchanges never came"
        );
        assert_eq!(
            hear(&mut watchdog, &[6]),
            heard(0, false),
            "the same once more: a period without a new one"
        );
        assert_eq!(
            hear(&mut watchdog, &[8]),
            heard(0, true),
            "what was late is not missed as well"
        );
        assert_eq!(hear(&mut watchdog, &[7]), heard(0, false), "an old one");
        assert_eq!(hear(&mut watchdog, &[10]), heard(0, true));
        assert_eq!(
            hear(&mut watchdog, &[u64::MAX]),
            heard(MAX_MISSED, true),
            "bounded"
        );
        assert_eq!(
            hear(&mut watchdog, &[u64::MAX]),
            heard(0, false),
            "no overflow"
        );
    }

    #[test]
    fn only_silence_in_a_row_trips() {
        let mut watchdog = Watchdog::new(2);
        for _ in 0..10 {
            watchdog.silence();
            watchdog.silence();
            watchdog.fed();
        }
        assert!(!watchdog.is_tripped());
        (0..3).for_each(|_| watchdog.silence());
        watchdog.fed();
        assert!(watchdog.is_tripped(), "sticky");
        watchdog.reset();
        assert!(!watchdog.is_tripped());
        let mut off = Watchdog::new(0);
        (0..1000).for_each(|_| off.silence());
        assert!(!off.is_tripped());
    }
}
