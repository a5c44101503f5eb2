//! Distributed clocks: which clock leads, what goes wrong with it, and that no SYNC0 is without a setpoint.

use proptest::prelude::*;
use tandem_ethercat_emulator::{AlCode, AlState, What};
use tandem_sdk::{Driver, JointState};

use crate::bus::{Rig, drive, emulated};

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// Whatever the drifts and the shift, no SYNC0 is without a new setpoint, and the frame keeps its phase.
    #[test]
    fn with_distributed_clocks_no_sync0_is_without_a_setpoint(
        ppm in prop::array::uniform3(-100.0..100.0_f64),
        phase_us in 200.0..800.0_f64,
    ) {
        let names = ["x", "y", "z"];
        let drives: String = (0..).zip(names).map(|(position, name)| drive(position, name, "")).collect();
        let clocks: String = ppm.iter().map(|ppm| emulated(&format!("drift_ppm = {ppm:?}"))).collect();
        let mut rig = Rig::of(&format!("sync = \"dc\"\nphase_us = {phase_us:?}\n{drives}{clocks}"), &names);
        let before: Vec<u64> = counters(&mut rig, |counters| counters.sync0_without_outputs);
        let mut worst_ns = 0;
        for _ in 0..2000 {
            rig.exchange();
            prop_assert_eq!(rig.feedback.has_phase, 1);
            worst_ns = worst_ns.max(rig.feedback.phase_ns.abs());
        }
        prop_assert!(counters(&mut rig, |counters| counters.sync0).iter().all(|sync0| *sync0 > 2000));
        prop_assert_eq!(counters(&mut rig, |counters| counters.sync0_without_outputs), before);
        prop_assert!(worst_ns < 10_000, "phase error {worst_ns} ns");
        prop_assert_eq!(rig.attached.delay_periods[0], 2);
    }
}

fn counters(rig: &mut Rig, of: impl Fn(tandem_ethercat_emulator::Counters) -> u64) -> Vec<u64> {
    rig.emulator(|wire| {
        wire.bus()
            .devices()
            .iter()
            .map(|device| of(device.counters()))
            .collect()
    })
}

/// What goes wrong with a clock in operation is a lost joint with the reason, never a silent one.
#[test]
fn missed_sync0_and_lost_clocks_are_told() {
    let of = |more: &str| {
        format!(
            "sync = \"dc\"\n{}{}{}{}",
            drive(0, "x", ""),
            drive(1, "y", ""),
            emulated(more),
            emulated("")
        )
    };
    let mut rig = Rig::of(&of(""), &["x", "y"]);
    rig.enable();
    // A jump is slewed back.
    rig.inject(What::ClockJump {
        device: 1,
        by_ns: 50_000,
    });
    (0..1000).for_each(|_| rig.exchange());
    assert_eq!(rig.feedback.state[..2], [JointState::Enabled; 2]);
    rig.inject(What::AlError {
        device: 0,
        state: AlState::SafeOp,
        code: AlCode::SYNC_ERROR,
    });
    rig.until(JointState::Lost);
    assert_eq!(rig.feedback.fault_code[0], 0x1_001A);
    assert_eq!(
        rig.feedback.state[1],
        JointState::Enabled,
        "the other one goes on"
    );
    // One SYNC0 that a drive misses passes; several are its fault, by its own code.
    let mut rig = Rig::of(&of(""), &["x", "y"]);
    rig.enable();
    rig.inject(What::MissedSync {
        device: 0,
        pulses: 1,
    });
    (0..100).for_each(|_| rig.exchange());
    assert_eq!(rig.feedback.state[..2], [JointState::Enabled; 2]);
    // The clock that leads is gone: nobody is steered by what it said before, and the joints do not drift on in silence.
    rig.inject(What::LostClock { device: 0 });
    for _ in 0..2 {
        rig.exchange();
        assert_eq!(rig.feedback.has_phase, 0);
        assert_eq!(rig.feedback.state[..2], [JointState::Enabled; 2]);
    }
    rig.exchange();
    assert_eq!(rig.feedback.state[0], JointState::Lost);
    assert_eq!(
        rig.feedback.state[1],
        JointState::Lost,
        "it followed that clock"
    );
    let why = rig.driver.explain(0, rig.feedback.fault_code[0]);
    assert!(
        why.as_str().contains("the clock that leads"),
        "{}",
        why.as_str()
    );
}

/// Whatever clock leads, and whatever the width of the others: one of 32 bits begins anew every 4.3 s, in no whole number of periods,
/// and neither the frame's phase nor any SYNC0 notices.
#[test]
fn a_clock_of_32_bits_leads_and_follows_past_its_end() {
    let coupler = "[[devices]]\nposition = 0\nproduct = \"2:0x044c2c52\"\n";
    let emulated_coupler =
        |more: &str| format!("[[emulated.devices]]\nkind = \"coupler\"\n{more}\n");
    let narrow = "clocking = \"bits32\"\ndrift_ppm = 60.0\n";
    let drives = |narrow_ones: [bool; 2]| {
        narrow_ones
            .map(|is| emulated(if is { narrow } else { "drift_ppm = -80.0" }))
            .concat()
    };
    for (case, first, others) in [
        ("a drive of 32 bits leads", None, drives([true, false])),
        ("one of 64 bits leads", None, drives([false, true])),
        // It has a clock that others can follow, and no SYNC0.
        (
            "a coupler of 64 bits leads",
            Some(emulated_coupler("")),
            drives([false, true]),
        ),
        (
            "a coupler of 32 bits leads",
            Some(emulated_coupler(
                "clocking = \"bits32\"\nfeatures = 0xf4\ndrift_ppm = 95.0",
            )),
            drives([false, true]),
        ),
    ] {
        let behind = u32::from(first.is_some());
        let devices = format!(
            "{}{}{}",
            first.as_ref().map_or("", |_| coupler),
            drive(behind, "x", ""),
            drive(behind + 1, "y", "")
        );
        let bus = first.unwrap_or_default() + &others;
        let mut rig = Rig::of(&format!("sync = \"dc\"\n{devices}{bus}"), &["x", "y"]);
        rig.setpoint.enable = 1;
        let empty = counters(&mut rig, |counters| counters.sync0_without_outputs);
        // Past two of its ends.
        for n in 0..9_500 {
            rig.exchange();
            assert_eq!(rig.feedback.has_phase, 1, "{case}, exchange {n}");
            let phase_ns = rig.feedback.phase_ns.abs();
            assert!(phase_ns < 10_000, "{case}, exchange {n}: {phase_ns} ns");
        }
        assert_eq!(rig.feedback.state[..2], [JointState::Enabled; 2], "{case}");
        assert_eq!(
            counters(&mut rig, |counters| counters.sync0_without_outputs),
            empty,
            "{case}"
        );
    }
}
