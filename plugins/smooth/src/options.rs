//! `[planner.options]` of the planner.

use serde::Deserialize;
use tandem_sdk::{PluginError, parse_options};

use crate::plan::Tuning;

/// The options. All have defaults that need no change; they exist to see what they do.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Options {
    /// Step of the grid in time, ms: 2 to 20.
    pub grid_ms: f64,
    /// Time that is planned at once, ms: 100 to 2000.
    pub window_ms: f64,
    /// Share of the tolerance that the first try uses: 0.5 to 1.
    pub tolerance_share: f64,
    /// Turns of smoothing and pacing: 1 to 8.
    pub rounds: u32,
}

impl Default for Options {
    fn default() -> Self {
        Self { grid_ms: 6.0, window_ms: 1000.0, tolerance_share: 0.955, rounds: 3 }
    }
}

impl Options {
    /// Reads and checks the TOML text of the options.
    ///
    /// # Errors
    /// An unknown key, or a value out of range.
    pub fn parse(text: &str) -> Result<Self, PluginError> {
        let options: Self = parse_options(text)?;
        // The ranges are asked in this form because a comparison with NaN is false.
        let ranges = [
            ("grid_ms", options.grid_ms, 2.0, 20.0),
            ("window_ms", options.window_ms, 100.0, 2000.0),
            ("tolerance_share", options.tolerance_share, 0.5, 1.0),
            ("rounds", f64::from(options.rounds), 1.0, 8.0),
        ];
        for (key, value, low, high) in ranges {
            if !(low..=high).contains(&value) {
                return Err(PluginError::new(format!("options: {key} = {value}: must be {low} to {high}")));
            }
        }
        Ok(options)
    }

    pub(crate) fn tuning(&self) -> Tuning {
        Tuning {
            step_s: self.grid_ms / 1000.0,
            window_s: self.window_ms / 1000.0,
            box_share: self.tolerance_share / crate::sites::BOX_SHARE,
            rounds: self.rounds as usize,
            repairs: 3,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_read_and_checked() {
        assert_eq!(Options::parse("").unwrap(), Options::default());
        assert_eq!(Options::parse("rounds = 2").unwrap().rounds, 2);
        for (text, word) in [
            ("grid_ms = 0.5", "grid_ms"),
            ("window_ms = nan", "window_ms"),
            ("tolerance_share = 1.1", "tolerance_share"),
            ("grid_s = 1", "grid_s"),
        ] {
            let message = Options::parse(text).unwrap_err().to_string();
            assert!(message.contains(word), "{text}: {message}");
        }
    }
}
