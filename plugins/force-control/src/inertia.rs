//! Inertia by recursive least squares.

/// Recursive least squares of one parameter with a forgetting factor, equations (16) and (17).
#[derive(Clone, Copy, Debug)]
pub struct Rls {
    forgetting: f64,
    covariance: f64,
    value: f64,
    squares: f64,
    weight: f64,
}

impl Rls {
    /// Starts at `value` with the covariance `covariance`; large ones mean that the start counts little. A forgetting factor of
    /// 1 forgets nothing.
    pub fn new(value: f64, covariance: f64, forgetting: f64) -> Self {
        Self {
            forgetting,
            covariance,
            value,
            squares: 0.0,
            weight: 0.0,
        }
    }

    /// Takes `input` and the `output` that is to be value × input.
    pub fn update(&mut self, input: f64, output: f64) {
        let scale = self.forgetting + self.covariance * input * input;
        let error = self.value * input - output;
        self.value -= self.covariance * input / scale * error;
        self.covariance /= scale;
        self.squares = self.forgetting * self.squares + error * error * self.forgetting / scale;
        self.weight = self.forgetting * self.weight + 1.0;
    }

    /// The value.
    pub fn value(&self) -> f64 {
        self.value
    }

    /// Its covariance, relative to that of the output's noise.
    pub fn covariance(&self) -> f64 {
        self.covariance
    }

    /// Standard deviation of the value, from the residuals; infinite before three samples.
    pub fn deviation(&self) -> f64 {
        if self.weight < 3.0 {
            f64::INFINITY
        } else {
            (self.squares / (self.weight - 1.0) * self.covariance).sqrt()
        }
    }
}

/// Acceleration and current over several periods, so that an encoder's counts do not drown the signal.
///
/// The acceleration is the second difference of the angle over `span` periods; the mean current that belongs to it exactly is
/// weighted by a triangle. What is regressed is their change over `span` periods: torque that stays the same drops out.
#[derive(Clone, Debug)]
pub struct Differences {
    span: usize,
    period_s: f64,
    min_speed_rad_per_s: f64,
    /// The last 3·span + 1 angles and the currents of the periods that end at them, newest first.
    rows: Vec<(f64, f64)>,
    seen: usize,
}

impl Differences {
    /// Differences over `span` periods; samples near a reversal, below `min_speed_rad_per_s`, are left out: Coulomb friction
    /// changes its sign there. Allocates; [`Differences::push`] does not.
    pub fn new(span: usize, period_s: f64, min_speed_rad_per_s: f64) -> Self {
        Self {
            span,
            period_s,
            min_speed_rad_per_s,
            rows: vec![(0.0, 0.0); 3 * span + 1],
            seen: 0,
        }
    }

    /// Takes the angle at the end of a period, rad, and the mean current of that period, A. Gives the change of the
    /// acceleration, rad/s², and that of the current, A, where the motor does not come near a reversal.
    pub fn push(&mut self, angle_rad: f64, current_a: f64) -> Option<(f64, f64)> {
        self.rows.rotate_right(1);
        self.rows[0] = (angle_rad, current_a);
        self.seen += 1;
        if self.seen < self.rows.len() || self.is_near_reversal() {
            return None;
        }
        let acceleration = self.acceleration(0) - self.acceleration(self.span);
        Some((acceleration, self.current_a(0) - self.current_a(self.span)))
    }

    /// Begins anew where samples are missing.
    pub fn restart(&mut self) {
        self.seen = 0;
    }

    fn acceleration(&self, ago: usize) -> f64 {
        let angle = |periods: usize| self.rows[ago + periods].0;
        let time_s = self.span as f64 * self.period_s;
        (angle(0) - 2.0 * angle(self.span) + angle(2 * self.span)) / (time_s * time_s)
    }

    fn current_a(&self, ago: usize) -> f64 {
        let span = self.span as f64;
        // Row i ended i periods ago: its current weighs as much as its middle is far from the triangle's end.
        let weight = |i: usize| {
            let middle = i as f64 + 0.5;
            if middle < span {
                middle
            } else {
                2.0 * span - middle
            }
        };
        (0..2 * self.span)
            .map(|i| weight(i) * self.rows[ago + i].1)
            .sum::<f64>()
            / (span * span)
    }

    /// Whether any speed over `span` periods is low: the window is as long as what the differences see.
    fn is_near_reversal(&self) -> bool {
        let time_s = self.span as f64 * self.period_s;
        let speed = |i: usize| (self.rows[i].0 - self.rows[i + self.span].0) / time_s;
        let first = speed(0);
        [0, self.span, 2 * self.span]
            .iter()
            .any(|i| speed(*i) * first.signum() < self.min_speed_rad_per_s)
    }
}
