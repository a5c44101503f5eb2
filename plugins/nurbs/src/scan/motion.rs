//! A window of the form `scan`: a spline over pseudo-time, and the rate at which that passes.

use tandem_motion::retime::Rate;

use super::spline::evaluate;
use crate::stream::{Motion, State};
use crate::windowed::Ramps;

/// Where the next window is planned: from this share of the latest time on.
const EARLIEST: f64 = 0.8;
/// The next window begins so long before that, s, and follows this one as long: there its limits are kept, and in that time
/// it builds up what another motion needs.
const LEAD_S: f64 = 0.02;
/// Where none was found: so much later at least, s, and up to this share of the window.
const LATER_S: f64 = 0.02;
const LAST: f64 = 0.93;

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
        [
            s_mm,
            s1 * b.sqrt(),
            s2 * b + s1 * b1 / 2.0,
            b.sqrt() * (s3 * b + 1.5 * s2 * b1 + 0.5 * s1 * b2),
        ]
    }

    /// Where in interval `k` the path coordinate is `s_mm`, by halving.
    pub fn place(&self, k: usize, s_mm: f64) -> f64 {
        let mut low = 0.0;
        let mut high = 1.0;
        for _ in 0..30 {
            let middle = f64::midpoint(low, high);
            if evaluate(&self.coefficients, k, middle, self.step_s)[0] < s_mm {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }

    fn at(&self, k: usize, t_s: f64) -> State {
        let z = self.rate.place(k, t_s, self.step_s);
        let [s_mm, first, second, _] = evaluate(&self.coefficients, k, z, self.step_s);
        let [b, slope, _] = self.rate.at(k, z, self.step_s);
        State {
            s_mm,
            speed_mm_per_s: first * b.sqrt(),
            acceleration_mm_per_s2: second * b + first * slope / 2.0,
        }
    }

    /// Where it has the least acceleration between two times; the latest of those about equal.
    fn calmest_s(&self, times: &[f64], (from_s, to_s): (f64, f64)) -> Option<f64> {
        let mut least = f64::INFINITY;
        let mut found = None;
        for (k, t) in times
            .iter()
            .copied()
            .enumerate()
            .filter(|(_, t)| (from_s..=to_s).contains(t))
        {
            let size = self
                .at(k.min(times.len() - 2), 0.0)
                .acceleration_mm_per_s2
                .abs();
            if size <= least.max(1.0) {
                least = size.min(least);
                found = Some(t);
            }
        }
        found
    }
}

impl Driven {
    /// How long a window that begins at `now_s` follows this one, s.
    pub fn lead_s(&self, times: &[f64], now_s: f64) -> f64 {
        let calm_s = if self.by_ramps {
            None
        } else {
            self.rated.calmest_s(times, (now_s, now_s + 1.1 * LEAD_S))
        };
        calm_s.map_or(0.0, |calm_s| calm_s - now_s)
    }
}

impl Motion for Driven {
    fn at(&self, k: usize, t_s: f64) -> State {
        if self.by_ramps {
            self.ramps.at(k, t_s)
        } else {
            self.rated.at(k, t_s)
        }
    }

    fn end_mm(&self) -> f64 {
        if self.by_ramps {
            self.ramps.end_mm()
        } else {
            self.rated.coefficients.last().copied().unwrap_or(0.0)
        }
    }

    fn commit_s(&self, times: &[f64], latest_s: f64) -> f64 {
        if self.by_ramps {
            self.ramps.commit_s(times, latest_s)
        } else {
            let calm_s = self
                .rated
                .calmest_s(times, (EARLIEST * latest_s, latest_s))
                .unwrap_or(latest_s);
            calm_s - LEAD_S.min(calm_s / 2.0)
        }
    }

    fn later_s(&self, times: &[f64], now_s: f64) -> f64 {
        if self.by_ramps {
            self.ramps.later_s(times, now_s)
        } else {
            let whole_s = times[times.len() - 1];
            let from_s = now_s + LATER_S + LEAD_S;
            self.rated
                .calmest_s(times, (from_s, LAST * whole_s))
                .map_or(whole_s, |calm_s| calm_s - LEAD_S)
        }
    }
}
