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
    pub home_or_probe: u64,
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
            home_or_probe: 0,
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
            | self.home_or_probe
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

    /// Any role alone, several on one input, a level that trips beside an age that does: whatever there is is judged, and nothing else.
    #[test]
    fn every_role_is_judged_and_an_input_may_have_several() {
        let fields: [fn(&mut Roles) -> &mut u64; 6] = [
            |roles| &mut roles.emergency_stop,
            |roles| &mut roles.drives_ready,
            |roles| &mut roles.door,
            |roles| &mut roles.feed_hold,
            |roles| &mut roles.limit,
            |roles| &mut roles.home_or_probe,
        ];
        assert!(!Roles::default().any());
        for (number, field) in fields.iter().enumerate() {
            for other in fields {
                let input = 7 * number as u32;
                let mut roles = Roles::default();
                *field(&mut roles) |= 1 << input;
                *other(&mut roles) |= 1 << input;
                assert!(roles.any());
                for closed in [false, true] {
                    roles.normally_closed = if closed { 1 << input } else { 0 };
                    for (tripped, age) in [(false, 0), (true, 0), (false, 1), (true, 1)] {
                        let mut feedback = Feedback {
                            inputs: if tripped == closed { 0 } else { u64::MAX },
                            ..Feedback::default()
                        };
                        feedback.input_age_periods[input as usize] = age;
                        let old = u64::from(age) << input;
                        let all = u64::from(tripped || age > 0) << input;
                        let judged = roles.judge(&feedback);
                        assert_eq!(
                            judged,
                            Tripped { all, old },
                            "{number} {closed} {tripped} {age}"
                        );
                        let first = (all != 0).then_some((input, age > 0));
                        assert_eq!(judged.first(u64::MAX), first);
                        assert_eq!(judged.first(!(1 << input)), None);
                    }
                }
            }
        }
    }

    /// An old input beside one that has the level: each is told as what it is.
    #[test]
    fn the_age_of_one_input_is_not_that_of_another() {
        let roles = Roles {
            door: 1 << 2 | 1 << 5,
            ..Roles::default()
        };
        let mut feedback = Feedback {
            inputs: 1 << 2,
            ..Feedback::default()
        };
        feedback.input_age_periods[5] = 1;
        let tripped = roles.judge(&feedback);
        assert_eq!(tripped.first(1 << 2 | 1 << 5), Some((2, false)));
        assert_eq!(tripped.first(1 << 5), Some((5, true)));
    }
}
