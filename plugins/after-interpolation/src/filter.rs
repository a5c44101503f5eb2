//! The filters, in continuous time.
//!
//! With p the programmed position and y what comes out: linear `y′(t) = (p(t) − p(t−τ))/τ`; bell the same twice, with τ
//! and τ/2; exponential `T·y′ + y = p`. Linear and bell are computed afresh at every knot from the part of p they look
//! back on, and the exponential forgets its past, so rounding does not add up over a long program.

use tandem_sdk::{AxisLimits, AxisVector};

use crate::options::{FilterKind, Options};
use crate::signal::Signal;

/// Position and velocity of the machine at a knot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Knot {
    pub position: AxisVector,
    pub velocity: AxisVector,
}

impl Knot {
    /// At rest.
    pub fn rest(position: &AxisVector) -> Self {
        Self {
            position: *position,
            velocity: AxisVector::ZERO,
        }
    }
}

/// The lag of an exponential filter that counts as none, mm or rad. With half of it the wait for it is longer than it must be
/// (`an_exponential_filter_is_cut_off_where_nothing_is_left`); with twice as much no test of this crate had another result.
const SETTLED_MM: f64 = 1e-9;

/// A low-pass filter, the same for every axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Filter {
    kind: FilterKind,
    tau_s: f64,
    settle_s: f64,
}

impl Filter {
    /// The filter of the options; the axis limits bound how far an exponential filter can lag.
    pub fn new(options: &Options, axes: &[AxisLimits]) -> Self {
        let tau_s = options.time_constant_ms / 1000.0;
        let fastest = axes
            .iter()
            .map(|axis| axis.feed_mm_per_s.max(axis.rapid_mm_per_s))
            .fold(0.0, f64::max);
        let settle_s = match options.filter {
            FilterKind::Linear => tau_s,
            FilterKind::Bell => 1.5 * tau_s,
            // An axis lags by at most its speed times T when its command comes to rest, then by e^(−t/T) of that.
            FilterKind::Exponential => tau_s * (fastest * tau_s / SETTLED_MM).ln().max(1.0),
        };
        Self {
            kind: options.filter,
            tau_s,
            settle_s,
        }
    }

    /// Time constant, s.
    pub fn time_constant_s(&self) -> f64 {
        self.tau_s
    }

    /// How long after its command the machine comes to rest on the programmed position, s. A block moves the machine
    /// for at most this long after its own end.
    pub fn settle_s(&self) -> f64 {
        self.settle_s
    }

    /// How late a kink of the signal shows in the output, in time constants: at once, and when it leaves an average.
    pub fn delays(&self) -> &'static [f64] {
        match self.kind {
            FilterKind::Linear => &[0.0, 1.0],
            FilterKind::Bell => &[0.0, 0.5, 1.0, 1.5],
            FilterKind::Exponential => &[0.0],
        }
    }

    /// How far back the signal is still needed, s.
    pub fn memory_s(&self) -> f64 {
        self.delays()
            .iter()
            .fold(0.0, |most: f64, delay| most.max(*delay))
            * self.tau_s
    }

    /// The longest piece that one polynomial may stand for, s: an exponential is fitted over a tenth of T.
    pub fn longest_s(&self) -> f64 {
        if self.kind == FilterKind::Exponential {
            self.tau_s / 10.0
        } else {
            f64::INFINITY
        }
    }

    /// The knot at `t_s`, `step_s` after the knot `last`.
    pub fn knot(&self, signal: &Signal, t_s: f64, step_s: f64, last: &Knot) -> Knot {
        let now = signal.position(t_s);
        let tau_s = self.tau_s;
        match self.kind {
            FilterKind::Linear => {
                let velocity = (now - signal.position(t_s - tau_s)) * (1.0 / tau_s);
                Knot {
                    position: average(signal, t_s, tau_s),
                    velocity,
                }
            }
            FilterKind::Bell => {
                let step = average(signal, t_s, tau_s) - average(signal, t_s - tau_s / 2.0, tau_s);
                Knot {
                    position: self.bell(signal, t_s, &now),
                    velocity: step * (2.0 / tau_s),
                }
            }
            FilterKind::Exponential => {
                let weight = |s: f64| ((s - t_s) / tau_s).exp() / tau_s;
                let kept = (last.position - now) * (-step_s / tau_s).exp();
                let position = now + kept + signal.integral(t_s - step_s, t_s, &now, weight);
                Knot {
                    position,
                    velocity: (now - position) * (1.0 / tau_s),
                }
            }
        }
    }

    /// Acceleration at `t_s`, where the velocity is `velocity`; at a kink that of the piece around `inside_s`.
    pub fn acceleration(
        &self,
        signal: &Signal,
        t_s: f64,
        inside_s: f64,
        velocity: &AxisVector,
    ) -> AxisVector {
        let tau_s = self.tau_s;
        match self.kind {
            FilterKind::Linear => {
                let before = signal.velocity(t_s - tau_s, inside_s - tau_s);
                (signal.velocity(t_s, inside_s) - before) * (1.0 / tau_s)
            }
            FilterKind::Bell => {
                let at = |delay: f64| signal.position(t_s - delay * tau_s);
                ((at(0.0) - at(0.5)) - (at(1.0) - at(1.5))) * (2.0 / (tau_s * tau_s))
            }
            FilterKind::Exponential => (signal.velocity(t_s, inside_s) - *velocity) * (1.0 / tau_s),
        }
    }

    /// The average over τ of the average over τ/2: one average under a trapezoid of height 1/τ.
    fn bell(&self, signal: &Signal, t_s: f64, now: &AxisVector) -> AxisVector {
        let tau_s = self.tau_s;
        let slope = 2.0 / (tau_s * tau_s);
        let [start_s, rise_s, fall_s] = [1.5, 1.0, 0.5].map(|age| t_s - age * tau_s);
        *now + signal.integral(start_s, rise_s, now, |s| (s - start_s) * slope)
            + signal.integral(rise_s, fall_s, now, |_| 1.0 / tau_s)
            + signal.integral(fall_s, t_s, now, |s| (t_s - s) * slope)
    }
}

