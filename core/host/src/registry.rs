//! Plugins by kind and name.

use tandem_sdk::{
    Driver, FeedStrategy, Kinematics, Made, Planner, PlannerContext, Plugin, PluginKind, StrategyContext,
};

/// The plugins a host knows. It names none itself: they are registered from outside.
#[derive(Default)]
pub struct Registry {
    plugins: Vec<Plugin>,
}

impl Registry {
    /// Adds a plugin.
    ///
    /// # Errors
    /// A plugin of that kind and name is there already.
    pub fn register(&mut self, plugin: Plugin) -> Result<(), String> {
        let kind = plugin.kind.name();
        if self.find(kind, plugin.name).is_some() {
            return Err(format!("a {kind} called {} is registered twice", plugin.name));
        }
        self.plugins.push(plugin);
        Ok(())
    }

    /// All plugins in the order of their registration.
    pub fn plugins(&self) -> &[Plugin] {
        &self.plugins
    }

    /// Makes the planner called `name`.
    ///
    /// # Errors
    /// It is not there, or refuses its options.
    pub fn planner(&self, name: &str, options: &str, context: &PlannerContext) -> Result<Box<dyn Planner>, String> {
        self.make("planner", name, |kind| match kind {
            PluginKind::Planner(make) => Some(make(options, context)),
            _ => None,
        })
    }

    /// Makes the feed strategy called `name`.
    ///
    /// # Errors
    /// It is not there, or refuses its options.
    pub fn strategy(
        &self,
        name: &str,
        options: &str,
        context: &StrategyContext,
    ) -> Result<Box<dyn FeedStrategy>, String> {
        self.make("feed strategy", name, |kind| match kind {
            PluginKind::FeedStrategy(make) => Some(make(options, context)),
            _ => None,
        })
    }

    /// Makes the driver called `name`.
    ///
    /// # Errors
    /// It is not there, or refuses its options.
    pub fn driver(&self, name: &str, options: &str) -> Result<Box<dyn Driver>, String> {
        self.make("driver", name, |kind| match kind {
            PluginKind::Driver(make) => Some(make(options)),
            _ => None,
        })
    }

    /// Makes the kinematics called `name`.
    ///
    /// # Errors
    /// It is not there, or refuses its options.
    pub fn kinematics(&self, name: &str, options: &str) -> Result<Box<dyn Kinematics>, String> {
        self.make("kinematics", name, |kind| match kind {
            PluginKind::Kinematics(make) => Some(make(options)),
            _ => None,
        })
    }

    fn find(&self, kind: &str, name: &str) -> Option<&Plugin> {
        self.plugins.iter().find(|p| p.kind.name() == kind && p.name == name)
    }

    fn make<T: ?Sized>(
        &self,
        kind: &str,
        name: &str,
        make: impl Fn(&PluginKind) -> Option<Made<T>>,
    ) -> Result<Box<T>, String> {
        let made = self.find(kind, name).and_then(|plugin| make(&plugin.kind));
        made.ok_or_else(|| self.unknown(kind, name))?.map_err(|e| format!("{kind} {name}: {e}"))
    }

    fn unknown(&self, kind: &str, name: &str) -> String {
        let known: Vec<&str> = self.plugins.iter().filter(|p| p.kind.name() == kind).map(|p| p.name).collect();
        let known = if known.is_empty() { "none".to_string() } else { known.join(", ") };
        format!("no {kind} is called {name:?}; there is: {known}")
    }
}
