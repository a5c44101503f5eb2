//! How much program time must be queued so that the machine can stop within it.
//!
//! # The depth, and turning
//!
//! Starvation must end on the path, inside what is queued. Each segment declares the path deceleration that the plan
//! leaves everywhere in it, `Segment::stop_deceleration_mm_per_s2`, its own braking counted. With the path speed v of a segment, and its
//! declared deceleration `a_s` and jerk J, the rough loop keeps at least
//!
//! ```text
//! v / (0.95·a_s) + a_s/(0.8·J) + easing + two rough periods
//! ```
//!
//! of program time in the ring, and three rough periods more as margin. `v/a_s` is the longest of a single segment, for σ falls
//! by `a_s/v` at each place; or that of which a segment of order 3 says so itself, as the bound on σ̇ that the plan leaves: where a
//! rotary axis turns much on little path, path speed says nothing of how long it takes to stop. `a_s/J`, the time in which the deceleration is
//! built up, is what segments of order 3 declare as the quotient of their two bounds on σ. Easing is the time
//! before that in which a plan that uses the jerk itself leaves little of it (`easing.rs`). Both are zero for order 2.
//! `0.95` is what the fine loop counts on, because the governor stays 0.1 % inside the limits and acts from the next
//! period on. v/(2a) would do only for a plan that cruises: a plan that already brakes consumes its queue faster, and
//! the fine loop counts on `v/a_s`. With half the depth a fast program starves without any stall, again and again;
//! `core/host/tests/session/depth.rs` shows both. Motion starts, and starts again after starvation, when this depth or
//! the end of the stream is queued, or the ring is full.
//!
//! The ring is made at the start for the deepest queue that the machine can ask for, the stop from its highest speed at
//! its lowest acceleration, where the first pass finds the blocks of the program to follow each other most densely:
//! 4096 entries (3 MB) or more, but no more than 65 536 (48 MB). Where that would not hold the stop in pieces of a
//! rough period, the planner is asked for several at a time. It is still finite, blocks of 0.1 µm are short, and so the
//! ring can be full before the depth is there. Then the machine is not late but too fast for what can be queued: the
//! rough loop tells the fine loop the highest σ that a stop inside the ring allows, and the governor drives no faster
//! (`Depth::max_rate`, counted in `queue_limited_samples`). Along the path σ²/2 falls by `a_s/v` per s of program time
//! at most, so with E the integral of `a_s/v` over what is queued, and `t` the time that the rough loop may be late and
//! the deceleration takes to build up, it is the greatest σ with
//!
//! ```text
//! E(wall) − E(now + σ·t) ≥ σ²/(2·0.95)
//! ```
//!
//! Entries that come to the end of the queue only add to E. So from a state that keeps this there is always a stop
//! inside the ring, and starvation is declared only where the rough loop has not looked after a full ring for two of
//! its periods: with time to spare it cannot happen. The same number keeps no more entries in a period than the fine
//! loop looks at.
//!
//! For `a_s` to be large, turning must leave something to brake with. The planner lets turning take at most 0.8 of the
//! acceleration of an axis. On a circle the deceleration left along the path is then at least min over φ of (1 −
//! 0.8·cos φ)/sin φ = 0.6 of it.

use std::collections::VecDeque;

use crate::easing::{EASED, Easing, PathMotion};
use crate::window::SlidingMax;
use tandem_rings::{STOP_JERK_SHARE, STOP_SHARE, max_entries_a_period};
use tandem_sdk::{Segment, SegmentFlags};

/// The worst stop over what is queued.
#[derive(Debug)]
pub struct QueueDepth {
    /// Negative stop decelerations, mm/s²: their largest is the smallest deceleration.
    decelerations: SlidingMax,
    /// Stops of each segment from its own speed with its own deceleration, s.
    stops: SlidingMax,
    /// Times in which the deceleration is built up, s.
    ramps: SlidingMax,
    /// Times before that in which the plan leaves little jerk, s.
    easings: SlidingMax,
    easing: Easing,
    braking: Braking,
    /// Negative rates at which entries come no denser than the fine loop looks at them.
    dense: SlidingMax,
    /// Where the fine loop was last, s of program time.
    passed_s: f64,
    /// Where the last entries end, s of program time, and the place of the next one among them.
    ends_s: Box<[f64]>,
    next_end: usize,
    rough_period_s: f64,
    fine_period_s: f64,
    factor: f64,
}

