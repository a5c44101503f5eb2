//! The options of the simulated drives and what is refused.

use serde::Deserialize;
use tandem_sdk::{PluginError, parse_options};

/// How a joint follows its setpoint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Model {
    /// The feedback is the setpoint of the same exchange; no motor current.
    #[default]
    Ideal,
    /// A position servo of second order: x″ = ω²·(setpoint − x) − 2ζω·x′.
    SecondOrder,
}

/// A simulated switch: its input is 1 while the joint stands above a position. A touch plane for probing and homing.
///
/// Several switches may share an input; it is 1 while any of them is on.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Switch {
    /// Number of the digital input, 0 to 63.
    pub input: u32,
    /// Number of the (linear) joint, from 0.
    pub joint: usize,
    /// The input is 1 while the joint's position is greater than this, mm.
    pub above_mm: f64,
}

/// Options of the simulated drives; the keys of `[driver.options]`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Options {
    /// How the joints follow.
    pub model: Model,
    /// Undamped natural frequency of a second-order joint, Hz. Without effect on ideal ones.
    pub natural_frequency_hz: f64,
    /// Damping ratio ζ of a second-order joint: below 1 it overshoots. Without effect on ideal ones.
    pub damping_ratio: f64,
    /// Time constant with which the spindle's speed follows its command, s; 0: at once.
    pub spindle_time_constant_s: f64,
    /// Deceleration with which every joint stops by itself: in a quick stop, and when the drives are let go, mm/s².
    pub quick_stop_deceleration_mm_per_s2: f64,
    /// How many fine periods in a row may pass without a new setpoint (an exchange with a new tick) before the drives
    /// stop by themselves, 0 to 100; 0: they never do.
    pub watchdog_periods: u32,
    /// Simulated switches on the digital inputs; all other inputs are 0.
    pub switches: Vec<Switch>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            model: Model::Ideal,
            natural_frequency_hz: 30.0,
            damping_ratio: 0.7,
            spindle_time_constant_s: 0.0,
            quick_stop_deceleration_mm_per_s2: 5000.0,
            watchdog_periods: 5,
            switches: Vec::new(),
        }
    }
}

impl Options {
    /// Reads and checks the TOML text of the options.
    ///
    /// # Errors
    /// An unknown key, a wrong type, or a value that makes no sense, with the reason.
    pub fn parse(text: &str) -> Result<Self, PluginError> {
        let options: Self = parse_options(text)?;
        options.check()?;
        Ok(options)
    }

    fn check(&self) -> Result<(), PluginError> {
        // The bounds keep the closed form of the servo far from overflow and underflow at any fine period.
        within("natural_frequency_hz", self.natural_frequency_hz, 1e-3, 1e5)?;
        within("damping_ratio", self.damping_ratio, 1e-3, 1e3)?;
        within("quick_stop_deceleration_mm_per_s2", self.quick_stop_deceleration_mm_per_s2, 1e-3, 1e9)?;
        within("spindle_time_constant_s", self.spindle_time_constant_s, 0.0, 1e4)?;
        within("watchdog_periods", f64::from(self.watchdog_periods), 0.0, 100.0)?;
        self.switches.iter().try_for_each(Switch::check)
    }
}

impl Switch {
    fn check(&self) -> Result<(), PluginError> {
        if self.input > 63 {
            return Err(refusal(&format!("switches: input = {}: the inputs are 0 to 63", self.input)));
        }
        if !self.above_mm.is_finite() {
            return Err(refusal(&format!("switches: above_mm = {}: not a position", self.above_mm)));
        }
        Ok(())
    }
}

fn within(key: &str, value: f64, low: f64, high: f64) -> Result<(), PluginError> {
    // A comparison with NaN is false, so NaN is refused as well.
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(refusal(&format!("{key} = {value}: must be {low} to {high}")))
}

fn refusal(what: &str) -> PluginError {
    PluginError::new(format!("options: {what}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_ideal() {
        assert_eq!(Options::parse("").unwrap(), Options::default());
        assert_eq!(Options::default().model, Model::Ideal);
    }

    #[test]
    fn every_key_is_read() {
        let text = "model = \"second-order\"\nnatural_frequency_hz = 12\ndamping_ratio = 1.5\n\
                    spindle_time_constant_s = 0.25\nquick_stop_deceleration_mm_per_s2 = 800\nwatchdog_periods = 9\n\
                    [[switches]]\ninput = 3\njoint = 1\nabove_mm = 12.5\n";
        let options = Options::parse(text).unwrap();
        assert_eq!(options.model, Model::SecondOrder);
        assert_eq!((options.natural_frequency_hz, options.damping_ratio), (12.0, 1.5));
        assert_eq!((options.spindle_time_constant_s, options.quick_stop_deceleration_mm_per_s2), (0.25, 800.0));
        assert_eq!(options.watchdog_periods, 9);
        assert_eq!(options.switches, [Switch { input: 3, joint: 1, above_mm: 12.5 }]);
    }

    #[test]
    fn nonsense_is_refused_by_name() {
        let cases = [
            ("natural_frequency_hz = 0", "natural_frequency_hz"),
            ("natural_frequency_hz = nan", "natural_frequency_hz"),
            ("damping_ratio = -0.1", "damping_ratio"),
            ("damping_ratio = inf", "damping_ratio"),
            ("spindle_time_constant_s = -1", "spindle_time_constant_s"),
            ("quick_stop_deceleration_mm_per_s2 = 0", "quick_stop_deceleration_mm_per_s2"),
            ("watchdog_periods = 101", "0 to 100"),
            ("frequency_hz = 3", "frequency_hz"),
            ("model = \"third-order\"", "third-order"),
            ("[[switches]]\ninput = 64\njoint = 0\nabove_mm = 1", "0 to 63"),
            ("[[switches]]\ninput = 1\njoint = 0\nabove_mm = nan", "above_mm"),
            ("[[switches]]\ninput = 1\njoint = 0", "above_mm"),
            ("[[switches]]\ninput = 1\njoint = -1\nabove_mm = 1", "-1"),
        ];
        for (text, word) in cases {
            let message = Options::parse(text).unwrap_err().to_string();
            assert!(message.contains(word), "{text}: {message}");
        }
    }
}
