//! Injected stalls, and what is counted of them.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use tandem_fine::{FaultKind, FineConfig, FineLoop};
use tandem_rig::Random;
use tandem_rings::{HostEnd, Queued, RoughEnd, Sizes, bridge};
use tandem_sdk::{AxisLimits, AxisVector, Driver, DriverContext, Limits, Segment, SegmentFlags};

use super::{Body, PeriodClock, Timing, run};
use crate::clock::wall_clock::FineBody;

const PERIOD_NS: i64 = 1_000_000;

/// A time that only tests advance.
type Now = Rc<Cell<i64>>;

/// Wakes 3 µs late, and in the n-th sleep by so much more.
struct Scripted {
    now: Now,
    sleeps: usize,
    stalls: Vec<(usize, i64)>,
}

impl PeriodClock for Scripted {
    fn now_ns(&mut self) -> i64 {
        self.now.get()
    }

    fn sleep_until(&mut self, deadline_ns: i64) {
        self.sleeps += 1;
        let stalled: i64 = self
            .stalls
            .iter()
            .filter(|(at, _)| *at == self.sleeps)
            .map(|(_, ns)| ns)
            .sum();
        self.now
            .set(self.now.get().max(deadline_ns) + 3_000 + stalled);
    }
}

/// Works 100 µs a period, and in the n-th by so much more; notes when each sample was done.
struct Working {
    now: Now,
    stalls: Vec<(usize, i64)>,
    samples_ns: Rc<RefCell<Vec<i64>>>,
    in_a_row: Vec<u64>,
    until: usize,
}

impl Body for Working {
    fn is_over(&self) -> bool {
        self.samples_ns.borrow().len() == self.until
    }

    fn period(&mut self) {
        let number = self.samples_ns.borrow().len() + 1;
        let stalled: i64 = self
            .stalls
            .iter()
            .filter(|(at, _)| *at == number)
            .map(|(_, ns)| ns)
            .sum();
        self.now.set(self.now.get() + 100_000 + stalled);
        self.samples_ns.borrow_mut().push(self.now.get());
    }

    fn missed(&mut self, _periods: u64, in_a_row: u64) {
        self.in_a_row.push(in_a_row);
    }
}

/// 200 samples with stalls while asleep and at work; what was counted, the periods in a row, and when samples were done.
fn stalled(asleep: &[(usize, i64)], at_work: &[(usize, i64)]) -> (Timing, Vec<u64>, Vec<i64>) {
    let now = Now::default();
    let mut clock = Scripted {
        now: Rc::clone(&now),
        sleeps: 0,
        stalls: asleep.to_vec(),
    };
    let samples_ns = Rc::default();
    let mut body = Working {
        now,
        stalls: at_work.to_vec(),
        samples_ns: Rc::clone(&samples_ns),
        in_a_row: vec![],
        until: 200,
    };
    let mut timing = Timing::default();
    run(&mut clock, PERIOD_NS, &mut body, &mut timing);
    let samples_ns = samples_ns.borrow().clone();
    (timing, body.in_a_row, samples_ns)
}

/// Never two samples in one period, and every period without one counted.
fn assert_each_period_counts(timing: &Timing, samples_ns: &[i64]) {
    let periods: Vec<i64> = samples_ns.iter().map(|ns| ns / PERIOD_NS).collect();
    assert!(
        periods.windows(2).all(|pair| pair[0] < pair[1]),
        "two samples in one period"
    );
    let passed = periods[periods.len() - 1] - periods[0] + 1;
    assert_eq!(
        passed.unsigned_abs(),
        samples_ns.len() as u64 + timing.missed_periods
    );
    assert_eq!(timing.lateness.count(), samples_ns.len() as u64);
}

#[test]
fn nothing_is_missed_where_nothing_stalls() {
    let (timing, in_a_row, samples_ns) = stalled(&[], &[]);
    assert_eq!(
        (
            timing.overruns,
            timing.missed_periods,
            timing.lateness.max_ns()
        ),
        (0, 0, 3_000)
    );
    assert!(in_a_row.is_empty());
    assert_each_period_counts(&timing, &samples_ns);
}

#[test]
fn counters_equal_the_stalls_injected() {
    for periods in [1, 3, 50] {
        let stall = [(20, periods * PERIOD_NS)];
        let counted = periods.unsigned_abs();
        let (asleep, in_a_row, samples_ns) = stalled(&stall, &[]);
        assert_eq!(
            (asleep.overruns, asleep.missed_periods, in_a_row),
            (0, counted, vec![counted])
        );
        assert_eq!(asleep.lateness.max_ns(), counted * 1_000_000 + 3_000);
        assert_each_period_counts(&asleep, &samples_ns);

        let (at_work, in_a_row, samples_ns) = stalled(&[], &stall);
        assert_eq!(
            (at_work.overruns, at_work.missed_periods, in_a_row),
            (1, counted, vec![counted])
        );
        assert_each_period_counts(&at_work, &samples_ns);
    }
}

#[test]
fn a_stall_within_the_period_costs_nothing() {
    let (timing, in_a_row, samples_ns) = stalled(&[(20, 800_000)], &[(30, 800_000)]);
    assert_eq!(
        (timing.overruns, timing.missed_periods, in_a_row),
        (0, 0, vec![])
    );
    assert_each_period_counts(&timing, &samples_ns);
}

#[test]
fn asleep_and_then_at_work_is_one_row() {
    let (timing, in_a_row, samples_ns) = stalled(&[(20, 2 * PERIOD_NS)], &[(20, PERIOD_NS)]);
    assert_eq!(
        (timing.overruns, timing.missed_periods, in_a_row),
        (1, 3, vec![2, 3])
    );
    assert_each_period_counts(&timing, &samples_ns);
}

