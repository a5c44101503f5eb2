//! What the drives' answer says of the drives.

use tandem_sdk::{AxisVector, Feedback, JointState, MAX_AXES};

use crate::fault::FaultKind;
use crate::history::History;

/// The numbers of an answer that go on to strategies and trace, but the positions, which the history keeps.
pub struct Numbers {
    joints: [AxisVector; 2],
    spindle: [f64; 2],
}

impl Numbers {
    /// Those of `feedback`. Fine loop; does not allocate.
    #[inline]
    pub fn of(feedback: &Feedback) -> Self {
        Self {
            joints: [feedback.speed, feedback.current_a],
            spindle: [feedback.spindle_rad_per_s, feedback.spindle_angle_rad],
        }
    }

    /// Puts these, and the last `position`, in the place of what is no finite number in `feedback`, so that nothing downstream
    /// computes with it; gives the fault that it is. Fine loop; does not allocate.
    #[inline]
    pub fn replace_wrong_ones(
        &self,
        feedback: &mut Feedback,
        position: &AxisVector,
        joints: usize,
    ) -> Option<FaultKind> {
        // What is true nearly always is looked at first: a sum is finite only where all of it is.
        let lanes = feedback
            .position
            .0
            .iter()
            .zip(&feedback.speed.0)
            .zip(&feedback.current_a.0)
            .take(joints);
        let sum = lanes.fold(
            feedback.spindle_rad_per_s + feedback.spindle_angle_rad,
            |sum, ((p, s), c)| sum + p + s + c,
        );
        if sum.is_finite() {
            None
        } else {
            self.replace(feedback, position, joints)
        }
    }

    #[cold]
    #[inline(never)]
    fn replace(
        &self,
        feedback: &mut Feedback,
        position: &AxisVector,
        joints: usize,
    ) -> Option<FaultKind> {
        let mut fault = None;
        let spindle = [
            &mut feedback.spindle_rad_per_s,
            &mut feedback.spindle_angle_rad,
        ];
        for (value, last) in spindle.into_iter().zip(&self.spindle) {
            if !value.is_finite() {
                *value = *last;
                fault = Some(FaultKind::Feedback { joint: None });
            }
        }
        let vectors = [
            &mut feedback.position,
            &mut feedback.speed,
            &mut feedback.current_a,
        ];
        for (vector, last) in vectors
            .into_iter()
            .zip([position, &self.joints[0], &self.joints[1]])
        {
            // The lowest joint is named: it comes last.
            for joint in (0..joints).rev() {
                if !vector[joint].is_finite() {
                    vector[joint] = last[joint];
                    fault = Some(FaultKind::Feedback { joint: Some(joint) });
                }
            }
        }
        fault
    }
}

/// Age of what is reported of each joint, fine periods; 0 where there is no such joint. Fine loop.
pub fn ages(feedback: &Feedback, joints: usize) -> [u32; MAX_AXES] {
    // What is true nearly always is looked at first.
    if feedback.age_periods == [0; MAX_AXES] {
        return [0; MAX_AXES];
    }
    // As many steps as there are joints at most: to copy a part of an array is a call.
    std::array::from_fn(|joint| {
        if joint < joints {
            feedback.age_periods[joint]
        } else {
            0
        }
    })
}

/// Bit per digital input that was not heard of in this exchange. Fine loop.
pub fn old_inputs(feedback: &Feedback) -> u64 {
    // What is true nearly always is looked at first.
    if feedback
        .input_age_periods
        .iter()
        .fold(0, |any, age| any | age)
        == 0
    {
        return 0;
    }
    let ages = feedback.input_age_periods.iter().enumerate();
    ages.fold(0, |old, (input, age)| old | u64::from(*age > 0) << input)
}

/// Whether all joints hold. Fine loop.
#[inline]
pub fn all_hold(feedback: &Feedback, joints: usize) -> bool {
    feedback
        .state
        .iter()
        .take(joints)
        .fold(0, |any, state| any | (state.0 ^ JointState::Enabled.0))
        == 0
}

