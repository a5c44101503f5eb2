//! Inputs with a role: what they ask of the machine, before each period.

use std::sync::atomic::Ordering::Relaxed;

use tandem_rings::{StopCause, SwitchedBy};
use tandem_sdk::{AxisVector, Edge};

use super::spindle::SpinUp;
use super::{FineLoop, Phase};
use crate::fault::{FaultKind, InputFault};
use crate::roles::Tripped;

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

impl FineLoop {
    /// Behind an exchange: the inputs have been heard of.
    pub(super) fn hear_roles(&mut self, failed: bool) {
        self.roles.heard |= !failed;
    }

    /// Whether nothing is known yet that forbids the drives to hold: inputs with a role are looked at first.
    pub(super) fn may_enable(&self) -> bool {
        self.roles.heard || !self.config.roles.any()
    }

    /// Before a period: what the inputs with a role ask for in it.
    pub(super) fn watch_roles(&mut self) {
        if !self.config.roles.any() || !self.roles.heard {
            return;
        }
        let tripped = self.config.roles.judge(&self.drives.feedback);
        self.status.tripped.store(tripped.all, Relaxed);
        self.obey_stops(&tripped);
        // The spindle of an open door is off, whatever the axes do.
        if tripped.all & self.config.roles.door != 0 && !self.roles.door {
            self.roles.door = true;
            self.switch_by_door();
        }
        if self.fault.is_none() && self.attach.is_done() && !self.outputs.ended {
            self.obey_holds(&tripped);
        }
    }

    /// Inputs that are a fault.
    fn obey_stops(&mut self, tripped: &Tripped) {
        let roles = &self.config.roles;
        let moves = matches!(self.phase, Phase::Following)
            && self.drives.setpoint.velocity != AxisVector::ZERO;
        let homes = self.outputs.unhomed != 0;
        if !moves {
            let may_leave = homes || roles.may_leave_limits;
            self.roles.stood_on = if may_leave {
                tripped.all & !tripped.old
            } else {
                0
            };
        }
        self.roles.stood_on &= tripped.all & !tripped.old;
        let holds = self.attach.is_done() && (!self.outputs.ended || self.stays_enabled());
        let sought = if homes { roles.home_switches } else { 0 };
        let limits = if moves {
            roles.limit & !self.roles.stood_on & !sought
        } else {
            0
        };
        let awaited = if moves {
            roles.home_or_probe & self.awaited() & tripped.old
        } else {
            0
        };
        let ready = if holds { roles.drives_ready } else { 0 };
        for (those, role) in [
            (roles.emergency_stop, InputFault::EmergencyStop),
            (ready, InputFault::DrivesReady),
            (limits, InputFault::Limit),
            (awaited, InputFault::NotHeardOf),
        ] {
            let Some((input, old)) = tripped.first(those) else {
                continue;
            };
            self.fail(FaultKind::Input { role, input, old });
            // What the operator's switches off, it does too, whatever has been a fault before.
            self.given.emergency_stop |= role == InputFault::EmergencyStop;
        }
    }

    /// The input that the motion waits for, as a mask.
    fn awaited(&self) -> u64 {
        let stop_on = &self.plan.cursor.segment().stop_on;
        if stop_on.edge == Edge::None {
            0
        } else {
            1 << stop_on.input.min(63)
        }
    }

    /// Inputs that hold the machine until they are released and the operator resumes.
    fn obey_holds(&mut self, tripped: &Tripped) {
        let roles = &self.config.roles;
        let (door, hold) = (
            tripped.all & roles.door != 0,
            tripped.all & roles.feed_hold != 0,
        );
        self.roles.hold |= hold;
        if door || hold {
            self.controls.hold.store(true, Relaxed);
            self.given.hold = true;
        }
        if !self.given.hold {
            // The operator has resumed: what was switched off comes first.
            if self.roles.door {
                self.switch_by_door();
                self.spin_up = SpinUp::begin();
            }
            (self.roles.door, self.roles.hold) = (false, false);
        }
    }

    /// A door stops the spindle, or lets it turn again: where it turns, that is what switches last.
    fn switch_by_door(&mut self) {
        if self.outputs.spindle_rad_per_s != 0.0 {
            self.outputs.by = SwitchedBy::Door;
        }
    }

    /// What the spindle is told: nothing, where a door is open.
    pub(super) fn spindle_rad_per_s(&self) -> f64 {
        if self.roles.door {
            0.0
        } else {
            self.outputs.spindle_rad_per_s
        }
    }

    /// Which hold it is that the machine rests by.
    pub(super) fn cause_of_hold(&self) -> StopCause {
        if self.roles.door {
            StopCause::Door
        } else if self.roles.hold {
            StopCause::HoldInput
        } else {
            StopCause::Hold
        }
    }

    /// Once more, behind a fault.
    pub(super) fn forget_roles(&mut self) {
        (self.roles, self.spin_up) = (RoleWatch::default(), SpinUp::default());
    }
}
