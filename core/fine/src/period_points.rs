//! Where the plan goes within one fine period: velocity and acceleration at the points that matter.

use tandem_sdk::{AxisLimits, MAX_AXES, Segment, SegmentFlags, derivatives};

use crate::governor::TOLERANCE;
use crate::plan_ahead::{Ahead, LOOK_ENTRIES, Piece};

/// Segments that something is known of at the same time: more than a period passes of all but the shortest.
const KNOWN: usize = 4;

/// What is known of a whole segment.
#[derive(Clone, Copy, Debug)]
struct Known {
    /// Number of its entry.
    number: u64,
    /// Points of a stretch of it.
    points: usize,
    /// It keeps velocity and acceleration wherever it is looked at.
    keeps_limits: bool,
}

impl Known {
    /// Of no segment.
    const NOTHING: Self = Self {
        number: u64::MAX,
        points: 0,
        keeps_limits: false,
    };
}

/// One point of the plan, per axis and per s of program time.
#[derive(Clone, Copy, Debug, Default)]
pub struct PeriodPoint {
    /// Velocity that is continuous over junctions, mm/s.
    pub velocity: [f64; MAX_AXES],
    /// Its rate of change, mm/s².
    pub acceleration: [f64; MAX_AXES],
}

/// The points of one fine period.
#[derive(Debug)]
pub struct PeriodPoints {
    list: Box<[PeriodPoint]>,
    count: usize,
    /// Per axis 1/acceleration, and 1/speed in feed and in rapid motion: divisions are made once.
    per_acceleration: [f64; MAX_AXES],
    per_speed: [[f64; MAX_AXES]; 2],
    axes: usize,
    /// The points themselves are kept, and not only what they are of the limits.
    keeps_points: bool,
    /// Each at its number modulo their count; only where no points are kept.
    known: [Known; KNOWN],
    /// Largest |velocity| / limit. Where no points are kept, of segments that may be beyond their limits only.
    pub speed_ratio: f64,
    /// Largest |acceleration| / limit, in the same way.
    pub acceleration_ratio: f64,
    /// Program time that the points cover, s.
    pub covered_s: f64,
}

impl PeriodPoints {
    const POINTS: usize = 3 * LOOK_ENTRIES;

    /// No points; the limits are those of the machine's `axes` first axes.
    pub fn new(limits: &[AxisLimits; MAX_AXES], axes: usize) -> Self {
        let list = vec![PeriodPoint::default(); Self::POINTS].into_boxed_slice();
        Self {
            list,
            keeps_points: true,
            known: [Known::NOTHING; KNOWN],
            count: 0,
            per_acceleration: limits.map(|l| 1.0 / l.acceleration_mm_per_s2),
            per_speed: [
                limits.map(|l| 1.0 / l.feed_mm_per_s),
                limits.map(|l| 1.0 / l.rapid_mm_per_s),
            ],
            axes,
            speed_ratio: 0.0,
            acceleration_ratio: 0.0,
            covered_s: 0.0,
        }
    }

    /// Nobody looks at the points themselves, where jerk is limited too.
    pub fn without_points(self) -> Self {
        Self {
            keeps_points: false,
            ..self
        }
    }

    /// Forgets all points.
    pub fn clear(&mut self) {
        self.count = 0;
        self.speed_ratio = 0.0;
        self.acceleration_ratio = 0.0;
        self.covered_s = 0.0;
    }

    /// Collects where the plan goes within `horizon_s` of program time.
    pub fn fill(&mut self, ahead: &Ahead<'_>, horizon_s: f64) {
        self.clear();
        if horizon_s <= 0.0 && ahead.is_at_rest() {
            return;
        }
        let mut left_s = horizon_s;
        for piece in ahead.pieces() {
            if self.count > 0 && (left_s <= 0.0 || self.is_full()) {
                break;
            }
            let duration_s = piece.duration_s();
            let stretch_s = duration_s.min(left_s);
            if !self.passes(&piece, stretch_s) {
                self.add(piece.segment, piece.from_s, stretch_s);
            }
            left_s -= duration_s;
            if piece.ends_at_rest() {
                // At a wall behind which only a rest without duration has come, no time leads there: but it is to be reached.
                self.covered_s = self.covered_s.max(f64::MIN_POSITIVE);
                return;
            }
        }
        if left_s <= 0.0 {
            // The sum of the pieces may be a rounding short of it.
            self.covered_s = horizon_s;
        }
    }