/// How far a stop has come at each end of a queued segment.
///
/// On the path the rate σ of program time can fall by `a_s/v` per s of machine time, so σ²/2 falls by `a_s/v` per s of
/// program time. Its integral over program time, between two places, is therefore the σ²/2 that is braked away between them,
/// whatever speeds and decelerations lie there.
#[derive(Debug, Default)]
struct Braking {
    /// Program time at the end of each segment, s, and the integral up to there.
    ends: VecDeque<(f64, f64)>,
    /// The integral up to the first of them.
    passed: f64,
}

impl Braking {
    /// More than any stop takes, which is 1/2: what one segment adds at most, so that sums keep their precision.
    const WHOLE_STOP: f64 = 1.0;

    fn push(&mut self, stop: f64, until_s: f64) {
        let before = self.ends.back().map_or(self.passed, |(_, sum)| *sum);
        self.ends
            .push_back((until_s, before + stop.min(Self::WHOLE_STOP)));
    }

    fn forget(&mut self, now_s: f64) {
        while let Some((_, sum)) = self.ends.pop_front_if(|(until_s, _)| *until_s < now_s) {
            self.passed = sum;
        }
    }

    /// The integral up to the last end that is not behind `at_s`.
    fn before(&self, at_s: f64) -> f64 {
        let count = self.ends.partition_point(|(until_s, _)| *until_s <= at_s);
        if count == 0 {
            self.passed
        } else {
            self.ends[count - 1].1
        }
    }

    /// The integral up to the first end that is not before `at_s`.
    fn behind(&self, at_s: f64) -> f64 {
        let count = self.ends.partition_point(|(until_s, _)| *until_s < at_s);
        self.ends
            .get(count)
            .or(self.ends.back())
            .map_or(self.passed, |(_, sum)| *sum)
    }
}

/// Rough periods for which the rate that is told holds though the rough loop is late. With half of it a stop from the rate that a full
/// ring allows ends behind the ring, where the loop is two periods late (`from_the_rate_that_a_full_ring_allows_a_stop_ends_inside_it`);
/// twice of it costs rate and queue alone.
pub const SERVED_FOR_PERIODS: f64 = 2.0;

/// Halvings in which the rate is found that the ring allows: to a millionth, from below. With half of them it is up to a thousandth too
/// low, and more of them cost time alone.
const HALVINGS: u32 = 20;

/// The rate at least, for a queue whose segments leave no deceleration at all: the machine has to get out of it. Any rate above nothing
/// does that; half or double of it change only how long it takes.
const MIN_RATE: f64 = 1e-3;

impl QueueDepth {
    /// Nothing queued. `factor` is the share of the worst stop that is asked for, 1 but in tests.
    pub fn new(rough_period_s: f64, fine_period_s: f64, factor: f64, easing: Easing) -> Self {
        Self {
            decelerations: SlidingMax::default(),
            stops: SlidingMax::default(),
            ramps: SlidingMax::default(),
            easings: SlidingMax::default(),
            easing,
            braking: Braking::default(),
            dense: SlidingMax::default(),
            passed_s: f64::NEG_INFINITY,
            ends_s: vec![f64::NEG_INFINITY; max_entries_a_period(fine_period_s)].into_boxed_slice(),
            next_end: 0,
            rough_period_s,
            fine_period_s,
            factor,
        }
    }

    /// Rough period, s.
    pub fn rough_period_s(&self) -> f64 {
        self.rough_period_s
    }

    /// Nothing is queued any more.
    pub fn clear(&mut self) {
        *self = Self::new(
            self.rough_period_s,
            self.fine_period_s,
            self.factor,
            self.easing,
        );
    }

