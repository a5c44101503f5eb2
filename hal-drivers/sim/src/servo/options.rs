//! Options of servo axes and of the cutting process.

use serde::{Deserialize, Serialize};
use tandem_sdk::PluginError;

use super::friction::Friction;
use super::workpiece::{Profile, Workpiece};
use crate::options::{refusal, within};

/// A servo axis. The defaults are those of a 100 W motor on a screw of 20 mm lead without friction and with an exact encoder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ServoOptions {
    /// Inertia of motor, coupling, screw and table at the motor shaft, kg·m².
    pub inertia_kg_m2: f64,
    /// Inertia that the velocity loop was tuned for, kg·m²; left out: the true one.
    pub tuned_inertia_kg_m2: Option<f64>,
    /// Torque constant, N·m/A.
    pub torque_constant_nm_per_a: f64,
    /// Greatest current, A.
    pub peak_current_a: f64,
    /// Travel per turn of the motor, mm.
    pub lead_mm: f64,
    /// Share of the motor's work that reaches the table, 0 to 1.
    pub screw_efficiency: f64,
    /// Counts per turn; 0 is an exact angle and speed.
    pub encoder_counts: u32,
    /// Noise of the measured current, mA rms.
    pub current_noise_ma: f64,
    /// Gain of the position loop, 1/s.
    pub position_gain_per_s: f64,
    /// Share of the commanded speed that is fed forward to the velocity loop, 0 to 1.
    pub velocity_feed_forward: f64,
    /// Bandwidth of the velocity loop, Hz.
    pub velocity_loop_hz: f64,
    /// Integral time of the velocity loop, ms.
    pub velocity_integral_ms: f64,
    /// Friction at the motor shaft.
    pub friction: Friction,
}

impl Default for ServoOptions {
    fn default() -> Self {
        Self {
            inertia_kg_m2: 1.842e-4,
            tuned_inertia_kg_m2: None,
            torque_constant_nm_per_a: 0.378,
            peak_current_a: 2.54,
            lead_mm: 20.0,
            screw_efficiency: 1.0,
            encoder_counts: 0,
            current_noise_ma: 0.0,
            position_gain_per_s: 40.0,
            velocity_feed_forward: 0.0,
            velocity_loop_hz: 50.0,
            velocity_integral_ms: 20.0,
            friction: Friction::default(),
        }
    }
}

impl ServoOptions {
    pub(crate) fn check(&self, index: usize) -> Result<(), PluginError> {
        let key = |name: &str| format!("servo[{index}].{name}");
        within(&key("inertia_kg_m2"), self.inertia_kg_m2, 1e-9, 1e3)?;
        within(
            &key("tuned_inertia_kg_m2"),
            self.tuned_inertia_kg_m2.unwrap_or(1.0),
            1e-9,
            1e3,
        )?;
        within(
            &key("torque_constant_nm_per_a"),
            self.torque_constant_nm_per_a,
            1e-6,
            1e3,
        )?;
        within(&key("peak_current_a"), self.peak_current_a, 1e-6, 1e4)?;
        within(&key("lead_mm"), self.lead_mm, 1e-3, 1e4)?;
        within(&key("screw_efficiency"), self.screw_efficiency, 1e-3, 1.0)?;
        within(
            &key("encoder_counts"),
            f64::from(self.encoder_counts),
            0.0,
            4.3e9,
        )?;
        within(&key("current_noise_ma"), self.current_noise_ma, 0.0, 1e6)?;
        within(
            &key("position_gain_per_s"),
            self.position_gain_per_s,
            1e-3,
            1e4,
        )?;
        within(
            &key("velocity_feed_forward"),
            self.velocity_feed_forward,
            0.0,
            1.0,
        )?;
        within(&key("velocity_loop_hz"), self.velocity_loop_hz, 1e-3, 1e4)?;
        within(
            &key("velocity_integral_ms"),
            self.velocity_integral_ms,
            1e-3,
            1e9,
        )?;
        let friction = &self.friction;
        within(&key("friction.coulomb_nm"), friction.coulomb_nm, 0.0, 1e3)?;
        within(
            &key("friction.viscous_nm_s_per_rad"),
            friction.viscous_nm_s_per_rad,
            0.0,
            1e3,
        )?;
        within(&key("friction.stribeck_nm"), friction.stribeck_nm, 0.0, 1e3)?;
        within(
            &key("friction.stribeck_speed_rad_per_s"),
            friction.stribeck_speed_rad_per_s,
            1e-6,
            1e6,
        )?;
        within(
            &key("friction.constant_nm"),
            friction.constant_nm,
            -1e3,
            1e3,
        )
    }
}

