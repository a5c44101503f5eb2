//! One call a period, with absolute deadlines, on any clock.

use tandem_recorder::Lateness;

use crate::clock::phase::PhaseSteering;
use crate::plugins::hang::FineRuns;

/// A clock that can wait. Times are ns from any origin.
pub trait PeriodClock {
    /// Now. Fine thread; does not allocate.
    fn now_ns(&mut self) -> i64;

    /// Returns at `deadline_ns` or later, at once where that has passed. Fine thread; does not allocate.
    fn sleep_until(&mut self, deadline_ns: i64);
}

/// What is done once a period.
pub trait Body {
    /// Whether no further period is wanted.
    fn is_over(&self) -> bool;

    /// The thread is prepared, and the first period follows; the answer is dropped after the last. Fine thread.
    fn begin(&self) -> Option<FineRuns> {
        None
    }

    /// One period. Fine thread; does not allocate.
    fn period(&mut self);

    /// How much later than the bus wants it the last period's exchange was, ns, within half a period; `None` where nobody
    /// knows. Fine thread.
    fn phase_ns(&self) -> Option<i64> {
        None
    }

    /// `periods` went by without a call of [`Body::period`]; with those before them it is `in_a_row` by now.
    fn missed(&mut self, periods: u64, in_a_row: u64);
}

/// What the clock saw.
#[derive(Clone, Debug, Default)]
pub struct Timing {
    /// Periods whose work went past their end.
    pub overruns: u64,
    /// Periods without a sample.
    pub missed_periods: u64,
    /// How late each wake-up was.
    pub lateness: Lateness,
}

/// Calls `body` once a period until it is over. Fine thread; does not allocate.
///
/// Time is divided into periods from the first deadline on, and each takes at most one sample: after a stall nothing is
/// caught up, and nothing goes by uncounted. What the wake-up was late by whole periods is missed before the sample, so
/// that the sample already answers it. Work that goes on into a later period has sent its sample nobody knows when: the
/// period in which it ends counts as its own, and the ones before as missed.
///
/// Where the body knows the phase of its exchange, the next deadline is steered by it ([`PhaseSteering`]), and everything
/// is counted against the deadlines as they are then. What the wake-up was late is known and is no phase of the deadline.
pub fn run(
    clock: &mut impl PeriodClock,
    period_ns: i64,
    body: &mut impl Body,
    timing: &mut Timing,
) {
    steered(
        clock,
        period_ns,
        body,
        timing,
        PhaseSteering::new(period_ns),
    );
}

fn steered(
    clock: &mut impl PeriodClock,
    period_ns: i64,
    body: &mut impl Body,
    timing: &mut Timing,
    mut steering: PhaseSteering,
) {
    let mut deadline_ns = clock.now_ns() + period_ns;
    while !body.is_over() {
        clock.sleep_until(deadline_ns);
        let late_ns = clock.now_ns() - deadline_ns;
        timing.lateness.record(late_ns);
        let slept_over = whole(late_ns, period_ns);
        if slept_over > 0 {
            timing.missed_periods += slept_over.unsigned_abs();
            body.missed(slept_over.unsigned_abs(), slept_over.unsigned_abs());
        }
        deadline_ns += slept_over * period_ns;
        let late_ns = late_ns - slept_over * period_ns;
        body.period();
        let worked_over = whole(clock.now_ns() - deadline_ns, period_ns);
        timing.overruns += u64::from(worked_over > 0);
        // After the last sample there is nothing to miss.
        if worked_over > 0 && !body.is_over() {
            timing.missed_periods += worked_over.unsigned_abs();
            body.missed(
                worked_over.unsigned_abs(),
                (slept_over + worked_over).unsigned_abs(),
            );
        }
        let phase_ns = body
            .phase_ns()
            .filter(|_| worked_over == 0)
            .map(|ns| ns.saturating_sub(late_ns));
        deadline_ns += (worked_over + 1) * period_ns - steering.sooner_ns(phase_ns);
    }
}

/// Whole periods in `ns`; none before the deadline.
fn whole(ns: i64, period_ns: i64) -> i64 {
    ns.max(0) / period_ns
}

#[cfg(test)]
#[path = "periods_tests.rs"]
mod tests;

#[cfg(test)]
#[path = "bus_tests.rs"]
mod bus_tests;
