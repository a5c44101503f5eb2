//! Inputs with a role: what they ask of the machine, before each period.

use tandem_rings::StopCause;
use tandem_sdk::Feedback;

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
            self.stood_on = if may_leave {
                tripped.all & !tripped.old
            } else {
                0
            };
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
