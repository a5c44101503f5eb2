//! `[planner.options]` of the planner.

use serde::Deserialize;
use tandem_sdk::{PluginError, parse_options};

/// The filter behind the interpolation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FilterKind {
    /// Moving average over the time constant: a step of feed becomes a linear ramp.
    #[default]
    Linear,
    /// First-order lag: a step of feed becomes an exponential.
    Exponential,
    /// Moving average over the time constant, then one over half of it: the ramp gets rounded ends.
    Bell,
}

/// The options.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Options {
    /// The filter, the same for every axis.
    pub filter: FilterKind,
    /// Its time constant, ms: 0.1 to 10000.
    pub time_constant_ms: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self { filter: FilterKind::Linear, time_constant_ms: 50.0 }
    }
}

impl Options {
    /// Reads and checks the TOML text of the options.
    ///
    /// # Errors
    /// An unknown key or filter, or a time constant out of range.
    pub fn parse(text: &str) -> Result<Self, PluginError> {
        let options: Self = parse_options(text)?;
        // The range is asked in this form because a comparison with NaN is false.
        if (0.1..=10_000.0).contains(&options.time_constant_ms) {
            return Ok(options);
        }
        Err(PluginError::new(format!("options: time_constant_ms = {}: must be 0.1 to 10000", options.time_constant_ms)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_read_and_checked() {
        assert_eq!(Options::parse("").unwrap(), Options::default());
        let bell = Options::parse("filter = \"bell\"\ntime_constant_ms = 30").unwrap();
        assert_eq!(bell, Options { filter: FilterKind::Bell, time_constant_ms: 30.0 });
        for (text, word) in [
            ("filter = \"parabolic\"", "parabolic"),
            ("time_constant_ms = 0", "time_constant_ms"),
            ("time_constant_ms = -5", "time_constant_ms"),
            ("time_constant_ms = nan", "time_constant_ms"),
            ("time_constant_s = 0.05", "time_constant_s"),
        ] {
            let message = Options::parse(text).unwrap_err().to_string();
            assert!(message.contains(word), "{text}: {message}");
        }
    }
}
