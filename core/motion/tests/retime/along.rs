//! A motion along a path: the coordinate as a cubic B-spline of pseudo-time, retimed in rounds.

use tandem_motion::retime::{AnyRetimer, AxisLimits, End, GRID, PLACES, Point, Status, Task};
use tandem_sdk::MAX_AXES;

/// A path by its length: first to third derivative in two axes.
pub struct Along {
    pub length: f64,
    pub lanes: usize,
    pub feed: f64,
    pub derivatives: Box<dyn Fn(f64) -> [[f64; 2]; 3]>,
}

/// A retimed motion: path coordinate every millisecond.
pub struct Retimed {
    pub time_s: f64,
    pub status: Status,
    samples: Vec<f64>,
}

const PERIOD_S: f64 = 1e-3;

/// Begins with a motion that is far too slow, and makes it fast in `rounds`.
pub fn retimed(along: &Along, limits: &AxisLimits, step_s: f64, rounds: usize) -> Retimed {
    let slow_s = 4.0 * along.length / along.feed + 0.2;
    // Speed rises and falls as a square of a sine: smooth at both ends.
    let slow = |t: f64| {
        along.length
            * (t / slow_s - (std::f64::consts::TAU * t / slow_s).sin() / std::f64::consts::TAU)
    };
    let mut timing: Vec<(f64, f64)> = (0..=4000)
        .map(|i| slow_s * f64::from(i) / 4000.0)
        .map(|t| (t, slow(t)))
        .collect();
    let mut retimer = AnyRetimer::default();
    let mut done = None;
    for _ in 0..rounds {
        let total = timing.last().unwrap().0;
        let count = ((total / step_s).ceil() as usize).max(7);
        let h = total / count as f64;
        let spline = coefficients(&timing, h, count, along.length);
        let points: Vec<[Point<MAX_AXES>; PLACES]> = (0..count)
            .map(|k| GRID.map(|z| point(along, value(&spline, k, z, h))))
            .collect();
        let ends = (End::Rest, End::Rest);
        let status = retimer.solve(&Task {
            points: &points,
            between: &[],
            limits: shared(limits),
            step_s: h,
            ends,
        });
        timing = vec![(0.0, 0.0)];
        let mut t = 0.0;
        for k in 0..count {
            for z in [0.25, 0.5, 0.75, 1.0] {
                timing.push((t + retimer.rate.time_s(k, z, h), value(&spline, k, z, h)[0]));
            }
            t += retimer.rate.time_s(k, 1.0, h);
        }
        done = Some(Retimed {
            time_s: t,
            status,
            samples: sampled(&retimer, &spline, count, h),
        });
    }
    done.unwrap()
}

/// Shares of the limits that leave room for what lies between the places.
fn shared(limits: &AxisLimits) -> AxisLimits {
    AxisLimits {
        acceleration_mm_per_s2: limits.acceleration_mm_per_s2.map(|a| 0.99 * a),
        jerk_mm_per_s3: limits.jerk_mm_per_s3.map(|j| 0.99 * j),
        ..*limits
    }
}

fn point(along: &Along, [s, s1, s2, s3]: [f64; 4]) -> Point<MAX_AXES> {
    let [x1, x2, x3] = (along.derivatives)(s);
    let mut point = Point::default();
    for lane in 0..along.lanes {
        point.first[lane] = x1[lane] * s1;
        point.second[lane] = x2[lane] * s1 * s1 + x1[lane] * s2;
        point.third[lane] = x3[lane] * s1 * s1 * s1 + 3.0 * x2[lane] * s1 * s2 + x1[lane] * s3;
    }
    point.most = if s1 > 1e-9 {
        (along.feed / s1).powi(2)
    } else {
        f64::INFINITY
    };
    point
}

/// Greville ordinates: the coordinate at the time that a coefficient stands for. Rest at both ends.
fn coefficients(timing: &[(f64, f64)], h: f64, count: usize, length: f64) -> Vec<f64> {
    let at = |t: f64| {
        let i = timing
            .partition_point(|(time, _)| *time < t)
            .clamp(1, timing.len() - 1);
        let ((t0, s0), (t1, s1)) = (timing[i - 1], timing[i]);
        s0 + (s1 - s0) * ((t - t0) / (t1 - t0)).clamp(0.0, 1.0)
    };
    let mut c: Vec<f64> = (0..count + 3).map(|i| at((i as f64 - 1.0) * h)).collect();
    c[..3].fill(0.0);
    c[count..].fill(length);
    c
}

/// Value and three derivatives of the cubic B-spline at `z` of interval `k`.
fn value(c: &[f64], k: usize, z: f64, h: f64) -> [f64; 4] {
    let (c, y) = (&c[k..k + 4], 1.0 - z);
    let sum = |w: [f64; 4]| w[0] * c[0] + w[1] * c[1] + w[2] * c[2] + w[3] * c[3];
    let cubic = [
        y * y * y,
        3.0 * z * z * z - 6.0 * z * z + 4.0,
        -3.0 * z * z * z + 3.0 * z * z + 3.0 * z + 1.0,
        z * z * z,
    ];
    let square = [
        -y * y,
        3.0 * z * z - 4.0 * z,
        -3.0 * z * z + 2.0 * z + 1.0,
        z * z,
    ];
    let slope = [y, 3.0 * z - 2.0, 1.0 - 3.0 * z, z];
    [
        sum(cubic) / 6.0,
        sum(square) / (2.0 * h),
        sum(slope) / (h * h),
        sum([-1.0, 3.0, -3.0, 1.0]) / (h * h * h),
    ]
}

fn sampled(retimer: &AnyRetimer, spline: &[f64], count: usize, h: f64) -> Vec<f64> {
    let (mut samples, mut k, mut start, mut t) = (vec![], 0, 0.0, 0.0);
    while k < count {
        let whole = retimer.rate.time_s(k, 1.0, h);
        if t - start > whole {
            start += whole;
            k += 1;
            continue;
        }
        samples.push(value(spline, k, retimer.rate.place(k, t - start, h), h)[0]);
        t += PERIOD_S;
    }
    samples
}

impl Retimed {
    /// Path speed between samples, mm/s.
    pub fn speeds(&self) -> Vec<f64> {
        differences(&self.samples)
    }

    /// Largest acceleration and jerk of an axis, as differences of samples. The path is integrated from its direction.
    pub fn peaks(&self, along: &Along) -> [f64; 2] {
        let mut peaks = [0.0f64; 2];
        for axis in 0..along.lanes {
            let mut position = vec![0.0];
            for pair in self.samples.windows(2) {
                let at =
                    |part: f64| (along.derivatives)(pair[0] + part * (pair[1] - pair[0]))[0][axis];
                // Boole's rule: exact to degree 5.
                let mean = (7.0 * at(0.0)
                    + 32.0 * at(0.25)
                    + 12.0 * at(0.5)
                    + 32.0 * at(0.75)
                    + 7.0 * at(1.0))
                    / 90.0;
                position.push(position.last().unwrap() + mean * (pair[1] - pair[0]));
            }
            let acceleration = differences(&differences(&position));
            let most = |values: &[f64]| values.iter().fold(0.0f64, |most, v| most.max(v.abs()));
            peaks[0] = peaks[0].max(most(&acceleration));
            peaks[1] = peaks[1].max(most(&differences(&acceleration)));
        }
        peaks
    }
}

fn differences(values: &[f64]) -> Vec<f64> {
    values
        .windows(2)
        .map(|w| (w[1] - w[0]) / PERIOD_S)
        .collect()
}
