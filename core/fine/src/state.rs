//! The state of the machine as a table; the states are those that `PLCopen` and `CiA 402` know.

use tandem_rings::MachineState::{
    self, Disabled, Fault, Holding, Running, Standstill, Starved, Stopping,
};

/// What drives the state, once a fine period or on command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// The operator or the host acknowledges a fault.
    Reset = 0,
    /// Every drive follows its setpoint.
    DrivesOn = 1,
    /// At least one drive does not.
    DrivesOff = 2,
    /// The plan moves, or waits in a dwell.
    Run = 3,
    /// There is nothing to do.
    Rest = 4,
    /// A feed hold is asked for.
    Hold = 5,
    /// The queue runs low.
    Starve = 6,
    /// A fault was seen.
    Trip = 7,
    /// The fault reaction has brought the machine to rest.
    Stopped = 8,
}

/// Number of [`Input`]s.
const INPUTS: usize = 9;

/// The state after an input. A fault is sticky until reset, and a machine starts faulted.
pub fn next(state: MachineState, input: Input) -> MachineState {
    TABLE[state as usize].1[input as usize]
}

/// One row a state in the order of its number: the state after each input, in the order of [`Input`].
#[rustfmt::skip]
const TABLE: [(MachineState, [MachineState; INPUTS]); 7] = [
    //           reset       drives on   drives off run       rest        hold      starve    trip      stopped
    (Standstill, [Standstill, Standstill, Disabled,  Running,  Standstill, Holding,  Starved,  Stopping, Fault]),
    (Running,    [Running,    Running,    Stopping,  Running,  Standstill, Holding,  Starved,  Stopping, Fault]),
    (Holding,    [Holding,    Holding,    Stopping,  Running,  Standstill, Holding,  Starved,  Stopping, Fault]),
    (Starved,    [Starved,    Starved,    Stopping,  Running,  Standstill, Holding,  Starved,  Stopping, Fault]),
    (Stopping,   [Stopping,   Stopping,   Stopping,  Stopping, Stopping,   Stopping, Stopping, Stopping, Fault]),
    (Fault,      [Disabled,   Fault,      Fault,     Fault,    Fault,      Fault,    Fault,    Fault,    Fault]),
    (Disabled,   [Disabled,   Standstill, Disabled,  Disabled, Disabled,   Disabled, Disabled, Fault,    Fault]),
];

#[cfg(test)]
mod tests {
    use super::*;

    const INPUT: [Input; INPUTS] = [
        Input::Reset,
        Input::DrivesOn,
        Input::DrivesOff,
        Input::Run,
        Input::Rest,
        Input::Hold,
        Input::Starve,
        Input::Trip,
        Input::Stopped,
    ];

    fn states() -> impl Iterator<Item = MachineState> {
        TABLE.iter().map(|(state, _)| *state)
    }

    #[test]
    fn rows_stand_in_the_order_of_the_states() {
        assert!(
            states()
                .enumerate()
                .all(|(index, state)| state as usize == index)
        );
        assert!(
            INPUT
                .iter()
                .enumerate()
                .all(|(index, input)| *input as usize == index)
        );
    }

    #[test]
    fn a_fault_is_left_by_reset_alone_and_into_disabled() {
        for input in INPUT {
            let expected = if input == Input::Reset {
                Disabled
            } else {
                Fault
            };
            assert_eq!(next(Fault, input), expected);
        }
    }

    #[test]
    fn motion_begins_from_a_machine_that_stands_with_its_drives_on() {
        for state in states() {
            for input in INPUT
                .into_iter()
                .filter(|_| [Disabled, Fault, Stopping].contains(&state))
            {
                assert!(
                    ![Running, Holding, Starved].contains(&next(state, input)),
                    "{state:?} {input:?}"
                );
            }
        }
        assert_eq!(next(Disabled, Input::DrivesOn), Standstill);
        assert_eq!(next(Standstill, Input::Run), Running);
    }

    #[test]
    fn every_state_trips() {
        for state in states() {
            let moving = [Standstill, Running, Holding, Starved, Stopping].contains(&state);
            assert_eq!(
                next(state, Input::Trip),
                if moving { Stopping } else { Fault }
            );
            assert_eq!(next(state, Input::Stopped), Fault);
        }
    }

    #[test]
    fn the_operator_can_hold_wherever_something_may_move() {
        for state in [Standstill, Running, Holding, Starved] {
            assert_eq!(next(state, Input::Hold), Holding);
            assert_eq!(next(state, Input::Run), Running);
            assert_eq!(next(state, Input::Starve), Starved);
            assert_eq!(next(state, Input::Rest), Standstill);
        }
    }

    #[test]
    fn reset_changes_nothing_but_a_fault_and_drives_that_stay_on_change_nothing() {
        for state in states().filter(|s| *s != Fault) {
            assert_eq!(next(state, Input::Reset), state);
            assert_eq!(
                next(state, Input::DrivesOn),
                if state == Disabled { Standstill } else { state }
            );
        }
    }

    #[test]
    fn lost_drives_stop_what_moves() {
        let expected = |state| match state {
            Standstill | Disabled => Disabled,
            Fault => Fault,
            _ => Stopping,
        };
        assert!(states().all(|state| next(state, Input::DrivesOff) == expected(state)));
    }
}
