//! A joint that its drive homes: handed over at rest, neither followed nor judged, and taken back where the drive says it is.

use std::sync::atomic::Ordering::Relaxed;

use tandem_rings::RestCause;
use tandem_sdk::{AxisVector, JointState};

use super::rest::Stop;
use super::{FineLoop, Phase};
use crate::fault::FaultKind;
use crate::state::Input;

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

impl FineLoop {
    /// At a rest: hands the joint over that an event has named.
    pub(super) fn begin_hand_over(&mut self) -> Option<Input> {
        let (joint, within_s) = self
            .outputs
            .hand_over
            .filter(|_| self.plan.cursor.is_resting())?;
        self.outputs.hand_over = None;
        if joint >= self.drives.joints {
            return None;
        }
        let begun = self.drives.feedback.homed >> joint & 1 == 0;
        let (periods, given_up, told, held) = (0, false, false, false);
        self.phase = Phase::HandedOver(HandOver {
            joint,
            within_s,
            periods,
            begun,
            given_up,
            told,
            held,
        });
        Some(Input::Run)
    }

    /// One period of a joint in its drive's hands: where the axes stand, by the plan, and what it is to the machine's state.
    pub(super) fn hand_over(&mut self, hand: HandOver) -> (AxisVector, Input) {
        let input = self.look_at_hand(hand);
        (self.stand(), input)
    }

    fn look_at_hand(&mut self, mut hand: HandOver) -> Input {
        let (bit, state) = (1_u32 << hand.joint, self.drives.feedback.state[hand.joint]);
        let is_new = self.drives.feedback.age_periods[hand.joint] == 0;
        hand.begun |=
            is_new && (state == JointState::Homing || self.drives.feedback.homed & bit == 0);
        let homed = hand.told && hand.begun && self.drives.feedback.homed & bit != 0;
        hand.given_up |= self.given.abort || self.is_jog_let_go();
        if is_new && state == JointState::Enabled && (homed || hand.given_up) {
            self.take_back(hand.joint);
            return self.end_epoch(if hand.given_up {
                Stop::abort()
            } else {
                Stop::of(RestCause::Corrected)
            });
        }
        // Holds and doors interrupt the drive's own motion; it begins anew when they are over.
        let held = self.given.hold || self.given.program_hold;
        hand.told = !hand.given_up && !held;
        hand.periods += u64::from(!held);
        self.drives.setpoint.homing = if hand.told { bit } else { 0 };
        if hand.periods as f64 * self.config.period_s > hand.within_s {
            let (joint, within_s, code) = (
                hand.joint,
                hand.within_s,
                self.drives.feedback.fault_code[hand.joint],
            );
            self.fail(FaultKind::NotHomed {
                joint,
                state,
                code,
                within_s,
            });
            return Input::Trip;
        }
        if self.controls.soft_fault.load(Relaxed) {
            self.fail(FaultKind::Soft);
            return Input::Trip;
        }
        self.phase = Phase::HandedOver(hand);
        if held { Input::Hold } else { Input::Run }
    }

    /// Before a fault: what a drive has in its hands is taken back as it is.
    pub(super) fn end_hand_over(&mut self) {
        if let Phase::HandedOver(hand) = &self.phase {
            let joint = hand.joint;
            self.phase = Phase::AwaitingReplan;
            self.take_back(joint);
        }
    }

    /// Joints in their drives' hands, a bit each.
    pub(super) fn handed_over(&self) -> u32 {
        if let Phase::HandedOver(hand) = &self.phase {
            1 << hand.joint
        } else {
            0
        }
    }

    /// What the joints are told: the one in its drive's hands is where it is, and that is no motion of the plan. Where its drive
    /// is interrupted and holds it, it stays, so that it does not sink.
    pub(super) fn hold_the_others(&mut self, axes: &AxisVector) -> AxisVector {
        let mut joints = self.joints_of(axes);
        if let Phase::HandedOver(hand) = &mut self.phase {
            let joint = hand.joint;
            let holds = !hand.told && self.drives.feedback.state[joint] == JointState::Enabled;
            let stays = holds && hand.held;
            joints[joint] = if stays {
                self.drives.setpoint.position[joint]
            } else {
                self.drives.feedback.position[joint]
            };
            hand.held = holds;
        }
        joints
    }

    /// The machine stands where the drive says that its joint is. What was sent before is no way from there to here.
    fn take_back(&mut self, joint: usize) {
        self.drives.setpoint.homing = 0;
        let mut joints = self.joints_of(self.guard.position());
        joints[joint] = self.drives.feedback.position[joint];
        self.space.offset[joint] = 0.0;
        self.stand_at(&joints);
        self.drives.forget_way(&joints);
    }
}
