//! `[planner.options]` of the planner.

use serde::{Deserialize, Serialize};
use tandem_sdk::{PluginError, PluginOptions};

/// What decides the feed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FormName {
    /// As published: the chord error at the place where a fine period begins. Breaks acceleration and jerk limits.
    Adaptive,
    /// As published: corners, look-ahead with ripple propagation and cubic feed windows, within the limits of every axis.
    Windowed,
    /// Near time-optimal within velocity, acceleration and jerk of every axis and the chord error.
    #[default]
    Scan,
}

tandem_sdk::options! {
    /// The options.
    #[derive(Copy)]
    pub struct Options {
        /// What decides the feed: near time-optimal within all limits; the published look-ahead with cubic feed windows,
        /// within them too; or as published, which breaks them (simulated drives with `guard.mode = "count"` only).
        pub form: FormName = FormName::default(),
        /// Most that the chord of a fine period may stand off the curve, µm: 0.001 to 1000.
        pub chord_error_um: f64 = 1.0,
    }
}

impl Options {
    /// Reads and checks the TOML text of the options.
    ///
    /// # Errors
    /// An unknown key or form, or a chord error out of range.
    pub fn parse(text: &str) -> Result<Self, PluginError> {
        let options = Self::read(text)?;
        options.check().map(|()| options)
    }

    /// Checks what a type cannot say.
    ///
    /// # Errors
    /// A chord error out of range.
    pub fn check(&self) -> Result<(), PluginError> {
        // The range is asked in this form because a comparison with NaN is false.
        if (0.001..=1000.0).contains(&self.chord_error_um) {
            return Ok(());
        }
        let wrong = format!("{}: must be 0.001 to 1000", self.chord_error_um);
        Err(PluginError::of_option("chord_error_um", wrong))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_read_and_checked() {
        let plain = Options::parse("form = \"adaptive\"").unwrap();
        assert_eq!(
            plain,
            Options {
                form: FormName::Adaptive,
                chord_error_um: 1.0
            }
        );
        assert_eq!(Options::parse("").unwrap().form, FormName::Scan);
        assert_eq!(
            Options::parse("form = \"windowed\"").unwrap().form,
            FormName::Windowed
        );
        for (text, word) in [
            ("form = \"fast\"", "fast"),
            ("form = \"adaptive\"\nchord_error_um = 0", "chord_error_um"),
            (
                "form = \"adaptive\"\nchord_error_um = nan",
                "chord_error_um",
            ),
            ("form = \"adaptive\"\nchord_error_mm = 1", "chord_error_mm"),
        ] {
            let message = Options::parse(text).unwrap_err().to_string();
            assert!(message.contains(word), "{text}: {message}");
        }
    }
}
