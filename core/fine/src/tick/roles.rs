//! Inputs with a role: what they ask of the machine, before each period.

use tandem_rings::StopCause;
use tandem_sdk::{Edge, Feedback, StopOn};

use crate::fault::{FaultKind, InputFault};
use crate::roles::{Roles, Tripped};

/// What inputs with a role have asked for.
#[derive(Debug, Default)]
pub(super) struct RoleWatch {
    /// The drives have answered at least once: their inputs count.
    heard: bool,
    /// Limits that the axes stood on when the motion began.
    stood_on: u64,
    /// A door is open, or was and nobody has resumed since: the spindle is off.
    door: bool,
    /// A feed-hold input is tripped, or was and nobody has resumed since.
    hold: bool,
}

/// What the machine does, on which it depends what an input means.
pub(super) struct Doing {
    /// It moves along the plan.
    pub(super) moves: bool,
    /// Axes are homed.
    pub(super) homes: bool,
    /// The drives hold and are to go on holding.
    pub(super) holds: bool,
    /// The input that the motion waits for, as a mask.
    pub(super) awaited: u64,
}

/// The input that a motion waits for, as a mask.
pub(super) fn awaited(stop_on: &StopOn) -> u64 {
    if stop_on.edge == Edge::None {
        0
    } else {
        1 << stop_on.input.min(63)
    }
}

impl RoleWatch {
    /// After an exchange that `failed` or not: the inputs have been heard of.
    #[inline]
    pub(super) fn hear(&mut self, failed: bool) {
        self.heard |= !failed;
    }

    /// Whether nothing is known yet that forbids the drives to hold: inputs with a role are looked at first.
    pub(super) fn may_enable(&self, roles: &Roles) -> bool {
        self.heard || !roles.any()
    }

    /// The inputs that are tripped, where any has a role and has been heard of.
    #[inline]
    pub(super) fn judge(&self, roles: &Roles, feedback: &Feedback) -> Option<Tripped> {
        (roles.any() && self.heard).then(|| roles.judge(feedback))
    }

    /// The fault that an input is: the first of them.
    pub(super) fn fault(
        &mut self,
        roles: &Roles,
        tripped: &Tripped,
        doing: &Doing,
    ) -> Option<FaultKind> {
        if !doing.moves {
            let may_leave = doing.homes || roles.may_leave_limits;
            self.stood_on = if may_leave { u64::MAX } else { 0 };
        }
        self.stood_on &= tripped.all & !tripped.old;
        let sought = if doing.homes { roles.home_switches } else { 0 };
        let limits = if doing.moves {
            roles.limit & !self.stood_on & !sought
        } else {
            0
        };
        let awaited = if doing.moves {
            roles.home_or_probe & doing.awaited & tripped.old
        } else {
            0
        };
        let ready = if doing.holds { roles.drives_ready } else { 0 };
        [
            (roles.emergency_stop, InputFault::EmergencyStop),
            (ready, InputFault::DrivesReady),
            (limits, InputFault::Limit),
            (awaited, InputFault::NotHeardOf),
        ]
        .into_iter()
        .find_map(|(those, role)| {
            let (input, old) = tripped.first(those)?;
            Some(FaultKind::Input { role, input, old })
        })
    }

    /// Whether a door has been opened since this was last asked; it stays open until the operator resumes.
    pub(super) fn opens_door(&mut self, roles: &Roles, tripped: &Tripped) -> bool {
        let opens = tripped.all & roles.door != 0 && !self.door;
        self.door |= opens;
        opens
    }

    /// Whether inputs ask for a hold, which stands until they are released and the operator resumes.
    pub(super) fn asks_for_hold(&mut self, roles: &Roles, tripped: &Tripped) -> bool {
        let hold = tripped.all & roles.feed_hold != 0;
        self.hold |= hold;
        hold || tripped.all & roles.door != 0
    }

    /// The operator has resumed; whether a door had been open.
    pub(super) fn resume(&mut self) -> bool {
        self.hold = false;
        std::mem::take(&mut self.door)
    }

    /// Whether a door is open: the spindle is off.
    pub(super) fn is_door_open(&self) -> bool {
        self.door
    }

