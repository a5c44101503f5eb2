//! The input edge that ends a motion: probing, homing.

use tandem_sdk::{Arm, AxisVector, Edge, Feedback, Latch, MAX_AXES, MAX_LATCHES, Segment, StopOn};

use crate::config::HomeSwitch;
use crate::history::History;

/// Watches for the edge while a block that waits for one moves.
#[derive(Debug, Default)]
pub struct EdgeWatch {
    block: Option<u64>,
    /// The drives' latches before the block: what has not changed since is of an older edge.
    latches: [Latch; MAX_LATCHES],
}

impl EdgeWatch {
    /// Begins to watch where `segment` is the first of its block; `before` is the feedback before it moved. Whether the
    /// input already has the level waited for. Fine loop.
    pub fn begin(
        &mut self,
        segment: &Segment,
        before: &Feedback,
        homes: &[HomeSwitch; MAX_AXES],
    ) -> bool {
        if segment.stop_on.edge == Edge::None || self.block == Some(segment.block) {
            return false;
        }
        self.block = Some(segment.block);
        self.latches = before.latches;
        has_level(&segment.stop_on, before, homes)
    }

    /// Joint positions at the edge that `stop_on` waits for, mm or rad, where it has come. A latch of the drives is
    /// nearer to the edge than the feedback, and shows an edge that is over before the period is; a joint that it did not catch
    /// is found in `measured`, where the joints were in the periods up to this one, a period of `period_s` after the other. What
    /// is old is no edge. Fine loop.
    pub fn find(
        &self,
        stop_on: &StopOn,
        feedback: &Feedback,
        measured: &History,
        period_s: f64,
        homes: &[HomeSwitch; MAX_AXES],
    ) -> Option<AxisVector> {
        let fits =
            |latch: &Latch| latch.input == stop_on.input && latch.edge == stop_on.edge as u32;
        let latch = feedback
            .latches
            .iter()
            .find(|latch| fits(latch) && !self.latches.contains(latch));
        if let Some(latch) = latch {
            let then = measured.before(latch.before_s / period_s);
            let caught = |joint: usize| latch.joints >> joint & 1 == 1;
            return Some(AxisVector(std::array::from_fn(|i| {
                if caught(i) {
                    latch.position[i]
                } else {
                    then[i]
                }
            })));
        }
        (is_new(stop_on, feedback) && has_level(stop_on, feedback, homes))
            .then_some(feedback.position)
    }

    /// Forgets the block. Fine loop.
    pub fn end(&mut self) {
        self.block = None;
    }
}

/// What the drives are to catch for `stop_on`.
pub fn arm_for(stop_on: &StopOn) -> Arm {
    match stop_on.edge {
        Edge::None => Arm::default(),
        _ if stop_on.home_axes().is_some() => Arm::default(),
        edge => Arm {
            input: stop_on.input,
            edge: edge as u32,
        },
    }
}

/// Whether the input that is waited for was read in this period; each of several is asked by itself.
fn is_new(stop_on: &StopOn, feedback: &Feedback) -> bool {
    stop_on.home_axes().is_some() || feedback.input_age_periods[stop_on.input.min(63) as usize] == 0
}

fn has_level(stop_on: &StopOn, feedback: &Feedback, homes: &[HomeSwitch; MAX_AXES]) -> bool {
    if let Some(axes) = stop_on.home_axes() {
        return stop_on.edge != Edge::None && any_home(axes, stop_on.edge, feedback, homes);
    }
    let high = feedback.inputs >> stop_on.input.min(63) & 1 == 1;
    match stop_on.edge {
        Edge::None => false,
        Edge::Rising => high,
        Edge::Falling => !high,
    }
}

