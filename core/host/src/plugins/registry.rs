//! Plugins by kind and name, or by the file that holds them.

use tandem_machine::{DriverChoice, Machine, PluginChoice};
use tandem_sdk::{
    Driver, FeedStrategy, Kinematics, KinematicsContext, Planner, PlannerContext, Plugin,
    PluginError, PluginKind, StrategyContext,
};

use crate::error::{HostError, refusal};
use crate::plugins::hang::HangWatch;
use crate::plugins::{loading, plugin_log};

/// The plugins a host knows. It names none itself: they are registered from outside, or loaded by path.
pub struct Registry {
    plugins: Vec<Plugin>,
}

/// Why a plugin is not there, or does not start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PluginRefusal {
    /// The option that is wrong, where it is one: a dotted path below `options`.
    pub option: Option<String>,
    /// What is wrong, with the plugin's kind and name.
    pub cause: String,
}

impl PluginRefusal {
    /// The refusal with its place in the machine file: of the option that is wrong, or of the plugin's name in `section`.
    pub(crate) fn at(self, machine: &Machine, section: &str) -> HostError {
        let key = match self.option {
            Some(option) => format!("{section}.options.{option}"),
            None => format!("{section}.plugin"),
        };
        refusal(machine, &key, self.cause)
    }
}

impl Default for Registry {
    /// No plugin, a log for those to come, and no word on standard error about their panics.
    fn default() -> Self {
        plugin_log::listen();
        tandem_sdk::abi::quiet_linked_panics();
        Self { plugins: vec![] }
    }
}

impl Registry {
    /// Adds a plugin.
    ///
    /// # Errors
    /// A plugin of that kind and name is there already.
    pub fn register(&mut self, plugin: Plugin) -> Result<(), String> {
        let kind = plugin.kind();
        let name = plugin.name();
        if self.named(kind, name).is_some() {
            return Err(format!(
                "a {} called {name} is registered twice",
                kind.name()
            ));
        }
        self.plugins.push(plugin);
        Ok(())
    }

    /// All plugins in the order of their registration.
    pub fn plugins(&self) -> &[Plugin] {
        &self.plugins
    }

    /// The plugin of `kind` that a machine asks for: a registered one by its name, or one in a shared library, which is
    /// loaded for good.
    ///
    /// # Errors
    /// It is not there, or the library is refused.
    pub fn find(&self, kind: PluginKind, choice: &PluginChoice) -> Result<Plugin, PluginRefusal> {
        let found = match &choice.library {
            Some(path) => self
                .loaded(kind, path)
                .map_err(|cause| format!("{}: {cause}", path.display())),
            None => self
                .named(kind, &choice.plugin)
                .ok_or_else(|| self.unknown(kind, &choice.plugin)),
        };
        found.map_err(|cause| PluginRefusal {
            option: None,
            cause,
        })
    }

    /// Opens the planner that a machine asks for.
    ///
    /// # Errors
    /// It is not there, or refuses its options.
    pub fn planner(
        &self,
        choice: &PluginChoice,
        context: &PlannerContext,
    ) -> Result<Box<dyn Planner>, PluginRefusal> {
        let plugin = self.find(PluginKind::Planner, choice)?;
        plugin
            .planner(&choice.options, context)
            .map_err(|e| refused(plugin, &e))
    }

    /// Opens the feed strategy that a machine asks for.
    ///
    /// # Errors
    /// It is not there, or refuses its options.
    pub fn strategy(
        &self,
        choice: &PluginChoice,
        context: &StrategyContext,
    ) -> Result<Box<dyn FeedStrategy>, PluginRefusal> {
        let plugin = self.find(PluginKind::FeedStrategy, choice)?;
        plugin
            .feed_strategy(&choice.options, context)
            .map_err(|e| refused(plugin, &e))
    }

    /// Makes the driver that a machine asks for.
    ///
    /// # Errors
    /// It is not there, or refuses its options.
    pub fn driver(&self, choice: &PluginChoice) -> Result<Box<dyn Driver>, PluginRefusal> {
        let plugin = self.find(PluginKind::Driver, choice)?;
        plugin
            .driver(&choice.options)
            .map_err(|e| refused(plugin, &e))
    }

    /// Makes the kinematics that a machine asks for.
    ///
    /// # Errors
    /// It is not there, or refuses its options.
    pub fn kinematics(
        &self,
        choice: &PluginChoice,
        context: &KinematicsContext,
    ) -> Result<Box<dyn Kinematics>, PluginRefusal> {
        let plugin = self.find(PluginKind::Kinematics, choice)?;
        plugin
            .kinematics(&choice.options, context)
            .map_err(|e| refused(plugin, &e))
    }

    fn named(&self, kind: PluginKind, name: &str) -> Option<Plugin> {
        self.plugins
            .iter()
            .find(|p| p.kind() == kind && p.name() == name)
            .copied()
    }

    fn loaded(&self, kind: PluginKind, path: &std::path::Path) -> Result<Plugin, String> {
        let all = loading::load(path)?;
        let mut fitting = all.iter().filter(|plugin| plugin.kind() == kind);
        let plugin = *fitting.next().ok_or_else(|| wrong_kind(kind, &all))?;
        if fitting.next().is_some() {
            return Err(format!(
                "it holds several plugins of kind {}; one can be chosen by its file",
                kind.name()
            ));
        }
        let name = plugin.name();
        match self.named(kind, name) {
            Some(_) => Err(format!(
                "it calls itself {name}, and a {} of that name is there already",
                kind.name()
            )),
            None => Ok(plugin),
        }
    }

    fn unknown(&self, kind: PluginKind, name: &str) -> String {
        let known: Vec<&str> = self
            .plugins
            .iter()
            .filter(|p| p.kind() == kind)
            .map(Plugin::name)
            .collect();
        let known = if known.is_empty() {
            "none".to_string()
        } else {
            known.join(", ")
        };
        format!(
            "no {} is called {name:?}; there is: {known}. A shared library is named by its path",
            kind.name()
        )
    }
}

fn wrong_kind(kind: PluginKind, all: &[Plugin]) -> String {
    let there: Vec<String> = all
        .iter()
        .map(|p| format!("{} {}", p.kind().name(), p.name()))
        .collect();
    format!("it is no {}: it holds {}", kind.name(), there.join(", "))
}

fn refused(plugin: Plugin, error: &PluginError) -> PluginRefusal {
    let cause = format!(
        "{} {}: {}",
        plugin.kind().name(),
        plugin.name(),
        error.message()
    );
    PluginRefusal {
        option: error.option().map(str::to_string),
        cause,
    }
}

/// Whether real drives are behind the machine; not where a driver cannot be made, which every run refuses. The drivers are made
/// under watch, for a constructor that does not come back is told as such. Host.
pub fn moves_metal(machine: &Machine, registry: &Registry) -> bool {
    let _watch = HangWatch::of(machine);
    machine
        .drivers
        .iter()
        .any(|driver| is_real(driver, registry))
}

/// Whether real drives are behind `driver`; not where it cannot be made.
pub fn is_real(driver: &DriverChoice, registry: &Registry) -> bool {
    registry
        .driver(&driver.choice)
        .is_ok_and(|driver| driver.describe().simulated == 0)
}
