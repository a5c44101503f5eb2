//! The governor where jerk is not limited and the plan goes beyond the feed: how high the rate may be so that the feed can be
//! kept ahead.
//!
//! After a corner a plan may get fast sooner than the rate can fall, because a slower axis turns there with all that it has.
//! Then the rate has to be low before. With w = σ²/2 the rate of change σ̇ is dw/dτ, τ being program time, and an axis
//! accelerates by `2w·q″ + q′·dw/dτ`: what the limits leave for dw/dτ is linear in w. Laid out backward from the feeds ahead
//! with the least dw/dτ this gives the highest w from which each of them can be met.
//!
//! It looks back over up to 96 pieces of the queued plan.

use super::tuning::FEEDS_AHEAD_LIMIT_SHARE;
use tandem_sdk::Segment;

use super::{Governor, TOLERANCE};
use crate::period_points::{PeriodPoint, PeriodPoints};
use crate::plan_ahead::PlanCursor;

/// Pieces that are laid out: in long segments they reach over 900 periods, longer than most machines take to their feed.
const PIECES: usize = 96;
/// Share of its distance by which a piece may be long; one period at least.
const LONGER: f64 = 0.05;
/// w of the highest rate.
const MOST: f64 = 0.5;

/// A place ahead.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// Program time from here, s.
    offset_s: f64,
    /// The highest w there.
    w: f64,
}

/// The highest rates ahead.
#[derive(Debug)]
pub(super) struct FeedsAhead {
    nodes: Box<[Node]>,
    count: usize,
    /// Of one piece.
    points: PeriodPoints,
}

impl FeedsAhead {
    /// Nothing is known ahead. `points` for one piece. Allocates.
    pub(super) fn new(points: PeriodPoints) -> Self {
        Self {
            nodes: vec![
                Node {
                    offset_s: 0.0,
                    w: MOST
                };
                PIECES + 1
            ]
            .into_boxed_slice(),
            count: 0,
            points,
        }
    }

    /// The highest rate `offset_s` of program time from here; 1 where nothing is known.
    fn rate(&self, offset_s: f64) -> f64 {
        let nodes = &self.nodes[..self.count];
        let behind = nodes.partition_point(|node| node.offset_s <= offset_s);
        if behind == 0 || behind == nodes.len() {
            return 1.0;
        }
        let (from, to) = (nodes[behind - 1], nodes[behind]);
        let share = (offset_s - from.offset_s) / (to.offset_s - from.offset_s);
        (2.0 * (from.w + share * (to.w - from.w))).sqrt().min(1.0)
    }
}

impl Governor {
    /// Looks at the queued plan from `place` on, for [`Governor::rate_in_time`]: `ratio` of the programmed feeds is to be kept.
    pub fn look_ahead(&mut self, mut place: PlanCursor<'_>, ratio: f64) {
        let mut pieces: [Option<(&Segment, f64, f64)>; PIECES] = [None; PIECES];
        let (mut count, mut offset_s, mut least) = (0, 0.0, MOST);
        while let Some((segment, from_s)) = place.segment().filter(|_| count < PIECES) {
            let piece_s = place.stretch_s((LONGER * offset_s).max(self.period_s));
            if piece_s > 0.0 {
                pieces[count] = Some((segment, from_s, piece_s));
                least = least.min(highest(segment, from_s, ratio)).min(highest(
                    segment,
                    from_s + piece_s,
                    ratio,
                ));
                self.feeds_ahead.nodes[count] = Node { offset_s, w: MOST };
                (count, offset_s) = (count + 1, offset_s + piece_s);
                self.feeds_ahead.nodes[count] = Node { offset_s, w: MOST };
            }
            place.advance(piece_s);
            if place.stretch_s(self.period_s) <= 0.0 {
                place.step();
            }
        }
        self.feeds_ahead.count = if least < MOST { count + 1 } else { 0 };
        if least < MOST {
            self.lay_out(&pieces[..count], ratio);
        }
    }

    fn lay_out(&mut self, pieces: &[Option<(&Segment, f64, f64)>], ratio: f64) {
        let mut w = MOST;
        for (number, piece) in pieces.iter().enumerate().rev() {
            let Some((segment, from_s, piece_s)) = *piece else {
                continue;
            };
            w = w.min(highest(segment, from_s + piece_s, ratio));
            self.feeds_ahead.nodes[number + 1].w = w;
            self.feeds_ahead.points.clear();
            self.feeds_ahead.points.add(segment, from_s, piece_s);
            let slope = self.min_slope(w);
            let slope = slope.max(self.min_slope((w - piece_s * slope).min(MOST)));
            w = (w - piece_s * slope).min(highest(segment, from_s, ratio));
            self.feeds_ahead.nodes[number].w = w;
        }
    }

