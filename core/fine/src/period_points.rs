//! Where the plan goes within one fine period: velocity and acceleration at the points that matter.

use tandem_sdk::{AxisLimits, MAX_AXES, Segment, SegmentFlags};

use crate::plan_ahead::{Ahead, LOOK_ENTRIES};

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
    /// Largest |velocity| / limit.
    pub speed_ratio: f64,
    /// Largest |acceleration| / limit.
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

    /// Forgets all points.
    pub fn clear(&mut self) {
        self.count = 0;
        (self.speed_ratio, self.acceleration_ratio, self.covered_s) = (0.0, 0.0, 0.0);
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
            self.add(piece.segment, piece.from_s, duration_s.min(left_s));
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

    /// Adds a stretch of `segment`: its ends, and the middle where the segment is curved; one point where that is all it is.
    pub fn add(&mut self, segment: &Segment, from_s: f64, duration_s: f64) {
        self.point(segment, from_s);
        if duration_s == 0.0 {
            return;
        }
        self.point(segment, from_s + duration_s);
        if (0..self.axes).any(|axis| segment.coefficients[axis][3] != 0.0) {
            self.point(segment, from_s + duration_s / 2.0);
        }
        self.covered_s += duration_s;
    }

    fn point(&mut self, segment: &Segment, t: f64) {
        let per_speed = &self.per_speed[usize::from(segment.flags.contains(SegmentFlags::RAPID))];
        let point = &mut self.list[self.count];
        let (mut speed_ratio, mut acceleration_ratio) = (self.speed_ratio, self.acceleration_ratio);
        for (axis, c) in segment.coefficients[..self.axes].iter().enumerate() {
            let velocity =
                c[1] + t * (2.0 * c[2] + t * (3.0 * c[3] + t * (4.0 * c[4] + t * 5.0 * c[5])));
            let acceleration = 2.0 * c[2] + t * (6.0 * c[3] + t * (12.0 * c[4] + t * 20.0 * c[5]));
            let takeback = segment.step_acceleration[axis];
            let smooth = acceleration + takeback;
            point.velocity[axis] = velocity - segment.step_velocity[axis] + takeback * t;
            point.acceleration[axis] = smooth;
            speed_ratio = larger(speed_ratio, velocity.abs() * per_speed[axis]);
            acceleration_ratio = larger(
                acceleration_ratio,
                smooth.abs() * self.per_acceleration[axis],
            );
        }
        (self.speed_ratio, self.acceleration_ratio) = (speed_ratio, acceleration_ratio);
        self.count += 1;
    }
}

/// The larger of two numbers of which the first is one: one instruction, where `f64::max` also looks for NaN there.
pub fn larger(most: f64, value: f64) -> f64 {
    if value > most { value } else { most }
}
