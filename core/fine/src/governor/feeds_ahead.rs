//! The governor where jerk is not limited and the plan goes beyond the feed: how high the rate may be so that the feed can be
//! kept ahead.
//!
//! After a corner a plan may get fast sooner than the rate can fall, because a slower axis turns there with all that it has.
//! Then the rate has to be low before. With w = σ²/2 the rate of change σ̇ is dw/dτ, τ being program time, and an axis
//! accelerates by `2w·q″ + q′·dw/dτ`: what the limits leave for dw/dτ is linear in w. Laid out backward from the feeds ahead
//! with the least dw/dτ this gives the highest w from which each of them can be met.
//!
//! Along a piece w is linear. What the feed allows of it, `(allowed / path speed)² / 2`, is not: while the plan gets fast it falls
//! as a convex curve, and the chord of a piece lies above it. Taken instead is the tangent in the middle, below the curve
//! everywhere, on pieces in which the path speed changes little. And while the one rises and the other falls within a period, its
//! mean lies above its ends.
//!
//! It looks back over up to 96 pieces of the queued plan.

use super::tuning::{
    FEEDS_AHEAD_LIMIT_SHARE, FEEDS_AHEAD_MIN_PERIODS, FEEDS_AHEAD_MIN_RATIO,
    FEEDS_AHEAD_PIECE_SHARE, FEEDS_AHEAD_SPEED_SHARE,
};
use tandem_sdk::{Segment, SegmentFlags, derivatives};

use super::{Governor, TOLERANCE};
use crate::period_points::{PeriodPoint, PeriodPoints};
use crate::plan_ahead::PlanCursor;