    /// The least dw/dτ that the limits leave at the points of the piece; not more than 0.
    fn min_slope(&self, w: f64) -> f64 {
        let mut least = f64::NEG_INFINITY;
        for point in self.feeds_ahead.points.iter() {
            for axis in 0..self.axes {
                least = least.max(min_slope_of_axis(point, axis, w, self.acceleration[axis]));
            }
        }
        least.min(0.0)
    }

    /// The highest rate at which the feeds ahead of [`Governor::look_ahead`] can be kept, `offset_s` of program time from
    /// there.
    pub fn rate_in_time(&self, offset_s: f64) -> f64 {
        self.feeds_ahead.rate(offset_s)
    }

    /// Forgets what lies ahead: the plan keeps what is asked.
    pub fn look_no_more(&mut self) {
        self.feeds_ahead.count = 0;
    }
}

fn min_slope_of_axis(point: &PeriodPoint, axis: usize, w: f64, limit: f64) -> f64 {
    let planned = 2.0 * w * point.acceleration[axis] * point.velocity[axis].signum();
    let speed = point.velocity[axis].abs();
    if speed > 0.0 {
        -((FEEDS_AHEAD_LIMIT_SHARE * limit).max(planned.abs()) + planned) / speed
    } else {
        f64::NEG_INFINITY
    }
}

/// w at which the path speed is `ratio` of the programmed feed at local time `t_s` of `segment`, and no more than the greatest.
fn highest(segment: &Segment, t_s: f64, ratio: f64) -> f64 {
    let speed = segment.path_speed_mm_per_s(t_s);
    let allowed = ratio * segment.feed_mm_per_s;
    let free = segment.flags.contains(tandem_sdk::SegmentFlags::RAPID)
        || speed * (1.0 - TOLERANCE) <= allowed;
    if free {
        MOST
    } else {
        (allowed / speed).powi(2) / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan_ahead::{PlanAhead, TWO_LINEAR};
    use proptest::prelude::*;
    use tandem_sdk::{AxisLimits, AxisVector, MAX_AXES};

    fn limits(accelerations: [f64; 2]) -> [AxisLimits; MAX_AXES] {
        let axis = AxisLimits {
            min_mm: -1000.0,
            max_mm: 1000.0,
            feed_mm_per_s: 1000.0,
            rapid_mm_per_s: 1000.0,
            acceleration_mm_per_s2: accelerations[0],
            jerk_mm_per_s3: f64::INFINITY,
            speed_difference_mm_per_s: 0.0,
        };
        let mut limits = [axis; MAX_AXES];
        limits[1].acceleration_mm_per_s2 = accelerations[1];
        limits
    }

    proptest! {
        /// X slows down with nearly all that it has while Y gets fast: from the rate that is given, lowering it with what the
        /// limits leave keeps the feed at every place.
        #[test]
        fn from_the_rate_that_is_given_the_feed_can_be_kept(
            most in 10.0..1000.0f64, used in 0.3..1.0f64, from in 1.0..20.0f64, gain in 0.5..4.0f64, share in 0.1..0.9f64,
        ) {
            let (braking, time_s) = (most * used, share * from / most);
            let mut segment = Segment::rest(&AxisVector::ZERO, time_s);
            segment.coefficients[0] = [0.0, from, -braking / 2.0, 0.0, 0.0, 0.0];
            segment.coefficients[1] = [0.0, 0.0, gain * from / time_s / 2.0, 0.0, 0.0, 0.0];
            segment.path = [0.0, from, gain * from / time_s / 2.0, 0.0, 0.0, 0.0];
            segment.feed_mm_per_s = from;
            let limits = limits([most, 1e6]);
            let mut governor = Governor::new(&limits, 2, 0.02 * time_s);
            governor.look_ahead(PlanAhead::new(&segment, [&[], &[]], TWO_LINEAR).begin(0.0), 1.0);
            let mut w = governor.rate_in_time(0.0).powi(2) / 2.0;
            let step_s = time_s / 2000.0;
            for step in 0..2000 {
                let t = f64::from(step) * step_s;
                let allowed = (from / segment.path_speed_mm_per_s(t)).powi(2) / 2.0;
                prop_assert!(w <= 1.001 * allowed, "{w} at {t} of {time_s}, {allowed} is allowed");
                let speed = from - braking * t;
                w -= step_s * (most - 2.0 * w * braking).max(0.0) / speed;
            }
        }
    }
}