    /// A segment has been queued that ends at `until_s`.
    pub fn push(&mut self, segment: &Segment, until_s: f64) {
        self.count(until_s);
        if segment.flags.contains(SegmentFlags::DWELL) || segment.duration_s == 0.0 {
            self.braking.push(Braking::WHOLE_STOP, until_s);
            return;
        }
        let along = PathMotion::at(segment);
        let [first, middle, end] = along.speeds_mm_per_s;
        let speed = first.max(middle).max(end);
        self.decelerations
            .push(-segment.stop_deceleration_mm_per_s2, until_s);
        let stop_s =
            (speed / segment.stop_deceleration_mm_per_s2).max(1.0 / segment.max_sigma_rate_per_s);
        if speed > 0.0 {
            self.stops.push(stop_s, until_s);
        }
        let rests = segment.flags.contains(SegmentFlags::ENDS_AT_REST);
        self.braking.push(
            if rests {
                Braking::WHOLE_STOP
            } else {
                segment.duration_s / stop_s
            },
            until_s,
        );
        // Without a jerk limit both bounds are infinite.
        let ramp_s = segment.max_sigma_rate_per_s / segment.max_sigma_acceleration_per_s2;
        if ramp_s > 0.0 {
            self.ramps.push(ramp_s, until_s);
        }
        let easing_s = self.easing.longest_s(segment, &along);
        if easing_s > 0.0 {
            self.easings.push(easing_s, until_s);
        }
    }

    /// The fine loop has come to `now_s`.
    pub fn passed(&mut self, now_s: f64) {
        // It is asked several times in a rough period, and what has come meanwhile ends later.
        if now_s == self.passed_s {
            return;
        }
        self.passed_s = now_s;
        self.decelerations.forget(now_s);
        self.stops.forget(now_s);
        self.ramps.forget(now_s);
        self.easings.forget(now_s);
        self.braking.forget(now_s);
        self.dense.forget(now_s);
    }

    /// Another entry ends at `until_s`: as many as the fine loop looks at are not to pass in less than a period.
    fn count(&mut self, until_s: f64) {
        let first_s = std::mem::replace(&mut self.ends_s[self.next_end], until_s);
        self.next_end = (self.next_end + 1) % self.ends_s.len();
        let rate = (until_s - first_s) / self.fine_period_s;
        if rate < 1.0 {
            self.dense.push(-rate, until_s);
        }
    }

    /// Highest rate of program time at which no more entries come in a fine period than the fine loop looks at.
    pub fn rate_for_entries(&self) -> f64 {
        self.dense
            .max()
            .map_or(1.0, |negative| (-negative).max(MIN_RATE))
    }

