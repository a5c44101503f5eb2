//! The ratio that strategy and policy ask for, and how it is led from one to the next.
//!
//! They answer once in a rough period. A ratio that acted as it comes would be a staircase of that period, and each step of it a
//! jerk of the axes. So it is led over evenly: the period after its tick ends at the ratio, and a ramp that is asked for in
//! equal steps is a ramp of the feed. The price is that a ratio acts on average half a rough period later.

use rtrb::Consumer;
use tandem_rings::Ratio;

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
        (self.from, self.to, self.passed) = (self.now(), to, 0);
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
    pub(super) fn now(&self) -> f64 {
        self.led.now()
    }

    /// Its mean over the present period.
    pub(super) fn mean(&self) -> f64 {
        self.led.mean()
    }
}
