//! The simulated spindle.

/// A spindle whose speed follows its command with a lag of first order; the angle is its integral.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Spindle {
    /// Speed, rad/s.
    pub speed: f64,
    /// Angle since start, rad.
    pub angle: f64,
    /// Share of the speed error that is left after one period.
    kept: f64,
    /// Integral of that share over the period, s.
    kept_s: f64,
    period_s: f64,
}

impl Spindle {
    /// A spindle at rest; `time_constant_s = 0` follows at once.
    pub fn new(time_constant_s: f64, period_s: f64) -> Self {
        let (kept, kept_s) = if time_constant_s > 0.0 {
            let gone = -(-period_s / time_constant_s).exp_m1();
            (1.0 - gone, time_constant_s * gone)
        } else {
            (0.0, 0.0)
        };
        Self { speed: 0.0, angle: 0.0, kept, kept_s, period_s }
    }

    /// One period under the speed `command` (rad/s), exactly integrated. Fine loop; does not allocate.
    pub fn follow(&mut self, command: f64) {
        let error = self.speed - command;
        self.angle += command * self.period_s + error * self.kept_s;
        self.speed = command + error * self.kept;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_lag_it_follows_at_once() {
        let mut spindle = Spindle::new(0.0, 0.001);
        spindle.follow(300.0);
        assert_eq!((spindle.speed, spindle.angle), (300.0, 0.3));
    }

    #[test]
    fn first_order_lag_and_its_integral() {
        let (tau, period) = (0.2, 0.001);
        let mut spindle = Spindle::new(tau, period);
        (0..500).for_each(|_| spindle.follow(-100.0));
        let left = (-0.5_f64 / tau).exp();
        assert!((spindle.speed + 100.0 * (1.0 - left)).abs() < 1e-9);
        assert!((spindle.angle + 100.0 * (0.5 - tau * (1.0 - left))).abs() < 1e-9);
    }
}
