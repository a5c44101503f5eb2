//! Friction of a servo axis.

use serde::{Deserialize, Serialize};

/// Speed over which Coulomb friction changes its sign, rad/s: the simulated axis creeps instead of sticking.
const SMOOTH_RAD_PER_S: f64 = 0.05;

/// Friction torque at the motor shaft: Coulomb, viscous and Stribeck, and a constant torque such as gravity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Friction {
    /// Coulomb friction, N·m.
    pub coulomb_nm: f64,
    /// Viscous friction, N·m·s/rad.
    pub viscous_nm_s_per_rad: f64,
    /// What friction at rest exceeds Coulomb friction by, N·m.
    pub stribeck_nm: f64,
    /// Speed at which the excess has fallen to 1/e, rad/s.
    pub stribeck_speed_rad_per_s: f64,
    /// Torque that does not depend on the speed, N·m: a vertical axis carries its weight.
    pub constant_nm: f64,
}

impl Default for Friction {
    fn default() -> Self {
        Self {
            coulomb_nm: 0.0,
            viscous_nm_s_per_rad: 0.0,
            stribeck_nm: 0.0,
            stribeck_speed_rad_per_s: 0.4,
            constant_nm: 0.0,
        }
    }
}

impl Friction {
    /// The torque that opposes motion at `speed_rad_per_s`, N·m.
    pub fn torque_nm(&self, speed_rad_per_s: f64) -> f64 {
        let sign = (speed_rad_per_s / SMOOTH_RAD_PER_S).tanh();
        let excess = (speed_rad_per_s / self.stribeck_speed_rad_per_s).powi(2);
        let level = self.coulomb_nm + self.stribeck_nm * (-excess).exp();
        level * sign + self.viscous_nm_s_per_rad * speed_rad_per_s + self.constant_nm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_shows_at_its_speed() {
        let friction = Friction {
            coulomb_nm: 0.06,
            viscous_nm_s_per_rad: 6e-4,
            stribeck_nm: 0.02,
            stribeck_speed_rad_per_s: 0.4,
            constant_nm: 0.1,
        };
        assert_eq!(friction.torque_nm(0.0), 0.1);
        assert!((friction.torque_nm(0.4) - (0.1 + 0.06 + 0.02 / 1f64.exp() + 2.4e-4)).abs() < 1e-6);
        assert!((friction.torque_nm(-31.4) - (0.1 - 0.06 - 6e-4 * 31.4)).abs() < 1e-12);
    }
}
