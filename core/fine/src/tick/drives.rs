//! The drives as the loop knows them: what they were told last, and what they have answered.

use tandem_sdk::{Arm, Attached, AxisVector, Driver, Feedback, JointState, PluginError, Setpoint};

use crate::answer::{self, Numbers};
use crate::config::FineConfig;
use crate::fault::FaultKind;
use crate::history::History;

/// What an exchange has come to.
pub(super) struct Exchanged {
    /// The driver says that it failed.
    pub(super) failed: bool,
    /// Numbers in its answer that are none: the last ones stand in for them.
    pub(super) unreadable: Option<FaultKind>,
    /// All joints hold.
    pub(super) all_hold: bool,
    /// Age of the oldest position that was answered, fine periods.
    pub(super) age_periods: u32,
}

/// What a setpoint holds besides positions.
pub(super) struct SetpointExtras {
    /// What they are to catch.
    pub(super) arm: Arm,
    /// Bit per joint whose drive keeps to a torque limit.
    pub(super) limited: u32,
    /// Digital outputs.
    pub(super) outputs: u64,
    /// Speed of the spindle, rad/s.
    pub(super) spindle_rad_per_s: f64,
}

/// The drives of the joints.
pub(super) struct Drives {
    driver: Box<dyn Driver>,
    /// Number of joints.
    joints: usize,
    setpoint: Setpoint,
    feedback: Feedback,
    /// Where the joints were told to be in the last periods, where some joint has a limit of its following error.
    sent: Option<History>,
    /// Where they were.
    measured: History,
    /// The drives hear their heartbeat from the job before: the setpoint's tick goes on from there, in every exchange.
    beats_on: bool,
}

impl Drives {
    /// The drives of `joints` joints, where the driver has told that they stand. Host; allocates.
    pub(super) fn new(config: &FineConfig, driver: Box<dyn Driver>, joints: usize) -> Self {
        let Attached { position, .. } = config.attached;
        let mut following_limits = config.max_following_error_mm.0.iter();
        let judges_following = following_limits.any(|most| *most < f64::INFINITY);
        Self {
            driver,
            joints,
            setpoint: Setpoint::default(),
            feedback: Feedback {
                position,
                ..Feedback::default()
            },
            sent: judges_following.then(|| History::new(&position)),
            measured: History::new(&position),
            beats_on: false,
        }
    }

    /// Number of joints.
    pub(super) fn joints(&self) -> usize {
        self.joints
    }

    /// What they were told last.
    pub(super) fn setpoint(&self) -> &Setpoint {
        &self.setpoint
    }

    /// What they have answered last.
    pub(super) fn feedback(&self) -> &Feedback {
        &self.feedback
    }

    /// The state of each joint's drive.
    pub(super) fn states(&self) -> &[JointState] {
        &self.feedback.state[..self.joints]
    }

    /// Where the joints were in the last periods.
    pub(super) fn measured(&self) -> &History {
        &self.measured
    }

    /// Whether some joint has a limit of its following error.
    pub(super) fn judges_following(&self) -> bool {
        self.sent.is_some()
    }

    /// The fault that their last answer is, of joints that move or are to hold where `moving`; those of the mask `own` have
    /// something else to do.
    pub(super) fn reported(&self, moving: bool, own: u32) -> Option<FaultKind> {
        answer::reported(&self.feedback, self.joints, moving, own)
    }

    /// The joint, not one of `own`, that is too far from where it was told to be, as a fault.
    pub(super) fn too_far(&self, config: &FineConfig, own: u32) -> Option<FaultKind> {
        answer::following(
            &self.feedback,
            (self.sent.as_ref()?, &config.attached.delay_periods),
            self.joints,
            &config.max_following_error_mm,
            own,
        )
    }

    /// Puts into the setpoint what it holds besides positions.
    #[inline]
    pub(super) fn tell(&mut self, extras: &SetpointExtras) {
        self.setpoint.arm = extras.arm;
        self.setpoint.limited = extras.limited;
        self.setpoint.outputs = extras.outputs;
        self.setpoint.spindle_rad_per_s = extras.spindle_rad_per_s;
    }

