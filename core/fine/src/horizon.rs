//! Where the plan goes in the coming period and for a while after it, for segments that keep a jerk limit.

use crate::governor::tuning::{
    APPROACH_JERK_SHARE, HURRY_FACTOR, MAX_RATE_CHANGE, STRAIGHT_ON_JERK_SHARE, STRAIGHT_ON_SHARE,
};
use tandem_sdk::{AxisLimits, MAX_AXES, Segment, derivatives};

use crate::law::stop_s;
use crate::plan_ahead::{Ahead, Motion};

/// One point of the plan.
#[derive(Clone, Copy, Debug, Default)]
pub struct HorizonPoint {
    /// Program time from here, s.
    pub offset_s: f64,
    /// How the plan moves there.
    pub motion: Motion,
    /// Path jerk that the limits leave here on a straight path, mm/s³; infinite where the path stands still.
    pub path_jerk_mm_per_s3: f64,
}

/// The points, nearest first: all ends of segments within the period, then a coarse grid.
#[derive(Debug)]
pub struct Horizon {
    list: Box<[HorizonPoint]>,
    count: usize,
    axes: usize,
    acceleration: [f64; MAX_AXES],
    jerk: [f64; MAX_AXES],
    /// The queue runs dry.
    is_hurried: bool,
    /// How far the grid reaches, s of program time.
    pub reach_s: f64,
    /// The longest time in which an axis stops from its highest speed with its acceleration, s: for as long the rate may have to
    /// be lowered.
    pub stop_s: f64,
    /// Least path jerk that the limits leave on a straight path, over the points, mm/s³.
    pub path_jerk_mm_per_s3: f64,
    /// Bound on σ̈ that the period sets: σ changes in small steps, also where next to nothing moves, 1/s².
    pub max_change_per_s2: f64,
    /// Bound on σ̈ that the jerk limits leave at the plan's speed, over the points, 1/s².
    pub rate_change_per_s2: f64,
    /// Share of the jerk that an approach may come in with: nearly all of it where the plan goes straight on at constant speed,
    /// else what turning and the plan's own jerk, as they change on the way, leave.
    pub approach_jerk_share: f64,
}

impl Horizon {
    /// Points of the grid beyond the period.
    pub const GRID: usize = 12;
    /// Most points.
    const POINTS: usize = 64;

    /// No points. The horizon is the longest time in which an axis changes its acceleration from none to its limit.
    pub fn new(limits: &[AxisLimits; MAX_AXES], axes: usize, period_s: f64) -> Self {
        let change_s = |l: &AxisLimits| l.acceleration_mm_per_s2 / l.jerk_mm_per_s3;
        let stop_s =
            |l: &AxisLimits| l.feed_mm_per_s.max(l.rapid_mm_per_s) / l.acceleration_mm_per_s2;
        Self {
            list: vec![HorizonPoint::default(); Self::POINTS].into_boxed_slice(),
            count: 0,
            is_hurried: false,
            axes,
            acceleration: limits.map(|l| l.acceleration_mm_per_s2),
            jerk: limits.map(|l| l.jerk_mm_per_s3),
            reach_s: limits[..axes].iter().map(change_s).fold(0.0, f64::max),
            stop_s: limits[..axes].iter().map(stop_s).fold(0.0, f64::max),
            max_change_per_s2: MAX_RATE_CHANGE / (period_s * period_s),
            path_jerk_mm_per_s3: f64::INFINITY,
            rate_change_per_s2: f64::INFINITY,
            approach_jerk_share: STRAIGHT_ON_JERK_SHARE,
        }
    }

    /// Collects the points of the coming period, and a grid beyond it.
    pub fn fill(&mut self, ahead: &Ahead<'_>, period_s: f64) {
        self.clear();
        let step_s = self.reach_s / Self::GRID as f64;
        let mut grid_s = period_s + step_s;
        let reach_s = self.reach_s;
        for piece in ahead.pieces() {
            let duration_s = piece.duration_s();
            let end_s = piece.offset_s + duration_s;
            if piece.offset_s < period_s {
                if self.is_full() {
                    return;
                }
                let stretch_s = duration_s.min(period_s - piece.offset_s);
                self.stretch(piece.segment, piece.from_s, stretch_s, piece.offset_s);
            } else if grid_s > reach_s {
                return;
            }
            while grid_s <= end_s && grid_s <= reach_s {
                let local_s = piece.from_s + (grid_s - piece.offset_s);
                self.point(piece.segment, local_s, grid_s);
                grid_s += step_s;
            }
        }
    }

