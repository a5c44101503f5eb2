//! The options of the strategy and what is refused.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tandem_sdk::{PluginError, StrategyContext};

use crate::friction::FrictionModel;
use crate::law::{Bounds, Law};
use crate::mean::window;
use crate::stability::LoopModel;

/// Wrong inertia within which the loop is shown to stay stable, %.
const MAX_INERTIA_DOUBT_PERCENT: f64 = 20.0;

/// The name of a law.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LawName {
    /// Proportional, as published: it leaves an offset.
    P,
    /// With an integral.
    #[default]
    Pi,
    /// Multiplicative.
    Ratio,
}

/// What is done with the torque.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// The feed follows it.
    #[default]
    Control,
    /// It is told and nothing else: the ratio is 1 and no guard holds.
    Observe,
}

tandem_sdk::options! {
    /// The keys of `[feed_strategy.options]`.
    pub struct Options {
        /// What is done with the torque: `control` sets the feed by it, `observe` tells it as a signal and does nothing else;
        /// then reference, feeds and `stability` may be left out.
        pub mode: Mode = Mode::Control,
        /// The law: `pi` and `ratio` hold the reference, `p` is the published one and leaves an offset.
        pub law: LawName = LawName::Pi,
        /// Torque to be held, N·m at the motor of the first axis listed; required but in mode `observe`.
        pub reference_torque_nm: Option<f64> = None,
        /// Gain of `p` and `pi`, (mm/min)/(N·m); 1500 and 1000 where left out.
        pub gain_mm_per_min_per_nm: Option<f64> = None,
        /// Integral gain of `pi`, (mm/min)/(N·m) a rough period.
        pub integral_gain_mm_per_min_per_nm: f64 = 50.0,
        /// Exponent of `ratio` a rough period.
        pub exponent: f64 = 0.05,
        /// Lowest feed, mm/min; required.
        pub min_feed_mm_per_min: Option<f64> = None,
        /// Highest feed, mm/min; required.
        pub max_feed_mm_per_min: Option<f64> = None,
        /// How fast the feed asked for changes, mm/s².
        pub feed_change_mm_per_s2: f64 = 100.0,
        /// Mean torque below which the tool is in air, N·m; a tenth of the reference where left out.
        pub air_torque_nm: Option<f64> = None,
        /// Feed in air, mm/min; the programmed one where left out.
        pub air_feed_mm_per_min: Option<f64> = None,
        /// Feed from which the law goes on where the tool enters material, mm/min; the programmed one where left out.
        pub entry_feed_mm_per_min: Option<f64> = None,
        /// Torque of the tool guard, N·m; twice the reference where left out.
        pub guard_torque_nm: Option<f64> = None,
        /// Fine samples in a row above it that trip the guard.
        pub guard_samples: u32 = 8,
        /// Time constant of the observer, ms.
        pub observer_time_constant_ms: f64 = 5.0,
        /// Teeth of the cutter: with the measured spindle speed, torque is averaged over whole tooth periods. Left out: over
        /// a rough period.
        pub teeth: Option<u32> = None,
        /// The axes that take the cutting force, by letter: a table of each; required.
        pub axes: BTreeMap<String, AxisOptions> = BTreeMap::new(),
        /// What is learned of the axes while they run in air.
        pub learning: LearningOptions = LearningOptions::default(),
        /// What the loop is, for the check at the start.
        pub stability: StabilityOptions = StabilityOptions::default(),
    }
}

/// An axis with a motor and a screw.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AxisOptions {
    /// Travel per turn of the motor, mm; required.
    pub lead_mm: Option<f64>,
    /// Torque constant, N·m/A; required.
    pub torque_constant_nm_per_a: Option<f64>,
    /// Share of the motor's work that reaches the table, 0 to 1.
    pub screw_efficiency: f64,
    /// Inertia at the motor, kg·m²; `tandem identify` finds it.
    pub inertia_kg_m2: Option<f64>,
    /// Friction at the motor; `tandem identify` finds it.
    pub friction: FrictionModel,
    /// How good the identified values are.
    pub confidence: Confidence,
}

/// What `tandem identify` says of its values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Confidence {
    /// Half-width of the 95 % interval of the inertia, %.
    pub inertia_percent: f64,
    /// Half-width of the 95 % interval of the Coulomb friction, N·m.
    pub coulomb_nm: f64,
    /// Residual of the friction model, N·m rms.
    pub friction_rms_nm: f64,
}

