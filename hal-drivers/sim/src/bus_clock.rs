//! The clock of the bus: drives take their setpoint when it ticks, whatever the host's clock says.

use serde::{Deserialize, Serialize};
use tandem_random::Random;
use tandem_sdk::PluginError;

use crate::options::within;

/// How the clock of the bus goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BusClockOptions {
    /// How much faster it goes than the host's, millionths; slower where it is below zero.
    pub drift_ppm: f64,
    /// How far at most the instant of a tick is measured wrongly, µs.
    pub jitter_us: f64,
}

impl BusClockOptions {
    pub(crate) fn check(&self) -> Result<(), PluginError> {
        within("bus_clock.drift_ppm", self.drift_ppm, -1e4, 1e4)?;
        within("bus_clock.jitter_us", self.jitter_us, 0.0, 1e6)
    }
}

/// The ticks of the bus, a fine period of its own clock apart, from the first exchange on.
#[derive(Clone, Debug)]
pub(crate) struct BusClock {
    /// Fine period as the host's clock has it, ns.
    period_ns: f64,
    jitter_ns: f64,
    noise: Random,
    /// The first tick on the host's clock, ns.
    first_ns: Option<i64>,
}

impl BusClock {
    pub fn new(options: &BusClockOptions, period_s: f64, seed: u64) -> Self {
        let period_ns = period_s * 1e9 / (1.0 + options.drift_ppm * 1e-6);
        let noise = Random::new(seed.wrapping_add(PHASE));
        Self {
            period_ns,
            jitter_ns: options.jitter_us * 1e3,
            noise,
            first_ns: None,
        }
    }

    /// How much later than the nearest tick of the bus an exchange at `now_ns` of the host's clock is, ns. Fine loop.
    pub fn phase_ns(&mut self, now_ns: i64) -> i64 {
        let since_ns = (now_ns - *self.first_ns.get_or_insert(now_ns)) as f64;
        let ticks = (since_ns / self.period_ns).round();
        let error_ns = self.noise.between(-self.jitter_ns, self.jitter_ns);
        (since_ns - ticks * self.period_ns + error_ns).round() as i64
    }
}

/// What makes rows of random numbers from one seed different ones.
const PHASE: u64 = 0x7068_6173_6500_0000;

#[cfg(test)]
mod tests {
    use super::*;

    fn phases(drift_ppm: f64, jitter_us: f64, exchanges: i64) -> Vec<i64> {
        let mut clock = BusClock::new(
            &BusClockOptions {
                drift_ppm,
                jitter_us,
            },
            0.001,
            1,
        );
        (0..exchanges)
            .map(|n| clock.phase_ns(7 + n * 1_000_000))
            .collect()
    }

    #[test]
    fn a_clock_that_goes_right_is_met() {
        assert!(phases(0.0, 0.0, 1000).iter().all(|phase| *phase == 0));
    }

    #[test]
    fn drift_adds_up_to_half_a_period_and_then_the_next_tick_is_nearer() {
        let phases = phases(100.0, 0.0, 10_001);
        // 100 ppm of 1 ms are 100 ns a period.
        assert!(
            (phases[1000] - 100_000).abs() < 50 && (phases[4000] - 400_000).abs() < 100,
            "{}",
            phases[4000]
        );
        assert!((phases[9000] + 100_000).abs() < 200, "{}", phases[9000]);
    }

    #[test]
    fn jitter_stays_within_its_bound_and_uses_it() {
        let phases = phases(0.0, 100.0, 1000);
        assert!(phases.iter().all(|phase| phase.abs() <= 100_000));
        assert!(
            phases.iter().any(|phase| *phase > 90_000)
                && phases.iter().any(|phase| *phase < -90_000)
        );
    }
}