/// Mean of the signal over the `tau_s` before `t_s`.
fn average(signal: &Signal, t_s: f64, tau_s: f64) -> AxisVector {
    let now = signal.position(t_s);
    now + signal.integral(t_s - tau_s, t_s, &now, |_| 1.0 / tau_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_motion::Path;
    use tandem_sdk::{Block, BlockKind};

    /// One axis at rest at 1, then a line to 101 at 40 mm/s.
    fn ramp() -> Signal {
        let mut block = Block::at(AxisVector::from_slice(&[1.0]));
        block.kind = BlockKind::Line;
        block.end = AxisVector::from_slice(&[101.0]);
        block.length_mm = 100.0;
        let mut signal = Signal::new(&block.start);
        signal.push_path(&Path::new(&block).unwrap(), 40.0);
        signal
    }

    fn knots(kind: FilterKind, times: &[f64]) -> Vec<[f64; 3]> {
        let filter = Filter::new(
            &Options {
                filter: kind,
                time_constant_ms: 200.0,
            },
            &[],
        );
        let signal = ramp();
        let mut knot = Knot::rest(&AxisVector::from_slice(&[1.0]));
        let mut last = 0.0;
        let mut at = |t: &f64| {
            knot = filter.knot(&signal, *t, t - last, &knot);
            last = *t;
            [
                knot.position[0],
                knot.velocity[0],
                filter.acceleration(&signal, *t, *t, &knot.velocity)[0],
            ]
        };
        times.iter().map(&mut at).collect()
    }

    fn assert_near(found: &[[f64; 3]], expected: &[[f64; 3]]) {
        for (f, e) in found.iter().zip(expected) {
            assert!(
                f.iter().zip(e).all(|(a, b)| (a - b).abs() < 1e-9),
                "{f:?} is not {e:?}"
            );
        }
    }

    #[test]
    fn linear_makes_a_ramp_of_the_step() {
        let found = knots(FilterKind::Linear, &[0.1, 0.5]);
        assert_near(&found, &[[2.0, 20.0, 200.0], [1.0 + 40.0 * 0.4, 40.0, 0.0]]);
    }

    #[test]
    fn bell_rounds_the_ramp() {
        // Jerk 40/(0.2·0.1) = 2000 for 0.1 s, then the ramp of 200 mm/s², in the end a delay of 0.75 τ.
        let found = knots(FilterKind::Bell, &[0.05, 0.1, 0.15, 1.0]);
        let at_50 = [1.0 + 2000.0 * 0.05_f64.powi(3) / 6.0, 2.5, 100.0];
        let at_100 = [1.0 + 2.0 / 6.0, 10.0, 200.0];
        let at_150 = [1.0 + 2.0 / 6.0 + 0.5 + 0.25, 20.0, 200.0];
        assert_near(
            &found,
            &[at_50, at_100, at_150, [1.0 + 40.0 * 0.85, 40.0, 0.0]],
        );
    }

    #[test]
    fn exponential_lags_by_the_time_constant() {
        let times: Vec<f64> = (1..=50).map(|k| f64::from(k) * 0.02).collect();
        for (t, found) in times.iter().zip(knots(FilterKind::Exponential, &times)) {
            let left = (-t / 0.2_f64).exp();
            let lag = 40.0 * 0.2 * (1.0 - left);
            assert_near(
                &[found],
                &[[1.0 + 40.0 * t - lag, 40.0 * (1.0 - left), 200.0 * left]],
            );
        }
    }
}