/// What is learned while the axes run in air.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LearningOptions {
    /// The proportion of an axis' friction to its model.
    pub friction: bool,
    /// The inertia of an axis.
    pub inertia: bool,
    /// What is left of a rough period's weight in the next: 0.998 forgets over 500 of them.
    pub friction_forgetting: f64,
    /// What is left of the weight of an acceleration in the next fine sample that has one.
    pub inertia_forgetting: f64,
    /// Torque of an axis, beyond its friction, below which it runs in air, as a share of that friction.
    pub air_share_of_friction: f64,
    /// The inertia of the first axis is a signal too.
    pub inertia_signal: bool,
}

/// The loop around the law.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StabilityOptions {
    /// Torque per feed at the deepest cut, N·m per mm/min; required.
    pub torque_per_feed_nm_min_per_mm: Option<f64>,
    /// Gain of the drives' position loop, 1/s.
    pub position_gain_per_s: f64,
    /// Bandwidth of their velocity loop, Hz.
    pub velocity_loop_hz: f64,
    /// Integral time of it, ms.
    pub velocity_integral_ms: f64,
    /// Longest time between two teeth, ms.
    pub tooth_period_ms: f64,
    /// Factor on the gains at which the loop must still be stable.
    pub gain_margin: f64,
}

impl Default for AxisOptions {
    fn default() -> Self {
        Self {
            lead_mm: None,
            torque_constant_nm_per_a: None,
            screw_efficiency: 1.0,
            inertia_kg_m2: None,
            friction: FrictionModel::default(),
            confidence: Confidence::default(),
        }
    }
}

impl Default for LearningOptions {
    fn default() -> Self {
        Self {
            friction: true,
            inertia: true,
            friction_forgetting: 0.998,
            inertia_forgetting: 0.999,
            air_share_of_friction: 0.4,
            inertia_signal: false,
        }
    }
}

impl Default for StabilityOptions {
    fn default() -> Self {
        Self {
            torque_per_feed_nm_min_per_mm: None,
            position_gain_per_s: 40.0,
            velocity_loop_hz: 50.0,
            velocity_integral_ms: 20.0,
            tooth_period_ms: 33.3,
            gain_margin: 1.25,
        }
    }
}

impl Options {
    /// Checks what a type cannot say, and the stability of the loop that the options make.
    ///
    /// # Errors
    /// A value that makes no sense or is missing, an axis that the machine does not have, a loop that is not stable, a
    /// machine on which it cannot tell which motor drives which axis.
    pub fn check(&self, context: &StrategyContext) -> Result<(), PluginError> {
        if context.joints_are_axes == 0 {
            return Err(PluginError::new(
                "it reads the current of each axis, and here currents are those of joints that are not the axes: it runs \
                 where each axis has one motor of its own",
            ));
        }
        if self.mode == Mode::Control {
            self.check_control()?;
        }
        self.check_estimate(context)?;
        match self.mode() {
            Mode::Control => self.check_stability(context),
            Mode::Observe => Ok(()),
        }
    }

    /// What the law and the guard need.
    fn check_control(&self) -> Result<(), PluginError> {
        let reference_nm = stated("reference_torque_nm", self.reference_torque_nm, 1e-6, 1e4)?;
        within(
            "gain_mm_per_min_per_nm",
            self.gain_mm_per_min_per_nm.unwrap_or(1.0),
            0.0,
            1e9,
        )?;
        within(
            "integral_gain_mm_per_min_per_nm",
            self.integral_gain_mm_per_min_per_nm,
            0.0,
            1e9,
        )?;
        within("exponent", self.exponent, 0.0, 1.0)?;
        let least = stated("min_feed_mm_per_min", self.min_feed_mm_per_min, 1e-3, 1e6)?;
        let most = stated("max_feed_mm_per_min", self.max_feed_mm_per_min, least, 1e6)?;
        within(
            "feed_change_mm_per_s2",
            self.feed_change_mm_per_s2,
            1e-3,
            1e6,
        )?;
        within("air_torque_nm", self.air_torque_nm(), 0.0, reference_nm)?;
        let feeds = [
            ("air_feed_mm_per_min", self.air_feed_mm_per_min),
            ("entry_feed_mm_per_min", self.entry_feed_mm_per_min),
        ];
        for (key, feed) in feeds {
            if let Some(feed) = feed {
                within(key, feed, least, most)?;
            }
        }
        within("guard_torque_nm", self.guard_torque_nm(), reference_nm, 1e6)?;
        within("guard_samples", f64::from(self.guard_samples), 1.0, 1e6)?;
        self.stability.check()
    }

