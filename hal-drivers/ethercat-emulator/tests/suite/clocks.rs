//! Distributed clocks, SYNC0 and the watchdog of the process data.

use std::time::Duration;

use ethercrab::subdevice_group::{CycleInfo, DcConfiguration};
use ethercrab::{DcSync, MainDevice};
use proptest::prelude::*;
use tandem_ethercat_emulator::{AlCode, AlState, DriveState, What};

use crate::cyclic::{Command, Cyclic};
use crate::rig::{MAX_BYTES, MAX_DEVICES, Rig, now_ns};

const PERIOD: Duration = Duration::from_millis(1);

/// Three drives, each with a drift of its own, and an hour of difference between their clocks.
fn drifting(ppm: [f64; 3]) -> String {
    let device = |(n, ppm): (usize, &f64)| {
        format!(
            "[[devices]]\nkind = \"drive\"\ndrift_ppm = {ppm:?}\nclock_start_ns = {}\n",
            n as u64 * 3_600_000_000_000
        )
    };
    ppm.iter().enumerate().map(device).collect()
}

/// Differences of the clocks to the first one's, in ns.
fn differences(rig: &Rig) -> Vec<i64> {
    let wire = rig.wire.borrow();
    let times: Vec<u64> = wire
        .bus()
        .devices()
        .iter()
        .map(|device| device.system_time_ns(now_ns()))
        .collect();
    times
        .iter()
        .map(|time| time.wrapping_sub(times[0]).cast_signed())
        .collect()
}

