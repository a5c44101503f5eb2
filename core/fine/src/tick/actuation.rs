//! From a sample of the axes to what the drives are told, and back: the guard that judges it, the joints that it is for, and the
//! drives, which hold all joints before one moves.

use tandem_sdk::{AxisVector, Driver, Kinematics, PluginError};

use super::attach::{Attach, Watched};
use super::drives::{Drives, Exchanged, SetpointExtras};
use super::hand_over::{Found, HandOver};
use super::joints::{self, JointSpace};
use crate::config::{FineConfig, Joints};
use crate::fault::FaultKind;
use crate::guard::{Checked, Guard};

/// How far the joints may be from where the kinematics have them without it being a skew, mm or rad: rounding.
const ROUNDING: f64 = 1e-9;

/// What the axes do, as the drives know it.
pub(super) struct Actuation {
    drives: Drives,
    space: JointSpace,
    guard: Guard,
    attach: Attach,
}

impl Actuation {
    /// At rest, with drives that are to be enabled. Host; allocates.
    pub(super) fn new(
        config: &FineConfig,
        driver: Box<dyn Driver>,
        kinematics: Option<Box<dyn Kinematics>>,
    ) -> Self {
        let joints = joints::count(config, kinematics.as_deref());
        Self {
            drives: Drives::new(config, driver, joints),
            space: JointSpace::new(config, kinematics),
            guard: Guard::new(config),
            attach: Attach::new(config),
        }
    }

    /// The drives: what they were told, and what they have answered.
    #[inline]
    pub(super) fn drives(&self) -> &Drives {
        &self.drives
    }

    /// The guard: what was sent last.
    #[inline]
    pub(super) fn guard(&self) -> &Guard {
        &self.guard
    }

    /// Axes to joints and back.
    #[inline]
    pub(super) fn space(&self) -> &JointSpace {
        &self.space
    }

    /// Whether all joints hold: before that nothing moves.
    #[inline]
    pub(super) fn all_hold(&self) -> bool {
        self.attach.is_done()
    }

    /// The position sent last.
    #[inline]
    pub(super) fn position(&self) -> AxisVector {
        *self.guard.position()
    }

    /// Where the joints are to be in the sample `position`.
    #[inline]
    pub(super) fn joints_of(&self, config: &FineConfig, position: &AxisVector) -> AxisVector {
        self.space.joints_of(config, position)
    }

    /// A sample on its way to the guard gets the joints behind the axes, where only the kinematics know them. Kinematics
    /// that do not know either are a fault, and each joint goes to rest by its own limit.
    #[inline]
    pub(super) fn add_joints(
        &mut self,
        config: &FineConfig,
        after_fault: bool,
        position: &mut AxisVector,
    ) -> Option<FaultKind> {
        let Joints::Curved { axes } = config.joints else {
            return None;
        };
        self.space
            .add_joints(config, &self.guard, after_fault, axes, position)
    }

    /// Axis coordinates of `joints` by the kinematics, mm or rad; the fault where they do not know them.
    pub(super) fn axes_by_kinematics(
        &mut self,
        config: &FineConfig,
        joints: &AxisVector,
    ) -> Result<AxisVector, FaultKind> {
        self.space.axes_by_kinematics(config, joints)
    }

    /// Judges `position` as the next sample; the travel of the axes `unhomed`, a bit each, does not count.
    #[inline]
    pub(super) fn check(&mut self, position: &AxisVector, unhomed: u32) -> Checked {
        self.guard.check(position, unhomed)
    }

    /// What was judged last is going to be sent.
    #[inline]
    pub(super) fn send(&mut self, position: &AxisVector) {
        self.guard.sent(position);
    }

    /// No rate is known that keeps the jerk limit with the next sample: where it does not, that is not held against it.
    pub(super) fn relax_jerk(&mut self) {
        self.guard.relax_jerk();
    }

    /// The sample of a period that leaves the axes where they are; the guard knows from it that they stand.
    pub(super) fn stand(&mut self, unhomed: u32) -> AxisVector {
        let position = self.position();
        self.guard.check(&position, unhomed);
        self.guard.sent(&position);
        position
    }

    /// Whether the joints rest when the axes do: they may have been slowing down on their own.
    pub(super) fn joints_rest(&self, config: &FineConfig) -> bool {
        let velocity = &self.guard.velocity().0[config.axis_count()..];
        self.space.axes_lead() || velocity.iter().all(|speed| *speed == 0.0)
    }

