//! Inputs with a role: which are tripped in a period.

use tandem_sdk::{Feedback, MAX_DIGITAL};

/// Which digital inputs mean something to the fine loop: masks with a bit per input.
#[derive(Clone, Copy, Debug)]
pub struct Roles {
    /// As the operator's emergency stop.
    pub emergency_stop: u64,
    /// A fault where the drives, which hold, are not ready any more.
    pub drives_ready: u64,
    /// A hold with the spindle off, until they are closed and the operator resumes.
    pub door: u64,
    /// A hold, until they are released and the operator resumes.
    pub feed_hold: u64,
    /// A fault in motion.
    pub limit: u64,
    /// Home switches and probes: a fault where the motion that waits for one does not hear of it.
    pub awaited: u64,
    /// Switches that homing goes onto and off again: one that is a limit too is none while axes are homed.
    pub home_switches: u64,
    /// Those among them that are 1 as long as nothing trips them.
    pub normally_closed: u64,
    /// Age above which each counts as tripped, fine periods.
    pub max_age_periods: [u16; MAX_DIGITAL],
    /// Axes are moved by hand: the motion that begins on a limit may leave it.
    pub may_leave_limits: bool,
}

impl Default for Roles {
    /// None.
    fn default() -> Self {
        Self {
            emergency_stop: 0,
            drives_ready: 0,
            door: 0,
            feed_hold: 0,
            limit: 0,
            awaited: 0,
            home_switches: 0,
            normally_closed: 0,
            max_age_periods: [0; MAX_DIGITAL],
            may_leave_limits: false,
        }
    }
}

/// What is tripped, a bit per input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tripped {
    /// Those that have the level of it, and those that are too old.
    pub all: u64,
    /// Those among them that nothing has been heard of for too long.
    pub old: u64,
}

impl Tripped {
    /// The lowest of `those` that is tripped, and whether it is by its age. Fine loop.
    pub fn first(&self, those: u64) -> Option<(u32, bool)> {
        let tripped = self.all & those;
        (tripped != 0).then(|| {
            (
                tripped.trailing_zeros(),
                self.old >> tripped.trailing_zeros() & 1 == 1,
            )
        })
    }
}

impl Roles {
    /// Whether there is any. Fine loop.
    pub fn any(&self) -> bool {
        self.all() != 0
    }

    fn all(&self) -> u64 {
        self.emergency_stop
            | self.drives_ready
            | self.door
            | self.feed_hold
            | self.limit
            | self.awaited
    }

    /// What of them is tripped by `feedback`. Fine loop; as many steps as there are inputs with a role.
    pub fn judge(&self, feedback: &Feedback) -> Tripped {
        let (all, mut left, mut old) = (self.all(), self.all(), 0);
        while left != 0 {
            let input = left.trailing_zeros();
            let at = input as usize;
            old |= u64::from(feedback.input_age_periods[at] > self.max_age_periods[at]) << input;
            left &= left - 1;
        }
        Tripped {
            all: ((feedback.inputs ^ self.normally_closed) & all) | old,
            old,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_trips_by_its_kind_and_an_age_trips_either_kind() {
        let mut roles = Roles {
            door: 1 << 3,
            limit: 1 << 63,
            normally_closed: 1 << 3,
            ..Roles::default()
        };
        roles.max_age_periods[3] = 2;
        let mut feedback = Feedback {
            inputs: 1 << 3 | 1 << 5,
            ..Feedback::default()
        };
        assert_eq!(roles.judge(&feedback), Tripped::default());
        feedback.inputs = 1 << 63;
        assert_eq!(
            roles.judge(&feedback),
            Tripped {
                all: 1 << 3 | 1 << 63,
                old: 0
            }
        );
        feedback.inputs = 1 << 3;
        (
            feedback.input_age_periods[3],
            feedback.input_age_periods[63],
        ) = (2, 1);
        assert_eq!(
            roles.judge(&feedback),
            Tripped {
                all: 1 << 63,
                old: 1 << 63
            }
        );
        feedback.input_age_periods[3] = u16::MAX;
        let tripped = roles.judge(&feedback);
        assert_eq!(
            (tripped.first(roles.door), tripped.first(roles.limit)),
            (Some((3, true)), Some((63, true)))
        );
        assert_eq!(tripped.first(roles.feed_hold), None);
        feedback.input_age_periods[5] = u16::MAX;
        assert_eq!(roles.judge(&feedback).all >> 5 & 1, 0, "it has no role");
    }
}
