//! One servo axis: position and velocity loop, current limit, motor, friction, encoder.

use std::f64::consts::TAU;

use tandem_random::Random;

use super::options::ServoOptions;

/// Time between two plant steps is the step of the integration; the loops act once a fine period.
///
/// In every period: [`ServoAxis::measure`], [`ServoAxis::control`], then [`ServoAxis::step`] once a plant step. Nothing here
/// allocates.
#[derive(Clone, Debug)]
pub struct ServoAxis {
    /// What it is made of. May be changed between two steps.
    pub options: ServoOptions,
    /// Angle of the motor, rad.
    pub angle_rad: f64,
    /// Speed of the motor, rad/s.
    pub speed_rad_per_s: f64,
    /// Current since the last [`ServoAxis::control`], A.
    pub current_a: f64,
    integral_nm: f64,
    measured: Measured,
    period_s: f64,
    noise: Random,
}

/// What the encoder says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Angle, rad.
    pub angle_rad: f64,
    /// Speed, rad/s: with an encoder, the difference of two angles over the period.
    pub speed_rad_per_s: f64,
}

impl ServoAxis {
    /// An axis at rest at `angle_rad`.
    pub fn new(options: ServoOptions, angle_rad: f64, period_s: f64, seed: u64) -> Self {
        let mut this = Self {
            options,
            angle_rad,
            speed_rad_per_s: 0.0,
            current_a: 0.0,
            integral_nm: 0.0,
            measured: Measured::default(),
            period_s,
            noise: Random::new(seed),
        };
        this.rest_at(angle_rad, 0.0);
        this
    }

    /// Puts the axis somewhere, as its brake does; the loops begin anew.
    pub fn rest_at(&mut self, angle_rad: f64, speed_rad_per_s: f64) {
        (self.angle_rad, self.speed_rad_per_s) = (angle_rad, speed_rad_per_s);
        (self.integral_nm, self.current_a) = (0.0, 0.0);
        self.measured = Measured {
            angle_rad: self.quantised(),
            speed_rad_per_s,
        };
    }

    fn quantised(&self) -> f64 {
        let counts = f64::from(self.options.encoder_counts);
        if counts == 0.0 {
            self.angle_rad
        } else {
            (self.angle_rad * counts / TAU).floor() * TAU / counts
        }
    }

    /// Reads the encoder, once a period.
    pub fn measure(&mut self) -> Measured {
        let angle_rad = self.quantised();
        let speed_rad_per_s = if self.options.encoder_counts == 0 {
            self.speed_rad_per_s
        } else {
            (angle_rad - self.measured.angle_rad) / self.period_s
        };
        self.measured = Measured {
            angle_rad,
            speed_rad_per_s,
        };
        self.measured
    }

    /// The angle, rad, and speed, rad/s, read last.
    pub fn measured(&self) -> Measured {
        self.measured
    }

    /// The loops, once a period, after [`ServoAxis::measure`]: sets the current for the period.
    pub fn control(&mut self, angle_rad: f64, speed_rad_per_s: f64) {
        let options = &self.options;
        let wanted = options.position_gain_per_s * (angle_rad - self.measured.angle_rad)
            + options.velocity_feed_forward * speed_rad_per_s;
        let error = wanted - self.measured.speed_rad_per_s;
        let inertia = options.tuned_inertia_kg_m2.unwrap_or(options.inertia_kg_m2);
        let gain = inertia * TAU * options.velocity_loop_hz;
        let integral_nm =
            self.integral_nm + gain / (options.velocity_integral_ms * 1e-3) * self.period_s * error;
        let current_a = (gain * error + integral_nm) / options.torque_constant_nm_per_a;
        self.current_a = current_a.clamp(-options.peak_current_a, options.peak_current_a);
        if current_a == self.current_a {
            self.integral_nm = integral_nm;
        }
    }

    /// One plant step of `step_s` under the cutting torque `load_nm`, which opposes positive motion where positive.
    pub fn step(&mut self, load_nm: f64, step_s: f64) {
        let options = &self.options;
        let friction_nm = options.friction.torque_nm(self.speed_rad_per_s);
        let torque_nm = options.torque_constant_nm_per_a * self.current_a - load_nm - friction_nm;
        self.speed_rad_per_s += step_s * torque_nm / options.inertia_kg_m2;
        self.angle_rad += step_s * self.speed_rad_per_s;
    }

    /// The current as the drive measures it, A.
    pub fn measured_current_a(&mut self) -> f64 {
        let noise_a = self.options.current_noise_ma * 1e-3;
        if noise_a == 0.0 {
            self.current_a
        } else {
            self.current_a + noise_a * self.noise.normal()
        }
    }

    /// Torque at the motor per force at the table, N·m per N: lead/(2π) over the efficiency of the screw.
    pub fn torque_per_force_m(&self) -> f64 {
        self.options.lead_mm * 1e-3 / (TAU * self.options.screw_efficiency)
    }
}