/// Whether a home switch of `axes` is on (rising), or off.
#[inline(never)]
fn any_home(axes: u32, edge: Edge, feedback: &Feedback, homes: &[HomeSwitch; MAX_AXES]) -> bool {
    let wanted = edge == Edge::Rising;
    homes.iter().enumerate().any(|(axis, home)| {
        axes >> axis & 1 == 1
            && feedback.input_age_periods[home.input.min(63) as usize] == 0
            && home.is_on(feedback.inputs) == wanted
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The switches of the first two axes; the second is 0 where it is on.
    const HOMES: [HomeSwitch; MAX_AXES] = {
        let mut homes = [HomeSwitch {
            input: 9,
            inverted: false,
        }; MAX_AXES];
        homes[1] = HomeSwitch {
            input: 12,
            inverted: true,
        };
        homes
    };

    #[test]
    fn any_home_switch_of_the_axes_that_move_ends_their_motion_and_no_other() {
        let waits = |axes, edge| {
            let mut segment = probing(edge);
            segment.stop_on = StopOn::home_switches(axes, edge);
            segment
        };
        let found = |axes, edge, inputs| {
            find(&EdgeWatch::default(), &waits(axes, edge), &feedback(inputs)).is_some()
        };
        let (first, second) = (1 << 9, 1 << 12);
        // The second is on where its input is 0.
        for (axes, inputs, trips, releases) in [
            (1, second, false, true),
            (1, first, true, false),
            (2, second, false, true),
            (2, 0, true, false),
            (3, second, false, true),
            (3, first | second, true, true),
            (3, first, true, false),
        ] {
            assert_eq!(
                (
                    found(axes, Edge::Rising, inputs),
                    found(axes, Edge::Falling, inputs)
                ),
                (trips, releases),
                "axes {axes:b}, inputs {inputs:b}"
            );
        }
        let mut old = feedback(first);
        old.input_age_periods[9] = 1;
        assert!(find(&EdgeWatch::default(), &waits(1, Edge::Rising), &old).is_none());
        assert_eq!(arm_for(&waits(3, Edge::Rising).stop_on), Arm::default());
    }

    fn probing(edge: Edge) -> Segment {
        let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
        segment.block = 7;
        segment.stop_on = StopOn {
            input: 3,
            edge,
            miss_is_fault: 0,
        };
        segment
    }

    fn feedback(inputs: u64) -> Feedback {
        Feedback {
            inputs,
            position: AxisVector([5.0; 8]),
            ..Feedback::default()
        }
    }

    /// What is found where the joints have gone 1 mm a period up to 5 mm.
    fn find(watch: &EdgeWatch, segment: &Segment, feedback: &Feedback) -> Option<AxisVector> {
        let mut measured = History::new(&AxisVector::ZERO);
        for at in 1..=5 {
            measured.push(&AxisVector([f64::from(at); 8]));
        }
        watch.find(&segment.stop_on, feedback, &measured, 0.001, &HOMES)
    }

    #[test]
    fn a_joint_that_was_not_caught_is_found_between_its_samples() {
        let mut at_edge = feedback(0);
        at_edge.latches[0] = Latch {
            input: 3,
            edge: 1,
            joints: 2,
            before_s: 0.00125,
            position: AxisVector([9.0; 8]),
        };
        let found = find(&EdgeWatch::default(), &probing(Edge::Rising), &at_edge).unwrap();
        assert_eq!((found[0], found[1], found[2]), (3.75, 9.0, 3.75));
    }

    #[test]
    fn an_old_input_is_no_edge() {
        let mut old = feedback(8);
        old.input_age_periods[3] = 1;
        assert_eq!(
            find(&EdgeWatch::default(), &probing(Edge::Rising), &old),
            None
        );
        assert!(find(&EdgeWatch::default(), &probing(Edge::Rising), &feedback(8)).is_some());
    }

    #[test]
    fn a_level_that_is_there_before_the_motion_is_told_once() {
        for (edge, there, away) in [(Edge::Rising, 8, 0), (Edge::Falling, 0, 8)] {
            let mut watch = EdgeWatch::default();
            assert!(watch.begin(&probing(edge), &feedback(there), &HOMES));
            assert!(
                !watch.begin(&probing(edge), &feedback(there), &HOMES),
                "it moves already"
            );
            watch.end();
            assert!(!watch.begin(&probing(edge), &feedback(away), &HOMES));
            assert_eq!(find(&watch, &probing(edge), &feedback(away)), None);
            assert_eq!(
                find(&watch, &probing(edge), &feedback(there)),
                Some(AxisVector([5.0; 8]))
            );
        }
        assert!(!EdgeWatch::default().begin(&probing(Edge::None), &feedback(u64::MAX), &HOMES));
    }

    #[test]
    fn a_new_latch_counts_an_old_one_does_not() {
        let segment = probing(Edge::Rising);
        let with = |input, edge, at: f64| {
            let mut feedback = feedback(0);
            feedback.latches[2] = Latch {
                input,
                edge,
                joints: 255,
                position: AxisVector([at; 8]),
                ..Latch::default()
            };
            feedback
        };
        let mut watch = EdgeWatch::default();
        watch.begin(&segment, &with(3, 1, 1.0), &HOMES);
        assert_eq!(
            find(&watch, &segment, &with(3, 1, 1.0)),
            None,
            "of an older edge"
        );
        assert_eq!(
            find(&watch, &segment, &with(3, 2, 4.0)),
            None,
            "of the other edge"
        );
        assert_eq!(
            find(&watch, &segment, &with(2, 1, 4.0)),
            None,
            "of another input"
        );
        assert_eq!(
            find(&watch, &segment, &with(3, 1, 4.0)),
            Some(AxisVector([4.0; 8]))
        );
    }
}