    /// Forgets all points.
    fn clear(&mut self) {
        (self.count, self.is_hurried) = (0, false);
        (self.path_jerk_mm_per_s3, self.rate_change_per_s2) =
            (f64::INFINITY, self.max_change_per_s2);
        self.approach_jerk_share = STRAIGHT_ON_JERK_SHARE;
    }

    /// The queue runs dry: σ is lowered in larger steps than where there is time, within what the limits leave.
    pub fn hurry(&mut self) {
        self.is_hurried = true;
    }

    /// Bound on σ̈ that the period sets now, 1/s².
    pub fn small_change_per_s2(&self) -> f64 {
        if self.is_hurried {
            HURRY_FACTOR * self.max_change_per_s2
        } else {
            self.max_change_per_s2
        }
    }

    /// Whether the points of a period have taken what room there is beside the grid.
    fn is_full(&self) -> bool {
        self.count + Self::GRID + 2 > Self::POINTS
    }

    /// Whether the plan goes straight on at constant speed.
    pub fn is_steady(&self) -> bool {
        self.approach_jerk_share > APPROACH_JERK_SHARE
    }

    /// The points so far.
    pub fn iter(&self) -> impl Iterator<Item = &HorizonPoint> {
        self.list[..self.count].iter()
    }

    /// Adds both ends of a stretch of `segment` in the coming period.
    fn stretch(&mut self, segment: &Segment, from_s: f64, duration_s: f64, offset_s: f64) {
        for (t, offset) in [
            (from_s, offset_s),
            (from_s + duration_s, offset_s + duration_s),
        ] {
            self.point(segment, t, offset);
        }
    }

    /// Adds the point at local time `t_s` of `segment`, `offset_s` of program time from here.
    fn point(&mut self, segment: &Segment, t_s: f64, offset_s: f64) {
        let point = &mut self.list[self.count];
        point.offset_s = offset_s;
        let mut per_speed = f64::INFINITY;
        let motion = &mut point.motion;
        for axis in 0..self.axes {
            let [velocity, acceleration, jerk] = derivatives(&segment.coefficients[axis], t_s);
            motion.velocity[axis] = velocity;
            motion.acceleration[axis] = acceleration;
            motion.jerk[axis] = jerk;
            per_speed = per_speed.min(self.jerk[axis] / velocity.abs());
            let steady = acceleration.abs() < STRAIGHT_ON_SHARE * self.acceleration[axis]
                && jerk.abs() < STRAIGHT_ON_SHARE * self.jerk[axis];
            if !steady {
                self.approach_jerk_share = APPROACH_JERK_SHARE;
            }
        }
        let [speed, ..] = derivatives(&segment.path, t_s);
        point.path_jerk_mm_per_s3 = if speed > 0.0 {
            speed * per_speed
        } else {
            f64::INFINITY
        };
        if speed > 0.0 {
            self.path_jerk_mm_per_s3 = self.path_jerk_mm_per_s3.min(speed * per_speed);
            self.rate_change_per_s2 = self.rate_change_per_s2.min(per_speed);
        }
        self.count += 1;
    }

    /// The least path jerk of the points that are passed before a stop with it comes to rest, mm/s³: from the rate `sigma`, and
    /// from `speed`, mm/s, and `acceleration`, mm/s², along the path. What lies beyond does not matter: where an axis turns much
    /// on little path it is next to nothing.
    pub fn path_jerk_to_rest(&self, sigma: f64, speed: f64, acceleration: f64) -> f64 {
        let mut least = f64::INFINITY;
        for point in self.iter() {
            if least.is_finite()
                && point.offset_s > sigma * stop_s(speed, acceleration, f64::INFINITY, least)
            {
                break;
            }
            least = least.min(point.path_jerk_mm_per_s3);
        }
        least
    }

