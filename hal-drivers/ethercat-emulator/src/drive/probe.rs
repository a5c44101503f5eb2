//! Touch probes: positions caught at edges, by the objects 60B8 and 60B9.

/// One touch probe.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Probe {
    level: bool,
    /// What the master asked for last, in the low byte of its half.
    function: u8,
    status: u8,
    /// Positions of the last rising and falling edge that were asked for.
    pub(super) rising: f64,
    pub(super) falling: f64,
}

/// Bits of the function.
const ENABLED: u8 = 0x01;
const CONTINUOUS: u8 = 0x02;
const RISING: u8 = 0x10;
const FALLING: u8 = 0x20;
/// Bits of the status: enabled, caught at an edge; two that turn over with every position caught in continuous mode.
const CAUGHT_RISING: u8 = 0x02;
const CAUGHT_FALLING: u8 = 0x04;
const TURNS_RISING: u8 = 0x40;
const TURNS_FALLING: u8 = 0x80;

impl Probe {
    /// Takes the function. An edge that is switched on, or the probe, is awaited anew.
    pub(super) fn arm(&mut self, function: u8) {
        let risen = function & !self.function;
        self.function = function;
        if function & ENABLED == 0 {
            self.status = 0;
            return;
        }
        if risen & ENABLED != 0 {
            self.status = ENABLED;
        }
        if risen & RISING != 0 {
            self.status &= !CAUGHT_RISING;
        }
        if risen & FALLING != 0 {
            self.status &= !CAUGHT_FALLING;
        }
    }

    /// Follows the level of the input; `position` is where the axis stood as it changed.
    pub(super) fn follow(&mut self, level: bool, position: f64) {
        if std::mem::replace(&mut self.level, level) == level || self.function & ENABLED == 0 {
            return;
        }
        let (wanted, caught, turns) = if level {
            (RISING, CAUGHT_RISING, TURNS_RISING)
        } else {
            (FALLING, CAUGHT_FALLING, TURNS_FALLING)
        };
        let continuous = self.function & CONTINUOUS != 0;
        if self.function & wanted == 0 || self.status & caught != 0 && !continuous {
            return;
        }
        self.status |= caught;
        if continuous {
            self.status ^= turns;
        }
        if level {
            self.rising = position;
        } else {
            self.falling = position;
        }
    }

    pub(super) fn status(&self) -> u8 {
        self.status
    }

    pub(super) fn level(&self) -> bool {
        self.level
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_edge_is_caught_once_until_it_is_asked_for_again() {
        let mut probe = Probe::default();
        probe.follow(true, 1.0);
        assert_eq!((probe.status(), probe.rising), (0, 0.0));
        probe.follow(false, 2.0);
        probe.arm(ENABLED | RISING);
        probe.follow(true, 3.0);
        probe.follow(false, 4.0);
        probe.follow(true, 5.0);
        assert_eq!(
            (probe.status(), probe.rising, probe.falling),
            (ENABLED | CAUGHT_RISING, 3.0, 0.0)
        );
        probe.arm(ENABLED);
        probe.arm(ENABLED | RISING);
        assert_eq!(probe.status(), ENABLED);
        probe.follow(false, 6.0);
        probe.follow(true, 7.0);
        assert_eq!(probe.rising, 7.0);
    }
}
