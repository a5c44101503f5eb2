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
    /// Speed that it was told last, rad/s.
    command: f64,
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
        Self {
            speed: 0.0,
            angle: 0.0,
            kept,
            kept_s,
            period_s,
            command: 0.0,
        }
    }

    /// One period under the speed `command` (rad/s), exactly integrated. Fine loop; does not allocate.
    pub fn follow(&mut self, command: f64) {
        let error = self.speed - command;
        self.angle += command * self.period_s + error * self.kept_s;
        self.speed = command + error * self.kept;
        self.command = command;
    }

    /// Whether it turns as fast as it was told to, or stands where it was told to. Fine loop.
    pub fn is_at_speed(&self) -> bool {
        (self.speed - self.command).abs() <= AT_SPEED_SHARE * self.command.abs() + AT_REST_RAD_PER_S
    }
}

/// Share of its speed by which a spindle may be off while its drive says that it is there; drives come set to a few percent.
const AT_SPEED_SHARE: f64 = 0.02;

/// Speed below which a spindle stands, rad/s: ten turns a minute, what drives take for standstill.
const AT_REST_RAD_PER_S: f64 = 1.0;

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

    #[test]
    fn it_says_when_it_is_there() {
        let mut spindle = Spindle::new(0.1, 0.001);
        assert!(spindle.is_at_speed(), "it stands and is to stand");
        let up = (1..1000).find(|_| {
            spindle.follow(300.0);
            spindle.is_at_speed()
        });
        // 7 of 300 rad/s are left after 3.76 time constants.
        assert_eq!(up, Some(376));
        spindle.follow(0.0);
        assert!(!spindle.is_at_speed());
        let mut fast = Spindle::new(0.0, 0.001);
        fast.follow(-300.0);
        assert!(fast.is_at_speed());
    }
}
