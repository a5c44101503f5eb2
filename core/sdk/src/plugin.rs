//! A plugin as a host has it, whether it is linked in or loaded.

use crate::abi::layout::layout_of_enum;
use crate::abi::{self, Descriptor};
use crate::options::OptionDocs;
use crate::{
    Driver, FeedStrategy, Kinematics, KinematicsContext, OptionDoc, Planner, PlannerContext,
    PluginError, StrategyContext,
};

/// What a constructor gives: the plugin, or why it refuses to start.
pub type PluginResult<T> = Result<Box<T>, PluginError>;

/// The kinds of plugins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum PluginKind {
    /// A [`Planner`].
    Planner = 1,
    /// A [`FeedStrategy`].
    FeedStrategy = 2,
    /// A [`Driver`].
    Driver = 3,
    /// A [`Kinematics`].
    Kinematics = 4,
}

layout_of_enum!(PluginKind {
    Planner,
    FeedStrategy,
    Driver,
    Kinematics
});

impl PluginKind {
    /// All kinds.
    pub const ALL: [Self; 4] = [
        Self::Planner,
        Self::FeedStrategy,
        Self::Driver,
        Self::Kinematics,
    ];

    /// The kind's name as people read it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Planner => "planner",
            Self::FeedStrategy => "feed strategy",
            Self::Driver => "driver",
            Self::Kinematics => "kinematics",
        }
    }
}

/// A plugin as a host registers it. [`crate::plugin!`] makes one; a loaded library gives the same
/// ([`crate::abi::Library::plugins`]).
#[derive(Clone, Copy, Debug)]
pub struct Plugin(&'static Descriptor);

impl Plugin {
    /// The plugin that `descriptor` describes.
    pub const fn new(descriptor: &'static Descriptor) -> Self {
        Self(descriptor)
    }

    /// The name that `machine.toml` gives.
    pub fn name(&self) -> &'static str {
        self.0.name()
    }

    /// The version of its crate.
    pub fn version(&self) -> &'static str {
        self.0.version()
    }

    /// What it makes.
    pub fn kind(&self) -> PluginKind {
        self.0
            .kind()
            .unwrap_or_else(|| unreachable!("libraries with kinds of the future are refused"))
    }

    /// Its options with their meaning and defaults.
    ///
    /// # Errors
    /// It cannot describe them, in its own words.
    pub fn options(&self) -> Result<Vec<OptionDoc>, PluginError> {
        let text = self.0.options()?;
        let docs: OptionDocs =
            toml::from_str(text.as_str()).map_err(|e| PluginError::new(e.message()))?;
        Ok(docs.option)
    }

    /// Opens a planner; `options` is the TOML text of the plugin's `options` table. Host.
    ///
    /// # Errors
    /// It is of another kind, or refuses.
    pub fn planner(&self, options: &str, context: &PlannerContext) -> PluginResult<dyn Planner> {
        abi::open_planner(
            self.table(PluginKind::Planner)?,
            self.name(),
            options,
            context,
        )
    }

    /// Opens a feed strategy. Host.
    ///
    /// # Errors
    /// It is of another kind, or refuses.
    pub fn feed_strategy(
        &self,
        options: &str,
        context: &StrategyContext,
    ) -> PluginResult<dyn FeedStrategy> {
        abi::open_strategy(
            self.table(PluginKind::FeedStrategy)?,
            self.name(),
            options,
            context,
        )
    }

    /// Makes a driver, which is not open yet. Host.
    ///
    /// # Errors
    /// It is of another kind, or refuses.
    pub fn driver(&self, options: &str) -> PluginResult<dyn Driver> {
        abi::open_driver(self.table(PluginKind::Driver)?, self.name(), options)
    }

    /// Makes a kinematics. Host.
    ///
    /// # Errors
    /// It is of another kind, or refuses.
    pub fn kinematics(
        &self,
        options: &str,
        context: &KinematicsContext,
    ) -> PluginResult<dyn Kinematics> {
        abi::open_kinematics(
            self.table(PluginKind::Kinematics)?,
            self.name(),
            options,
            context,
        )
    }

    fn table<T>(self, kind: PluginKind) -> Result<&'static T, PluginError> {
        let wrong = || {
            PluginError::new(format!(
                "it is a {}, not a {}",
                self.kind().name(),
                kind.name()
            ))
        };
        self.0.table(kind).ok_or_else(wrong)
    }
}

