//! From drives without torque to joints that hold, all where they stand: nothing moves on the way.

use tandem_sdk::{AxisVector, JointState, MAX_AXES};

use super::rest::Stop;
use super::{FineLoop, Phase};
use crate::config::{FineConfig, Joints};
use crate::fault::FaultKind;
use crate::state::Input;

/// How far the joints may be from where the kinematics have them without it being a skew, mm or rad: rounding.
const ROUNDING: f64 = 1e-9;

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
        let stage = if config.reset_drives {
            Stage::Resetting
        } else {
            Stage::Enabling
        };
        Self {
            stage,
            told: false,
            periods: 0,
            held: 0,
            joints: config.attached.position,
        }
    }

    /// Once more, from where the joints stand now.
    pub(super) fn again(joints: AxisVector) -> Self {
        Self {
            stage: Stage::Resetting,
            told: false,
            periods: 0,
            held: 0,
            joints,
        }
    }

    /// Once more, from where the joints stand now; their faults are reset first where that `resets`.
    pub(super) fn anew(joints: AxisVector, resets: bool) -> Self {
        let stage = if resets {
            Stage::Resetting
        } else {
            Stage::Enabling
        };
        Self {
            stage,
            ..Self::again(joints)
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
}

impl FineLoop {
    /// What the joints are told in this period: each where it stands until it holds, and from then on the same.
    pub(super) fn hold_still(&mut self) -> AxisVector {
        let may_hold = self.fault.is_none() && !self.is_letting_go() && self.may_enable();
        let enables = self.attach.stage == Stage::Enabling && may_hold;
        self.drives.setpoint.enable = u32::from(enables);
        self.drives.setpoint.reset =
            u32::from(self.attach.stage == Stage::Resetting && !self.attach.told);
        self.attach.told = true;
        self.attach.joints
    }

    /// After an exchange: which joints hold, and where those stand that do not.
    pub(super) fn watch_attach(&mut self) {
        if self.attach.is_done() || self.fault.is_some() || self.is_letting_go() {
            return;
        }
        self.attach.periods += 1;
        let states: [JointState; MAX_AXES] = self.drives.feedback.state;
        for (joint, state) in states.iter().enumerate().take(self.drives.joints) {
            let (bit, holds) = (1 << joint, *state == JointState::Enabled);
            if !holds {
                self.attach.held &= !bit;
                self.attach.joints[joint] = self.drives.feedback.position[joint];
            } else if self.attach.stage == Stage::Enabling {
                self.attach.held |= bit;
            }
        }
        match self.attach.stage {
            Stage::Resetting if !states[..self.drives.joints].contains(&JointState::Fault) => {
                self.attach.stage = Stage::Enabling;
            }
            Stage::Enabling if self.attach.held.count_ones() as usize == self.drives.joints => {
                self.stand_there();
            }
            _ => self.watch_time(&states),
        }
    }

    /// A joint that takes longer than its driver has said.
    fn watch_time(&mut self, states: &[JointState; MAX_AXES]) {
        if self.attach.periods < self.config.enable_periods {
            return;
        }
        let late = states[..self.drives.joints]
            .iter()
            .position(|state| *state != JointState::Enabled);
        let joint = late.unwrap_or_default();
        self.fail(FaultKind::NotEnabled {
            joint,
            state: states[joint],
            code: self.drives.feedback.fault_code[joint],
        });
    }

    /// The operator aborts before the joints hold: they are not told to any more, and nothing follows.
    pub(super) fn give_up_enabling(&mut self) -> Input {
        let input = self.end_epoch(Stop::abort());
        let reported = matches!(self.phase, Phase::AwaitingReplan);
        (self.outputs.ended, self.release.had_ended) = (reported, reported);
        if reported {
            self.release.begin();
        }
        input
    }

    /// Whether the drives' faults count: before they are reset they are what the reset is for.
    pub(super) fn is_resetting(&self) -> bool {
        self.attach.stage == Stage::Resetting
    }

    /// All joints hold: the machine stands where they do, and planning starts from there.
    fn stand_there(&mut self) {
        let joints = self.attach.joints;
        self.attach.stage = Stage::Done;
        let position = *self.guard.position();
        if self.joints_of(&position).0[..self.drives.joints] != joints.0[..self.drives.joints] {
            self.stand_at(&joints);
        }
        if self.fault.is_none() && self.config.plans_from_rest {
            self.end_epoch(Stop::attached());
            // Ticks are counted from the first motion on.
            self.phase = Phase::Waiting;
        }
    }

    /// Takes the place of `joints` as that of the axes; what a joint is beside them, such as one of a gantry, it keeps.
    pub(super) fn stand_at(&mut self, joints: &AxisVector) {
        let axes = self.axes_of(joints);
        let mut position = self.config.axes_alone(&axes);
        match self.config.joints {
            Joints::Axes => {}
            Joints::Sums(lanes) => lanes.fill(&mut position),
            Joints::Curved { .. } => self.add_joints(&mut position),
        }
        let beside = *joints - self.joints_of(&position);
        for joint in (0..self.drives.joints).filter(|joint| beside[*joint].abs() > ROUNDING) {
            self.space.offset[joint] += beside[joint];
        }
        self.guard.place(&position);
    }
}