    /// Whether another segment might not fit.
    fn is_full(&self) -> bool {
        self.count + 3 > Self::POINTS
    }

    /// The points so far.
    pub fn iter(&self) -> impl Iterator<Item = &PeriodPoint> {
        self.list[..self.count].iter()
    }

    /// Passes a stretch of a segment that is known to keep its limits, where nobody asks for more than that.
    #[inline]
    fn passes(&mut self, piece: &Piece<'_>, duration_s: f64) -> bool {
        if self.keeps_points {
            return false;
        }
        let place = piece.number as usize % KNOWN;
        if self.known[place].number != piece.number {
            self.known[place] = self.known_of(piece);
        }
        let known = &self.known[place];
        if known.keeps_limits {
            self.count += if duration_s == 0.0 { 1 } else { known.points };
            self.covered_s += duration_s;
        }
        known.keeps_limits
    }

    fn known_of(&self, piece: &Piece<'_>) -> Known {
        let segment = piece.segment;
        let per_speed = &self.per_speed[usize::from(segment.flags.contains(SegmentFlags::RAPID))];
        // Far more is left of the tolerance than what points of a segment are off by rounding.
        let most = 1.0 + TOLERANCE / 2.0;
        let keeps = |axis: usize| {
            let (c, takeback) = (&segment.coefficients[axis], segment.step_acceleration[axis]);
            let [speed, acceleration] = bounds(c, takeback, segment.duration_s);
            speed * per_speed[axis] <= most && acceleration * self.per_acceleration[axis] <= most
        };
        Known {
            number: piece.number,
            points: 2 + usize::from(self.is_curved(segment)),
            keeps_limits: (0..self.axes).all(keeps),
        }
    }

    /// Whether some axis of `segment` jerks.
    fn is_curved(&self, segment: &Segment) -> bool {
        segment.coefficients[..self.axes]
            .iter()
            .any(|c| c[3] != 0.0)
    }

    /// Adds a stretch of `segment`: its ends, and the middle where the segment is curved; one point where that is all it is.
    pub fn add(&mut self, segment: &Segment, from_s: f64, duration_s: f64) {
        let (to_s, middle_s) = (from_s + duration_s, from_s + duration_s / 2.0);
        // One stands for another where there are fewer.
        let (count, times) = if duration_s == 0.0 {
            (1, [from_s; 3])
        } else if self.is_curved(segment) {
            (3, [from_s, to_s, middle_s])
        } else {
            (2, [from_s, to_s, to_s])
        };
        self.compare(segment, &times);
        if self.keeps_points {
            times[..count].iter().for_each(|t| self.point(segment, *t));
        } else {
            self.count += count;
        }
        self.covered_s += duration_s;
    }

    /// Compares with the limits how `segment` moves at several times at once, side by side.
    fn compare(&mut self, segment: &Segment, times: &[f64; 3]) {
        let per_speed = &self.per_speed[usize::from(segment.flags.contains(SegmentFlags::RAPID))];
        let mut speed = [self.speed_ratio; 3];
        let mut acceleration = [self.acceleration_ratio; 3];
        for (axis, c) in segment.coefficients[..self.axes].iter().enumerate() {
            let (per_speed, per_acceleration) = (per_speed[axis], self.per_acceleration[axis]);
            let takeback = segment.step_acceleration[axis];
            let lanes = times.iter().zip(&mut speed).zip(&mut acceleration);
            for ((t, speed), acceleration) in lanes {
                let [velocity, bend, _] = derivatives(c, *t);
                *speed = larger(*speed, velocity.abs() * per_speed);
                *acceleration = larger(*acceleration, (bend + takeback).abs() * per_acceleration);
            }
        }
        self.speed_ratio = speed.into_iter().fold(0.0, larger);
        self.acceleration_ratio = acceleration.into_iter().fold(0.0, larger);
    }

    /// Keeps the point at `t`.
    fn point(&mut self, segment: &Segment, t: f64) {
        let point = &mut self.list[self.count];
        for (axis, c) in segment.coefficients[..self.axes].iter().enumerate() {
            let [velocity, acceleration, _] = derivatives(c, t);
            let takeback = segment.step_acceleration[axis];
            point.velocity[axis] = velocity - segment.step_velocity[axis] + takeback * t;
            point.acceleration[axis] = acceleration + takeback;
        }
        self.count += 1;
    }
}