    /// Highest rate of program time from which the machine comes to rest between `now_s` and `wall_s`, where the queue gets
    /// no deeper. Before it brakes it drives on for as long as the rough loop may be late, and builds its deceleration up;
    /// the same once more is for following what is said here. Below some rate every plan leaves jerk to begin with.
    pub fn rate_for_wall(&self, now_s: f64, wall_s: f64) -> f64 {
        let late_s = (SERVED_FOR_PERIODS + 1.0) * self.rough_period_s + 3.0 * self.fine_period_s;
        let built_s = late_s + 2.0 * self.ramp_s();
        let easing_s = self.easing_s();
        let end = self.braking.before(wall_s);
        let fits = |rate: f64| {
            let eases = rate > 1.0 - EASED;
            let before_s = built_s + if eases { easing_s } else { 0.0 };
            end - self.braking.behind(now_s + rate * before_s) >= rate * rate / (2.0 * STOP_SHARE)
        };
        if fits(1.0) {
            return 1.0;
        }
        let (mut good, mut bad) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let rate = f64::midpoint(good, bad);
            *(if fits(rate) { &mut good } else { &mut bad }) = rate;
        }
        good.max(MIN_RATE)
    }

    /// Smallest stop deceleration queued, mm/s²; infinite where nothing moves.
    pub fn stop_deceleration_mm_per_s2(&self) -> f64 {
        self.decelerations
            .max()
            .map_or(f64::INFINITY, |negative| -negative)
    }

    /// Longest stop of a segment queued from its own speed with its own deceleration, s. On its path program time slows at
    /// `a_s/v` at most, so no stop from full rate takes longer, whatever speeds and decelerations the others have. Infinite
    /// where nothing moves.
    pub fn stop_s(&self) -> f64 {
        self.stops.max().unwrap_or(f64::INFINITY)
    }

    /// Longest time in which a deceleration queued is built up with the share of the jerk that is counted on, s.
    fn ramp_s(&self) -> f64 {
        self.ramps.max().unwrap_or(0.0) / STOP_JERK_SHARE
    }

    /// Longest time before that in which the plan leaves little jerk, s.
    fn easing_s(&self) -> f64 {
        self.easings.max().unwrap_or(0.0)
    }

    /// Longest time before a stop has the deceleration that is declared, s.
    pub fn build_up_s(&self) -> f64 {
        self.ramp_s() + self.easing_s()
    }

    /// Program time that must be queued, s: the longest stop of a segment and what builds it up, and two rough periods.
    pub fn required_s(&self) -> f64 {
        let worst_s = self.stops.max().unwrap_or(0.0) / STOP_SHARE;
        self.factor * (worst_s + self.build_up_s()) + 2.0 * self.rough_period_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::AxisVector;

    /// A segment of 1 s at this speed, mm/s, that leaves this deceleration, mm/s².
    fn level(speed: f64, deceleration: f64) -> Segment {
        let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
        segment.path[1] = speed;
        segment.stop_deceleration_mm_per_s2 = deceleration;
        segment
    }

    #[test]
    fn the_worst_stop_of_equal_segments_is_speed_over_deceleration() {
        let mut depth = QueueDepth::new(0.01, 0.001, 1.0, Easing::NONE);
        depth.push(&level(50.0, 100.0), 1.0);
        depth.push(&level(20.0, 100.0), 2.0);
        assert!((depth.required_s() - (0.5 / STOP_SHARE + 0.02)).abs() < 1e-12);
    }

    #[test]
    fn a_slow_segment_that_leaves_little_does_not_lengthen_the_stop_of_a_fast_one() {
        let mut depth = QueueDepth::new(0.01, 0.001, 1.0, Easing::NONE);
        depth.push(&level(50.0, 1000.0), 1.0);
        depth.push(&level(0.004, 0.05), 2.0);
        assert!((depth.required_s() - (0.08 / STOP_SHARE + 0.02)).abs() < 1e-12);
        depth.passed(1.5);
        assert!((depth.required_s() - (0.08 / STOP_SHARE + 0.02)).abs() < 1e-12);
    }

    /// A queue of pieces of 2 ms whose speeds and decelerations go up and down over two decades.
    fn uneven(pieces: u32) -> (QueueDepth, Vec<(f64, f64)>) {
        let mut depth = QueueDepth::new(0.01, 0.001, 1.0, Easing::NONE);
        let mut stops = vec![];
        for piece in 0..pieces {
            let phase = f64::from(piece) * 0.05;
            let speed = 30.0 + 25.0 * phase.sin();
            let deceleration = 100.0 * 10f64.powf((1.7 * phase).cos());
            depth.push(
                &Segment {
                    duration_s: 0.002,
                    flags: SegmentFlags::default(),
                    ..level(speed, deceleration)
                },
                f64::from(piece + 1) * 0.002,
            );
            stops.push((f64::from(piece + 1) * 0.002, deceleration / speed));
        }
        (depth, stops)
    }

    #[test]
    fn from_the_rate_that_a_full_ring_allows_a_stop_ends_inside_it() {
        for pieces in [20, 60, 100, 150, 400] {
            let (depth, stops) = uneven(pieces);
            let wall_s = f64::from(pieces) * 0.002;
            let rate = depth.rate_for_wall(0.0, wall_s);
            // Late for two rough periods and noticed in the third, then as hard as the segments leave it.
            let (mut sigma, mut now_s) = (rate, rate * (0.03 + 0.003));
            while sigma > 0.0 {
                let place = stops.iter().find(|(until_s, _)| *until_s > now_s);
                let Some((_, rate_per_s)) = place else {
                    panic!("{pieces}: {sigma} of {rate} is left at the wall")
                };
                now_s += sigma * 1e-5;
                sigma -= STOP_SHARE * rate_per_s * 1e-5;
            }
            assert!(pieces > 20 || rate < 1.0, "{pieces}: {rate}");
        }
        assert_eq!(uneven(400).0.rate_for_wall(0.0, 0.8), 1.0);
    }

    #[test]
    fn the_fastest_place_of_a_segment_counts_wherever_it_is() {
        let mut depth = QueueDepth::new(0.01, 0.001, 1.0, Easing::NONE);
        // From rest over 50 mm/s in the middle to rest, within half a second.
        let mut segment = level(0.0, 100.0);
        segment.duration_s = 0.5;
        (segment.path[2], segment.path[3]) = (200.0, -800.0 / 3.0);
        depth.push(&segment, 0.5);
        assert!((depth.required_s() - (0.5 / STOP_SHARE + 0.02)).abs() < 1e-9);
    }

    /// A segment that leaves this deceleration, which is built up in this time, s.
    fn built_up(segment: &Segment, ramp_s: f64) -> Segment {
        let rate_per_s = segment.stop_deceleration_mm_per_s2 / segment.path[1];
        Segment {
            max_sigma_rate_per_s: rate_per_s,
            max_sigma_acceleration_per_s2: rate_per_s / ramp_s,
            ..*segment
        }
    }

    /// A rotary axis turns at its full speed where the path hardly gets on.
    #[test]
    fn a_stop_takes_as_long_as_the_slowest_axis_on_the_path_says() {
        let turns = Segment {
            duration_s: 0.002,
            flags: SegmentFlags::default(),
            max_sigma_rate_per_s: 2.0,
            ..level(0.004, 100.0)
        };
        let mut depth = QueueDepth::new(0.01, 0.001, 1.0, Easing::NONE);
        for piece in 1..=100 {
            depth.push(&turns, f64::from(piece) * 0.002);
        }
        assert!((depth.required_s() - (0.5 / STOP_SHARE + 0.02)).abs() < 1e-12);
        let rate = depth.rate_for_wall(0.0, 0.2);
        assert!(rate < 0.9, "{rate}");
    }

    #[test]
    fn what_is_passed_no_longer_counts_and_what_builds_a_deceleration_up_does() {
        let mut depth = QueueDepth::new(0.01, 0.001, 1.0, Easing::NONE);
        depth.push(&built_up(&level(50.0, 100.0), 0.16), 1.0);
        depth.push(&built_up(&level(20.0, 1000.0), 0.04), 2.0);
        let first_s = 0.5 / STOP_SHARE + 0.16 / STOP_JERK_SHARE + 0.02;
        assert!((depth.required_s() - first_s).abs() < 1e-12);
        assert_eq!(
            (depth.stop_s(), depth.build_up_s()),
            (0.5, 0.16 / STOP_JERK_SHARE)
        );
        depth.passed(1.5);
        assert_eq!(
            (depth.stop_s(), depth.build_up_s()),
            (0.02, 0.04 / STOP_JERK_SHARE)
        );
        assert_eq!(depth.stop_deceleration_mm_per_s2(), 1000.0);
        depth.passed(2.5);
        assert_eq!((depth.stop_s(), depth.build_up_s()), (f64::INFINITY, 0.0));
    }

    /// Pieces of 2 ms at 50 mm/s that leave 100 mm/s²; the last one as it is changed.
    fn even(pieces: u32, last: impl Fn(&mut Segment)) -> QueueDepth {
        let mut depth = QueueDepth::new(0.01, 0.001, 1.0, Easing::NONE);
        for piece in 1..=pieces {
            let mut segment = level(50.0, 100.0);
            (segment.duration_s, segment.flags) = (0.002, SegmentFlags::default());
            if piece == pieces {
                last(&mut segment);
            }
            depth.push(&segment, f64::from(piece) * 0.002);
        }
        depth
    }

    #[test]
    fn a_rest_inside_the_ring_is_a_stop_that_the_plan_makes() {
        let rate = even(20, |_| ()).rate_for_wall(0.0, 0.04);
        assert!(rate < 0.5, "{rate}");
        let rests = even(20, |last| last.flags = SegmentFlags::ENDS_AT_REST);
        assert_eq!(rests.rate_for_wall(0.0, 0.04), 1.0);
        let dwells = even(20, |last| last.flags = SegmentFlags::DWELL);
        assert_eq!(dwells.rate_for_wall(0.0, 0.04), 1.0);
        let only_says_so = even(20, |last| last.duration_s = 0.0);
        assert_eq!(only_says_so.rate_for_wall(0.0, 0.04), 1.0);
    }

    /// The rate r at which `r²/(2·0.95)` is what 2 per s brake away of the 0.4 s, less `r` times what passes before.
    #[test]
    fn a_deceleration_that_takes_time_to_build_up_lowers_the_rate_that_a_full_ring_allows() {
        let at_once = even(200, |_| ()).rate_for_wall(0.0, 0.4);
        assert_eq!(at_once, 1.0);
        let slow = even(200, |last| *last = built_up(last, 0.08));
        let before_s = 0.033 + 2.0 * 0.08 / STOP_JERK_SHARE;
        let half = 2.0 * STOP_SHARE * before_s;
        let expected = (half * half + 4.0 * STOP_SHARE * 0.4).sqrt() - half;
        let rate = slow.rate_for_wall(0.0, 0.4);
        assert!((rate - expected).abs() < 0.01, "{rate}, not {expected}");
    }

    /// A plan that uses all of the jerk leaves some of it once it is a fifth slower: what a stop then takes to begin counts above
    /// that rate only.
    #[test]
    fn what_a_stop_takes_to_begin_lowers_the_rate_only_where_the_plan_leaves_no_jerk() {
        const JERK: f64 = 1e5;
        let mut easing = Easing::NONE;
        easing.count(0, JERK);
        let rate_of = |pieces: u32, easing: Easing| {
            let mut depth = QueueDepth::new(0.01, 0.001, 1.0, easing);
            for piece in 1..=pieces {
                let mut segment = level(50.0, 100.0);
                (segment.duration_s, segment.flags) = (0.002, SegmentFlags::default());
                if piece == pieces {
                    segment.order = 3;
                    (segment.coefficients[0][1], segment.coefficients[0][3]) = (50.0, -JERK / 6.0);
                }
                depth.push(&segment, f64::from(piece) * 0.002);
            }
            let rate = depth.rate_for_wall(0.0, f64::from(pieces) * 0.002);
            (rate, depth.build_up_s())
        };
        let at_rate = |queued_s: f64, before_s: f64| {
            let half = 2.0 * STOP_SHARE * before_s;
            (half * half + 4.0 * STOP_SHARE * queued_s).sqrt() - half
        };
        let (whole, easing_s) = rate_of(200, easing);
        assert!((0.03..0.1).contains(&easing_s), "{easing_s}");
        assert_eq!(whole, 1.0);
        let queued_s = 0.3;
        let (rate, _) = rate_of(150, easing);
        let expected = at_rate(queued_s, 0.033 + easing_s);
        assert!((0.82..0.98).contains(&expected), "{expected}");
        assert!((rate - expected).abs() < 0.01, "{rate}, not {expected}");
        let slow = [easing, Easing::NONE].map(|easing| rate_of(80, easing).0);
        assert!(slow[0] < 0.8 && slow[0] == slow[1], "{slow:?}");
    }

    #[test]
    fn a_queue_that_leaves_nothing_to_brake_with_is_still_driven_out_of() {
        let mut depth = QueueDepth::new(0.01, 0.001, 1.0, Easing::NONE);
        depth.push(
            &Segment {
                flags: SegmentFlags::default(),
                ..level(50.0, 0.0)
            },
            1.0,
        );
        assert_eq!(depth.rate_for_wall(0.0, 1.0), MIN_RATE);
    }

    #[test]
    fn more_entries_than_a_period_has_time_for_slow_program_time_until_they_are_passed() {
        let mut depth = QueueDepth::new(0.01, 0.001, 1.0, Easing::NONE);
        depth.push(&level(50.0, 100.0), 1.0);
        assert_eq!(depth.rate_for_entries(), 1.0);
        let most = max_entries_a_period(0.001);
        for entry in 1..=2 * most {
            depth.push(
                &level(50.0, 100.0),
                1.0 + entry as f64 * 0.0005 / most as f64,
            );
        }
        assert!((depth.rate_for_entries() - 0.5).abs() < 1e-6);
        depth.passed(1.1);
        assert_eq!(depth.rate_for_entries(), 1.0);
    }
}
