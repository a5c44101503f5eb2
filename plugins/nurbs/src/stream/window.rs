//! A planned window: the path coordinate over time, from a state to rest.

use tandem_sdk::{AxisVector, LimitedBy};

use super::check::BINDS;
use super::trail::Trail;
use super::{Motion, State};

/// Sums up the durations of intervals into the times at their ends.
pub fn lay_times(times: &mut Vec<f64>, durations_s: impl Iterator<Item = f64>) {
    times.clear();
    times.push(0.0);
    let mut t = 0.0;
    times.extend(durations_s.map(|duration_s| {
        t += duration_s;
        t
    }));
}

/// The interval of `times` that holds `t_s`: the later one at a border.
pub fn interval(times: &[f64], t_s: f64) -> usize {
    let behind = times.partition_point(|start| *start <= t_s);
    behind.clamp(1, times.len() - 1) - 1
}

/// Path deceleration and path jerk that are left for a stop, mm/s² and mm/s³.
#[derive(Clone, Copy, Debug)]
pub struct Reserve {
    pub stop_mm_per_s2: f64,
    pub stop_mm_per_s3: f64,
}

/// A window.
#[derive(Debug, Default)]
pub struct Window<M> {
    pub motion: M,
    /// Time at the ends of the intervals, s from the start.
    pub times: Vec<f64>,
    /// Where it goes to the end of the run.
    pub whole: bool,
    /// Positions at the ticks of the fine period: three before its start, then from `first_tick_s` on.
    pub samples: Vec<AxisVector>,
    pub first_tick_s: f64,
    /// What binds at the ticks from that one on.
    pub bounds: Vec<Option<LimitedBy>>,
    /// What is left for a stop at the ticks from that one on.
    pub reserves: Vec<Reserve>,
    /// Its highest speed.
    pub max_mm_per_s: f64,
    /// Memory of its check.
    pub trail: Trail,
}

impl<M: Motion> Window<M> {
    /// Exchanges everything but the motion with a window of another kind.
    pub fn take_all_but_motion<N>(&mut self, other: &mut Window<N>) {
        std::mem::swap(&mut self.times, &mut other.times);
        std::mem::swap(&mut self.samples, &mut other.samples);
        std::mem::swap(&mut self.bounds, &mut other.bounds);
        std::mem::swap(&mut self.reserves, &mut other.reserves);
        self.whole = other.whole;
        self.first_tick_s = other.first_tick_s;
        self.max_mm_per_s = other.max_mm_per_s;
    }

    /// What is left everywhere between two times: the least of the ticks there and of those around.
    pub fn reserve(&self, (from_s, to_s): (f64, f64), period_s: f64) -> Reserve {
        let tick = |t_s: f64| (t_s - self.first_tick_s) / period_s;
        let last = self.reserves.len().saturating_sub(1);
        let [from, to] = [
            tick(from_s).floor().max(0.0) as usize,
            tick(to_s).ceil().max(0.0) as usize,
        ];
        let around = &self.reserves[from.min(last)..(to + 1).min(self.reserves.len())];
        let least = |of: fn(&Reserve) -> f64| around.iter().map(of).fold(f64::INFINITY, f64::min);
        Reserve {
            stop_mm_per_s2: least(|at| at.stop_mm_per_s2),
            stop_mm_per_s3: least(|at| at.stop_mm_per_s3),
        }
    }

    /// What binds most of the ticks between two times; none where nothing does.
    pub fn bound(&self, (from_s, to_s): (f64, f64), period_s: f64) -> Option<LimitedBy> {
        let tick = |t_s: f64| ((t_s - self.first_tick_s) / period_s).ceil().max(0.0) as usize;
        let to = tick(to_s).min(self.bounds.len());
        let inside = &self.bounds[tick(from_s).min(to)..to];
        let count = |bound: &LimitedBy| inside.iter().filter(|each| **each == Some(*bound)).count();
        let kinds = BINDS
            .iter()
            .map(|(bound, _)| *bound)
            .filter(|bound| count(bound) > 0);
        kinds.max_by_key(count)
    }

    pub fn duration_s(&self) -> f64 {
        self.times[self.times.len() - 1]
    }

    /// The interval at `t_s`: the later one at a border.
    pub fn interval(&self, t_s: f64) -> usize {
        interval(&self.times, t_s)
    }

    /// Path coordinate, speed and acceleration at `t_s`.
    pub fn at(&self, t_s: f64) -> State {
        self.at_in(self.interval(t_s), t_s)
    }

    /// The same, in interval `k`.
    pub fn at_in(&self, k: usize, t_s: f64) -> State {
        self.motion.at(k, t_s - self.times[k])
    }

    /// The time at which `s_mm` is reached between two times, by halving.
    pub fn time_at(&self, s_mm: f64, (from_s, to_s): (f64, f64)) -> f64 {
        let mut low = from_s;
        let mut high = to_s;
        for _ in 0..50 {
            let middle = f64::midpoint(low, high);
            if self.at(middle).s_mm < s_mm {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }
}
