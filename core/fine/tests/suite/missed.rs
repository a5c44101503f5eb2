//! Missed periods: counted at rest, and in motion a fault where they are too many in a row or in a second.

use crate::common;

use std::collections::VecDeque;
use std::sync::atomic::Ordering::Relaxed;

use common::Bench;
use proptest::prelude::*;
use tandem_fine::{FaultKind, GuardMode};
use tandem_rings::MachineState;

/// What the bench's machine allows in a row, and of the thousand periods of a second.
const IN_A_ROW: u64 = 2;
const OF_A_SECOND: u64 = 10;

fn tick(bench: &mut Bench, periods: u32) {
    for _ in 0..periods {
        bench.fine.tick();
        while bench.host.samples.pop().is_ok() {}
    }
}

/// At the feed, with a minute of it ahead.
fn cruising() -> Bench {
    let mut bench = Bench::new(GuardMode::Stop);
    bench.accelerate();
    bench.cruise(45.0);
    bench.brake();
    tick(&mut bench, 300);
    assert_eq!(bench.state(), MachineState::Running);
    bench
}

fn cause(bench: &Bench) -> Option<FaultKind> {
    bench.fine.fault().map(|fault| fault.kind)
}

const fn in_a_row(missed: u64) -> FaultKind {
    FaultKind::MissedPeriods {
        missed,
        most: IN_A_ROW,
        of_last: None,
    }
}

const OF_LAST: Option<FaultKind> = Some(FaultKind::MissedPeriods {
    missed: OF_A_SECOND + 1,
    most: OF_A_SECOND,
    of_last: Some(1000),
});

#[test]
fn in_motion_one_more_in_a_row_than_allowed_is_a_fault() {
    for (missed, fault) in [
        (1, None),
        (2, None),
        (3, Some(in_a_row(3))),
        (50, Some(in_a_row(50))),
        (u64::MAX / 2, Some(in_a_row(u64::MAX / 2))),
    ] {
        let mut bench = cruising();
        bench.fine.missed(missed, missed);
        assert_eq!(cause(&bench), fault);
        assert_eq!(
            (
                bench.fine.counters().missed_periods,
                bench.fine.counters().missed_in_motion
            ),
            (missed, missed)
        );
    }
}

#[test]
fn a_row_that_is_reported_in_two_parts_is_one_row_and_two_rows_are_two() {
    let mut bench = cruising();
    bench.fine.missed(2, 2);
    tick(&mut bench, 1);
    bench.fine.missed(2, 2);
    assert_eq!(cause(&bench), None, "a sample lies between them");
    bench.fine.missed(1, 3);
    assert_eq!(cause(&bench), Some(in_a_row(3)));
}

#[test]
fn at_rest_they_are_counted_and_nothing_else() {
    let mut waiting = Bench::new(GuardMode::Stop);
    let mut holding = cruising();
    holding.host.controls.hold.store(true, Relaxed);
    tick(&mut holding, 100);
    assert_eq!(holding.state(), MachineState::Holding);
    let mut over = cruising();
    tick(&mut over, 46_000);
    assert_eq!(over.state(), MachineState::Standstill);
    let mut aborted = cruising();
    aborted.host.controls.abort.store(true, Relaxed);
    tick(&mut aborted, 100);
    assert_eq!(aborted.state(), MachineState::Standstill);
    for bench in [&mut waiting, &mut holding, &mut over, &mut aborted] {
        for _ in 0..100 {
            bench.fine.missed(50, 50);
            tick(bench, 1);
        }
        let counted = bench.fine.counters();
        assert_eq!(
            (
                cause(bench),
                counted.missed_periods,
                counted.missed_in_motion
            ),
            (None, 5000, 0)
        );
    }
}

/// What was slept over while the machine stood does not make the first moving period one of a row.
#[test]
fn a_row_that_began_at_rest_counts_from_where_the_machine_moves() {
    let mut bench = Bench::new(GuardMode::Stop);
    bench.accelerate();
    bench.cruise(45.0);
    bench.brake();
    while bench.fine.counters().samples == 0 {
        tick(&mut bench, 1);
    }
    bench.fine.missed(50, 50);
    tick(&mut bench, 1);
    bench.fine.missed(2, 52);
    assert_eq!(
        (cause(&bench), bench.fine.counters().missed_in_motion),
        (None, 2)
    );
}

#[test]
fn as_many_in_a_second_as_allowed_are_none_too_many_however_long_it_goes_on() {
    let mut bench = cruising();
    // Ten in each second, evenly.
    for _ in 0..400 {
        bench.fine.missed(1, 1);
        tick(&mut bench, 99);
    }
    assert_eq!(
        (cause(&bench), bench.fine.counters().missed_in_motion),
        (None, 400)
    );
    tick(&mut bench, 1000);
    for _ in 0..OF_A_SECOND {
        bench.fine.missed(1, 1);
        tick(&mut bench, 1);
    }
    assert_eq!(cause(&bench), None);
    bench.fine.missed(1, 1);
    assert_eq!(cause(&bench), OF_LAST);
}

/// The first and the last of eleven lie in one second, or by a period do not.
#[test]
fn the_window_is_a_second_to_a_period() {
    for (between, fault) in [(999, OF_LAST), (1000, None)] {
        let mut bench = cruising();
        bench.fine.missed(1, 1);
        for _ in 1..OF_A_SECOND {
            tick(&mut bench, 1);
            bench.fine.missed(1, 1);
        }
        // Ten periods missed and nine kept so far, numbered 0 to 18.
        tick(&mut bench, between - 19);
        assert_eq!(cause(&bench), None);
        bench.fine.missed(1, 1);
        assert_eq!(
            cause(&bench),
            fault,
            "{between} periods from the first to the last"
        );
    }
}

#[test]
fn what_was_missed_at_rest_takes_nothing_of_the_share() {
    let mut bench = cruising();
    bench.host.controls.hold.store(true, Relaxed);
    tick(&mut bench, 100);
    (0..100).for_each(|_| bench.fine.missed(2, 2));
    bench.host.controls.hold.store(false, Relaxed);
    tick(&mut bench, 20);
    for _ in 0..OF_A_SECOND / 2 {
        bench.fine.missed(2, 2);
        tick(&mut bench, 1);
    }
    assert_eq!(cause(&bench), None);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Beside a list of all that was missed, which nobody could keep in a fine period.
    #[test]
    fn exactly_when_a_list_of_everything_says_so(
        steps in proptest::collection::vec((1..40u32, 0..4u64), 1..300),
    ) {
        let mut bench = cruising();
        let (mut now, mut list) = (0u64, VecDeque::new());
        for (kept, missed) in steps {
            tick(&mut bench, kept);
            now += u64::from(kept);
            if missed > 0 {
                bench.fine.missed(missed, missed);
            }
            let mut expected = if missed > IN_A_ROW { Some(in_a_row(missed)) } else { None };
            for period in now..now + missed {
                list.push_back(period);
                while list.front().is_some_and(|first| period - first >= 1000) { list.pop_front(); }
                if list.len() as u64 > OF_A_SECOND { expected = expected.or(OF_LAST); }
            }
            now += missed;
            prop_assert_eq!(cause(&bench), expected);
            if expected.is_some() { break; }
        }
    }
}