    /// Per axis: its number, and its limits of acceleration, mm/s², and jerk, mm/s³.
    pub fn limits(&self) -> impl Iterator<Item = (usize, (f64, f64))> {
        (0..self.axes).map(|axis| (axis, (self.acceleration[axis], self.jerk[axis])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cursor::Cursor;
    use rtrb::RingBuffer;
    use tandem_rings::Queued;
    use tandem_sdk::{AxisVector, SegmentFlags};

    /// 0.15 s along an axis with a jerk of 1000 mm/s³, then along one with 100, at 10 mm/s.
    #[test]
    fn only_what_a_stop_passes_limits_its_path_jerk() {
        let limits = [1000.0, 100.0, 100.0, 100.0, 100.0, 100.0, 100.0, 100.0];
        let limits = limits.map(|jerk_mm_per_s3| AxisLimits {
            min_mm: -1000.0,
            max_mm: 1000.0,
            feed_mm_per_s: 100.0,
            rapid_mm_per_s: 100.0,
            acceleration_mm_per_s2: 100.0,
            jerk_mm_per_s3,
            speed_difference_mm_per_s: 0.0,
        });
        let (mut input, output) = RingBuffer::new(8);
        for (axis, duration_s) in [(0, 0.15), (1, 1.0)] {
            let mut segment = Segment::rest(&AxisVector::ZERO, duration_s);
            segment.flags = SegmentFlags::default();
            segment.coefficients[axis][1] = 10.0;
            segment.path[1] = 10.0;
            let start_s = 0.0;
            input.push(Queued::Segment { start_s, segment }).unwrap();
        }
        let mut cursor = Cursor::new(output, &AxisVector::ZERO);
        cursor.advance(1e-9, |_| false);
        let mut horizon = Horizon::new(&limits, 2, 0.001);
        horizon.fill(&cursor.ahead(), 0.001);
        // A stop from there takes 0.2 s: at half the rate 0.1 s of program time pass, which end before the second segment.
        let near = horizon.path_jerk_to_rest(0.5, 10.0, 0.0);
        let far = horizon.path_jerk_to_rest(1.0, 10.0, 0.0);
        assert!((near / far - 10.0).abs() < 1e-9, "{near} and {far} mm/s³");
        assert_eq!(far, horizon.path_jerk_mm_per_s3);
    }

    /// 0.03 s at 10 mm/s, then with 10 mm/s²: an axis takes 0.1 s to all of its acceleration, and so far is looked.
    #[test]
    fn places_ahead_are_those_of_the_segment_that_they_lie_in() {
        let axis = AxisLimits {
            acceleration_mm_per_s2: 100.0,
            jerk_mm_per_s3: 1000.0,
            ..AxisLimits::unlimited()
        };
        let (mut input, output) = RingBuffer::new(8);
        for (rise, duration_s) in [(0.0, 0.03), (10.0, 1.0)] {
            let mut segment = Segment::rest(&AxisVector::ZERO, duration_s);
            segment.flags = SegmentFlags::default();
            segment.coefficients[0] = [0.0, 10.0, rise / 2.0, 0.0, 0.0, 0.0];
            segment.path = segment.coefficients[0];
            let start_s = 0.0;
            input.push(Queued::Segment { start_s, segment }).unwrap();
        }
        let mut cursor = Cursor::new(output, &AxisVector::ZERO);
        cursor.advance(1e-9, |_| false);
        let mut horizon = Horizon::new(&[axis; MAX_AXES], 2, 0.001);
        assert!(horizon.is_steady());
        horizon.fill(&cursor.ahead(), 0.001);
        assert!(!horizon.is_steady(), "the second segment gets faster");
        let risen = |horizon: &Horizon, from_s: f64| {
            let mut risen = 0;
            for point in horizon.iter() {
                let expected = 10.0 + 10.0 * (from_s + point.offset_s - 0.03).max(0.0);
                let velocity = point.motion.velocity[0];
                assert!(
                    (velocity - expected).abs() < 1e-6,
                    "{velocity} at {}",
                    point.offset_s
                );
                risen += usize::from(velocity > 10.1);
            }
            risen
        };
        assert!(risen(&horizon, 0.0) > 3);
        cursor.advance(0.05, |_| false);
        horizon.fill(&cursor.ahead(), 0.001);
        assert_eq!(risen(&horizon, 0.05), horizon.iter().count());
    }

    /// A period takes its points where there is room beside the grid, however many segments it passes.
    #[test]
    fn a_period_of_many_short_segments_has_room_for_their_first_points() {
        const PERIOD_S: f64 = 0.001;
        let axis = AxisLimits {
            acceleration_mm_per_s2: 100.0,
            jerk_mm_per_s3: 1000.0,
            ..AxisLimits::unlimited()
        };
        let (mut input, output) = RingBuffer::new(256);
        for _ in 0..200 {
            let mut segment = Segment::rest(&AxisVector::ZERO, PERIOD_S / 100.0);
            segment.flags = SegmentFlags::default();
            let start_s = 0.0;
            input.push(Queued::Segment { start_s, segment }).unwrap();
        }
        let mut cursor = Cursor::new(output, &AxisVector::ZERO);
        cursor.advance(1e-9, |_| false);
        let mut horizon = Horizon::new(&[axis; MAX_AXES], 2, PERIOD_S);
        horizon.fill(&cursor.ahead(), PERIOD_S);
        let points = horizon.iter().count();
        assert_eq!(points, Horizon::POINTS - Horizon::GRID);
    }

    /// Where the queue runs dry the steps are some times as large, in that period.
    #[test]
    fn a_hurry_is_over_with_its_period() {
        let segment = Segment::rest(&AxisVector::ZERO, 1.0);
        let ahead = Ahead::new(&segment, Some(0.0), 0, None);
        let mut horizon = Horizon::new(&[AxisLimits::unlimited(); MAX_AXES], 1, 0.002);
        let small = MAX_RATE_CHANGE / 0.002 / 0.002;
        for _ in 0..2 {
            horizon.fill(&ahead, 0.002);
            assert!((horizon.small_change_per_s2() / small - 1.0).abs() < 1e-12);
            horizon.hurry();
            let hurried = horizon.small_change_per_s2() / small;
            assert!((hurried / HURRY_FACTOR - 1.0).abs() < 1e-12);
        }
    }

    /// Places lie evenly from a place behind the period to the end of the reach, where that one counts too, in however many segments they are.
    #[test]
    fn places_ahead_lie_evenly_to_the_end_of_the_reach() {
        // Shares of two, which add up without rounding.
        const PERIOD_S: f64 = 1.0 / 1024.0;
        for (spacing, lasts) in [
            (1.0, 100.0),
            (1.0, 11.5),
            (1.0, 2.0),
            (4.0, 100.0),
            (4.0, 44.5),
            (4.0, 0.5),
        ] {
            let step_s = spacing * PERIOD_S;
            let axis = AxisLimits {
                acceleration_mm_per_s2: Horizon::GRID as f64 * step_s,
                jerk_mm_per_s3: 1.0,
                ..AxisLimits::unlimited()
            };
            let (mut input, output) = RingBuffer::new(256);
            for _ in 0..200 {
                let mut segment = Segment::rest(&AxisVector::ZERO, lasts * PERIOD_S);
                segment.flags = SegmentFlags::default();
                let start_s = 0.0;
                input.push(Queued::Segment { start_s, segment }).unwrap();
            }
            let mut cursor = Cursor::new(output, &AxisVector::ZERO);
            let mut horizon = Horizon::new(&[axis; MAX_AXES], 1, PERIOD_S);
            horizon.fill(&cursor.ahead(), PERIOD_S);
            let seen: Vec<_> = horizon.iter().map(|point| point.offset_s).collect();
            let behind: Vec<_> = seen.into_iter().filter(|s| *s > PERIOD_S).collect();
            let expected: Vec<_> = (1..=Horizon::GRID)
                .map(|n| PERIOD_S + n as f64 * step_s)
                .filter(|s| *s <= Horizon::GRID as f64 * step_s)
                .collect();
            assert_eq!(behind, expected, "every {spacing}, segments of {lasts}");
        }
    }

    /// A plan that turns or gets faster by next to nothing of what its axes have goes straight on.
    #[test]
    fn straight_on_is_what_uses_next_to_nothing_of_the_limits() {
        let axis = AxisLimits {
            acceleration_mm_per_s2: 100.0,
            jerk_mm_per_s3: 1000.0,
            ..AxisLimits::unlimited()
        };
        for (acceleration_share, jerk_share, is_steady) in [
            (0.0, 0.0, true),
            (0.5, 0.5, true),
            (1.5, 0.0, false),
            (0.0, 1.5, false),
        ] {
            let mut segment = Segment::rest(&AxisVector::ZERO, 1e-3);
            let acceleration = acceleration_share * STRAIGHT_ON_SHARE * 100.0;
            let jerk = jerk_share * STRAIGHT_ON_SHARE * 1000.0;
            segment.coefficients[1] = [0.0, 10.0, acceleration / 2.0, jerk / 6.0, 0.0, 0.0];
            let mut horizon = Horizon::new(&[axis; MAX_AXES], 2, 1e-3);
            horizon.fill(&Ahead::new(&segment, Some(0.0), 0, None), 1e-3);
            assert_eq!(horizon.is_steady(), is_steady, "{acceleration}, {jerk}");
        }
    }
}