    /// What the estimate of the torque needs.
    fn check_estimate(&self, context: &StrategyContext) -> Result<(), PluginError> {
        within(
            "observer_time_constant_ms",
            self.observer_time_constant_ms,
            1e-2,
            1e4,
        )?;
        within("teeth", f64::from(self.teeth.unwrap_or(1)), 1.0, 100.0)?;
        self.learning.check()?;
        if self.axes.is_empty() {
            return Err(refusal("axes", "no axis is listed"));
        }
        self.axes
            .iter()
            .try_for_each(|(letter, axis)| axis.check(letter, context))
    }

    /// What is done with the torque: a law without any gain observes.
    pub fn mode(&self) -> Mode {
        let idle = match self.law() {
            Law::Proportional { gain } => gain == 0.0,
            Law::Pi {
                gain,
                integral_gain,
            } => gain == 0.0 && integral_gain == 0.0,
            Law::Ratio { exponent } => exponent == 0.0,
        };
        if idle { Mode::Observe } else { self.mode }
    }

    /// Torque to be held, N·m; of checked options. Zero where it is only observed and none is stated.
    pub fn reference_nm(&self) -> f64 {
        self.reference_torque_nm.unwrap_or(0.0)
    }

    /// Mean torque below which the tool is in air, N·m.
    pub fn air_torque_nm(&self) -> f64 {
        self.air_torque_nm.unwrap_or(0.1 * self.reference_nm())
    }

    /// Torque of the tool guard, N·m.
    pub fn guard_torque_nm(&self) -> f64 {
        self.guard_torque_nm.unwrap_or(2.0 * self.reference_nm())
    }

    /// The law with its gains in mm/s.
    pub fn law(&self) -> Law {
        let gain = |default: f64| self.gain_mm_per_min_per_nm.unwrap_or(default) / 60.0;
        match self.law {
            LawName::P => Law::Proportional { gain: gain(1500.0) },
            LawName::Pi => Law::Pi {
                gain: gain(1000.0),
                integral_gain: self.integral_gain_mm_per_min_per_nm / 60.0,
            },
            LawName::Ratio => Law::Ratio {
                exponent: self.exponent,
            },
        }
    }

    /// What the law is bounded by.
    pub fn bounds(&self) -> Bounds {
        let mm_per_s = |mm_per_min: Option<f64>| mm_per_min.unwrap_or(f64::NAN) / 60.0;
        Bounds {
            reference_nm: self.reference_nm(),
            min_mm_per_s: mm_per_s(self.min_feed_mm_per_min),
            max_mm_per_s: mm_per_s(self.max_feed_mm_per_min),
        }
    }

    fn check_stability(&self, context: &StrategyContext) -> Result<(), PluginError> {
        let (law, stability) = (self.law(), &self.stability);
        let torque_per_feed = stability.torque_per_feed_nm_min_per_mm.unwrap_or(f64::NAN) * 60.0;
        let (reference_nm, asked) = (self.reference_nm(), stability.gain_margin);
        for (letter, axis) in &self.axes {
            let model = self.loop_model(axis, context);
            if model.growth(law.scaled(asked), torque_per_feed, reference_nm) < 1.0 {
                continue;
            }
            let most = model.gain_margin(law, torque_per_feed, reference_nm, asked);
            let what = format!(
                "with axis {letter} the loop is stable up to {most:.2} times these gains, and {asked} times is asked for: a \
                 cut as deep as that would make the feed swing"
            );
            return Err(refusal("stability.torque_per_feed_nm_min_per_mm", &what));
        }
        Ok(())
    }

    fn loop_model(&self, axis: &AxisOptions, context: &StrategyContext) -> LoopModel {
        let tooth_period_s = self.stability.tooth_period_ms * 1e-3;
        let per_rough = (context.rough_period_s / context.fine_period_s).round();
        let tooth = self.teeth.map(|_| tooth_period_s / context.fine_period_s);
        LoopModel {
            fine_period_s: context.fine_period_s,
            per_rough: per_rough as usize,
            inertia_kg_m2: axis.inertia_kg_m2.unwrap_or(1.0),
            torque_constant_nm_per_a: axis.torque_constant_nm_per_a.unwrap_or(1.0),
            lead_mm: axis.lead_mm.unwrap_or(1.0),
            position_gain_per_s: self.stability.position_gain_per_s,
            velocity_loop_hz: self.stability.velocity_loop_hz,
            velocity_integral_s: self.stability.velocity_integral_ms * 1e-3,
            observer_time_constant_s: self.observer_time_constant_ms * 1e-3,
            mean_samples: window(per_rough, tooth),
            tooth_period_s,
            latency: 1,
            delay_periods: context.delay_periods as usize,
            led: true,
        }
    }
}

