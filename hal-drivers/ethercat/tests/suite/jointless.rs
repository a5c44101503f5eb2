//! Devices that move no joint, a spindle's drive and terminals: where one of them is lost, the machine does not go on without it.

use tandem_ethercat_emulator::{AlCode, AlState, What};
use tandem_sdk::{Driver, JointState};

use crate::bus::{Rig, drive, emulated};

/// Two drives, a spindle, a terminal of inputs, one of outputs, and one that the machine does not use.
fn bus() -> String {
    let terminal = |position: u32, product: &str, lines: &str| {
        format!("[[devices]]\nposition = {position}\nproduct = \"2:{product}\"\n{lines}\n")
    };
    [
        drive(0, "x", ""),
        drive(1, "y", ""),
        "[[devices]]\nposition = 2\nproduct = \"0x0e1a:0x0402\"\nspindle = { mode = \"csv\" }\ncounts_per_turn = 4096\n"
            .to_string(),
        terminal(3, "0x03f03052", "inputs = [-1, 5]"),
        "[[devices]]\nalias = 700\nproduct = \"2:0x07d83052\"\noutputs = [3]\n".to_string(),
        terminal(5, "0x03f03052", "inputs = [-1]"),
        emulated(""),
        emulated(""),
        emulated("drive = { modes = [3, 9] }"),
        "[[emulated.devices]]\nkind = \"digital-inputs\"\n".to_string(),
        "[[emulated.devices]]\nkind = \"digital-outputs\"\nalias = 700\n".to_string(),
        "[[emulated.devices]]\nkind = \"digital-inputs\"\n".to_string(),
    ]
    .concat()
}

fn enabled() -> Rig {
    let mut rig = Rig::of(&bus(), &["x", "y"]);
    rig.setpoint.enable = 1;
    while rig.feedback.state[..2] != [JointState::Enabled; 2] {
        rig.exchange();
    }
    rig.setpoint.position = rig.feedback.position;
    rig
}

#[test]
fn a_spindle_or_a_terminal_that_is_lost_stops_the_machine_by_its_own_name() {
    let left = |device: usize| What::AlError {
        device,
        state: AlState::SafeOp,
        code: AlCode::WATCHDOG,
    };
    for (trouble, words) in [
        (
            What::Deaf { device: 2 },
            "device 2: the spindle's drive: the working counter says",
        ),
        (
            left(2),
            "device 2: the spindle's drive: it left OP: 001B, sync manager watchdog",
        ),
        (
            What::Deaf { device: 3 },
            "device 3: the working counter says",
        ),
        (
            What::Cut { behind: Some(2) },
            "device 3: the working counter says",
        ),
        (
            What::Deaf { device: 4 },
            "the device of alias 700: the working counter says",
        ),
        (
            What::Cut { behind: Some(3) },
            "the device of alias 700: the working counter says",
        ),
    ] {
        let mut rig = enabled();
        (0..20).for_each(|_| rig.go(0.01));
        rig.inject(trouble.clone());
        for n in 1..=3 {
            rig.go(0.0);
            // As patient as with a joint's drive.
            let is_lost = rig.feedback.state[0] == JointState::Lost;
            assert_eq!(is_lost, n > 2, "{trouble:?}: exchange {n}");
        }
        // Why it left its state is known where its state was asked for.
        (0..3).for_each(|_| rig.go(0.0));
        let why = rig.driver.explain(0, rig.feedback.fault_code[0]);
        assert!(why.as_str().starts_with(words), "{}", why.as_str());
        assert_eq!(rig.feedback.state[1], JointState::Enabled, "{trouble:?}");
        // The first joint is none the worse for it: it goes where it is told, and its brake is waited for.
        assert_eq!(rig.feedback.age_periods[..2], [0, 0]);
        let before = rig.feedback.position[0];
        (0..20).for_each(|_| rig.go(0.01));
        assert!(rig.feedback.position[0] - before > 0.15, "{trouble:?}");
        rig.emulator(tandem_ethercat_emulator::Wire::mend);
        rig.driver.stop().unwrap();
        rig.driver.start().unwrap();
        rig.setpoint.velocity = tandem_sdk::AxisVector::ZERO;
        (rig.setpoint.enable, rig.setpoint.reset) = (0, 1);
        rig.exchange();
        rig.enable();
    }
}

/// What nothing of the machine hangs on may go.
#[test]
fn a_terminal_that_the_machine_does_not_use_may_be_lost() {
    let mut rig = enabled();
    rig.inject(What::Deaf { device: 5 });
    (0..100).for_each(|_| rig.exchange());
    assert_eq!(rig.feedback.state[..2], [JointState::Enabled; 2]);
}
