//! A window of the form `scan`: a spline over pseudo-time, and the rate at which that passes.

use tandem_motion::retime::Rate;

use super::spline::evaluate;
use crate::stream::{Motion, State, interval};
use crate::windowed::Ramps;

/// A spline at a rate.
#[derive(Debug, Default)]
pub struct Rated {
    pub coefficients: Vec<f64>,
    pub rate: Rate,
    pub step_s: f64,
}

/// What a window drives.
#[derive(Debug, Default)]
pub struct Driven {
    pub rated: Rated,
    /// Where no rate keeps the limits: ramps between corners.
    pub ramps: Ramps,
    /// It drives the ramps.
    pub by_ramps: bool,
}

impl Rated {
    /// Path coordinate and its first three derivatives by time at `z` of interval `k`.
    pub fn derivatives(&self, k: usize, z: f64) -> [f64; 4] {
        let [s_mm, s1, s2, s3] = evaluate(&self.coefficients, k, z, self.step_s);
        let [b, b1, b2] = self.rate.at(k, z, self.step_s);
        [s_mm, s1 * b.sqrt(), s2 * b + s1 * b1 / 2.0, b.sqrt() * (s3 * b + 1.5 * s2 * b1 + 0.5 * s1 * b2)]
    }

    fn at(&self, k: usize, t_s: f64) -> State {
        let z = self.rate.place(k, t_s, self.step_s);
        let [s_mm, first, second, _] = evaluate(&self.coefficients, k, z, self.step_s);
        let [b, slope, _] = self.rate.at(k, z, self.step_s);
        State { s_mm, speed_mm_per_s: first * b.sqrt(), acceleration_mm_per_s2: second * b + first * slope / 2.0 }
    }

    /// Where it has the least acceleration, in the last part before `latest_s`; the latest of those about equal.
    fn commit_s(&self, times: &[f64], latest_s: f64) -> f64 {
        let (mut least, mut found) = (f64::INFINITY, latest_s);
        for t in times.iter().copied().filter(|t| (0.75..=1.0).contains(&(t / latest_s))) {
            let k = interval(times, t);
            let size = self.at(k, t - times[k]).acceleration_mm_per_s2.abs();
            if size <= least.max(1.0) {
                (least, found) = (size.min(least), t);
            }
        }
        found
    }
}

impl Motion for Driven {
    fn at(&self, k: usize, t_s: f64) -> State {
        if self.by_ramps { self.ramps.at(k, t_s) } else { self.rated.at(k, t_s) }
    }

    fn end_mm(&self) -> f64 {
        if self.by_ramps { self.ramps.end_mm() } else { self.rated.coefficients.last().copied().unwrap_or(0.0) }
    }

    fn commit_s(&self, times: &[f64], latest_s: f64) -> f64 {
        if self.by_ramps { self.ramps.commit_s(times, latest_s) } else { self.rated.commit_s(times, latest_s) }
    }

    fn later_s(&self, times: &[f64], now_s: f64) -> f64 {
        if self.by_ramps { self.ramps.later_s(times, now_s) } else { times[times.len() - 1] }
    }
}
