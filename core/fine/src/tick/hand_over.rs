//! A joint that its drive homes: handed over at rest, neither followed nor judged, and taken back where the drive says it is.

use tandem_sdk::{AxisVector, JointState};

use super::drives::Drives;
use crate::fault::FaultKind;

/// A joint in its drive's hands.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::struct_excessive_bools)] // independent facts of two sides that answer each other a period later
pub(super) struct HandOver {
    joint: usize,
    /// Time that the drive has, s, and fine periods of it that are over: a hold interrupts it.
    within_s: f64,
    periods: u64,
    /// The drive has begun: that it says it is homed is not of an older homing.
    begun: bool,
    /// Why it is taken back without being homed.
    given_up: bool,
    /// The drive has been told in the last exchange.
    told: bool,
    /// Its drive held it in the last exchange, interrupted.
    held: bool,
}

/// What has become of a joint in its drive's hands.
pub(super) enum Found {
    /// The drive says where it is.
    Homed,
    /// It holds, and is not homed: the operator has aborted.
    GivenUp,
    /// It has taken longer than it may.
    Late(FaultKind),
    /// The drive goes on.
    Goes,
}

impl HandOver {
    /// Hands `joint` over to its drive, which has `within_s` for it.
    pub(super) fn begin(joint: usize, within_s: f64, drives: &Drives) -> Self {
        Self {
            joint,
            within_s,
            periods: 0,
            begun: drives.feedback().homed >> joint & 1 == 0,
            given_up: false,
            told: false,
            held: false,
        }
    }

    /// The joint.
    pub(super) fn joint(&self) -> usize {
        self.joint
    }

    /// One period more, in which the operator holds it (`is_held`) or wants it back (`gives_up`).
    pub(super) fn look(
        &mut self,
        drives: &mut Drives,
        period_s: f64,
        is_held: bool,
        gives_up: bool,
    ) -> Found {
        let feedback = drives.feedback();
        let (bit, state) = (1_u32 << self.joint, feedback.state[self.joint]);
        let is_new = feedback.age_periods[self.joint] == 0;
        self.begun |= is_new && (state == JointState::Homing || feedback.homed & bit == 0);
        let homed = self.told && self.begun && feedback.homed & bit != 0;
        self.given_up |= gives_up;
        if is_new && state == JointState::Enabled && (homed || self.given_up) {
            return if self.given_up {
                Found::GivenUp
            } else {
                Found::Homed
            };
        }
        // Holds and doors interrupt the drive's own motion; it begins anew when they are over.
        self.told = !self.given_up && !is_held;
        self.periods += u64::from(!is_held);
        let code = feedback.fault_code[self.joint];
        drives.tell_to_home(if self.told { bit } else { 0 });
        if self.periods as f64 * period_s > self.within_s {
            return Found::Late(FaultKind::NotHomed {
                joint: self.joint,
                state,
                code,
                within_s: self.within_s,
            });
        }
        Found::Goes
    }

    /// Puts the joint where it is among `joints`: that is no motion of the plan. Where its drive is interrupted and holds it, it
    /// stays, so that it does not sink.
    pub(super) fn place(&mut self, drives: &Drives, joints: &mut AxisVector) {
        let holds = !self.told && drives.feedback().state[self.joint] == JointState::Enabled;
        let position = if holds && self.held {
            &drives.setpoint().position
        } else {
            &drives.feedback().position
        };
        joints[self.joint] = position[self.joint];
        self.held = holds;
    }
}