/// Pieces that are laid out: in long segments they reach over 900 periods, longer than most machines take to their feed.
const PIECES: usize = 96;
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
        let period_s = self.period_s;
        let feeds = Feeds { ratio, period_s };
        while let Some((segment, from_s)) = place.segment().filter(|_| count < PIECES) {
            let longest_s = (FEEDS_AHEAD_PIECE_SHARE * offset_s).max(self.period_s);
            let shortest_s =
                FEEDS_AHEAD_MIN_PERIODS * ratio.clamp(FEEDS_AHEAD_MIN_RATIO, 1.0) * self.period_s;
            let piece_s = place.stretch_s(
                longest_s.min(feeds.changing_s(segment, from_s, longest_s).max(shortest_s)),
            );
            if piece_s > 0.0 {
                pieces[count] = Some((segment, from_s, piece_s));
                let [from, to] = feeds.highest_in(segment, from_s, piece_s);
                least = least.min(from).min(to);
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
            self.lay_out(&pieces[..count], feeds);
        }
    }

    fn lay_out(&mut self, pieces: &[Option<(&Segment, f64, f64)>], feeds: Feeds) {
        let mut w = MOST;
        for (number, piece) in pieces.iter().enumerate().rev() {
            let Some((segment, from_s, piece_s)) = *piece else {
                continue;
            };
            let [from, to] = feeds.highest_in(segment, from_s, piece_s);
            w = w.min(to);
            self.feeds_ahead.nodes[number + 1].w = w;
            // The rate changes evenly over a period, or what lies of it in a segment: as much as the limits leave all along it.
            let period_s = (2.0 * w).sqrt() * self.period_s;
            let first_s = (from_s - period_s).max(0.0);
            let last_s = (from_s + piece_s + period_s).min(segment.duration_s);
            self.feeds_ahead.points.clear();
            self.feeds_ahead
                .points
                .add(segment, first_s, last_s - first_s);
            let slope = self.min_slope(w);
            let slope = slope.max(self.min_slope((w - (piece_s + period_s) * slope).min(MOST)));
            w = (w - piece_s * slope).min(from);
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

/// The feeds that are to be kept.
#[derive(Clone, Copy, Debug)]
struct Feeds {
    /// Share of the programmed ones.
    ratio: f64,
    period_s: f64,
}

impl Feeds {
    fn allowed_mm_per_s(&self, segment: &Segment) -> f64 {
        self.ratio * segment.feed_mm_per_s
    }

    /// How long the path speed takes from local time `from_s` of `segment` to change by its share, where it comes beyond the feed
    /// within `longest_s`; infinite where it does not, s.
    fn changing_s(&self, segment: &Segment, from_s: f64, longest_s: f64) -> f64 {
        let ends = [from_s, (from_s + longest_s).min(segment.duration_s)];
        if ends.iter().all(|t| self.highest(segment, *t) >= MOST) {
            return f64::INFINITY;
        }
        let [speed, acceleration, _] = derivatives(&segment.path, from_s);
        FEEDS_AHEAD_SPEED_SHARE * speed.max(self.allowed_mm_per_s(segment)) / acceleration.abs()
    }

    /// What is allowed of w at both ends of a piece of `segment`: the line between them lies nowhere above what is at each place.
    fn highest_in(&self, segment: &Segment, from_s: f64, piece_s: f64) -> [f64; 2] {
        let ends = [0.0, piece_s].map(|t| self.highest(segment, from_s + t));
        let tangent = |at_s: f64| {
            let w = self.highest(segment, from_s + at_s);
            let [speed, acceleration, _] = derivatives(&segment.path, from_s + at_s);
            let slope = -2.0 * w * acceleration / speed;
            let of_piece = [w - slope * at_s, w + slope * (piece_s - at_s)];
            (w < MOST).then_some(of_piece)
        };
        // Where the middle is below the feed, an end is at the most that is allowed.
        let line = tangent(piece_s / 2.0)
            .or_else(|| tangent(piece_s))
            .or_else(|| tangent(0.0))
            .unwrap_or(ends);
        // Where the speed changes many times over, the tangent would meet nothing: there the lower end counts all along.
        let least = ends[0].min(ends[1]);
        if line[0].min(line[1]) < 0.5 * least {
            return [least; 2];
        }
        [0, 1].map(|end| ends[end].min(line[end]))
    }

    /// w at which the feed is kept at local time `t_s` of `segment`, and no more than the greatest.
    fn highest(&self, segment: &Segment, t_s: f64) -> f64 {
        let [speed, acceleration, _] = derivatives(&segment.path, t_s);
        let allowed = self.allowed_mm_per_s(segment);
        let free =
            segment.flags.contains(SegmentFlags::RAPID) || speed * (1.0 - TOLERANCE) <= allowed;
        if free {
            return MOST;
        }
        let rate = allowed / speed;
        // A period at both ends of which the feed is met, the plan getting faster by the share δ in it, has a mean δ²/6 above.
        let faster = (acceleration.abs() * rate * self.period_s / speed).min(1.0);
        (rate / (1.0 + faster * faster / 6.0)).powi(2) / 2.0
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

    /// X slows down by `used` of the `most` that it has, from 10 mm/s by `share` of that, while Y gets fast.
    fn turning(most: f64, used: f64, share: f64, gain: f64) -> Segment {
        let (from, braking) = (10.0, most * used);
        let time_s = share * from / most;
        let faster = gain * from / time_s / 2.0;
        let mut segment = Segment::rest(&AxisVector::ZERO, time_s);
        segment.coefficients[0] = [0.0, from, -braking / 2.0, 0.0, 0.0, 0.0];
        segment.coefficients[1] = [0.0, 0.0, faster, 0.0, 0.0, 0.0];
        segment.path = [0.0, from, faster, 0.0, 0.0, 0.0];
        segment.feed_mm_per_s = from;
        segment
    }

    /// From rest to a hundred times the feed asked for within a few pieces: the rate is low, and not nothing.
    #[test]
    fn a_ratio_near_nothing_leaves_a_rate() {
        for ratio in [0.1, 0.01, 0.001, 1e-4] {
            let mut segment = Segment::rest(&AxisVector::ZERO, 0.02);
            segment.coefficients[0] = [0.0, 0.0, 1000.0, 0.0, 0.0, 0.0];
            segment.path = segment.coefficients[0];
            segment.feed_mm_per_s = 40.0;
            let mut governor = Governor::new(&limits([2000.0; 2]), 2, 0.002);
            for from_s in [0.0, 1e-6, 1e-4, 1e-3] {
                let plan = PlanAhead::new(&segment, [&[], &[]], TWO_LINEAR);
                governor.look_ahead(plan.begin(from_s), ratio);
                for offset_s in [0.0, 1e-4, 1e-3, 0.015] {
                    let rate = governor.rate_in_time(offset_s);
                    assert!(
                        rate > 0.25 * ratio,
                        "{rate} for {ratio} at {from_s} s + {offset_s} s"
                    );
                }
            }
            // At none there is no rate, and an end to looking.
            governor.look_ahead(
                PlanAhead::new(&segment, [&[], &[]], TWO_LINEAR).begin(0.0),
                0.0,
            );
        }
    }

    /// A path that gets faster, beyond its feed of 10 mm/s in a piece of 0.01 s: the line of w is that of the piece's middle where this is too
    /// fast, and that of its end where only this is.
    #[test]
    fn what_is_allowed_in_a_piece_is_a_tangent_where_it_is_too_fast() {
        const PIECE_S: f64 = 0.01;
        let feeds = Feeds {
            ratio: 1.0,
            period_s: 0.0,
        };
        let getting_faster = |from: f64, to: f64| {
            let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
            segment.path = [0.0, from, (to - from) / PIECE_S / 2.0, 0.0, 0.0, 0.0];
            segment.feed_mm_per_s = 10.0;
            segment.flags = SegmentFlags::default();
            segment
        };
        let segment = getting_faster(20.0, 24.0);
        let [from, to] = feeds.highest_in(&segment, 0.0, PIECE_S);
        let middle = (10.0f64 / 22.0).powi(2) / 2.0;
        assert!((f64::midpoint(from, to) - middle).abs() < 1e-9);
        let around = [4.9e-3, 5.1e-3].map(|t_s| feeds.highest(&segment, t_s));
        let slope = (around[1] - around[0]) / 2e-4;
        assert!(((to - from) / PIECE_S / slope - 1.0).abs() < 1e-4);
        // Too fast at its end alone: there as much as that place allows.
        let segment = getting_faster(8.0, 11.0);
        let found = feeds.highest_in(&segment, 0.0, PIECE_S);
        assert_eq!(found, [MOST, feeds.highest(&segment, PIECE_S)]);
    }

    /// Twice as fast as the feed on the whole of a segment: half the rate everywhere on it, to its end, and nothing is known behind it.
    #[test]
    fn the_rate_is_low_to_the_end_of_what_is_too_fast() {
        let mut segment = Segment::rest(&AxisVector::ZERO, 0.02);
        segment.coefficients[0][1] = 20.0;
        segment.path = segment.coefficients[0];
        segment.feed_mm_per_s = 10.0;
        let mut governor = Governor::new(&limits([1000.0; 2]), 2, 0.001);
        let plan = PlanAhead::new(&segment, [&[], &[]], TWO_LINEAR);
        governor.look_ahead(plan.begin(0.0), 1.0);
        for offset_s in [0.0, 0.0005, 0.01, 0.018, 0.019, 0.0199] {
            let rate = governor.rate_in_time(offset_s);
            assert!((rate - 0.5).abs() < 1e-9, "{rate} at {offset_s} s");
        }
        assert_eq!(governor.rate_in_time(0.021), 1.0);
        governor.look_ahead(plan.begin(0.0), 2.0);
        assert_eq!(governor.rate_in_time(0.01), 1.0);
        governor.look_ahead(plan.begin(0.0), 1.0);
        governor.look_no_more();
        assert_eq!(governor.rate_in_time(0.01), 1.0);
    }

    /// The slope of a piece is what the limits leave in the periods of its rate alone: it is not taken from far behind, where X is faster.
    #[test]
    fn the_rate_that_is_given_is_little_lower_than_it_must_be() {
        let (most, used) = (100.0, 0.9);
        let segment = turning(most, used, 0.9, 4.0);
        let (feed, time_s) = (segment.feed_mm_per_s, segment.duration_s);
        let mut governor = Governor::new(&limits([most, 1e6]), 2, 0.02 * time_s);
        governor.look_ahead(
            PlanAhead::new(&segment, [&[], &[]], TWO_LINEAR).begin(0.0),
            1.0,
        );
        let step_s = time_s / 2000.0;
        let (mut w, mut least) = (MOST, f64::INFINITY);
        for step in (0..2000).rev() {
            let t = f64::from(step) * step_s;
            let speed = feed - most * used * t;
            w += step_s * (most - 2.0 * w * most * used).max(0.0) / speed;
            w = w.min((feed / segment.path_speed_mm_per_s(t)).powi(2) / 2.0);
            let found = governor.rate_in_time(t).powi(2) / 2.0;
            least = least.min(found / w);
        }
        assert!(least > 0.95, "{least} of what can be kept");
    }

    proptest! {
        /// X slows down with nearly all that it has while Y gets fast: from the rate that is given, lowering it with what the
        /// limits leave keeps the feed at every place.
        #[test]
        fn from_the_rate_that_is_given_the_feed_can_be_kept(
            most in 10.0..1000.0f64, used in 0.3..1.0f64, gain in 0.5..4.0f64, share in 0.1..0.9f64,
        ) {
            let segment = turning(most, used, share, gain);
            let (from, braking, time_s) = (segment.feed_mm_per_s, most * used, segment.duration_s);
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

        /// The same by whole periods, in each of which the rate changes evenly: their means keep the feed too.
        #[test]
        fn from_the_rate_that_is_given_whole_periods_keep_the_feed(
            most in 10.0..1000.0f64, used in 0.3..1.0f64, gain in 0.5..4.0f64, share in 0.1..0.9f64, periods in 3.0..50.0f64,
        ) {
            let segment = turning(most, used, share, gain);
            let (feed, period_s) = (segment.feed_mm_per_s, segment.duration_s / periods);
            let limits = limits([most, 1e6]);
            let mut governor = Governor::new(&limits, 2, period_s);
            let mut points = PeriodPoints::new(&limits, 2);
            let (mut t, mut sigma) = (0.0, 1.0);
            while t + sigma * period_s < segment.duration_s {
                governor.look_ahead(PlanAhead::new(&segment, [&[], &[]], TWO_LINEAR).begin(t), 1.0);
                if t == 0.0 {
                    sigma = governor.rate_in_time(0.0);
                }
                let mut end = sigma;
                for _ in 0..8 {
                    let passed_s = f64::midpoint(sigma, end) * period_s;
                    points.clear();
                    points.add(&segment, t, passed_s);
                    end = governor.choose_within(sigma, governor.rate_in_time(passed_s), &points, period_s);
                }
                let passed_s = f64::midpoint(sigma, end) * period_s;
                let mean = (segment.path_mm(t + passed_s) - segment.path_mm(t)) / period_s;
                prop_assert!(mean < (1.0 + 5e-4) * feed, "{mean} mm/s for {feed} at {t} of {} s", segment.duration_s);
                (t, sigma) = (t + passed_s, end);
            }
        }
    }
}