    /// The position sent last, in the coordinates of the drives, mm or rad. Where the joints came to rest on their own, it is what
    /// the kinematics make of them, if that leads back.
    pub(super) fn sent(&self, config: &FineConfig) -> AxisVector {
        let axes = config.axes_alone(self.guard.position());
        if self.space.axes_lead() {
            return axes + *self.space.offset();
        }
        let joints = self.joints_of(config, self.guard.position());
        self.space.found_from(config, &joints).unwrap_or(axes)
    }

    /// Sets the position of the axes anew where the machine rests. The drives are sent what they were sent before.
    pub(super) fn correct(&mut self, by: &AxisVector) {
        self.guard.correct(by);
        let offset = self.space.offset_mut();
        *offset = *offset - *by;
    }

    /// Stands at `position`, where the joints are at `joints`: what a joint is beside that, such as one of a gantry, it keeps.
    pub(super) fn place(
        &mut self,
        config: &FineConfig,
        joints: &AxisVector,
        position: &AxisVector,
    ) {
        let beside = *joints - self.joints_of(config, position);
        for joint in (0..self.drives.joints()).filter(|joint| beside[*joint].abs() > ROUNDING) {
            self.space.offset_mut()[joint] += beside[joint];
        }
        self.guard.place(position);
    }

    /// Puts into the setpoint where the joints are to be, and how they move. Where they do not all hold yet, each stays where it
    /// is, and is told to hold where it `may_hold`; `hand` is a joint that its drive moves; the drives may be to let go.
    #[inline]
    pub(super) fn set_joints(
        &mut self,
        config: &FineConfig,
        axes: &AxisVector,
        hand: Option<&mut HandOver>,
        may_hold: impl FnOnce() -> bool,
        lets_go: bool,
    ) {
        if !self.attach.is_done() {
            self.attach.tell(&mut self.drives, may_hold());
            return;
        }
        let mut joints = self.space.joints_of(config, axes);
        if let Some(hand) = hand {
            hand.place(&self.drives, &mut joints);
            self.drives.tell_to_stand(&joints);
            return;
        }
        self.drives.tell_to_move(&joints, 1.0 / config.period_s);
        self.drives.tell_to_home(0);
        self.drives.tell_to_hold(!lets_go, false);
    }

    /// Sends the setpoint in fine period `tick`, with the `extras` besides positions. The first words of a plugin that fails are
    /// kept in `words`.
    #[inline]
    pub(super) fn exchange(
        &mut self,
        tick: u64,
        extras: &SetpointExtras,
        words: &mut Option<PluginError>,
    ) -> Exchanged {
        self.drives.tell(extras);
        self.drives.exchange(tick, words)
    }

    /// The fault that the drives' answer is, where it is one. From the first motion on (`moving`) the drives hold, at rest too: what
    /// let go has moved. Nothing is asked of joints of the mask `own`, which their drives move.
    #[inline(never)]
    pub(super) fn fault_of_answer(
        &self,
        config: &FineConfig,
        exchanged: &Exchanged,
        moving: bool,
        own: u32,
        lets_go: bool,
    ) -> Option<FaultKind> {
        let fault = exchanged.failed.then_some(FaultKind::Driver);
        let reported = || {
            let counts = !self.attach.is_resetting() && !lets_go;
            self.drives.reported(moving, own).filter(|_| counts)
        };
        let far = || {
            let counts = self.attach.is_done() && !lets_go;
            self.drives.too_far(config, own).filter(|_| counts)
        };
        fault
            .or(exchanged.unreadable)
            .or_else(reported)
            .or_else(far)
    }

    /// After an exchange with joints that do not all hold: which do.
    pub(super) fn watch_attach(&mut self, max_periods: u64) -> Watched {
        self.attach.watch(&self.drives, max_periods)
    }

    /// Where the joints hold, where that is not where the axes stand.
    pub(super) fn found_elsewhere(&self, config: &FineConfig) -> Option<AxisVector> {
        let (held, count) = (self.attach.joints(), self.drives.joints());
        let expected = self.joints_of(config, self.guard.position());
        (expected.0[..count] != held.0[..count]).then_some(*held)
    }