#[test]
fn every_mixture_of_stalls_is_counted() {
    // A fixed sequence of numbers that repeats late: no run differs from another.
    let mut random = Random::new(1);
    for _ in 0..200 {
        let mut some = || {
            (0..8)
                .map(|_| {
                    (
                        random.below(200) as usize + 1,
                        random.below(5_000_000).cast_signed(),
                    )
                })
                .collect::<Vec<_>>()
        };
        let (asleep, mut at_work) = (some(), some());
        // What follows the last sample is not missed.
        at_work.retain(|(at, _)| *at != 200);
        let (timing, _, samples_ns) = stalled(&asleep, &at_work);
        // Periods are counted from the first deadline on.
        let before_first = (samples_ns[0] / PERIOD_NS - 1).unsigned_abs();
        let counted = Timing {
            missed_periods: timing.missed_periods - before_first,
            ..timing
        };
        assert_each_period_counts(&counted, &samples_ns);
    }
}

/// A fine loop with a minute of motion ahead, or none, and both other ends so that the rings live.
fn fine_loop(moves: bool) -> (Box<FineLoop>, RoughEnd, HostEnd) {
    let axis = AxisLimits {
        min_mm: -100.0,
        max_mm: 100.0,
        feed_mm_per_s: 250.0,
        rapid_mm_per_s: 250.0,
        acceleration_mm_per_s2: 1000.0,
        jerk_mm_per_s3: f64::INFINITY,
        speed_difference_mm_per_s: 0.0,
    };
    let config = FineConfig::new(0.001, Limits::new(&[axis; 3]).unwrap());
    let (mut rough, end, host) = bridge(Sizes {
        segments: 16,
        samples: 1 << 17,
    });
    if moves {
        rough
            .segments
            .push(Queued::Segment {
                start_s: 0.0,
                segment: cruise(),
            })
            .unwrap();
        rough.depth.wall_s.store(f64::INFINITY);
        rough.depth.required_s.store(0.0);
    }
    let mut driver = tandem_sim::SimulatedDrives::new(tandem_sim::Options::default());
    driver.open(&DriverContext::new(3, 0.001)).unwrap();
    driver.start().unwrap();
    let mut fine = FineLoop::new(&config, end, Box::new(driver), None);
    fine.reset();
    (Box::new(fine), rough, host)
}

/// A minute at 1 mm/s, which the machine takes up at once.
fn cruise() -> Segment {
    let mut segment = Segment::rest(&AxisVector::ZERO, 60.0);
    (segment.coefficients[0][1], segment.path[1]) = (1.0, 1.0);
    segment.flags = SegmentFlags::ENDS_AT_REST;
    segment.feed_mm_per_s = 1.0;
    segment.stop_deceleration_mm_per_s2 = 1000.0;
    segment
}

/// The fine loop, for at most so many more periods.
struct AtMost(FineBody, u32);

impl Body for AtMost {
    fn is_over(&self) -> bool {
        self.1 == 0 || self.0.is_over()
    }

    fn period(&mut self) {
        self.1 -= 1;
        self.0.period();
    }

    fn missed(&mut self, periods: u64, in_a_row: u64) {
        self.0.missed(periods, in_a_row);
    }
}

/// 1 s of a fine loop with these stalls asleep.
fn second_of(moves: bool, stalls: Vec<(usize, i64)>) -> Box<FineLoop> {
    let (fine, _rough, _host) = fine_loop(moves);
    let mut clock = Scripted {
        now: Now::default(),
        sleeps: 0,
        stalls,
    };
    let mut body = AtMost(FineBody { fine, watch: None }, 900);
    run(&mut clock, PERIOD_NS, &mut body, &mut Timing::default());
    body.0.fine
}

#[test]
fn more_missed_periods_in_a_row_than_allowed_are_a_fault_in_motion() {
    for (periods, faults) in [(1_i64, false), (2, false), (3, true), (50, true)] {
        let missed = periods.unsigned_abs();
        for moves in [true, false] {
            let fine = second_of(moves, vec![(20, periods * PERIOD_NS)]);
            let fault = FaultKind::MissedPeriods {
                missed,
                most: 2,
                of_last: None,
            };
            assert_eq!(
                fine.fault().map(|f| f.kind),
                (moves && faults).then_some(fault),
                "{periods} periods"
            );
            let counted = fine.counters();
            assert_eq!(
                (counted.missed_periods, counted.missed_in_motion),
                (missed, if moves { missed } else { 0 })
            );
        }
    }
}

#[test]
fn a_stall_in_every_fiftieth_period_is_a_fault_at_the_eleventh_and_never_two_in_a_row() {
    let stalls = |count: usize| (1..=count).map(|stall| (50 * stall, PERIOD_NS)).collect();
    for (count, faults) in [(10, false), (11, true), (17, true)] {
        let fine = second_of(true, stalls(count));
        let fault = FaultKind::MissedPeriods {
            missed: 11,
            most: 10,
            of_last: Some(1000),
        };
        assert_eq!(
            fine.fault().map(|f| f.kind),
            faults.then_some(fault),
            "{count} stalls"
        );
        // The eleventh ends it: the way to rest takes two periods.
        let seen = if faults { 11 } else { count as u64 };
        assert_eq!(
            (
                fine.counters().missed_periods,
                fine.counters().missed_in_motion
            ),
            (seen, seen)
        );
        assert_eq!(
            second_of(false, stalls(count)).fault(),
            None,
            "nothing moves"
        );
    }
}
