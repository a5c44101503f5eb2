//! The ratio that strategy and policy ask for, and how it is led from one to the next.
//!
//! They answer once in a rough period. A ratio that acted as it comes would be a staircase of that period, and each step of it a
//! jerk of the axes. So it is led over evenly: the period after its tick ends at the ratio, and a ramp that is asked for in
//! equal steps is a ramp of the feed. The price is that a ratio acts on average half a rough period later.

use rtrb::Consumer;
use tandem_rings::{OperatorInputs, Ratio};

use crate::config::FineConfig;
use crate::outputs::Outputs;

/// Relative tolerance on the feed.
pub(super) const FEED_TOLERANCE: f64 = 1e-7;

/// The feed ratios that count now.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ratios {
    /// At the end of the period.
    pub(super) feed: f64,
    /// The mean of that over the period: on the way down a period that ends at its ratio is not to end below it.
    pub(super) mean_feed: f64,
    pub(super) rapid: f64,
}

/// The rate at which a planned speed is at most `allowed`; 1 where it is anyway, to the rounding of a long path.
pub(super) fn within(allowed: f64, planned_mm_per_s: f64) -> f64 {
    if planned_mm_per_s * (1.0 - FEED_TOLERANCE) > allowed {
        allowed / planned_mm_per_s
    } else {
        1.0
    }
}

/// A ratio on its way.
#[derive(Clone, Copy, Debug)]
struct Led {
    from: f64,
    to: f64,
    /// At the start of the present period.
    before: f64,
    /// Fine periods that have passed on the way.
    passed: u32,
    /// Fine periods of the way, at least 1.
    periods: u32,
}

impl Led {
    /// The ratio 1; every other one takes `periods` fine periods.
    fn new(periods: u32) -> Self {
        let periods = periods.max(1);
        Self {
            from: 1.0,
            to: 1.0,
            before: 1.0,
            passed: periods,
            periods,
        }
    }

    /// The ratio at the end of the present period.
    fn now(&self) -> f64 {
        if self.passed == self.periods {
            return self.to;
        }
        let share = f64::from(self.passed) / f64::from(self.periods);
        self.from + share * (self.to - self.from)
    }

    /// Its mean over the present period.
    fn mean(&self) -> f64 {
        f64::midpoint(self.before, self.now())
    }

    fn begin(&mut self, to: f64) {
        self.from = self.now();
        self.to = to;
        self.passed = 0;
    }

    fn step(&mut self) {
        self.before = self.now();
        self.passed = (self.passed + 1).min(self.periods);
    }
}

/// The ratio of strategy and policy: what is queued of it, and what acts.
pub(super) struct StrategyRatio {
    queue: Consumer<Ratio>,
    /// Taken out of the queue before its tick.
    next: Option<Ratio>,
    led: Led,
}

impl StrategyRatio {
    /// The ratio 1, until `queue` holds another; each takes `periods` fine periods. Host.
    pub(super) fn new(queue: Consumer<Ratio>, periods: u32) -> Self {
        Self {
            queue,
            next: None,
            led: Led::new(periods),
        }
    }

    /// Takes the ratios that are due in the fine period `tick`, and leads what acts on by a period. Gives how many came after
    /// the tick that they were meant for.
    pub(super) fn take(&mut self, tick: u64) -> u64 {
        let mut late = 0;
        while let Some(next) = self.next.take().or_else(|| self.queue.pop().ok()) {
            if next.tick > tick {
                self.next = Some(next);
                break;
            }
            late += u64::from(next.tick < tick);
            self.led.begin(next.ratio);
        }
        self.led.step();
        late
    }

    /// The ratio at the end of the present period.
    fn now(&self) -> f64 {
        self.led.now()
    }

    /// Its mean over the present period.
    fn mean(&self) -> f64 {
        self.led.mean()
    }