    /// Puts into the setpoint whether the drives are to hold, and whether their faults are to be reset.
    pub(super) fn tell_to_hold(&mut self, holds: bool, resets: bool) {
        self.setpoint.enable = u32::from(holds);
        self.setpoint.reset = u32::from(resets);
    }

    /// Puts into the setpoint which joints their drives are to home, a bit each.
    pub(super) fn tell_to_home(&mut self, joints: u32) {
        self.setpoint.homing = joints;
    }

    /// Sends the setpoint, in fine period `tick`, and takes the feedback. The first words of a plugin that fails are kept in
    /// `words`.
    #[inline]
    pub(super) fn exchange(&mut self, tick: u64, words: &mut Option<PluginError>) -> Exchanged {
        self.setpoint.tick = if self.beats_on {
            self.setpoint.tick + 1
        } else {
            tick
        };
        let last = Numbers::of(&self.feedback);
        let failed = match self.driver.exchange(&self.setpoint, &mut self.feedback) {
            Ok(()) => false,
            Err(error) => {
                words.get_or_insert(error);
                true
            }
        };
        let unreadable =
            last.replace_wrong_ones(&mut self.feedback, self.measured.last(), self.joints);
        if let Some(sent) = &mut self.sent {
            sent.push(&self.setpoint.position);
        }
        self.measured.push(&self.feedback.position);
        let ages = self.feedback.age_periods[..self.joints].iter();
        Exchanged {
            failed,
            unreadable,
            all_hold: answer::all_hold(&self.feedback, self.joints),
            age_periods: ages.fold(0, |oldest: u32, age| oldest.max(*age)),
        }
    }

    /// The setpoint of joints that are told to be where they stand: that is no motion, though the numbers may change.
    pub(super) fn tell_to_stand(&mut self, joints: &AxisVector) {
        self.setpoint.position = *joints;
        self.setpoint.velocity = AxisVector::ZERO;
        self.setpoint.acceleration = AxisVector::ZERO;
    }

    /// The setpoint of joints that are to be at `joints`, a period of `1/per_s` after they were where they were told last.
    pub(super) fn tell_to_move(&mut self, joints: &AxisVector, per_s: f64) {
        let velocity = (*joints - self.setpoint.position) * per_s;
        self.setpoint.acceleration = (velocity - self.setpoint.velocity) * per_s;
        self.setpoint.velocity = velocity;
        self.setpoint.position = *joints;
    }

    /// What was sent before is no way from there to `joints`, where they are from here on.
    pub(super) fn forget_way(&mut self, joints: &AxisVector) {
        self.setpoint.position = *joints;
        self.setpoint.velocity = AxisVector::ZERO;
        if let Some(sent) = &mut self.sent {
            *sent = History::new(joints);
        }
    }

    /// Whether the drives hold all joints but those of the mask `own`, which have something else to do.
    pub(super) fn hold_others_than(&self, own: u32) -> bool {
        let holds = |joint: usize| {
            own >> joint & 1 == 1 || self.feedback.state[joint] == JointState::Enabled
        };
        (0..self.joints).all(holds)
    }

    /// How much later than its bus wants it the last exchange was, ns; `None` as long as no driver tells.
    pub(super) fn phase_ns(&self) -> Option<i64> {
        (self.feedback.has_phase != 0).then_some(self.feedback.phase_ns)
    }

    /// Takes the drives over from a loop that has ended, with what they were told and have answered. Does not allocate.
    pub(super) fn take_over(&mut self, last: &mut Self) {
        std::mem::swap(&mut self.driver, &mut last.driver);
        self.setpoint = last.setpoint;
        self.feedback = last.feedback;
        std::mem::swap(&mut self.sent, &mut last.sent);
        std::mem::swap(&mut self.measured, &mut last.measured);
        self.beats_on = last.setpoint.tick > 0;
    }

    /// They are to stop by themselves.
    pub(super) fn quick_stop(&mut self) {
        self.driver.quick_stop();
    }

    /// The driver, for what its codes mean.
    pub(super) fn driver(&self) -> &dyn Driver {
        self.driver.as_ref()
    }

    /// Hands the driver back.
    pub(super) fn into_driver(self) -> Box<dyn Driver> {
        self.driver
    }
}
