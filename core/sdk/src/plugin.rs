//! What makes a plugin: a name, a version and a factory.

use std::borrow::Cow;
use std::fmt;

use serde::de::DeserializeOwned;

use crate::{Driver, FeedStrategy, Kinematics, Planner, PlannerContext, StrategyContext};

/// A plugin's refusal or fault, in its own words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PluginError(Cow<'static, str>);

impl PluginError {
    /// A message made up at run time. Allocates: not for the fine loop.
    pub fn new(message: impl Into<String>) -> Self {
        Self(Cow::Owned(message.into()))
    }

    /// A fixed message. Does not allocate.
    pub const fn fixed(message: &'static str) -> Self {
        Self(Cow::Borrowed(message))
    }
}

impl fmt::Display for PluginError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for PluginError {}

/// What a factory gives: the plugin, or why it refuses to start.
pub type Made<T> = Result<Box<T>, PluginError>;

/// The factory of each kind of plugin. `options` is the TOML text of the plugin's `options` table.
#[derive(Clone, Copy)]
pub enum PluginKind {
    /// Makes a [`Planner`].
    Planner(fn(options: &str, context: &PlannerContext) -> Made<dyn Planner>),
    /// Makes a [`FeedStrategy`].
    FeedStrategy(fn(options: &str, context: &StrategyContext) -> Made<dyn FeedStrategy>),
    /// Makes a [`Driver`].
    Driver(fn(options: &str) -> Made<dyn Driver>),
    /// Makes a [`Kinematics`].
    Kinematics(fn(options: &str) -> Made<dyn Kinematics>),
}

impl PluginKind {
    /// The kind's name as people read it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Planner(_) => "planner",
            Self::FeedStrategy(_) => "feed strategy",
            Self::Driver(_) => "driver",
            Self::Kinematics(_) => "kinematics",
        }
    }
}

/// A plugin as the host's registry knows it.
#[derive(Clone, Copy)]
pub struct Plugin {
    /// The name that `machine.toml` gives.
    pub name: &'static str,
    /// The plugin's version.
    pub version: &'static str,
    /// What it makes.
    pub kind: PluginKind,
}

/// Reads a plugin's options; an unknown key is an error where `T` denies unknown fields.
///
/// # Errors
/// What is wrong and where, in the TOML reader's words.
pub fn parse_options<T: DeserializeOwned>(options: &str) -> Result<T, PluginError> {
    toml::from_str(options).map_err(|e| PluginError::new(format!("options: {}", e.message())))
}
