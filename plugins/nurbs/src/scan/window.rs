//! A planned window: the path coordinate over time, from a state to rest.

use tandem_motion::retime::Rate;
use tandem_sdk::AxisVector;

use super::plan::State;
use super::spline::evaluate;

/// A window.
#[derive(Debug, Default)]
pub struct Window {
    pub coefficients: Vec<f64>,
    pub rate: Rate,
    pub step_s: f64,
    /// Time at the ends of the intervals, s from the start.
    pub times: Vec<f64>,
    /// Where it goes to the end of the run.
    pub whole: bool,
    /// Positions at the ticks of the fine period: three before its start, then from `first_tick_s` on.
    pub samples: Vec<AxisVector>,
    pub first_tick_s: f64,
    /// Path deceleration and path jerk that are left everywhere in it, mm/s² and mm/s³, and its highest speed.
    pub stop_mm_per_s2: f64,
    pub stop_mm_per_s3: f64,
    pub most_mm_per_s: f64,
}

impl Window {
    pub fn duration_s(&self) -> f64 {
        self.times[self.times.len() - 1]
    }

    /// Sums up the times of the intervals.
    pub fn lay_times(&mut self) {
        self.times.clear();
        self.times.push(0.0);
        let mut t = 0.0;
        for k in 0..self.rate.intervals() {
            t += self.rate.time_s(k, 1.0, self.step_s);
            self.times.push(t);
        }
    }

    /// The interval at `t_s`: the later one at a border.
    pub fn interval(&self, t_s: f64) -> usize {
        let behind = self.times.partition_point(|start| *start <= t_s);
        behind.clamp(1, self.times.len() - 1) - 1
    }

    /// Path coordinate, speed and acceleration at `t_s`.
    pub fn at(&self, t_s: f64) -> State {
        self.at_in(self.interval(t_s), t_s)
    }

    /// The same, in interval `k`.
    pub fn at_in(&self, k: usize, t_s: f64) -> State {
        let z = self.rate.place(k, t_s - self.times[k], self.step_s);
        let [s_mm, first, second, _] = evaluate(&self.coefficients, k, z, self.step_s);
        let [b, slope, _] = self.rate.at(k, z, self.step_s);
        State { s_mm, speed_mm_per_s: first * b.sqrt(), acceleration_mm_per_s2: second * b + first * slope / 2.0 }
    }

    /// Path coordinate and its first three derivatives by time at `z` of interval `k`.
    pub fn derivatives(&self, k: usize, z: f64) -> [f64; 4] {
        let [s_mm, s1, s2, s3] = evaluate(&self.coefficients, k, z, self.step_s);
        let [b, b1, b2] = self.rate.at(k, z, self.step_s);
        [s_mm, s1 * b.sqrt(), s2 * b + s1 * b1 / 2.0, b.sqrt() * (s3 * b + 1.5 * s2 * b1 + 0.5 * s1 * b2)]
    }

    /// The time at which `s_mm` is reached between two times, by halving.
    pub fn time_at(&self, s_mm: f64, (from_s, to_s): (f64, f64)) -> f64 {
        let (mut low, mut high) = (from_s, to_s);
        for _ in 0..50 {
            let middle = f64::midpoint(low, high);
            if self.at(middle).s_mm < s_mm { low = middle } else { high = middle }
        }
        high
    }

    /// Until when it is driven, s: where it has the least acceleration, in the middle; the latest of those about equal.
    pub fn commit_s(&self) -> f64 {
        let whole_s = self.duration_s();
        let (mut least, mut found) = (f64::INFINITY, 0.5 * whole_s);
        for t in self.times.iter().copied().filter(|t| (0.42..=0.7).contains(&(t / whole_s))) {
            let size = self.at(t).acceleration_mm_per_s2.abs();
            if size <= least.max(1.0) {
                (least, found) = (size.min(least), t);
            }
        }
        found
    }
}
