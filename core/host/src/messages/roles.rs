//! Inputs with a role, from the machine file to the fine loop and to words.

use tandem_fine::{InputFault, Roles};
use tandem_machine::{AxisHoming, Input, Machine, Role};

use crate::switches::Switches;

/// What the fine loop judges of the machine's inputs.
pub fn of(machine: &Machine, switches: Switches) -> Roles {
    let mut roles = Roles {
        may_leave_limits: switches.unhomed,
        ..Roles::default()
    };
    let mut seen = 0;
    for input in &machine.inputs {
        let Some(role) = input.role else { continue };
        let bit = 1_u64 << input.input.min(63);
        *mask(&mut roles, role) |= bit;
        roles.normally_closed |= if input.normally_closed { bit } else { 0 };
        let periods = (input.max_age_s / machine.fine_period_s * (1.0 + f64::EPSILON)).floor();
        // The greatest age stands for anything older: no age is above it.
        let most = (periods as u16).min(u16::MAX - 1);
        let age = &mut roles.max_age_periods[input.input.min(63) as usize];
        *age = if seen & bit == 0 {
            most
        } else {
            most.min(*age)
        };
        seen |= bit;
    }
    roles.home_switches = machine
        .homing
        .iter()
        .filter_map(AxisHoming::switch)
        .fold(0, |bits, switch| bits | 1 << switch.input.min(63));
    roles
}

fn mask(roles: &mut Roles, role: Role) -> &mut u64 {
    match role {
        Role::EmergencyStop => &mut roles.emergency_stop,
        Role::DrivesReady => &mut roles.drives_ready,
        Role::Door => &mut roles.door,
        Role::FeedHold => &mut roles.feed_hold,
        Role::Limit => &mut roles.limit,
        Role::Home | Role::Probe => &mut roles.home_or_probe,
    }
}

/// An input with a role is a fault, in words.
pub fn fault_text(machine: &Machine, role: InputFault, input: u32, old: bool) -> String {
    let is_meant = |named: &&Input| {
        let meant = match role {
            InputFault::EmergencyStop => named.role == Some(Role::EmergencyStop),
            InputFault::DrivesReady => named.role == Some(Role::DrivesReady),
            InputFault::Limit => named.role == Some(Role::Limit),
            InputFault::NotHeardOf => matches!(named.role, Some(Role::Home | Role::Probe)),
        };
        named.input == input && meant
    };
    let named = machine.inputs.iter().find(is_meant);
    let who = named.map_or(format!("input {input}"), |named| {
        format!("input {} ({input})", named.name)
    });
    let age_ms = named.map_or(0.0, |named| named.max_age_s * 1e3);
    let what = match role {
        InputFault::EmergencyStop => "emergency stop",
        InputFault::DrivesReady => "the drives are not ready",
        InputFault::Limit => "a limit switch tripped in motion",
        InputFault::NotHeardOf => "the motion waits for a switch that is not heard of",
    };
    if old {
        return format!(
            "{what}: {who} has not been heard of for more than {age_ms} ms, which counts as tripped"
        );
    }
    format!(
        "{what}: {who} is {}",
        if named.is_none_or(|named| named.normally_closed) {
            "open"
        } else {
            "closed"
        }
    )
}

/// The inputs among those `tripped`, a bit each, that hold the machine, in words; none where none does.
pub fn holding(machine: &Machine, tripped: u64) -> Option<String> {
    let holds = |named: &&Input| {
        matches!(named.role, Some(Role::Door | Role::FeedHold))
            && tripped >> named.input.min(63) & 1 == 1
    };
    let names: Vec<_> = machine
        .inputs
        .iter()
        .filter(holds)
        .map(|named| named.name.as_str())
        .collect();
    (!names.is_empty()).then(|| names.join(", "))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn roles_become_masks_and_faults_name_their_input() {
        let path =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/mill-3axis.toml");
        let table = "inputs.guard={input=4,role=\"door\",normally_closed=false,max_age_ms=2.5}";
        let stop = "inputs.button={input=7,role=\"emergency-stop\",max_age_ms=5000}";
        let sets = [table, stop]
            .map(|set| set.split_once('=').unwrap())
            .map(|(k, v)| (k.to_string(), v.to_string()));
        let machine = Machine::read(&path, &sets).unwrap();
        let roles = of(&machine, Switches::default());
        assert_eq!(
            (roles.door, roles.emergency_stop, roles.normally_closed),
            (1 << 4, 1 << 7, 1 << 7)
        );
        assert_eq!(
            (roles.max_age_periods[4], roles.max_age_periods[7]),
            (2, 5000)
        );
        assert!(
            !roles.may_leave_limits
                && of(
                    &machine,
                    Switches {
                        unhomed: true,
                        ..Switches::default()
                    }
                )
                .may_leave_limits
        );
        let words = |old| fault_text(&machine, InputFault::EmergencyStop, 7, old);
        assert_eq!(words(false), "emergency stop: input button (7) is open");
        let old = "emergency stop: input button (7) has not been heard of for more than 5000 ms, which counts as tripped";
        assert_eq!(words(true), old);
        assert_eq!(holding(&machine, u64::MAX).as_deref(), Some("guard"));
        assert_eq!(holding(&machine, 1 << 7), None);
    }
}
