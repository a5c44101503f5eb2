//! The ends of the travel, as a window sees them.

use tandem_motion::tube::{Lanes, each};
use tandem_sdk::{MAX_AXES, PlannerContext};

use crate::frame::{dot, plus};
use crate::route::Run;

/// Units in the last place by which a position on the end of the travel may be beyond it: the rounding of a polynomial.
const ROUNDING: f64 = 32.0 * f64::EPSILON;
/// Share of a box that stays free of the end of the travel: between two places the spline is not held.
const FREE: f64 = 0.05;
/// Share of a box that is left at least.
const LEFT: f64 = 0.1;
/// How fast the motion may be asked to leave an end of the travel, as a share of the path driven since the window's start or
/// left to its end: those two places are given, and may lie on the end of the travel. Without it a triangle of 0.3 mm that
/// begins there was driven to and fro along its first side.
const SLOPE: f64 = 0.1;
/// How far the motion may stand off a path along an end of the travel, on its free side, as a multiple of the same path. A slow
/// motion goes through the middle of its boxes: half a micrometre beside the end was driven by way of the middle of a box of
/// 0.2 mm, at its feed.
const ASIDE: f64 = 2.0;

/// Lowest and highest position of every lane, and of joints that are sums of axes.
#[derive(Clone, Copy, Debug)]
pub struct Travel<const L: usize> {
    low: Lanes<L>,
    high: Lanes<L>,
    /// What the joint takes of the lanes, and its ends.
    joints: [(Lanes<L>, [f64; 2]); MAX_AXES],
    joint_count: usize,
}

impl<const L: usize> Travel<L> {
    /// Of a machine whose axes are lanes by `scale`; joints stand behind the axes in `context`.
    pub fn new(context: &PlannerContext, scale: &Lanes<L>) -> Self {
        let limits = context.limits.axes();
        let joints = context.joint_lanes.map_or(&[][..], |lanes| lanes.weights());
        let count = limits.len() - joints.len();
        let mut travel = Self {
            low: each(|l| {
                if l < count {
                    scale[l] * limits[l].min_mm
                } else {
                    f64::NEG_INFINITY
                }
            }),
            high: each(|l| {
                if l < count {
                    scale[l] * limits[l].max_mm
                } else {
                    f64::INFINITY
                }
            }),
            joints: [([0.0; L], [f64::NEG_INFINITY, f64::INFINITY]); MAX_AXES],
            joint_count: joints.len(),
        };
        for (n, weights) in joints.iter().enumerate() {
            let limits = &limits[count + n];
            let of_lanes = each(|l| {
                if l < count {
                    weights[l] / scale[l]
                } else {
                    0.0
                }
            });
            travel.joints[n] = (of_lanes, [limits.min_mm, limits.max_mm]);
        }
        travel
    }

    fn joints(&self) -> &[(Lanes<L>, [f64; 2])] {
        &self.joints[..self.joint_count]
    }