/// Brings a bus up with SYNC0 and exchanges so many periods in OPERATIONAL, each in the middle between two SYNC0.
async fn synchronous(rig: &Rig, master: &MainDevice<'static>, periods: u32) {
    let mut group = master
        .init_single_group::<MAX_DEVICES, MAX_BYTES>(now_ns)
        .await
        .unwrap();
    for mut device in group.iter_mut(master) {
        device.set_dc_sync(DcSync::Sync0);
    }
    let group = group.into_pre_op_pdi(master).await.unwrap();
    for n in 1..300 {
        group.tx_rx_sync_system_time(master).await.unwrap();
        rig.until(now_ns() / 1_000_000 * 1_000_000 + 1_000_000)
            .await;
        let all = differences(rig);
        assert!(
            n < 299 || all.iter().all(|ns| ns.abs() < 1000),
            "{all:?} ns"
        );
    }
    let configuration = DcConfiguration {
        start_delay: Duration::from_millis(20),
        sync0_period: PERIOD,
        sync0_shift: PERIOD / 2,
    };
    let group = group
        .configure_dc_sync(master, configuration)
        .await
        .unwrap();
    let group = group.into_safe_op(master).await.unwrap();
    let group = group.request_into_op(master).await.unwrap();
    let mut left = periods;
    while left > 0 {
        let answer = group.tx_rx_dc(master).await.unwrap();
        if answer.all_op() {
            left -= 1;
        }
        let CycleInfo {
            next_cycle_wait, ..
        } = answer.extra;
        rig.until(now_ns() + next_cycle_wait.as_nanos() as u64)
            .await;
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// Whatever the drifts, a master that follows the first clock gives every SYNC0 of every drive a new setpoint.
    #[test]
    fn clocks_follow_the_first_and_no_sync0_is_without_a_setpoint(
        ppm in prop::array::uniform3(-100.0..100.0_f64)
    ) {
        let (rig, master) = Rig::of(&drifting(ppm));
        rig.run(synchronous(&rig, &master, 2000));
        let all = differences(&rig);
        prop_assert!(all.iter().all(|ns| ns.abs() < 1000), "{:?} ns at {:?} ppm", all, ppm);
        for device in rig.wire.borrow().bus().devices() {
            let counters = device.counters();
            prop_assert!(counters.sync0 >= 1999);
            prop_assert_eq!(counters.sync0_without_outputs, 0);
        }
    }
}

#[test]
fn missed_sync_events_beyond_the_limit_are_an_error_of_the_device() {
    let (rig, master) = Rig::of(&drifting([0.0, 50.0, -50.0]));
    rig.run(synchronous(&rig, &master, 20));
    let state = |rig: &Rig| {
        let wire = rig.wire.borrow();
        let drive = &wire.bus().devices()[1];
        (drive.al_state(), drive.al_code())
    };
    // Twelve of the error counter are four pulses; the next one is one too many.
    rig.silence(3);
    assert_eq!(state(&rig), (AlState::Op, None));
    rig.silence(3);
    assert_eq!(state(&rig), (AlState::SafeOp, Some(AlCode::SYNC_ERROR)));
}

#[test]
fn a_clock_that_jumps_is_slewed_back_and_one_that_is_lost_does_not_answer() {
    let (rig, master) = Rig::of(&drifting([0.0, 20.0, -20.0]));
    rig.run(async {
        let group = master
            .init_single_group::<MAX_DEVICES, MAX_BYTES>(now_ns)
            .await
            .unwrap();
        let group = group.into_pre_op_pdi(&master).await.unwrap();
        let jump = What::ClockJump {
            device: 1,
            by_ns: 50_000,
        };
        rig.wire.borrow_mut().inject(jump, None).unwrap();
        assert!(differences(&rig)[1] > 49_000);
        for _ in 0..400 {
            group.tx_rx_sync_system_time(&master).await.unwrap();
            rig.until(now_ns() + 1_000_000).await;
        }
        let left = differences(&rig)[1];
        assert!(left.abs() < 1000, "{left} ns");
        let before = group
            .tx_rx_sync_system_time(&master)
            .await
            .unwrap()
            .working_counter;
        rig.wire
            .borrow_mut()
            .inject(What::LostClock { device: 0 }, None)
            .unwrap();
        for _ in 0..400 {
            let answer = group.tx_rx_sync_system_time(&master).await.unwrap();
            assert_eq!(answer.working_counter, before);
            rig.until(now_ns() + 1_000_000).await;
        }
        // The others get no time any more, or zeros as time: they no longer follow.
        let left = differences(&rig);
        assert!(left[1].abs() > 1000, "{left:?} ns");
    });
}

#[test]
fn a_silent_master_is_noticed_by_the_devices_own_time() {
    let (rig, master) =
        Rig::of("[[devices]]\nkind = \"drive\"\n[[devices]]\nkind = \"digital-outputs\"\n");
    rig.run(async {
        let group = master
            .init_single_group::<MAX_DEVICES, MAX_BYTES>(now_ns)
            .await
            .unwrap();
        for device in group.iter(&master) {
            // 100 counts of 100 µs.
            device.register_write(0x0420_u16, 100_u16).await.unwrap();
        }
        let bus = Cyclic::of(&rig, &master, group).await.unwrap();
        bus.enable(0, 8).await;
        bus.switch(1, 0xff);
        let mut target = 0;
        for _ in 0..100 {
            target += 300;
            bus.exchange(
                0,
                Command {
                    control: 0x0f,
                    mode: 8,
                    target,
                    velocity: 300_000,
                    probe: 0,
                },
            )
            .await;
        }
    });
    let seen = |rig: &Rig| {
        let wire = rig.wire.borrow();
        let [drive, outputs] = wire.bus().devices() else {
            panic!("two devices")
        };
        assert_eq!(outputs.al_state(), AlState::Op);
        (
            drive.al_state(),
            drive.al_code(),
            drive.drive_state().unwrap(),
            outputs.output(0).unwrap(),
        )
    };
    rig.silence(9);
    assert_eq!(
        seen(&rig),
        (AlState::Op, None, DriveState::OperationEnabled, true)
    );
    rig.silence(2);
    let fallen = (
        AlState::SafeOp,
        Some(AlCode::WATCHDOG),
        DriveState::FaultReactionActive,
        false,
    );
    assert_eq!(seen(&rig), fallen);
    rig.silence(100);
    let wire = rig.wire.borrow();
    let drive = &wire.bus().devices()[0];
    assert_eq!(drive.drive_state(), Some(DriveState::Fault));
    assert!(drive.position_and_velocity_counts().unwrap().1.abs() < 1000.0);
    assert_eq!(drive.counters().watchdog, 1);
}
