//! `[planner.options]` of the planner.

use serde::{Deserialize, Serialize};
use tandem_sdk::PluginError;

/// The filter behind the interpolation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
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

tandem_sdk::options! {
    /// The options.
    #[derive(Copy)]
    pub struct Options {
        /// The filter, the same for every axis.
        pub filter: FilterKind = FilterKind::Linear,
        /// Its time constant, ms: 0.1 to 10000.
        pub time_constant_ms: f64 = 50.0,
    }
}

impl Options {
    /// Checks what a type cannot say.
    ///
    /// # Errors
    /// A time constant out of range.
    pub fn check(&self) -> Result<(), PluginError> {
        // The range is asked in this form because a comparison with NaN is false.
        if (0.1..=10_000.0).contains(&self.time_constant_ms) {
            return Ok(());
        }
        let wrong = format!("{}: must be 0.1 to 10000", self.time_constant_ms);
        Err(PluginError::of_option("time_constant_ms", wrong))
    }
}

#[cfg(test)]
mod tests {
    use tandem_sdk::PluginOptions;

    use super::*;

    fn parse(text: &str) -> Result<Options, PluginError> {
        let options = Options::read(text)?;
        options.check().map(|()| options)
    }

    #[test]
    fn options_are_read_and_checked() {
        assert_eq!(parse("").unwrap(), Options::default());
        let bell = parse("filter = \"bell\"\ntime_constant_ms = 30").unwrap();
        assert_eq!(
            bell,
            Options {
                filter: FilterKind::Bell,
                time_constant_ms: 30.0
            }
        );
        for (text, word) in [
            ("filter = \"parabolic\"", "parabolic"),
            ("time_constant_ms = 0", "time_constant_ms"),
            ("time_constant_ms = -5", "time_constant_ms"),
            ("time_constant_ms = nan", "time_constant_ms"),
            ("time_constant_s = 0.05", "time_constant_s"),
        ] {
            let message = parse(text).unwrap_err().to_string();
            assert!(message.contains(word), "{text}: {message}");
        }
    }
}
