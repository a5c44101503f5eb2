//! The reduced-order disturbance observer.

/// Estimates the torque that opposes a motor from its current and speed, one period late and through a low-pass of first
/// order. Equations (9) and (10) of Song, Son, Kwon and Kim, with a negative gain, as stability asks for.
///
/// Does not allocate.
#[derive(Clone, Copy, Debug)]
pub struct Observer {
    gain: f64,
    kept: f64,
    of_speed: f64,
    of_current: f64,
    next_eta: f64,
    estimate_nm: f64,
    begun: bool,
}

impl Observer {
    /// An observer for a motor of `inertia_kg_m2` and `torque_constant_nm_per_a` with samples `period_s` apart. A step of
    /// the torque is 63 % seen after `time_constant_s`.
    pub fn new(
        inertia_kg_m2: f64,
        torque_constant_nm_per_a: f64,
        period_s: f64,
        time_constant_s: f64,
    ) -> Self {
        let kept = (-period_s / time_constant_s).exp();
        let gain = -(1.0 - kept) * inertia_kg_m2 / period_s;
        let per_inertia = period_s / inertia_kg_m2;
        Self {
            gain,
            kept,
            of_speed: gain * gain * per_inertia,
            of_current: gain * torque_constant_nm_per_a * per_inertia,
            next_eta: 0.0,
            estimate_nm: 0.0,
            begun: false,
        }
    }

    /// The gain, N·m·s/rad: negative. The observer is stable above −2·inertia/period.
    pub fn gain(&self) -> f64 {
        self.gain
    }

    /// The estimate, N·m, after a period that ends at `speed_rad_per_s` and had the mean current `current_a`. The first call
    /// only takes the speed.
    pub fn step(&mut self, speed_rad_per_s: f64, current_a: f64) -> f64 {
        if !self.begun {
            self.restart(speed_rad_per_s);
            return self.estimate_nm;
        }
        let eta = self.next_eta - self.of_current * current_a;
        self.estimate_nm = eta + self.gain * speed_rad_per_s;
        self.prepare(eta, speed_rad_per_s);
        self.estimate_nm
    }

    /// All of η(k + 1) but the current of the period from k to k + 1.
    fn prepare(&mut self, eta: f64, speed_rad_per_s: f64) {
        self.next_eta = self.kept * eta + self.of_speed * speed_rad_per_s;
    }

    /// Goes on from `speed_rad_per_s` with the estimate as it is, where samples are missing.
    pub fn restart(&mut self, speed_rad_per_s: f64) {
        self.begun = true;
        let eta = self.estimate_nm - self.gain * speed_rad_per_s;
        self.prepare(eta, speed_rad_per_s);
    }

    /// Goes on with another inertia from `speed_rad_per_s`, with the estimate as it is.
    pub fn set_inertia(
        &mut self,
        inertia_kg_m2: f64,
        torque_constant_nm_per_a: f64,
        (period_s, time_constant_s): (f64, f64),
        speed_rad_per_s: f64,
    ) {
        let (estimate_nm, begun) = (self.estimate_nm, self.begun);
        *self = Self::new(
            inertia_kg_m2,
            torque_constant_nm_per_a,
            period_s,
            time_constant_s,
        );
        self.estimate_nm = estimate_nm;
        if begun {
            self.restart(speed_rad_per_s);
        }
    }

    /// Multiplies everything remembered: the observer is linear.
    pub(crate) fn scale(&mut self, factor: f64) {
        self.next_eta *= factor;
        self.estimate_nm *= factor;
    }

    /// The estimate, N·m.
    pub fn estimate_nm(&self) -> f64 {
        self.estimate_nm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The low-pass of the torque residual that the observer is, written out.
    fn residual(last: f64, kept: f64, speeds: [f64; 2], current: f64) -> f64 {
        kept * last + (1.0 - kept) * (0.378 * current - 1.842e-4 * (speeds[1] - speeds[0]) / 1e-3)
    }

    #[test]
    fn it_is_a_low_pass_of_the_torque_residual() {
        let mut observer = Observer::new(1.842e-4, 0.378, 1e-3, 5e-3);
        let kept = (-0.2_f64).exp();
        let (mut expected, mut last) = (0.0, 0.0);
        observer.step(0.0, 0.0);
        for k in 1..500 {
            let speed = (f64::from(k) * 0.37).sin() * 20.0;
            let current = (f64::from(k) * 0.11).cos();
            expected = residual(expected, kept, [last, speed], current);
            last = speed;
            assert!((observer.step(speed, current) - expected).abs() < 1e-13);
        }
    }

    #[test]
    fn another_inertia_is_no_torque() {
        let mut observer = Observer::new(1.842e-4, 0.378, 1e-3, 5e-3);
        // A ramp of 100 rad/s² with half of the inertia that it takes.
        let ramp = |observer: &mut Observer, from: i32| {
            let steps = from..from + 200;
            steps.fold(0.0, |_, k| {
                observer.step(0.1 * f64::from(k), 3.684e-4 * 100.0 / 0.378)
            })
        };
        assert!((ramp(&mut observer, 0) - 1.842e-2).abs() < 1e-6);
        observer.set_inertia(3.684e-4, 0.378, (1e-3, 5e-3), 19.9);
        assert!((observer.estimate_nm() - 1.842e-2).abs() < 1e-6);
        assert!(ramp(&mut observer, 200).abs() < 1e-6);
    }

    #[test]
    fn a_gap_keeps_the_estimate() {
        let mut observer = Observer::new(1.842e-4, 0.378, 1e-3, 5e-3);
        let _ = (0..200).map(|_| observer.step(5.0, 0.1 / 0.378)).last();
        assert!((observer.estimate_nm() - 0.1).abs() < 1e-9);
        observer.restart(90.0);
        assert!(
            (observer.step(90.0, 0.1 / 0.378) - 0.1).abs() < 1e-9,
            "a jump over a gap is no acceleration"
        );
    }
}