/// Makes plugins of constructors: what a plugin crate has besides its implementation of a contract.
///
/// ```
/// use tandem_sdk::{Answer, FeedStrategy, NoOptions, PluginError, Request, StrategyContext, Window};
///
/// struct Half;
///
/// impl Half {
///     fn open(_options: &NoOptions, _context: &StrategyContext) -> Result<Self, PluginError> {
///         Ok(Self)
///     }
/// }
///
/// impl FeedStrategy for Half {
///     fn update(&mut self, _window: &Window) -> Result<Answer, PluginError> {
///         Ok(Answer { ratio: 0.5, request: Request::None, signals: [0.0; 8] })
///     }
/// }
///
/// tandem_sdk::plugin!(feed_strategy "half" = Half::open);
/// # fn main() {
/// assert_eq!((PLUGIN.name(), PLUGIN.kind().name()), ("half", "feed strategy"));
/// # }
/// ```
///
/// The kinds and their constructors, where `O` is a structure of [`crate::options!`] or [`crate::NoOptions`]:
///
/// | kind | constructor |
/// |---|---|
/// | `planner` | `fn(&O, &PlannerContext) -> Result<impl Planner, PluginError>` |
/// | `feed_strategy` | `fn(&O, &StrategyContext) -> Result<impl FeedStrategy, PluginError>` |
/// | `driver` | `fn(&O) -> Result<impl Driver, PluginError>` |
/// | `kinematics` | `fn(&O, &KinematicsContext) -> Result<impl Kinematics, PluginError>` |
///
/// It goes into the root of the crate, once; several plugins are separated by commas. It makes `pub static PLUGIN` (the
/// first) and `fn plugins` (all) for hosts that link the crate in, and exports a symbol named after the crate for those that
/// load it: `cargo rustc --release --lib --crate-type cdylib` builds the shared library.
#[macro_export]
macro_rules! plugin {
    ($($kind:ident $name:literal = $open:expr),+ $(,)?) => {
        #[cfg(panic = "abort")]
        compile_error!("a plugin that aborts takes the machine's control down: build it with panic = \"unwind\"");

        /// The descriptions of this crate's plugins.
        static DESCRIPTORS: &[$crate::abi::Descriptor] =
            &[$($crate::abi::$kind($name, env!("CARGO_PKG_VERSION"), $open)),+];

        /// The plugin as a host registers it; the first where the crate has several.
        pub static PLUGIN: $crate::Plugin = $crate::Plugin::new(&DESCRIPTORS[0]);

        /// All plugins of this crate.
        pub fn plugins() -> impl Iterator<Item = $crate::Plugin> {
            DESCRIPTORS.iter().map($crate::Plugin::new)
        }

        #[doc(hidden)]
        #[unsafe(export_name = concat!("tandem_plugin_v1__", env!("CARGO_CRATE_NAME")))]
        pub static LIBRARY: $crate::abi::Library = $crate::abi::Library::new(DESCRIPTORS);
    };
}

/// A plugin for the process that it stands in, as a value: a test's. It exports nothing.
#[macro_export]
macro_rules! local_plugin {
    ($kind:ident $name:literal = $open:expr) => {{
        static DESCRIPTOR: $crate::abi::Descriptor = $crate::abi::$kind($name, "0.0.0", $open);
        $crate::Plugin::new(&DESCRIPTOR)
    }};
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_have_distinct_names() {
        let names = PluginKind::ALL.map(PluginKind::name);
        assert!(
            names
                .iter()
                .enumerate()
                .all(|(i, name)| !names[..i].contains(name))
        );
    }
}