    /// The ratios that count now: this one and the operator's, each where the program permits it.
    #[inline]
    pub(super) fn in_force(
        &self,
        config: &FineConfig,
        outputs: &Outputs,
        inputs: &OperatorInputs,
    ) -> Ratios {
        let operator = outputs.permitted_override(inputs);
        let [feed, mean_feed] = if outputs.adaptive_permitted {
            // What is above 1 is in the ratio already, within the strategy's own bounds.
            let operator = if config.strategy_takes_override {
                operator.min(1.0)
            } else {
                operator
            };
            [self.now(), self.mean()].map(|ratio| operator * ratio)
        } else {
            [operator; 2]
        };
        let rapid = if outputs.override_permitted {
            inputs.rapid_override.min(1.0)
        } else {
            1.0
        };
        Ratios {
            feed,
            mean_feed,
            rapid,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rtrb::RingBuffer;
    use tandem_sdk::{AxisLimits, Limits};

    #[test]
    fn a_rate_is_lowered_where_the_plan_is_above_what_is_allowed() {
        assert_eq!(within(10.0, 5.0), 1.0);
        assert_eq!(within(10.0, 10.0 * (1.0 + 1e-8)), 1.0);
        assert_eq!(within(10.0, 20.0), 0.5);
        assert_eq!(within(0.0, 20.0), 0.0);
    }

    /// What acts, where these ratios are queued, each for its tick, and take four periods.
    fn strategy(ratios: &[(u64, f64)]) -> StrategyRatio {
        let (mut input, output) = RingBuffer::new(8);
        for (tick, ratio) in ratios {
            let (tick, ratio) = (*tick, *ratio);
            input.push(Ratio { tick, ratio }).unwrap();
        }
        StrategyRatio::new(output, 4)
    }

    #[test]
    fn a_ratio_is_late_where_its_tick_is_over_and_not_in_it() {
        let mut strategy = strategy(&[(5, 0.5), (6, 0.6), (7, 0.7)]);
        assert_eq!((strategy.take(4), strategy.now()), (0, 1.0));
        assert_eq!(strategy.take(5), 0);
        assert!(strategy.now() < 1.0);
        assert_eq!(strategy.take(8), 2);
        assert_eq!(strategy.take(9), 0);
    }

    /// What the strategy and the operator ask for goes together, each where the program permits it.
    #[test]
    fn the_ratios_of_strategy_and_operator_multiply_where_they_are_permitted() {
        let axis = AxisLimits::unlimited();
        let plain = FineConfig::new(0.001, Limits::new(&[axis]).unwrap());
        let taken = FineConfig {
            strategy_takes_override: true,
            ..plain
        };
        let mut strategy = strategy(&[(0, 0.6)]);
        strategy.take(0);
        let (now, mean) = (strategy.now(), strategy.mean());
        assert!(now < mean && mean < 1.0);
        let inputs = OperatorInputs {
            feed_override: 1.5,
            rapid_override: 0.25,
            ..OperatorInputs::default()
        };
        let outputs = Outputs::new(false, 0);
        let of = |config, outputs: &Outputs| {
            let ratios = strategy.in_force(config, outputs, &inputs);
            [ratios.feed, ratios.mean_feed, ratios.rapid]
        };
        assert_eq!(of(&plain, &outputs), [1.5 * now, 1.5 * mean, 0.25]);
        assert_eq!(of(&taken, &outputs), [now, mean, 0.25]);
        let mut fixed = Outputs::new(false, 0);
        fixed.override_permitted = false;
        assert_eq!(of(&plain, &fixed), [now, mean, 1.0]);
        let mut steady = Outputs::new(false, 0);
        steady.adaptive_permitted = false;
        assert_eq!(of(&plain, &steady), [1.5, 1.5, 0.25]);
    }

    #[test]
    fn a_ratio_is_led_over_evenly_and_its_mean_is_that_of_both_ends_of_a_period() {
        let mut strategy = strategy(&[(0, 0.6)]);
        for (tick, now) in [(0, 0.9), (1, 0.8), (2, 0.7), (3, 0.6), (4, 0.6)] {
            let before = strategy.now();
            strategy.take(tick);
            assert!((strategy.now() - now).abs() < 1e-12, "{tick}");
            let mean = f64::midpoint(before, now);
            assert!((strategy.mean() - mean).abs() < 1e-12, "{tick}");
        }
    }
}
