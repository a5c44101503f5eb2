//! From power-on to OPERATIONAL, and what is in the way.

use ethercrab::error::Error;
use tandem_ethercat_emulator::{AlCode, AlState, What};

use crate::rig::{MAX_BYTES, MAX_DEVICES, Rig, now_ns};

const MIXED: &str = r#"
[[devices]]
kind = "coupler"
[[devices]]
kind = "digital-inputs"
channels = 8
[[devices]]
kind = "digital-outputs"
channels = 16
alias = 1001
[[devices]]
kind = "analog-inputs"
channels = 2
[[devices]]
kind = "analog-outputs"
channels = 2
[[devices]]
kind = "drive"
"#;

#[test]
fn a_mixed_bus_comes_to_operational_and_its_terminals_are_connected() {
    let (rig, master) = Rig::of(MIXED);
    rig.run(async {
        let group = master
            .init_single_group::<MAX_DEVICES, MAX_BYTES>(now_ns)
            .await
            .unwrap();
        let names: Vec<String> = group
            .iter(&master)
            .map(|device| device.name().to_string())
            .collect();
        assert_eq!(
            names,
            [
                "EK1100",
                "EL1008",
                "EL2008",
                "EL3004",
                "EL4004",
                "TANDEM-402"
            ]
        );
        assert_eq!(group.subdevice(&master, 2).unwrap().alias_address(), 1001);
        let group = group.into_safe_op(&master).await.unwrap();
        let group = group.request_into_op(&master).await.unwrap();
        // Two devices with inputs alone, two with outputs alone, one with both: 1 for inputs, 2 for outputs.
        loop {
            let answer = group.tx_rx(&master).await.unwrap();
            assert_eq!(answer.working_counter, 2 + 2 * 2 + 3);
            if answer.all_op() {
                break;
            }
        }
        group
            .subdevice(&master, 2)
            .unwrap()
            .outputs_raw_mut()
            .copy_from_slice(&[0x81, 0x40]);
        group.subdevice(&master, 4).unwrap().outputs_raw_mut()[2..]
            .copy_from_slice(&(-5_i16).to_le_bytes());
        if let Some(inputs) = rig.wire.borrow_mut().bus_mut().device_mut(1) {
            inputs.set_input(3, true);
        }
        if let Some(inputs) = rig.wire.borrow_mut().bus_mut().device_mut(3) {
            inputs.set_analog_input(1, 1234);
        }
        group.tx_rx(&master).await.unwrap();
        group.tx_rx(&master).await.unwrap();
        let wire = rig.wire.borrow();
        let devices = wire.bus().devices();
        assert!(
            devices
                .iter()
                .all(|device| device.al_state() == AlState::Op && device.al_code().is_none())
        );
        let outputs: Vec<bool> = (0..16).map(|n| devices[2].output(n).unwrap()).collect();
        let on: Vec<usize> = (0..16).filter(|n| outputs[*n]).collect();
        assert_eq!(on, [0, 7, 14]);
        assert_eq!(
            (devices[4].analog_output(0), devices[4].analog_output(1)),
            (Some(0), Some(-5))
        );
        assert_eq!(
            group.subdevice(&master, 1).unwrap().inputs_raw()[..],
            [0x08]
        );
        assert_eq!(
            group.subdevice(&master, 3).unwrap().inputs_raw()[6..8],
            1234_i16.to_le_bytes()
        );
    });
}

#[test]
fn a_refused_state_gives_its_code_and_is_taken_once_the_fault_is_over() {
    let refusals = [
        (AlState::PreOp, AlCode::MAILBOX),
        (AlState::SafeOp, AlCode::INPUTS),
        (AlState::Op, AlCode::PLL),
    ];
    for (state, code) in refusals {
        let (rig, master) = Rig::of(MIXED);
        rig.wire
            .borrow_mut()
            .inject(
                What::RefuseState {
                    device: 5,
                    state,
                    code,
                },
                None,
            )
            .unwrap();
        let outcome = rig.run(async {
            let group = master
                .init_single_group::<MAX_DEVICES, MAX_BYTES>(now_ns)
                .await?;
            let group = group.into_safe_op(&master).await?;
            let group = group.request_into_op(&master).await?;
            for _ in 0..1000 {
                group.tx_rx(&master).await?;
            }
            let found: u16 = group
                .subdevice(&master, 5)?
                .register_read(0x0134_u16)
                .await?;
            assert_eq!(found, code.0);
            Ok::<_, Error>(())
        });
        let wire = rig.wire.borrow();
        let drive = &wire.bus().devices()[5];
        assert_eq!(drive.al_code(), Some(code), "{state:?}: {outcome:?}");
        assert!(drive.al_state() < state);
        // ethercrab gives up before OPERATIONAL; in OPERATIONAL it is asked for the state.
        assert_eq!(outcome.is_ok(), state == AlState::Op);
    }
}
