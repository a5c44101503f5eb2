//! From drives without torque to joints that hold, all where they stand: nothing moves on the way.

use tandem_sdk::{AxisVector, JointState};

use super::drives::Drives;
use crate::config::FineConfig;
use crate::fault::FaultKind;

/// How far enabling has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// The drives' faults are reset.
    Resetting,
    /// The drives are told to hold.
    Enabling,
    /// All joints hold.
    Done,
}

/// What an exchange on the way has shown.
pub(super) enum Watched {
    /// It goes on.
    Goes,
    /// All joints hold, from here on.
    AllHold,
    /// A joint takes longer than its driver has said.
    Late(FaultKind),
}

/// Joints on their way to holding.
#[derive(Debug)]
pub(super) struct Attach {
    stage: Stage,
    /// The drives have been told to reset, which they are for one period, whatever comes in it.
    told: bool,
    /// Fine periods of this stage and those before it.
    periods: u64,
    /// Bit per joint that holds: what it is told stays as it is.
    held: u32,
    /// What the joints are told, mm or rad.
    joints: AxisVector,
}

impl Attach {
    /// Joints where the driver says they stand.
    pub(super) fn new(config: &FineConfig) -> Self {
        Self::anew(config.attached.position, config.reset_drives)
    }

    /// Once more, from where the joints stand now; their faults are reset first where that `resets`.
    pub(super) fn anew(joints: AxisVector, resets: bool) -> Self {
        Self {
            stage: if resets {
                Stage::Resetting
            } else {
                Stage::Enabling
            },
            told: false,
            periods: 0,
            held: 0,
            joints,
        }
    }

    /// All joints hold at `joints` already.
    pub(super) fn held(joints: AxisVector) -> Self {
        Self {
            stage: Stage::Done,
            told: true,
            periods: 0,
            held: u32::MAX,
            joints,
        }
    }

    /// Whether all joints hold.
    pub(super) fn is_done(&self) -> bool {
        self.stage == Stage::Done
    }

    /// Whether the drives' faults count not yet: before they are reset they are what the reset is for.
    pub(super) fn is_resetting(&self) -> bool {
        self.stage == Stage::Resetting
    }

    /// What the joints are told, mm or rad.
    pub(super) fn joints(&self) -> &AxisVector {
        &self.joints
    }

    /// Tells the drives what they are told in this period: each joint is to be where it stands until it holds, and from then on
    /// there. They are told to hold where they `may_hold`.
    pub(super) fn tell(&mut self, drives: &mut Drives, may_hold: bool) {
        let enables = self.stage == Stage::Enabling && may_hold;
        let resets = self.is_resetting() && !self.told;
        drives.tell_to_hold(enables, resets);
        drives.tell_to_stand(&self.joints);
        self.told = true;
    }

    /// After an exchange: which joints hold, and where those stand that do not.
    pub(super) fn watch(&mut self, drives: &Drives, max_periods: u64) -> Watched {
        self.periods += 1;
        let states = drives.states();
        for (joint, state) in states.iter().enumerate() {
            let (bit, holds) = (1 << joint, *state == JointState::Enabled);
            if !holds {
                self.held &= !bit;
                self.joints[joint] = drives.feedback().position[joint];
            } else if self.stage == Stage::Enabling {
                self.held |= bit;
            }
        }
        match self.stage {
            Stage::Resetting if !states.contains(&JointState::Fault) => {
                self.stage = Stage::Enabling;
                Watched::Goes
            }
            Stage::Enabling if self.held.count_ones() as usize == states.len() => {
                self.stage = Stage::Done;
                Watched::AllHold
            }
            _ if self.periods < max_periods => Watched::Goes,
            _ => Watched::Late(not_enabled(drives)),
        }
    }
}

/// The fault of drives whose time is over.
fn not_enabled(drives: &Drives) -> FaultKind {
    let mut states = drives.states().iter();
    let late = states.position(|state| *state != JointState::Enabled);
    let joint = late.unwrap_or_default();
    FaultKind::NotEnabled {
        joint,
        state: drives.feedback().state[joint],
        code: drives.feedback().fault_code[joint],
    }
}
