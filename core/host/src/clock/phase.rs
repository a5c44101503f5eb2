//! In step with the clock of a bus.

/// How slowly a deviation is corrected, ns: 16 periods of 1 ms. Drift of 100 ppm moves the phase by 1.6 µs meanwhile, far less
/// than the jitter of any computer, so that nothing is won by being quicker; and it is long enough to average jitter out.
const TIME_CONSTANT_NS: f64 = 16e6;
/// Most of a deviation that one period corrects: where periods are long, the loop stays far from half of what it can bear (2).
const MAX_GAIN: f64 = 0.25;
/// How much of a period one correction moves the deadline at most: the drives see a period that is so much shorter or longer.
const MAX_SHIFT: f64 = 0.05;
/// How far two clocks drift apart at most, as a share of time. Quartzes keep 100 ppm; what is beyond ten times that is no drift,
/// and learnt as one it would carry the deadlines away where the phase is not told.
const MAX_DRIFT: f64 = 1e-3;

/// A proportional and integral controller that steers the deadlines of a loop by the phase of its exchanges.
///
/// In periods, with the phase `e` of a deadline and the drift `d` of the clocks in a period, the loop is
///
/// ```text
/// e ← e + d − (p·e + s),   s ← s + i·e
/// ```
///
/// with `p = T/τ` and `i = p²/4`. Its characteristic polynomial is `(z − 1)² + p·(z − 1) + i = (z − 1 + p/2)²`: two equal
/// poles at `1 − p/2`, which do not swing at any period and lie within the unit circle by far, as `p` is 1/4 at most; so do
/// those of half and of twice these gains. The integral holds the drift: 100 ppm, 100 ns in a period of 1 ms, leave no
/// deviation. What the phase jitters by a standard deviation of σ moves the deadlines by one of `σ·√(5·p/8)`: where it is
/// spread evenly over 100 µs, and T is 1 ms, by 6 µs. A correction beyond [`MAX_SHIFT`] is cut off, and the integral waits
/// meanwhile, for it would take the way to the first lock for drift.
#[derive(Clone, Copy, Debug)]
pub struct PhaseSteering {
    /// Share of a deviation that is corrected in the next period.
    proportional: f64,
    /// Share of a deviation that is taken for drift.
    integral: f64,
    /// Half a period: a phase further off is nearer to the next exchange.
    max_phase_ns: f64,
    max_shift_ns: f64,
    max_drift_ns: f64,
    /// How far the clocks drift apart in a period, as far as is known.
    drift_ns: f64,
    /// What of the corrections so far is less than a ns.
    rest_ns: f64,
}

impl PhaseSteering {
    /// A controller for this period that knows of no drift.
    pub fn new(period_ns: i64) -> Self {
        let period_ns = period_ns as f64;
        let proportional = (period_ns / TIME_CONSTANT_NS).min(MAX_GAIN);
        Self {
            proportional,
            integral: proportional * proportional / 4.0,
            max_phase_ns: 0.5 * period_ns,
            max_shift_ns: MAX_SHIFT * period_ns,
            max_drift_ns: MAX_DRIFT * period_ns,
            drift_ns: 0.0,
            rest_ns: 0.0,
        }
    }

    /// By how much the next deadline comes sooner than a period after this one, which was `phase_ns` later than the bus wants
    /// it. Where that is not told, the drift that is known is made up for. Fine thread; does not allocate.
    pub fn sooner_ns(&mut self, phase_ns: Option<i64>) -> i64 {
        let phase_ns = phase_ns.map_or(0.0, |ns| {
            (ns as f64).clamp(-self.max_phase_ns, self.max_phase_ns)
        });
        let wanted_ns = self.proportional * phase_ns + self.drift_ns;
        let shift_ns = wanted_ns.clamp(-self.max_shift_ns, self.max_shift_ns);
        if shift_ns == wanted_ns {
            let drift_ns = self.drift_ns + self.integral * phase_ns;
            self.drift_ns = drift_ns.clamp(-self.max_drift_ns, self.max_drift_ns);
        }
        let exact_ns = shift_ns + self.rest_ns;
        let whole_ns = exact_ns.round();
        self.rest_ns = exact_ns - whole_ns;
        whole_ns as i64
    }

    /// Other gains, for tests of how far they are from where the loop would not hold.
    #[cfg(test)]
    pub fn with_gains(self, times: f64) -> Self {
        Self {
            proportional: self.proportional * times,
            integral: self.integral * times,
            ..self
        }
    }
}

#[cfg(test)]
#[path = "phase_tests.rs"]
mod tests;