    /// The travel around the path from `from` to `to`, where a motion within the tolerance may come to an end of it; none where
    /// it cannot. A path that is itself beyond an end, of axes that are not homed, may be followed there.
    pub fn around(
        &self,
        run: &Run<'_, L>,
        (from, to): (f64, f64),
        here: &Lanes<L>,
    ) -> Option<Self> {
        let first = run.chord_at(from, 0);
        let last = run.chord_at(to, 0);
        let mut low = *here;
        let mut high = *here;
        let mut tolerance = 0.0f64;
        for chord in &run.chords[first..=last] {
            low = each(|l| low[l].min(chord.start[l]));
            high = each(|l| high[l].max(chord.start[l]));
            tolerance = tolerance.max(chord.tolerance);
        }
        let end = run.chords[last].at(to.min(run.chords[last].end()));
        (low, high) = (each(|l| low[l].min(end[l])), each(|l| high[l].max(end[l])));
        let mut near =
            (0..L).any(|l| low[l] - tolerance < self.low[l] || high[l] + tolerance > self.high[l]);
        let mut travel = Self {
            low: each(|l| self.low[l].min(low[l])),
            high: each(|l| self.high[l].max(high[l])),
            ..*self
        };
        for (weights, ends) in &mut travel.joints[..self.joint_count] {
            let starts = run.chords[first..=last]
                .iter()
                .map(|chord| dot(weights, &chord.start));
            let values = starts.chain([dot(weights, here), dot(weights, &end)]);
            let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
                (a.min(v), b.max(v))
            });
            let tolerance = tolerance * dot(weights, weights).sqrt();
            near |= low - tolerance < ends[0] || high + tolerance > ends[1];
            *ends = [ends[0].min(low), ends[1].max(high)];
        }
        near.then_some(travel)
    }

    /// By how much a position is beyond an end, in lane units: a convex function of it. Below zero inside.
    #[inline(always)]
    pub fn beyond(&self, position: &Lanes<L>) -> f64 {
        let mut most = f64::NEG_INFINITY;
        let over = |value: f64, [low, high]: [f64; 2]| {
            (value - high).max(low - value) - ROUNDING * value.abs().max(1.0)
        };
        for l in 0..L {
            most = most.max(over(position[l], [self.low[l], self.high[l]]));
        }
        for (weights, ends) in self.joints() {
            most = most.max(over(dot(weights, position), *ends));
        }
        most
    }

    /// Cuts the box around `middle` off at the ends of the travel, and `margin` inside of them. `way` is that along the path to
    /// the nearer of the window's start and end.
    pub fn cut(&self, middle: &mut Lanes<L>, half: &mut Lanes<L>, margin: f64, way: f64) {
        for l in 0..L {
            let free = (FREE * half[l] + margin)
                .min((1.0 - LEFT) * half[l])
                .min(SLOPE * way);
            let above = self.high[l] - free - middle[l];
            let below = middle[l] - self.low[l] - free;
            // What is cut off on one side is not to draw the motion far to the other.
            let up = half[l].min(below.max(ASIDE * way));
            let down = half[l].min(above.max(ASIDE * way));
            let high = middle[l] + above.min(up);
            let low = middle[l] - below.min(down);
            if high > low {
                middle[l] = f64::midpoint(low, high);
                half[l] = (high - low) / 2.0;
            }
        }
        // A joint takes of all lanes alike: the box is made smaller until its corners are inside.
        for (weights, [low, high]) in self.joints() {
            let value = dot(weights, middle);
            let reach: f64 = (0..L).map(|l| weights[l].abs() * half[l]).sum();
            let room = (high - value).min(value - low) - margin;
            if reach > room {
                let share = (room / reach).max(LEFT);
                *half = plus(&[0.0; L], share, half);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::order::tests::{lines, open};
    use std::sync::OnceLock;
    use tandem_sdk::{AxisLimits, AxisVector, JointLanes, Limits};

    /// X between ∓1 and Y between ∓100; with `joints` also X + Y between −5 and 1, and X − Y between ∓50.
    fn travel(joints: bool) -> Travel<2> {
        static LANES: OnceLock<JointLanes> = OnceLock::new();
        let weights = [[1.0, 1.0], [1.0, -1.0]].map(|weights| AxisVector::from_slice(&weights));
        let lanes = LANES.get_or_init(|| JointLanes::new(2, &weights).unwrap());
        let limits = [[-1.0, 1.0], [-100.0, 100.0], [-5.0, 1.0], [-50.0, 50.0]];
        let limits = limits.map(|[min_mm, max_mm]| AxisLimits {
            min_mm,
            max_mm,
            ..tandem_rig::axis(1000.0)
        });
        let count = if joints { 4 } else { 2 };
        let machine = PlannerContext {
            limits: Limits::new(&limits[..count]).unwrap(),
            joint_lanes: joints.then_some(lanes),
            ..tandem_rig::context(&limits[..2], 1e-3)
        };
        Travel::new(&machine, &[1.0; 2])
    }

    fn assert_near(values: &[f64], expected: &[f64]) {
        let off = values.iter().zip(expected).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) < 1e-12, "{values:?}, {expected:?}");
    }

    #[test]
    fn a_position_is_beyond_the_end_that_it_is_furthest_behind() {
        let beyond = |joints: bool, at: [f64; 2]| travel(joints).beyond(&at);
        let found = [
            beyond(false, [0.0, 0.0]),
            beyond(false, [1.5, 0.0]),
            beyond(false, [-1.25, 100.5]),
            beyond(true, [0.0, -1.0]),
            beyond(true, [0.9, 0.9]),
            beyond(true, [1.4, -0.9]),
            beyond(true, [-0.5, -5.5]),
        ];
        assert_near(&found, &[-1.0, 0.5, 0.5, -1.0, 0.8, 0.4, 1.0]);
        // An end itself is not beyond itself, for all rounding.
        assert!(beyond(false, [1.0 + f64::EPSILON, 0.0]) <= 0.0);
    }

    #[test]
    fn a_path_is_near_an_end_that_its_tolerance_reaches() {
        let around = |joints: bool, points: &[[f64; 2]], from: f64, to: f64| {
            let mut chords = lines(points);
            for chord in &mut chords {
                chord.tolerance = 0.1;
            }
            travel(joints).around(&open(&chords), (from, to), &points[0])
        };
        let there = [[0.0, 0.0], [0.5, 0.0], [0.95, 0.0]];
        assert!(around(false, &there, 0.0, 0.95).is_some());
        assert!(around(false, &there, 0.0, 0.85).is_none());
        assert!(around(false, &there.map(|[x, y]| [-x, y]), 0.0, 0.95).is_some());
        assert!(around(false, &there.map(|[x, y]| [-x, y]), 0.0, 0.85).is_none());
        // Where it comes to the end on its way, where it begins, and where it ends.
        let over = [[0.0, 0.0], [0.95, 0.0], [0.0, 0.0]];
        assert!(around(false, &over, 0.0, 1.9).is_some());
        let back = [[0.95, 0.0], [0.5, 0.0], [0.0, 0.0]];
        assert!(around(false, &back, 0.5, 0.95).is_some());
        // Joints that are sums of axes take the tolerance in both.
        assert!(around(true, &[[0.0, 0.0], [0.45, 0.45]], 0.0, 1.0).is_some());
        assert!(around(true, &[[0.0, 0.0], [0.4, 0.4]], 0.0, 1.0).is_none());
        assert!(around(true, &[[0.0, -2.0], [-0.4, -4.5]], 0.0, 9.0).is_some());
        assert!(around(true, &[[0.0, -2.0], [-0.3, -4.5]], 0.0, 9.0).is_none());
    }

    #[test]
    fn a_path_beyond_an_end_may_be_followed_there_and_no_further() {
        let around = |joints: bool, points: &[[f64; 2]]| {
            let chords = lines(points);
            let travel = travel(joints);
            travel.around(&open(&chords), (0.0, 1.0), &chords[0].start)
        };
        let low = around(false, &[[-0.8, 0.0], [-1.2, 0.0], [-0.8, 0.0]]).unwrap();
        assert_near(
            &[low.beyond(&[-1.2, 0.0]).max(0.0), low.beyond(&[-1.3, 0.0])],
            &[0.0, 0.1],
        );
        let beyond = [false, true].map(|joints| {
            let travel = around(joints, &[[0.8, 0.6], [1.2, 0.9], [0.8, 0.6]]).unwrap();
            [
                travel.beyond(&[1.2, 0.9]).max(0.0),
                travel.beyond(&[1.3, 1.2]),
            ]
        });
        assert_near(beyond.as_flattened(), &[0.0, 0.1, 0.0, 0.4]);
    }

    #[test]
    fn a_box_is_cut_off_inside_the_end_and_keeps_its_other_side() {
        let cut = |joints: bool, middle: [f64; 2], half: [f64; 2], margin: f64, way: f64| {
            let (mut middle, mut half) = (middle, half);
            travel(joints).cut(&mut middle, &mut half, margin, way);
            [middle, half].as_flattened().to_vec()
        };
        let half = [0.5; 2];
        // A twentieth of the box and the margin stay free: from 0.4 to 0.965.
        let plain = [0.6825, 0.0, 0.2825, 0.5];
        assert_near(&cut(false, [0.9, 0.0], half, 0.01, 10.0), &plain);
        let left = [-0.6825, 0.0, 0.2825, 0.5];
        assert_near(&cut(false, [-0.9, 0.0], half, 0.01, 10.0), &left);
        // Near the start a tenth of the way stays free, and the middle stays where it is.
        let near = [0.9, 0.0, 0.0999, 0.5];
        assert_near(&cut(false, [0.9, 0.0], half, 0.01, 0.001), &near);
        // Where the margin is large, nine tenths of the half stay free.
        let small = [0.855, 0.0, 0.055, 0.1];
        assert_near(&cut(false, [0.9, 0.0], [0.1; 2], 0.5, 10.0), &small);
        // Joints: the box is made smaller around its middle, to a tenth at least.
        let sum = [0.3, 0.4, 0.1, 0.15];
        assert_near(&cut(true, [0.3, 0.4], [0.2, 0.3], 0.05, 10.0), &sum);
        let least = [0.3, 0.69, 0.02, 0.03];
        assert_near(&cut(true, [0.3, 0.69], [0.2, 0.3], 0.05, 10.0), &least);
        let inside = [0.0, 0.0, 0.2, 0.3];
        assert_near(&cut(true, [0.0, 0.0], [0.2, 0.3], 0.05, 10.0), &inside);
        let low = [-0.1, -4.55, 0.06, 0.09];
        assert_near(&cut(true, [-0.1, -4.55], [0.2, 0.3], 0.2, 10.0), &low);
    }
}