/// The fault that the drives report; one that has let go while the machine is `moving` is one too. Joints that are their drives'
/// `own`, a bit each, may move as those will. Fine loop.
pub fn reported(feedback: &Feedback, joints: usize, moving: bool, own: u32) -> Option<FaultKind> {
    // What is true nearly always is looked at first.
    if all_hold(feedback, joints) {
        return None;
    }
    let first = |state: JointState| feedback.state[..joints].iter().position(|s| *s == state);
    let foreign = feedback.state[..joints]
        .iter()
        .position(|state| !state.is_known());
    if let Some(joint) = foreign {
        return Some(FaultKind::State {
            joint,
            number: feedback.state[joint].0,
        });
    }
    let code = |joint: usize| feedback.fault_code[joint];
    let faulty = first(JointState::Fault).map(|joint| FaultKind::Drive {
        joint,
        code: code(joint),
    });
    let lost = || {
        first(JointState::Lost).map(|joint| FaultKind::Lost {
            joint,
            code: code(joint),
        })
    };
    let homes = |state: JointState| [JointState::Homing, JointState::QuickStop].contains(&state);
    let holds = |joint: usize, state: JointState| {
        state == JointState::Enabled || own >> joint & 1 == 1 && homes(state)
    };
    let off = || {
        (0..joints)
            .find(|joint| !holds(*joint, feedback.state[*joint]))
            .filter(|_| moving)
    };
    let let_go = || {
        off().map(|joint| FaultKind::LetGo {
            joint,
            state: feedback.state[joint],
        })
    };
    faulty.or_else(lost).or_else(let_go)
}

