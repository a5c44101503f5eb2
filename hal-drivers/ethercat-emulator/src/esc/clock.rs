//! Distributed clocks: a local oscillator with an error of its own, the system time made from it, and SYNC0.

use serde::Deserialize;

/// How much of distributed clocks a device has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Clocking {
    /// Nothing.
    None,
    /// Receive times of its ports only, so that delays across it can be measured.
    Delays,
    /// A system time of 32 bits.
    Bits32,
    /// A system time of 64 bits.
    #[default]
    Bits64,
}

impl Clocking {
    pub(crate) fn has_system_time(self) -> bool {
        matches!(self, Self::Bits32 | Self::Bits64)
    }
}

/// Time constant with which the drift compensation removes a difference, in ns. A fifth of it still lets a difference of
/// 1 µs settle within 15 000 writes at 10 µs, which is how masters settle the clocks at start.
const COMPENSATION_NS: f64 = 20e6;
/// Most that the compensation changes the speed of a clock, in parts in 10⁹: a jump is slewed, never followed at once.
const MAX_COMPENSATION_PPB: f64 = 1e6;
/// Longest time between two writes that the compensation integrates over, in ns; behind a longer silence it starts anew.
const MAX_INTEGRATION_NS: u64 = 10_000_000;
/// Shortest cycle of SYNC0 that is generated, in ns.
const MIN_SYNC_NS: u32 = 5_000;

/// A slave controller's clock. Times given to it are the emulator's, in ns, and never go back.
#[derive(Clone, Debug, Default)]
pub(crate) struct Clock {
    pub(crate) kind: Clocking,
    /// Emulator's and local time of the last change of speed; the local time also in parts of 10⁻⁹ ns.
    base_ns: u64,
    base_local: u64,
    base_fraction: i64,
    /// Error of the oscillator, and what the compensation adds.
    pub(crate) drift_ppb: i64,
    compensation_ppb: i64,
    learned_ppb: f64,
    last_compensated_ns: Option<u64>,
    mean_difference: f64,
    filter_depth: u8,
    pub(crate) offset: u64,
    pub(crate) delay: u32,
    pub(crate) receive_times: [u32; 4],
    pub(crate) receive_time_unit: u64,
    pub(crate) sync: Sync,
}

/// SYNC0 of a device.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sync {
    pub(crate) activation: u8,
    pub(crate) start: u64,
    pub(crate) cycle0: u32,
    pub(crate) cycle1: u32,
    /// System time of the next pulse; none where there will be none.
    next: Option<u64>,
    /// Pulses that a fault swallows.
    pub(crate) swallow: u32,
}

impl Clock {
    pub(crate) fn new(kind: Clocking, start_ns: u64, drift_ppb: i64) -> Self {
        Self {
            kind,
            base_local: start_ns,
            drift_ppb,
            filter_depth: 4,
            ..Self::default()
        }
    }

    fn speed_ppb(&self) -> i64 {
        self.drift_ppb + self.compensation_ppb
    }

    /// Local time, and the part of a ns behind it in 10⁻⁹ ns.
    fn local_exactly(&self, at_ns: u64) -> (u64, i64) {
        let elapsed = at_ns.saturating_sub(self.base_ns);
        // Behind a change of speed 64 bits are enough for hours; divisions of 128 would take most of a bus's time.
        let short = i64::try_from(elapsed)
            .ok()
            .and_then(|elapsed| elapsed.checked_mul(self.speed_ppb()))
            .and_then(|parts| parts.checked_add(self.base_fraction));
        let (whole, fraction) = short.map_or_else(
            || {
                let parts = i128::from(elapsed) * i128::from(self.speed_ppb())
                    + i128::from(self.base_fraction);
                let whole = parts.div_euclid(1_000_000_000) as i64;
                (whole, parts.rem_euclid(1_000_000_000) as i64)
            },
            |parts| {
                (
                    parts.div_euclid(1_000_000_000),
                    parts.rem_euclid(1_000_000_000),
                )
            },
        );
        let local = self.base_local.wrapping_add(elapsed);
        (local.wrapping_add_signed(whole), fraction)
    }

    pub(crate) fn local(&self, at_ns: u64) -> u64 {
        self.local_exactly(at_ns).0
    }

    /// System time as the whole clock knows it; a clock of 32 bits shows the low half.
    pub(crate) fn system(&self, at_ns: u64) -> u64 {
        self.local(at_ns).wrapping_add(self.offset)
    }

    /// System time as the registers show it.
    pub(crate) fn system_shown(&self, at_ns: u64) -> u64 {
        let system = self.system(at_ns);
        if self.kind == Clocking::Bits32 {
            system & 0xffff_ffff
        } else {
            system
        }
    }

    fn rebase(&mut self, at_ns: u64) {
        let (local, fraction) = self.local_exactly(at_ns);
        self.base_local = local;
        self.base_fraction = fraction;
        self.base_ns = self.base_ns.max(at_ns);
    }

