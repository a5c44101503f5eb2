//! Torque and brake of a joint: what its drive goes through on its way to following the setpoint, and back.

use tandem_sdk::JointState;

/// Where a drive is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// No torque, the brake closed.
    Off,
    /// Contactor and current loop come up; no torque yet.
    Waking,
    /// It holds, and the brake opens.
    Opening,
    /// It follows.
    On,
    /// It comes to rest by its own means.
    Stopping,
    /// It holds until the brake is closed.
    Closing,
}

/// The drive of one joint. Times are fine periods; with times of zero it follows in the period in which it is told to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Power {
    stage: Stage,
    /// Periods left of a stage that takes its time.
    left: u64,
    wake_periods: u64,
    brake_periods: u64,
    fault: Option<u32>,
    is_lost: bool,
}

impl Power {
    /// A drive that is off.
    pub fn new(wake_periods: u64, brake_periods: u64) -> Self {
        Self {
            stage: Stage::Off,
            left: 0,
            wake_periods,
            brake_periods,
            fault: None,
            is_lost: false,
        }
    }

    /// Before a period: whether the drive is to follow. Fine loop.
    #[inline]
    pub fn command(&mut self, follow: bool) {
        let follow = follow && self.fault.is_none() && !self.is_lost;
        // What is true nearly always is looked at first.
        if !(follow && self.stage == Stage::On) {
            self.change_stage(follow);
        }
    }

    fn change_stage(&mut self, follow: bool) {
        self.stage = match (self.stage, follow) {
            (Stage::Off, true) => self.enter(Stage::Waking, self.wake_periods),
            (Stage::Waking, false) => Stage::Off,
            (Stage::Opening, false) => self.enter(Stage::Closing, self.brake_periods),
            (Stage::Closing, true) => self.enter(Stage::Opening, self.brake_periods),
            (Stage::On, false) => Stage::Stopping,
            (Stage::Stopping, true) => Stage::On,
            (stage, _) => stage,
        };
        if self.stage == Stage::Waking && self.is_over() {
            self.stage = self.enter(Stage::Opening, self.brake_periods);
        }
        if self.stage == Stage::Opening && self.is_over() {
            self.stage = Stage::On;
        }
    }

    /// Behind a period: a joint that has come to rest on its own is held by its brake. Fine loop.
    pub fn settle(&mut self, at_rest: bool) {
        if self.stage == Stage::Stopping && at_rest {
            self.stage = self.enter(Stage::Closing, self.brake_periods);
        }
        if self.stage == Stage::Closing && self.is_over() {
            self.stage = Stage::Off;
        }
    }

    fn enter(&mut self, stage: Stage, periods: u64) -> Stage {
        self.left = periods;
        stage
    }

    /// Whether a stage that takes its time is over; otherwise it goes on for this period.
    fn is_over(&mut self) -> bool {
        let over = self.left == 0;
        self.left = self.left.saturating_sub(1);
        over
    }

    /// The drive goes into a fault of its own: it comes to rest, and stays there until it is reset. Fine loop.
    pub fn fail(&mut self, code: u32) {
        self.fault.get_or_insert(code);
    }

    /// The drive falls out of the bus: it comes to rest, and nobody hears of it until it is reset. Fine loop.
    pub fn lose(&mut self) {
        self.is_lost = true;
    }

    /// The host has reset the drive. Fine loop.
    pub fn reset(&mut self) {
        (self.fault, self.is_lost) = (None, false);
    }

    /// The bus is gone, and the drive without torque: its fault stays.
    pub fn cut(&mut self) {
        (self.stage, self.is_lost) = (Stage::Off, false);
    }

    /// Whether it follows its setpoint.
    pub fn follows(&self) -> bool {
        self.stage == Stage::On
    }

    /// Whether it keeps its joint where it is, against gravity too.
    pub fn holds(&self) -> bool {
        matches!(self.stage, Stage::Opening | Stage::Closing)
    }

    /// Whether neither torque nor a brake keeps the joint: one without a brake.
    pub fn sags(&self) -> bool {
        self.brake_periods == 0 && matches!(self.stage, Stage::Off | Stage::Waking)
    }

    /// Whether the driver does not reach it.
    pub fn is_lost(&self) -> bool {
        self.is_lost
    }

    /// Its code, 0 for none.
    pub fn code(&self) -> u32 {
        self.fault.unwrap_or(0)
    }

    /// What it says of itself.
    pub fn state(&self) -> JointState {
        if self.is_lost {
            return JointState::Lost;
        }
        if self.fault.is_some() {
            return JointState::Fault;
        }
        match self.stage {
            Stage::Off => JointState::Disabled,
            Stage::Waking | Stage::Opening => JointState::Enabling,
            Stage::On => JointState::Enabled,
            Stage::Stopping | Stage::Closing => JointState::QuickStop,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The states of a drive that is told to follow or not, and stands still or not, period by period.
    fn states(power: &mut Power, periods: &[(bool, bool)]) -> Vec<JointState> {
        let one = |(follow, rests): &(bool, bool)| {
            power.command(*follow);
            power.settle(*rests);
            power.state()
        };
        periods.iter().map(one).collect()
    }

    #[test]
    fn without_delays_it_follows_and_lets_go_at_once() {
        let told = [
            (true, true),
            (true, false),
            (false, false),
            (false, true),
            (true, true),
        ];
        let (on, off) = (JointState::Enabled, JointState::Disabled);
        let said = [on, on, JointState::QuickStop, off, on];
        assert_eq!(states(&mut Power::new(0, 0), &told), said);
    }

    #[test]
    fn torque_comes_before_the_brake_opens_and_goes_behind_it() {
        let mut power = Power::new(2, 3);
        let coming = states(&mut power, &[(true, true); 6]);
        assert_eq!(
            coming,
            [[JointState::Enabling; 5].as_slice(), &[JointState::Enabled]].concat()
        );
        let going = states(&mut power, &[(false, true); 4]);
        assert_eq!(
            going,
            [
                [JointState::QuickStop; 3].as_slice(),
                &[JointState::Disabled]
            ]
            .concat()
        );
        assert!(!power.sags(), "the brake holds it");
        assert!(Power::new(2, 0).sags());
    }

    #[test]
    fn a_fault_lasts_until_it_is_reset() {
        let mut power = Power::new(0, 0);
        states(&mut power, &[(true, true)]);
        power.fail(7);
        power.fail(8);
        assert_eq!(
            states(&mut power, &[(true, false), (false, true), (true, true)]),
            [JointState::Fault; 3]
        );
        assert_eq!((power.code(), power.follows()), (7, false));
        power.reset();
        assert_eq!(states(&mut power, &[(true, true)]), [JointState::Enabled]);
        power.lose();
        assert_eq!(
            states(&mut power, &[(true, true), (false, true)]),
            [JointState::Lost; 2]
        );
        power.reset();
        assert_eq!((power.code(), power.state()), (0, JointState::Disabled));
    }

    #[test]
    fn one_that_never_comes_up_is_on_its_way_for_ever() {
        let said = states(&mut Power::new(u64::MAX, 0), &[(true, true); 100]);
        assert!(said.iter().all(|state| *state == JointState::Enabling));
    }
}