/// The fault that a joint which follows is further from where it was told to be than its limit in `max_mm` allows: what is
/// reported answers what was `sent` its `delay_periods` before the last. What is old is not judged, nor is a joint that is its
/// drive's `own`, a bit each. Fine loop.
pub fn following(
    feedback: &Feedback,
    (sent, delay_periods): (&History, &[u32; MAX_AXES]),
    joints: usize,
    max_mm: &AxisVector,
    own: u32,
) -> Option<FaultKind> {
    let error =
        |joint: usize| (sent.at(delay_periods[joint])[joint] - feedback.position[joint]).abs();
    let holds = |joint: usize| {
        feedback.state[joint] == JointState::Enabled && feedback.age_periods[joint] == 0
    };
    let judged =
        |joint: &usize| max_mm[*joint] < f64::INFINITY && own >> *joint & 1 == 0 && holds(*joint);
    let lost = (0..joints)
        .filter(judged)
        .find(|joint| error(*joint) > max_mm[*joint]);
    lost.map(|joint| FaultKind::Following {
        joint,
        error_mm: error(joint),
        limit_mm: max_mm[joint],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wrong(change: impl FnOnce(&mut Feedback)) -> (Option<FaultKind>, Feedback) {
        let good = Feedback {
            position: AxisVector([7.0; 8]),
            spindle_angle_rad: 3.0,
            ..Feedback::default()
        };
        let mut feedback = Feedback {
            position: AxisVector([8.0; 8]),
            ..good
        };
        change(&mut feedback);
        (
            Numbers::of(&good).replace_wrong_ones(&mut feedback, &good.position, 3),
            feedback,
        )
    }

    #[test]
    fn what_is_no_number_is_a_fault_and_goes_no_further() {
        let (fault, feedback) = wrong(|_| ());
        assert_eq!((fault, feedback.position), (None, AxisVector([8.0; 8])));
        let (fault, feedback) =
            wrong(|f| (f.position[1], f.position[2]) = (f64::NAN, f64::INFINITY));
        assert_eq!(fault, Some(FaultKind::Feedback { joint: Some(1) }));
        assert_eq!(feedback.position.0[..4], [8.0, 7.0, 7.0, 8.0]);
        for change in [
            |f: &mut Feedback| f.speed[0] = f64::NAN,
            |f: &mut Feedback| f.current_a[0] = f64::NEG_INFINITY,
        ] {
            assert_eq!(
                wrong(change).0,
                Some(FaultKind::Feedback { joint: Some(0) })
            );
        }
        let (fault, feedback) = wrong(|f| f.spindle_angle_rad = f64::NAN);
        assert_eq!(
            (fault, feedback.spindle_angle_rad),
            (Some(FaultKind::Feedback { joint: None }), 3.0)
        );
        assert_eq!(
            wrong(|f| f.position[3] = f64::NAN).0,
            None,
            "there is no such joint"
        );
    }

    #[test]
    fn what_is_old_is_marked_input_by_input_and_joint_by_joint() {
        let mut feedback = Feedback {
            age_periods: [3; MAX_AXES],
            ..Feedback::default()
        };
        assert_eq!(
            (old_inputs(&feedback), ages(&feedback, 2)),
            (0, [3, 3, 0, 0, 0, 0, 0, 0])
        );
        for age in [1, u16::MAX] {
            feedback.input_age_periods[0] = age;
            feedback.input_age_periods[63] = age;
            assert_eq!(old_inputs(&feedback), 1 | 1 << 63);
        }
    }

    #[test]
    fn a_joint_that_follows_must_be_near_its_command() {
        let mut feedback = Feedback {
            state: [JointState::Enabled; 8],
            ..Feedback::default()
        };
        let max_mm = AxisVector([f64::INFINITY, 0.5, 0.25, 0.25, 0.1, 0.1, 0.1, 0.1]);
        let mut sent = History::new(&AxisVector([7.0; 8]));
        sent.push(&AxisVector([0.5; 8]));
        let command = (&sent, &[0; MAX_AXES]);
        let fault = Some(FaultKind::Following {
            joint: 2,
            error_mm: 0.5,
            limit_mm: 0.25,
        });
        assert_eq!(
            following(&feedback, command, 3, &max_mm, 0),
            fault,
            "at the limit it is not beyond it"
        );
        assert_eq!(
            following(&feedback, command, 3, &max_mm, 1 << 2),
            None,
            "its drive has it"
        );
        let before = Some(FaultKind::Following {
            joint: 1,
            error_mm: 7.0,
            limit_mm: 0.5,
        });
        assert_eq!(
            following(&feedback, (&sent, &[0, 1, 0, 0, 0, 0, 0, 0]), 3, &max_mm, 0),
            before,
            "a period ago"
        );
        feedback.state[2] = JointState::Disabled;
        assert_eq!(
            following(&feedback, command, 3, &max_mm, 0),
            None,
            "what is off follows nothing"
        );
    }

    #[test]
    fn a_number_that_stands_for_no_state_is_a_fault_whether_it_moves_or_not() {
        let mut feedback = Feedback {
            state: [JointState::Enabled; 8],
            ..Feedback::default()
        };
        feedback.state[1] = JointState(250);
        for moving in [true, false] {
            let fault = Some(FaultKind::State {
                joint: 1,
                number: 250,
            });
            assert_eq!(reported(&feedback, 3, moving, 0), fault);
            assert_eq!(
                reported(&feedback, 1, moving, 0),
                None,
                "there is no such joint"
            );
        }
    }

    #[test]
    fn drives_off_are_a_fault_in_motion_only() {
        let mut feedback = Feedback {
            state: [JointState::Enabled; 8],
            ..Feedback::default()
        };
        assert_eq!(reported(&feedback, 3, true, 0), None);
        feedback.state[2] = JointState::Disabled;
        assert_eq!(reported(&feedback, 3, false, 0), None);
        assert_eq!(
            reported(&feedback, 3, true, 0),
            Some(FaultKind::LetGo {
                joint: 2,
                state: JointState::Disabled
            })
        );
        feedback.state[2] = JointState::Homing;
        assert_eq!(reported(&feedback, 3, true, 1 << 2), None);
        assert!(
            reported(&feedback, 3, true, 1 << 1).is_some(),
            "another one is"
        );
        feedback.state[0] = JointState::Lost;
        assert_eq!(
            reported(&feedback, 3, false, 0),
            Some(FaultKind::Lost { joint: 0, code: 0 })
        );
        (feedback.state[1], feedback.fault_code[1]) = (JointState::Fault, 9);
        assert_eq!(
            reported(&feedback, 3, false, 0),
            Some(FaultKind::Drive { joint: 1, code: 9 })
        );
    }

    /// How far off a joint is does not depend on where it is, nor on the side that it is off to.
    #[test]
    fn an_error_is_the_way_from_what_was_sent_to_what_is_reported() {
        let max_mm = AxisVector([0.1; MAX_AXES]);
        for sent_mm in [-5.0, 0.0, 5.0] {
            let sent = History::new(&AxisVector([sent_mm; MAX_AXES]));
            for (off_mm, is_fault) in [(0.05, false), (-0.05, false), (0.25, true), (-0.25, true)] {
                let feedback = Feedback {
                    position: AxisVector([sent_mm + off_mm; MAX_AXES]),
                    state: [JointState::Enabled; MAX_AXES],
                    ..Feedback::default()
                };
                let fault = following(&feedback, (&sent, &[0; MAX_AXES]), 3, &max_mm, 0);
                let expected = is_fault.then_some(FaultKind::Following {
                    joint: 0,
                    error_mm: 0.25,
                    limit_mm: 0.1,
                });
                assert_eq!(fault, expected, "{off_mm} from {sent_mm}");
            }
        }
    }
}