    /// Changes the error of the oscillator from now on.
    pub(crate) fn set_drift(&mut self, at_ns: u64, drift_ppb: i64) {
        self.rebase(at_ns);
        self.drift_ppb = drift_ppb;
    }

    /// Moves the local clock.
    pub(crate) fn jump(&mut self, at_ns: u64, by_ns: i64) {
        self.rebase(at_ns);
        self.base_local = self.base_local.wrapping_add_signed(by_ns);
        self.realign(at_ns);
    }

    /// Latches the times at which a frame came in at the ports; `after_ns` counts from its arrival at port 0.
    pub(crate) fn latch(&mut self, at_ns: u64, after_ns: &[Option<u64>; 4]) {
        self.receive_times =
            after_ns.map(|after| after.map_or(0, |after| self.local(at_ns + after) as u32));
        self.receive_time_unit = self.local(at_ns);
    }

    /// Takes the offset that the master wrote.
    pub(crate) fn set_offset(&mut self, at_ns: u64, offset: u64) {
        self.offset = offset;
        self.mean_difference = 0.0;
        self.realign(at_ns);
    }

    /// Forgets what the drift compensation has learned.
    pub(crate) fn restart_compensation(&mut self, at_ns: u64) {
        self.rebase(at_ns);
        self.compensation_ppb = 0;
        self.learned_ppb = 0.0;
        self.mean_difference = 0.0;
        self.last_compensated_ns = None;
    }

    pub(crate) fn set_filter_depth(&mut self, depth: u8) {
        self.filter_depth = depth & 15;
    }

    /// Compares the low halves of the system time and of the reference's, as devices do whatever the width of their clocks, and
    /// changes the clock's speed accordingly.
    pub(crate) fn compensate(&mut self, at_ns: u64, reference: u32) {
        let own = self.system(at_ns) as u32;
        let due = reference.wrapping_add(self.delay);
        let difference = f64::from(own.wrapping_sub(due).cast_signed());
        self.mean_difference +=
            (difference - self.mean_difference) / f64::from(1_u32 << self.filter_depth);
        let elapsed = self
            .last_compensated_ns
            .map_or(0, |last| at_ns.saturating_sub(last));
        self.last_compensated_ns = Some(at_ns);
        // The speed of critical damping: proportional with the time constant, integral with a quarter of its square.
        let proportional = -difference * 1e9 / COMPENSATION_NS;
        if elapsed <= MAX_INTEGRATION_NS {
            let gain = 1e9 / (4.0 * COMPENSATION_NS * COMPENSATION_NS);
            let learned = self.learned_ppb - difference * elapsed as f64 * gain;
            self.learned_ppb = learned.clamp(-MAX_COMPENSATION_PPB, MAX_COMPENSATION_PPB);
        }
        self.rebase(at_ns);
        let sum = self.learned_ppb + proportional;
        self.compensation_ppb = sum.clamp(-MAX_COMPENSATION_PPB, MAX_COMPENSATION_PPB) as i64;
    }

    /// The mean difference as its register shows it: the highest bit is set where the own time is behind.
    pub(crate) fn difference_shown(&self) -> u32 {
        let magnitude = self.mean_difference.abs().min(f64::from(0x7fff_ffff)) as u32;
        if self.mean_difference < 0.0 {
            magnitude | 1 << 31
        } else {
            magnitude
        }
    }

    /// Takes new cycles of SYNC0 and SYNC1.
    pub(crate) fn set_cycles(&mut self, at_ns: u64, cycle0: u32, cycle1: u32) {
        self.sync.cycle0 = cycle0;
        self.sync.cycle1 = cycle1;
        self.realign(at_ns);
    }

    /// Takes a new activation of the sync unit.
    pub(crate) fn activate(&mut self, at_ns: u64, activation: u8) {
        let was = self.sync.activation & 3 == 3;
        self.sync.activation = activation;
        if activation & 3 != 3 {
            self.sync.next = None;
        } else if !was {
            let now = self.system(at_ns);
            let ahead = match self.kind {
                // The low halves are compared: a start in the past comes after the next wrap.
                Clocking::Bits32 => u64::from((self.sync.start as u32).wrapping_sub(now as u32)),
                // It is compared for equality, so a start in the past never comes.
                _ => self.sync.start.wrapping_sub(now),
            };
            if !(1..=u64::MAX / 2).contains(&ahead) {
                return;
            }
            self.sync.next = Some(now.wrapping_add(ahead));
        }
    }

    /// Whether SYNC0 will come, or comes.
    pub(crate) fn sync_runs(&self) -> bool {
        self.sync.next.is_some()
    }

    /// The cycle of SYNC0 where it is one that can be generated.
    pub(crate) fn sync_cycle_ns(&self) -> Option<u32> {
        (self.sync.cycle0 >= MIN_SYNC_NS).then_some(self.sync.cycle0)
    }