    /// The drives are to be enabled once more, where the joints are, and their faults reset first where that `resets`.
    pub(super) fn attach_again(&mut self, resets: bool) {
        self.attach = Attach::anew(self.drives.feedback().position, resets);
    }

    /// The drives hold all joints where they were told to be last.
    pub(super) fn stay_attached(&mut self) {
        self.attach = Attach::held(self.drives.setpoint().position);
    }

    /// After a fault the axes lead the joints again.
    pub(super) fn lead_again(&mut self) {
        self.space.lead_again();
    }

    /// One period more of a joint in its drive's hands, which the operator holds (`is_held`) or wants back (`gives_up`).
    pub(super) fn look_at_hand(
        &mut self,
        hand: &mut HandOver,
        period_s: f64,
        is_held: bool,
        gives_up: bool,
    ) -> Found {
        hand.look(&mut self.drives, period_s, is_held, gives_up)
    }

    /// Takes `joint` back from its drive; gives where the joints are: that is where the machine is to stand.
    pub(super) fn take_back(&mut self, config: &FineConfig, joint: usize) -> AxisVector {
        self.drives.tell_to_home(0);
        let mut joints = self.joints_of(config, self.guard.position());
        joints[joint] = self.drives.feedback().position[joint];
        self.space.offset_mut()[joint] = 0.0;
        joints
    }

    /// What was sent before is no way from there to `joints`, where they are from here on.
    pub(super) fn forget_way(&mut self, joints: &AxisVector) {
        self.drives.forget_way(joints);
    }

    /// Takes the drives over from a loop that has ended, with what they were told and have answered, and what homing has found.
    /// Does not allocate.
    pub(super) fn take_over(&mut self, last: &mut Self) {
        self.drives.take_over(&mut last.drives);
        self.space.take_over(&last.space);
    }

    /// Stands where `last` did, where its axes have joints as these do.
    pub(super) fn stands_like(&mut self, last: &Self) -> bool {
        let is_like = self.space.is_like(&last.space);
        if is_like {
            self.guard.place(last.guard.position());
        }
        is_like
    }

    /// The drives are to stop by themselves.
    pub(super) fn quick_stop(&mut self) {
        self.drives.quick_stop();
    }

    /// Hands the driver back.
    pub(super) fn into_driver(self) -> Box<dyn Driver> {
        self.drives.into_driver()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_rig::Echo;
    use tandem_sdk::{AxisLimits, Limits};

    /// A sample beyond the jerk limit is refused, but where no rate is known that keeps it.
    #[test]
    fn what_no_rate_can_keep_is_not_held_against_a_sample() {
        let axis = AxisLimits {
            min_mm: -100.0,
            max_mm: 100.0,
            feed_mm_per_s: 100.0,
            rapid_mm_per_s: 100.0,
            acceleration_mm_per_s2: 1000.0,
            jerk_mm_per_s3: 10_000.0,
            speed_difference_mm_per_s: 0.0,
        };
        let config = FineConfig {
            order: 3,
            ..FineConfig::new(0.001, Limits::new(&[axis]).unwrap())
        };
        // From rest to 100 mm/s² in a period.
        let jerky = AxisVector::from_slice(&[1e-4]);
        for is_relaxed in [false, true] {
            let mut actuation = Actuation::new(&config, Box::new(Echo::default()), None);
            if is_relaxed {
                actuation.relax_jerk();
            }
            let checked = actuation.check(&jerky, 0);
            assert_eq!(checked.relaxed, is_relaxed);
            assert_eq!(checked.breach.is_none(), is_relaxed);
        }
    }

    /// Where the position is set anew the axes are elsewhere, and the drives are told what they were told before.
    #[test]
    fn a_position_that_is_set_anew_moves_no_drive() {
        let config = FineConfig::new(0.001, Limits::new(&[AxisLimits::unlimited(); 2]).unwrap());
        let mut actuation = Actuation::new(&config, Box::new(Echo::default()), None);
        let by = AxisVector::from_slice(&[3.0, -0.5]);
        let before = actuation.sent(&config);
        for times in [1.0, 2.0] {
            actuation.correct(&by);
            assert_eq!(actuation.position(), by * times);
            let joints = actuation.joints_of(&config, &actuation.position());
            assert_eq!(joints, before);
        }
    }
}
