//! What the drives say of themselves, in words, while a run lasts. What a code means only the driver knows, which is the fine
//! loop's then: a fault has those words.

use std::sync::atomic::Ordering::Relaxed;

use serde::Serialize;
use tandem_machine::Machine;
use tandem_rings::{JointStatus, Status};
use tandem_sdk::{JointState, MAX_AXES, Words};

/// One joint's drive at one moment.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct JointLine {
    /// The joint's name.
    pub name: String,
    /// What its drive says.
    pub state: &'static str,
    /// The drive's fault code as its manual writes it.
    pub fault: Option<String>,
}

/// Names of the joints, in the order of the drives.
fn names(machine: &Machine) -> Vec<String> {
    if machine.kinematics.plugin != "identity" {
        return machine
            .joints
            .iter()
            .map(|joint| joint.name.clone())
            .take(MAX_AXES)
            .collect();
    }
    let of_axis = |axis: usize| {
        let own = machine
            .joints
            .iter()
            .filter(|joint| joint.axis == Some(axis))
            .map(|joint| joint.name.clone());
        let own: Vec<_> = own.collect();
        if own.is_empty() {
            vec![machine.axes.letter(axis).to_ascii_lowercase().to_string()]
        } else {
            own
        }
    };
    (0..machine.axes.count())
        .flat_map(of_axis)
        .take(MAX_AXES)
        .collect()
}

/// Every joint's drive as it was last heard of. Host; allocates.
pub fn lines(machine: &Machine, status: &Status) -> Vec<JointLine> {
    let hexadecimal = status.hexadecimal_codes.load(Relaxed);
    let line = |(name, joint): (String, &JointStatus)| {
        let (state, code) = joint.load();
        JointLine {
            name,
            state: state_text(state),
            fault: (code != 0).then(|| number_text(code, hexadecimal)),
        }
    };
    names(machine)
        .into_iter()
        .zip(&status.joints)
        .map(line)
        .collect()
}

/// While the drives are told to hold: who does not, and why. Host; allocates.
pub fn enabling(machine: &Machine, status: &Status) -> Option<String> {
    if !status.enabling.load(Relaxed) {
        return None;
    }
    let holds = state_text(JointState::Enabled);
    let word = |line: &JointLine| match &line.fault {
        Some(code) => format!("{} ({}, fault {code})", line.name, line.state),
        None => format!("{} ({})", line.name, line.state),
    };
    let missing: Vec<_> = lines(machine, status)
        .iter()
        .filter(|line| line.state != holds)
        .map(word)
        .collect();
    (!missing.is_empty()).then(|| format!("enabling {}", missing.join(", ")))
}

/// Whether a drive moves its joint by itself, to home it. Any side.
pub fn is_homing(status: &Status) -> bool {
    let homes = |joint: &JointStatus| joint.load().0 == JointState::Homing;
    status.joints.iter().any(homes)
}

/// A joint's state as people read it.
pub fn state_text(state: JointState) -> &'static str {
    match state {
        JointState::Disabled => "disabled",
        JointState::Enabling => "enabling",
        JointState::Enabled => "enabled",
        JointState::Homing => "homing",
        JointState::QuickStop => "in its quick stop",
        JointState::Fault => "in fault",
        JointState::Lost => "lost",
        _ => "in no known state",
    }
}

/// A drive's code as its manual writes it, with the driver's `words` for it.
pub fn code_text(hexadecimal: bool, code: u32, words: &Words) -> String {
    let number = number_text(code, hexadecimal);
    if words.as_str().is_empty() {
        number
    } else {
        format!("{number} ({})", words.as_str())
    }
}

/// A drive's code alone, as its manual writes it.
pub fn number_text(code: u32, hexadecimal: bool) -> String {
    if hexadecimal {
        format!("{code:#06x}")
    } else {
        code.to_string()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn who_does_not_hold_yet_is_named_with_state_and_code() {
        let path =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/mill-3axis.toml");
        let (machine, status) = (Machine::read(&path, &[]).unwrap(), Status::default());
        assert_eq!(enabling(&machine, &status), None);
        status.enabling.store(true, Relaxed);
        status.hexadecimal_codes.store(true, Relaxed);
        status.joints[0].store(JointState::Enabled, 0);
        status.joints[1].store(JointState::Fault, 0x7210);
        status.joints[2].store(JointState::Enabling, 0);
        assert_eq!(
            enabling(&machine, &status).unwrap(),
            "enabling y (in fault, fault 0x7210), z (enabling)"
        );
        assert_eq!(lines(&machine, &status)[1].fault.as_deref(), Some("0x7210"));
        status.joints[1].store(JointState::Enabled, 0);
        status.joints[2].store(JointState::Enabled, 0);
        assert_eq!(enabling(&machine, &status), None);
    }
}