    /// Skips the pulses that a jump of the system time has passed.
    fn realign(&mut self, at_ns: u64) {
        let (Some(next), Some(cycle)) = (self.sync.next, self.sync_cycle_ns()) else {
            return;
        };
        let now = self.system(at_ns);
        let late = now.wrapping_sub(next).cast_signed();
        let cycle = i64::from(cycle);
        if late > 0 {
            self.sync.next = Some(next.wrapping_add(((late / cycle + 1) * cycle) as u64));
        } else if late < -cycle {
            self.sync.next = Some(next.wrapping_sub((-late / cycle * cycle) as u64));
        }
    }

    /// The emulator's time of the next SYNC0 where it is at or before `until_ns`.
    pub(crate) fn sync_due(&self, until_ns: u64) -> Option<u64> {
        let next = self.sync.next?;
        if self.system(until_ns).wrapping_sub(next).cast_signed() < 0 {
            return None;
        }
        let ahead = next
            .wrapping_sub(self.offset)
            .wrapping_sub(self.base_local)
            .cast_signed();
        let speed = 1_000_000_000 + i128::from(self.speed_ppb());
        // Up to the next whole ns, at which the local time is there.
        let elapsed = (i128::from(ahead) * 1_000_000_000 + speed - 1)
            .div_euclid(speed)
            .max(0) as u64;
        Some((self.base_ns + elapsed).min(until_ns))
    }

    /// Goes on to the next SYNC0; answers whether this one is seen.
    pub(crate) fn sync_passes(&mut self) -> bool {
        let Some(next) = self.sync.next else {
            return false;
        };
        self.sync.next = self
            .sync_cycle_ns()
            .map(|cycle| next.wrapping_add(u64::from(cycle)));
        let swallowed = self.sync.swallow > 0;
        self.sync.swallow = self.sync.swallow.saturating_sub(1);
        !swallowed
    }

    /// System time of the next SYNC0, as its register shows it.
    pub(crate) fn sync_next_shown(&self) -> u64 {
        let shown = self.sync.next.unwrap_or(self.sync.start);
        if self.kind == Clocking::Bits32 {
            shown & 0xffff_ffff
        } else {
            shown
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A clock that follows a reference, written every `step` ns for `writes` writes; the difference at the end in ns.
    fn followed(drift_ppb: i64, start_ns: u64, step: u64, writes: u64) -> i64 {
        let reference = Clock::new(Clocking::Bits64, 5, 0);
        let mut clock = Clock::new(Clocking::Bits64, start_ns, drift_ppb);
        for at in (0..writes).map(|n| n * step) {
            clock.compensate(at, reference.system(at) as u32);
        }
        let end = writes * step;
        clock
            .system(end)
            .wrapping_sub(reference.system(end))
            .cast_signed()
    }

    #[test]
    fn drift_is_learned_whatever_the_pace_of_the_writes() {
        for step in [10_000, 250_000, 1_000_000] {
            for drift in [-100_000, 0, 100_000] {
                let left = followed(drift, 40_000, step, 400_000_000 / step);
                assert!(
                    left.abs() <= 150,
                    "{left} ns at {drift} ppb with a write every {step} ns"
                );
            }
        }
    }

    #[test]
    fn without_compensation_a_clock_runs_away_at_its_drift() {
        let mut clock = Clock::new(Clocking::Bits64, 0, 100_000);
        // Changes of speed lose nothing: a thousand of them, each within a ns.
        for n in 0..1000 {
            clock.set_drift(n * 1001, 100_000);
        }
        assert_eq!(clock.local(1_000_000_000), 1_000_100_000);
    }

    #[test]
    fn sync0_comes_on_the_devices_own_time_and_not_for_a_start_in_the_past() {
        let mut clock = Clock::new(Clocking::Bits64, 500, 50_000);
        clock.sync = Sync {
            start: 1_000_500,
            cycle0: 1_000_000,
            ..Sync::default()
        };
        clock.activate(0, 3);
        assert_eq!(clock.sync_due(900_000), None);
        let due = clock.sync_due(3_000_000).unwrap();
        assert_eq!(clock.system(due), 1_000_500);
        assert!(clock.sync_passes());
        assert_eq!(clock.system(clock.sync_due(3_000_000).unwrap()), 2_000_500);
        clock.activate(0, 0);
        clock.activate(2_000_000, 3);
        assert!(!clock.sync_runs());
    }

    #[test]
    fn a_clock_of_32_bits_starts_behind_its_wrap() {
        let mut clock = Clock::new(Clocking::Bits32, 0xffff_ff00, 0);
        clock.sync = Sync {
            start: 0x100,
            cycle0: 1_000_000,
            ..Sync::default()
        };
        clock.activate(0, 3);
        assert_eq!(clock.sync_due(10_000), Some(0x200));
        assert_eq!(clock.system_shown(0x200), 0x100);
    }
}