impl AxisOptions {
    fn check(&self, letter: &str, context: &StrategyContext) -> Result<(), PluginError> {
        let name = |key: &str| format!("axes.{letter}.{key}");
        let index = letter
            .chars()
            .next()
            .filter(|_| letter.len() == 1)
            .and_then(|c| context.axes.index(c.to_ascii_uppercase()));
        let table = format!("axes.{letter}");
        match index {
            None => return Err(refusal(&table, "the machine has no such axis")),
            Some(index) if context.axes.is_rotary(index) => {
                return Err(refusal(
                    &table,
                    "a rotary axis has no screw that takes a cutting force",
                ));
            }
            Some(_) => {}
        }
        stated(&name("lead_mm"), self.lead_mm, 1e-3, 1e4)?;
        stated(
            &name("torque_constant_nm_per_a"),
            self.torque_constant_nm_per_a,
            1e-6,
            1e3,
        )?;
        within(&name("screw_efficiency"), self.screw_efficiency, 1e-3, 1.0)?;
        let Some(inertia_kg_m2) = self.inertia_kg_m2 else {
            let what = format!("missing: tandem identify --axis {letter} finds it");
            return Err(refusal(&name("inertia_kg_m2"), &what));
        };
        within(&name("inertia_kg_m2"), inertia_kg_m2, 1e-9, 1e3)?;
        let friction = &self.friction;
        within(&name("friction.coulomb_nm"), friction.coulomb_nm, 0.0, 1e3)?;
        within(
            &name("friction.viscous_nm_s_per_rad"),
            friction.viscous_nm_s_per_rad,
            -1e3,
            1e3,
        )?;
        within(
            &name("friction.stribeck_nm"),
            friction.stribeck_nm,
            0.0,
            1e3,
        )?;
        let min_speed = if friction.stribeck_nm > 0.0 {
            1e-6
        } else {
            0.0
        };
        within(
            &name("friction.stribeck_speed_rad_per_s"),
            friction.stribeck_speed_rad_per_s,
            min_speed,
            1e6,
        )?;
        within(
            &name("friction.constant_nm"),
            friction.constant_nm,
            -1e3,
            1e3,
        )?;
        within(
            &name("confidence.inertia_percent"),
            self.confidence.inertia_percent,
            0.0,
            MAX_INERTIA_DOUBT_PERCENT,
        )
    }
}

impl LearningOptions {
    fn check(&self) -> Result<(), PluginError> {
        let name = |key: &str| format!("learning.{key}");
        within(
            &name("friction_forgetting"),
            self.friction_forgetting,
            0.9,
            1.0,
        )?;
        within(
            &name("inertia_forgetting"),
            self.inertia_forgetting,
            0.9,
            1.0,
        )?;
        within(
            &name("air_share_of_friction"),
            self.air_share_of_friction,
            0.0,
            1.0,
        )
    }
}

impl StabilityOptions {
    fn check(&self) -> Result<(), PluginError> {
        let name = |key: &str| format!("stability.{key}");
        stated(
            &name("torque_per_feed_nm_min_per_mm"),
            self.torque_per_feed_nm_min_per_mm,
            1e-12,
            1e6,
        )?;
        within(
            &name("position_gain_per_s"),
            self.position_gain_per_s,
            1e-3,
            1e4,
        )?;
        within(&name("velocity_loop_hz"), self.velocity_loop_hz, 1e-3, 1e4)?;
        within(
            &name("velocity_integral_ms"),
            self.velocity_integral_ms,
            1e-3,
            1e9,
        )?;
        within(&name("tooth_period_ms"), self.tooth_period_ms, 0.1, 2000.0)?;
        within(&name("gain_margin"), self.gain_margin, 1.0, 100.0)
    }
}

fn within(key: &str, value: f64, low: f64, high: f64) -> Result<(), PluginError> {
    // A comparison with NaN is false, so NaN is refused as well.
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(refusal(key, &format!("{value}: must be {low} to {high}")))
}

/// The value of an option that has no default.
fn stated(key: &str, value: Option<f64>, low: f64, high: f64) -> Result<f64, PluginError> {
    let value = value.ok_or_else(|| refusal(key, "missing, and there is no default"))?;
    within(key, value, low, high).map(|()| value)
}

fn refusal(key: &str, what: &str) -> PluginError {
    PluginError::of_option(key, what)
}
