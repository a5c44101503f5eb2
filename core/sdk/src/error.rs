//! What a plugin says when it refuses or fails.

use crate::abi::layout::layout;
use std::fmt;

use crate::text::Text;

/// A plugin's refusal or fault, in its own words.
#[derive(Clone, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct PluginError {
    message: Text,
    option: Text,
    /// 1 where it is a panic, else 0: a truth value of another side may be neither.
    panicked: u32,
}

layout!(PluginError {
    message,
    option,
    panicked
});

impl PluginError {
    /// A message made up at run time. Allocates: not for the fine loop.
    pub fn new(message: impl Into<String>) -> Self {
        Self {
            message: Text::owned(message.into()),
            option: Text::fixed(""),
            panicked: 0,
        }
    }

    /// A fixed message. Does not allocate.
    pub const fn fixed(message: &'static str) -> Self {
        Self {
            message: Text::fixed(message),
            option: Text::fixed(""),
            panicked: 0,
        }
    }

    /// What is wrong with the option `key`, a dotted path below `options`: the host adds where in `machine.toml` it
    /// was written. Allocates.
    pub fn of_option(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self {
            message: Text::owned(message.into()),
            option: Text::owned(key.into()),
            panicked: 0,
        }
    }

    /// The words of a plugin that has panicked.
    pub(crate) const fn of_panic(message: &'static str) -> Self {
        Self {
            message: Text::fixed(message),
            option: Text::fixed(""),
            panicked: 1,
        }
    }

    /// Whether the plugin has panicked, now or before.
    pub fn is_panic(&self) -> bool {
        self.panicked != 0
    }

    /// The option that is wrong, where it is one: a dotted path below `options`.
    pub fn option(&self) -> Option<&str> {
        Some(self.option.as_str()).filter(|key| !key.is_empty())
    }

    /// The words alone, without the option.
    pub fn message(&self) -> &str {
        self.message.as_str()
    }
}

impl fmt::Display for PluginError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.option() {
            Some(option) => write!(f, "options: {option}: {}", self.message()),
            None => f.write_str(self.message()),
        }
    }
}

impl std::error::Error for PluginError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_truth_value_of_another_side_that_is_neither_is_read_as_a_number() {
        let error = PluginError {
            panicked: 7,
            ..PluginError::fixed("words")
        };
        assert!(error.is_panic() && !PluginError::fixed("words").is_panic());
    }
}