/// Bounds on |velocity| and |acceleration| of an axis with the coefficients `c` from 0 to `t`, with a step that is taken back at
/// `takeback`: as if all that changes them pulled in one direction.
fn bounds(c: &[f64; 6], takeback: f64, t: f64) -> [f64; 2] {
    let [_, c1, c2, c3, c4, c5] = c.map(f64::abs);
    [
        c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * (5.0 * c5)))),
        2.0 * c2 + takeback.abs() + t * (6.0 * c3 + t * (12.0 * c4 + t * (20.0 * c5))),
    ]
}

/// The larger of two numbers of which the first is one: one instruction, where `f64::max` also looks for NaN there.
pub fn larger(most: f64, value: f64) -> f64 {
    if value > most { value } else { most }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cursor::Cursor;
    use crate::governor::Governor;
    use rtrb::RingBuffer;
    use tandem_rig::Random;
    use tandem_rings::Queued;
    use tandem_sdk::{AxisVector, SegmentFlags};

    /// At the beginning of so many segments of 0.1 ms each, with a jerk of `jerk`, each faster by 1 mm/s.
    fn at_short_segments(count: usize, jerk: f64) -> Cursor {
        let (mut input, output) = RingBuffer::new(count);
        for index in 0..count {
            let mut segment = Segment::rest(&AxisVector::ZERO, 1e-4);
            segment.flags = SegmentFlags::default();
            segment.coefficients[0][1] = 1.0 + index as f64;
            segment.coefficients[0][3] = jerk / 6.0;
            let start_s = 0.0;
            input.push(Queued::Segment { start_s, segment }).unwrap();
        }
        let mut cursor = Cursor::new(output, &AxisVector::ZERO);
        cursor.advance(1e-9, |_| false);
        cursor
    }

    /// As many segments as are looked at have room for all of their points.
    #[test]
    fn a_horizon_of_short_segments_is_covered() {
        let mut cursor = at_short_segments(LOOK_ENTRIES, 0.0);
        let mut points = PeriodPoints::new(&[AxisLimits::unlimited(); MAX_AXES], 1);
        let horizon_s = 1e-4 * (LOOK_ENTRIES as f64 - 1.5);
        points.fill(&cursor.ahead(), horizon_s);
        assert_eq!(points.covered_s, horizon_s);
        let fastest = points.iter().map(|point| point.velocity[0]);
        assert_eq!(fastest.fold(0.0, f64::max), LOOK_ENTRIES as f64 - 1.0);
    }

    /// Of curved segments, each with a point in its middle, as many have room, and what lies behind them is not looked at.
    #[test]
    fn no_more_curved_segments_are_looked_at_than_have_room() {
        let mut cursor = at_short_segments(LOOK_ENTRIES + 2, 1.0);
        let mut points = PeriodPoints::new(&[AxisLimits::unlimited(); MAX_AXES], 1);
        for (segments, is_covered) in [(LOOK_ENTRIES, true), (LOOK_ENTRIES + 1, false)] {
            let horizon_s = 1e-4 * (segments as f64 - 0.5);
            points.fill(&cursor.ahead(), horizon_s);
            assert_eq!(points.iter().count(), 3 * LOOK_ENTRIES);
            assert_eq!(points.covered_s == horizon_s, is_covered, "{segments}");
        }
    }

    /// Where no time passes inside the plan the place itself is looked at; at a rest of the plan nothing is.
    #[test]
    fn a_period_without_time_has_the_point_where_it_is() {
        let (mut input, output) = RingBuffer::new(2);
        let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
        segment.flags = SegmentFlags::default();
        segment.coefficients[0] = [0.0, 5.0, 10.0, 0.0, 0.0, 0.0];
        let start_s = 0.0;
        input.push(Queued::Segment { start_s, segment }).unwrap();
        let mut cursor = Cursor::new(output, &AxisVector::ZERO);
        let mut points = PeriodPoints::new(&[AxisLimits::unlimited(); MAX_AXES], 1);
        points.fill(&cursor.ahead(), 0.0);
        assert_eq!(points.iter().count(), 0);
        cursor.advance(0.25, |_| false);
        points.fill(&cursor.ahead(), 0.0);
        let seen: Vec<_> = points.iter().map(|point| point.velocity[0]).collect();
        assert_eq!(seen, [10.0]);
        assert_eq!(points.covered_s, 0.0);
    }

    /// What a segment that begins with a step takes back of it is a part of its acceleration, and what it still is off by none of its
    /// velocity.
    #[test]
    fn a_step_that_is_taken_back_counts_in_the_acceleration_of_a_point() {
        let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
        segment.coefficients[0] = [0.0, 10.0, 3.0, 0.0, 0.0, 0.0];
        (segment.step_velocity[0], segment.step_acceleration[0]) = (2.0, 4.0);
        let mut points = PeriodPoints::new(&[AxisLimits::unlimited(); MAX_AXES], 1);
        points.add(&segment, 0.0, 0.5);
        let seen: Vec<_> = points
            .iter()
            .map(|point| (point.velocity[0], point.acceleration[0]))
            .collect();
        assert_eq!(seen, [(8.0, 10.0), (13.0, 10.0)]);
    }

    /// Each axis is compared with its own limits, which are those of a rapid in a rapid, and the highest share in the period is what
    /// counts: of any axis, at any point, in any segment.
    #[test]
    fn the_highest_share_of_any_limit_in_the_period_counts() {
        let limits: [AxisLimits; MAX_AXES] = std::array::from_fn(|axis| AxisLimits {
            feed_mm_per_s: 10.0 + axis as f64,
            rapid_mm_per_s: 30.0 + axis as f64,
            acceleration_mm_per_s2: 200.0 + axis as f64,
            ..AxisLimits::unlimited()
        });
        let segment = |axis: usize, speed: f64, acceleration: f64, flags: SegmentFlags| {
            let mut segment = Segment::rest(&AxisVector::ZERO, 0.5);
            segment.coefficients[axis][1] = speed;
            segment.coefficients[axis][2] = acceleration / 2.0;
            segment.flags = flags;
            segment
        };
        for axis in 0..3 {
            for (flags, limit) in [
                (SegmentFlags::default(), limits[axis].feed_mm_per_s),
                (SegmentFlags::RAPID, limits[axis].rapid_mm_per_s),
            ] {
                // It gets slower, from 0.7 of its speed on.
                let acceleration = -0.4 * limits[axis].acceleration_mm_per_s2;
                let highest = segment(axis, 0.7 * limit, acceleration, flags);
                let slow = segment((axis + 1) % 3, 1.0, 1.0, SegmentFlags::default());
                for order in [[&highest, &slow], [&slow, &highest]] {
                    let mut points = PeriodPoints::new(&limits, 3);
                    for segment in order {
                        points.add(segment, 0.0, 0.001);
                    }
                    let found = [points.speed_ratio, points.acceleration_ratio];
                    let off = (found[0] - 0.7).abs().max((found[1] - 0.4).abs());
                    assert!(off < 1e-9, "axis {axis}: {found:?}");
                }
            }
        }
    }

    /// Segments about their limits, some within and some beyond: whether points are kept or not, the highest rate at which the plan
    /// keeps its limits is the same, and most segments that keep them are known to.
    #[test]
    fn what_is_known_of_segments_leaves_the_limit_of_the_plan_as_it_is() {
        let limits = [AxisLimits {
            feed_mm_per_s: 10.0,
            rapid_mm_per_s: 12.0,
            acceleration_mm_per_s2: 200.0,
            ..AxisLimits::unlimited()
        }; MAX_AXES];
        let mut random = Random::new(1);
        let mut within = 0;
        let mut known = 0;
        for _ in 0..200 {
            let mut exact = PeriodPoints::new(&limits, 2);
            let mut quick = PeriodPoints::new(&limits, 2).without_points();
            let mut segment = Segment::rest(&AxisVector::ZERO, 0.01);
            segment.flags = [SegmentFlags::default(), SegmentFlags::RAPID]
                [usize::from(random.between(-1.0, 1.0) > 0.0)];
            for c in &mut segment.coefficients {
                *c = [0.0, 12.0, 110.0, 1e3, 2e4, 5e5].map(|most| random.between(-most, most));
            }
            segment.step_acceleration[1] = random.between(-20.0, 20.0);
            let ahead = Ahead::new(&segment, Some(0.0), 1, None);
            exact.fill(&ahead, 0.01);
            quick.fill(&ahead, 0.01);
            assert_eq!(
                Governor::plan_limit(&exact),
                Governor::plan_limit(&quick),
                "{segment:?}"
            );
            assert_eq!(exact.count, quick.count);
            assert_eq!(exact.covered_s, quick.covered_s);
            within += u32::from(Governor::plan_limit(&exact) == 1.0);
            known += u32::from(quick.known[0].keeps_limits);
        }
        assert!((50..150).contains(&within), "{within}");
        assert!(known > within / 2, "{known} of {within}");
    }
}