    /// Which hold it is that the machine rests by.
    pub(super) fn cause_of_hold(&self) -> StopCause {
        if self.door {
            StopCause::Door
        } else if self.hold {
            StopCause::HoldInput
        } else {
            StopCause::Hold
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: u64 = 0b0001;
    const DOOR: u64 = 0b0010;
    const HOLD: u64 = 0b0100;
    const READY: u64 = 0b1000;
    const STOP: u64 = 0b1_0000;
    const PROBE: u64 = 0b10_0000;

    fn roles() -> Roles {
        Roles {
            limit: LIMIT,
            door: DOOR,
            feed_hold: HOLD,
            drives_ready: READY,
            emergency_stop: STOP,
            home_or_probe: PROBE,
            ..Roles::default()
        }
    }

    fn tripped(all: u64, old: u64) -> Tripped {
        Tripped { all, old }
    }

    fn doing(moves: bool) -> Doing {
        Doing {
            moves,
            homes: false,
            holds: true,
            awaited: 0,
        }
    }

    fn faults(
        watch: &mut RoleWatch,
        all: u64,
        old: u64,
        doing: &Doing,
    ) -> Option<(InputFault, u32, bool)> {
        match watch.fault(&roles(), &tripped(all, old), doing) {
            Some(FaultKind::Input { role, input, old }) => Some((role, input, old)),
            _ => None,
        }
    }

    #[test]
    fn nothing_is_asked_of_inputs_before_they_were_heard_of() {
        let (mut watch, feedback) = (RoleWatch::default(), Feedback::default());
        let closed = Roles {
            normally_closed: STOP,
            ..roles()
        };
        assert!(watch.judge(&closed, &feedback).is_none() && !watch.may_enable(&closed));
        assert!(watch.may_enable(&Roles::default()), "no input has a role");
        watch.hear(true);
        assert!(
            watch.judge(&closed, &feedback).is_none(),
            "the exchange failed"
        );
        watch.hear(false);
        watch.hear(true);
        assert!(watch.may_enable(&closed));
        let found = watch.judge(&closed, &feedback).map(|tripped| tripped.all);
        assert_eq!(found, Some(STOP));
        assert!(watch.judge(&Roles::default(), &feedback).is_none());
    }

    #[test]
    fn a_limit_is_a_fault_in_motion_but_for_one_that_may_be_left() {
        let mut watch = RoleWatch::default();
        assert_eq!(
            faults(&mut watch, LIMIT, 0, &doing(false)),
            None,
            "it stands"
        );
        let hit = Some((InputFault::Limit, 0, false));
        assert_eq!(faults(&mut watch, LIMIT, 0, &doing(true)), hit);
        let homing = |moves| Doing {
            homes: true,
            ..doing(moves)
        };
        assert_eq!(faults(&mut watch, LIMIT, 0, &homing(false)), None);
        assert_eq!(
            faults(&mut watch, LIMIT, 0, &homing(true)),
            None,
            "it stood on it"
        );
        assert_eq!(faults(&mut watch, 0, 0, &homing(true)), None);
        assert_eq!(
            faults(&mut watch, LIMIT, 0, &homing(true)),
            hit,
            "it had left it"
        );
        // What is only not heard of is no limit that it stands on.
        assert_eq!(faults(&mut watch, LIMIT, LIMIT, &homing(false)), None);
        let old = Some((InputFault::Limit, 0, true));
        assert_eq!(faults(&mut watch, LIMIT, LIMIT, &homing(true)), old);
    }

    #[test]
    fn an_emergency_stop_always_counts_and_first_drives_while_they_hold_a_probe_where_it_is_old() {
        let mut watch = RoleWatch::default();
        let stop = Some((InputFault::EmergencyStop, 4, false));
        assert_eq!(
            faults(&mut watch, STOP | READY | LIMIT, 0, &doing(false)),
            stop
        );
        let ready = Some((InputFault::DrivesReady, 3, false));
        assert_eq!(faults(&mut watch, READY | LIMIT, 0, &doing(true)), ready);
        let lets_go = Doing {
            holds: false,
            ..doing(false)
        };
        assert_eq!(faults(&mut watch, READY, 0, &lets_go), None);
        let waits = |moves| Doing {
            awaited: PROBE,
            ..doing(moves)
        };
        assert_eq!(
            faults(&mut watch, PROBE, 0, &waits(true)),
            None,
            "that is what it waits for"
        );
        let old = Some((InputFault::NotHeardOf, 5, true));
        assert_eq!(faults(&mut watch, PROBE, PROBE, &waits(true)), old);
        assert_eq!(faults(&mut watch, PROBE, PROBE, &waits(false)), None);
        assert_eq!(faults(&mut watch, PROBE, PROBE, &doing(true)), None);
    }

    #[test]
    fn a_door_and_a_hold_stand_until_the_operator_resumes_with_them_released() {
        let (mut watch, roles) = (RoleWatch::default(), roles());
        assert_eq!(watch.cause_of_hold(), StopCause::Hold);
        assert!(!watch.asks_for_hold(&roles, &tripped(LIMIT, 0)));
        assert!(watch.asks_for_hold(&roles, &tripped(HOLD, 0)));
        assert_eq!(watch.cause_of_hold(), StopCause::HoldInput);
        assert!(!watch.opens_door(&roles, &tripped(HOLD, 0)) && !watch.is_door_open());
        assert!(watch.opens_door(&roles, &tripped(DOOR, 0)));
        assert!(!watch.opens_door(&roles, &tripped(DOOR, 0)), "it was open");
        assert!(watch.asks_for_hold(&roles, &tripped(DOOR, 0)) && watch.is_door_open());
        assert_eq!(watch.cause_of_hold(), StopCause::Door);
        assert!(!watch.opens_door(&roles, &tripped(0, 0)) && watch.is_door_open());
        assert!(watch.resume(), "the door had been open");
        assert!(!watch.is_door_open() && !watch.resume());
        assert_eq!(watch.cause_of_hold(), StopCause::Hold);
    }
}