/// The cutting process. Without a workpiece nothing is cut.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CuttingOptions {
    /// Cutting force per area of the chip, N/mm²: force = this × depth × feed per tooth.
    #[serde(default = "specific_force")]
    pub specific_force_n_per_mm2: f64,
    /// Where stated, that force follows from the shear in front of the edge instead.
    #[serde(default)]
    pub merchant: Option<Merchant>,
    /// Teeth of the cutter.
    #[serde(default = "teeth")]
    pub teeth: u32,
    /// Share by which the force rises and falls with the angle of the teeth, 0 to 1.
    #[serde(default)]
    pub tooth_ripple: f64,
    /// Where material is.
    pub workpiece: Workpiece,
}

/// 0.1 N·m at the motor of a 20 mm screw for 3 mm at 150 mm/min with 30 teeth a second.
fn specific_force() -> f64 {
    125.663_706_143_591_73
}

/// Merchant's model of the chip: it shears in a plane, and slides off the face of the tool.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Merchant {
    /// Shear stress in the plane, N/mm².
    pub shear_stress_n_per_mm2: f64,
    /// Angle of friction between chip and tool, degrees.
    pub friction_angle_deg: f64,
    /// Rake of the tool, degrees.
    #[serde(default)]
    pub rake_angle_deg: f64,
    /// Angle of the plane against the motion, degrees; the one that takes the least force where it is left out.
    #[serde(default)]
    pub shear_angle_deg: Option<f64>,
}

impl Merchant {
    /// Resultant force per area of the chip, N/mm²: `S / (sin φ · cos(φ + β − α))`.
    pub fn specific_force_n_per_mm2(&self) -> f64 {
        let leans_deg = self.friction_angle_deg - self.rake_angle_deg;
        let shear_deg = self.shear_angle_deg.unwrap_or(45.0 - leans_deg / 2.0);
        let along = (shear_deg + leans_deg).to_radians().cos();
        self.shear_stress_n_per_mm2 / (shear_deg.to_radians().sin() * along)
    }

    fn check(&self) -> Result<(), PluginError> {
        let key = |name: &str| format!("cutting.merchant.{name}");
        let stress = self.shear_stress_n_per_mm2;
        within(&key("shear_stress_n_per_mm2"), stress, 0.0, 1e6)?;
        within(
            &key("friction_angle_deg"),
            self.friction_angle_deg,
            0.0,
            89.0,
        )?;
        within(&key("rake_angle_deg"), self.rake_angle_deg, -45.0, 45.0)?;
        if let Some(angle) = self.shear_angle_deg {
            within(&key("shear_angle_deg"), angle, 1.0, 89.0)?;
        }
        let force = self.specific_force_n_per_mm2();
        if (0.0..=1e6).contains(&force) {
            return Ok(());
        }
        Err(refusal(
            "cutting.merchant",
            "with these angles no force is large enough to shear the chip",
        ))
    }
}

fn teeth() -> u32 {
    2
}

impl CuttingOptions {
    /// Cutting force per area of the chip, N/mm².
    pub(crate) fn force_per_area(&self) -> f64 {
        self.merchant.as_ref().map_or(
            self.specific_force_n_per_mm2,
            Merchant::specific_force_n_per_mm2,
        )
    }

    pub(crate) fn check(&self) -> Result<(), PluginError> {
        within(
            "cutting.specific_force_n_per_mm2",
            self.specific_force_n_per_mm2,
            0.0,
            1e6,
        )?;
        if let Some(merchant) = &self.merchant {
            merchant.check()?;
        }
        within("cutting.teeth", f64::from(self.teeth), 1.0, 100.0)?;
        within("cutting.tooth_ripple", self.tooth_ripple, 0.0, 1.0)?;
        let finite = self.workpiece.origin_mm.iter().all(|v| v.is_finite())
            && self.workpiece.direction_deg.is_finite();
        if !finite {
            return Err(refusal(
                "cutting.workpiece",
                "origin_mm and direction_deg are numbers",
            ));
        }
        within(
            "cutting.workpiece.entry_radius_mm",
            self.workpiece.entry_radius_mm,
            0.0,
            1e4,
        )?;
        self.workpiece
            .profile()
            .map(|_: Profile| ())
            .map_err(|what| refusal("cutting.workpiece", &what))
    }
}
