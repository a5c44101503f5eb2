//! What the controller may do, whatever it is told.

use proptest::prelude::*;

use super::PhaseSteering;

const PERIOD_NS: i64 = 1_000_000;

#[test]
fn who_is_told_nothing_steers_nothing() {
    let mut steering = PhaseSteering::new(PERIOD_NS);
    assert!((0..1000).all(|_| steering.sooner_ns(None) == 0));
}

#[test]
fn a_late_exchange_comes_sooner_the_next_time_and_an_early_one_later() {
    assert!(PhaseSteering::new(PERIOD_NS).sooner_ns(Some(10_000)) > 0);
    assert!(PhaseSteering::new(PERIOD_NS).sooner_ns(Some(-10_000)) < 0);
}

/// A driver whose frames are lost for a while says nothing of the phase: the drift that was learnt holds the deadlines.
#[test]
fn the_drift_that_is_known_goes_on_where_the_phase_is_not_told() {
    let mut steering = PhaseSteering::new(PERIOD_NS);
    let mut phase_ns = 0;
    for _ in 0..1000 {
        phase_ns += 70 - steering.sooner_ns(Some(phase_ns));
    }
    assert!(phase_ns.abs() <= 10, "{phase_ns} ns");
    for _ in 0..1000 {
        phase_ns += 70 - steering.sooner_ns(None);
    }
    assert!(
        phase_ns.abs() < 2000,
        "{phase_ns} ns after a second without word"
    );
}

/// Long periods would make the loop swing; a phase of more than half a period is nearer to the next exchange.
#[test]
fn a_correction_is_a_quarter_of_the_deviation_at_most_and_the_deviation_half_a_period() {
    for (period_ns, correction_ns) in [(1_000_000, 625), (4_000_000, 2500), (20_000_000, 2500)] {
        assert_eq!(
            PhaseSteering::new(period_ns).sooner_ns(Some(10_000)),
            correction_ns,
            "{period_ns} ns"
        );
    }
    let half = PhaseSteering::new(PERIOD_NS).sooner_ns(Some(PERIOD_NS / 2));
    assert_eq!(half, PERIOD_NS / 32);
    assert_eq!(
        PhaseSteering::new(PERIOD_NS).sooner_ns(Some(10 * PERIOD_NS)),
        half
    );
}

/// The way to the first lock is no drift of the clocks.
#[test]
fn nothing_is_learnt_while_corrections_are_cut_off() {
    let mut steering = PhaseSteering::new(4_000_000);
    assert!((0..8).all(|_| steering.sooner_ns(Some(2_000_000)) == 200_000));
    assert_eq!(steering.sooner_ns(None), 0);
}

#[test]
fn what_is_less_than_a_nanosecond_is_not_lost() {
    let mut steering = PhaseSteering::new(PERIOD_NS);
    let sum_ns: i64 = (0..16).map(|_| steering.sooner_ns(Some(4))).sum();
    // A quarter of a nanosecond in each period, and what of it is taken for drift.
    assert!((4..=5).contains(&sum_ns), "{sum_ns} ns");
}

proptest! {
    /// Nonsense of a driver moves no deadline by more than a twentieth of a period, and is not learnt as a drift of more than
    /// a thousandth.
    #[test]
    fn never_more_than_its_bounds(
        period_ns in 1i64..20_000_000,
        phases in proptest::collection::vec(prop_oneof![any::<i64>(), -1_000_000i64..1_000_000], 1..200),
    ) {
        let mut steering = PhaseSteering::new(period_ns);
        for phase_ns in phases {
            let sooner_ns = steering.sooner_ns(Some(phase_ns));
            prop_assert!(sooner_ns.abs() as f64 <= 0.05 * period_ns as f64 + 1.0, "{sooner_ns} of {period_ns}");
        }
        let coasting_ns = steering.sooner_ns(None);
        prop_assert!(coasting_ns.abs() as f64 <= 1e-3 * period_ns as f64 + 1.0, "{coasting_ns} of {period_ns}");
    }
}
