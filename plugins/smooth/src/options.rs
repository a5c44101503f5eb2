//! `[planner.options]` of the planner.

use tandem_sdk::{PluginError, PluginOptions};

use crate::tuning::Tuning;

tandem_sdk::options! {
    /// The options. All have defaults that need no change; they exist to see what they do.
    #[derive(Copy)]
    pub struct Options {
        /// Step of the grid in time, ms: 0.5 to 20; with 0 it follows from tolerance, jerk and acceleration.
        pub grid_ms: f64 = 0.0,
        /// Time that is planned at once, ms: 100 to 5000; with 0 it follows from acceleration and jerk.
        pub window_ms: f64 = 0.0,
        /// Share of the tolerance that the first try uses: 0.5 to 1.
        pub tolerance_share: f64 = 0.955,
        /// Turns of smoothing and retiming for a window in motion; one that goes at its feed all the way has one, one from rest twice as
        /// many: 1 to 8.
        pub rounds: u32 = 2,
    }
}

impl Options {
    /// Reads and checks the TOML text of the options.
    ///
    /// # Errors
    /// An unknown key, or a value out of range.
    pub fn parse(text: &str) -> Result<Self, PluginError> {
        let options = Self::read(text)?;
        options.check().map(|()| options)
    }

    /// Checks what a type cannot say.
    ///
    /// # Errors
    /// A value out of range.
    pub fn check(&self) -> Result<(), PluginError> {
        // Zero leaves it to the machine.
        let or_zero = |value: f64, low: f64| if value == 0.0 { 0.0 } else { low };
        // The ranges are asked in this form because a comparison with NaN is false.
        let ranges = [
            ("grid_ms", self.grid_ms, or_zero(self.grid_ms, 0.5), 20.0),
            (
                "window_ms",
                self.window_ms,
                or_zero(self.window_ms, 100.0),
                5000.0,
            ),
            ("tolerance_share", self.tolerance_share, 0.5, 1.0),
            ("rounds", f64::from(self.rounds), 1.0, 8.0),
        ];
        for (key, value, low, high) in ranges {
            if !(low..=high).contains(&value) {
                return Err(PluginError::of_option(
                    key,
                    format!("{value}: must be {low} to {high}"),
                ));
            }
        }
        Ok(())
    }

    pub(crate) fn tuning(&self) -> Tuning {
        Tuning {
            step_s: self.grid_ms / 1000.0,
            window_s: self.window_ms / 1000.0,
            box_share: self.tolerance_share / crate::waypoints::BOX_SHARE,
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
            ("grid_ms = 0.4", "grid_ms"),
            ("window_ms = nan", "window_ms"),
            ("tolerance_share = 1.1", "tolerance_share"),
            ("grid_s = 1", "grid_s"),
        ] {
            let message = Options::parse(text).unwrap_err().to_string();
            assert!(message.contains(word), "{text}: {message}");
        }
    }
}
