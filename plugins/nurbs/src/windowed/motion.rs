//! A window of the stream as ramps of the published method.

use super::ramp::Ramp;
use crate::stream::{Motion, State, interval};

/// Least time that is driven where none was found, s.
const LATER_S: f64 = 0.02;

/// The ramps, one after the other.
#[derive(Debug, Default)]
pub struct Ramps(pub Vec<Ramp>);

impl Motion for Ramps {
    fn at(&self, k: usize, t_s: f64) -> State {
        let [s_mm, speed_mm_per_s, acceleration_mm_per_s2, _] = self.0[k].at(t_s);
        // Below zero it is the rounding of a ramp to rest.
        State {
            s_mm,
            speed_mm_per_s: speed_mm_per_s.max(0.0),
            acceleration_mm_per_s2,
        }
    }

    fn end_mm(&self) -> f64 {
        self.0
            .last()
            .map_or(0.0, |ramp| ramp.at(ramp.duration_s)[0])
    }

    /// At the latest time where the speed is level there, else at the last border before, where there is no
    /// acceleration either.
    fn commit_s(&self, times: &[f64], latest_s: f64) -> f64 {
        let whole_s = times[times.len() - 1];
        let until_s = latest_s;
        let [_, b, c, d] = self.0[interval(times, until_s)].speed;
        if [b, c, d] == [0.0; 3] {
            return until_s;
        }
        let within = |t: &f64| *t > 0.0 && *t <= until_s;
        times.iter().copied().rfind(within).unwrap_or(whole_s)
    }

    /// A later border.
    fn later_s(&self, times: &[f64], now_s: f64) -> f64 {
        times
            .iter()
            .copied()
            .find(|t| *t > now_s + LATER_S)
            .unwrap_or(times[times.len() - 1])
    }
}
