//! The friction model that is taken out of the estimate.

use serde::{Deserialize, Serialize};

/// Speed over which Coulomb friction changes its sign, rad/s.
const SMOOTH_RAD_PER_S: f64 = 0.05;

/// Coulomb, viscous and Stribeck friction at the motor shaft, and a constant torque.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct FrictionModel {
    /// Coulomb friction, N·m.
    pub coulomb_nm: f64,
    /// Viscous friction, N·m·s/rad.
    pub viscous_nm_s_per_rad: f64,
    /// What friction at low speed exceeds Coulomb friction by, N·m.
    pub stribeck_nm: f64,
    /// Speed at which the excess has fallen to 1/e, rad/s; without effect where there is no excess.
    pub stribeck_speed_rad_per_s: f64,
    /// Torque in both directions, N·m: weight.
    pub constant_nm: f64,
}

impl FrictionModel {
    /// The torque that opposes motion at the commanded speed, N·m. The commanded one: at cutting feeds the speed from an
    /// encoder toggles between no count and one.
    pub fn torque_nm(&self, speed_rad_per_s: f64) -> f64 {
        let smooth = speed_rad_per_s / SMOOTH_RAD_PER_S;
        // Beyond that tanh is 1 to 16 digits, and exp(−40) nothing.
        let sign = if smooth.abs() > 20.0 {
            smooth.signum()
        } else {
            smooth.tanh()
        };
        let excess = (speed_rad_per_s / self.stribeck_speed_rad_per_s).powi(2);
        let stribeck_nm = if excess < 40.0 {
            self.stribeck_nm * (-excess).exp()
        } else {
            0.0
        };
        (self.coulomb_nm + stribeck_nm) * sign
            + self.viscous_nm_s_per_rad * speed_rad_per_s
            + self.constant_nm
    }

    /// The torque that friction may hold at rest, in either direction, N·m.
    pub fn holding_nm(&self) -> f64 {
        self.coulomb_nm + self.stribeck_nm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shortcuts_change_nothing() {
        let model = FrictionModel {
            coulomb_nm: 0.06,
            viscous_nm_s_per_rad: 6e-4,
            stribeck_nm: 0.02,
            stribeck_speed_rad_per_s: 0.4,
            constant_nm: -0.01,
        };
        for step in -4000..=4000_i32 {
            let speed = f64::from(step) * 1e-3;
            let level = 0.06 + 0.02 * (-(speed / 0.4).powi(2)).exp();
            let whole = level * (speed / 0.05).tanh() + 6e-4 * speed - 0.01;
            assert!((model.torque_nm(speed) - whole).abs() < 1e-15, "{speed}");
        }
        assert_eq!(
            FrictionModel::default().torque_nm(3.0),
            0.0,
            "no friction needs no speeds"
        );
    }
}
