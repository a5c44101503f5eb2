//! The options of a plugin: read from TOML, described for people.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use toml::de::{DeTable, DeValue};

use crate::PluginError;
use crate::option_values::values;

/// What a plugin's constructor takes. [`crate::options!`] implements it for a structure that it declares.
pub trait PluginOptions: Sized {
    /// Reads the TOML text of the plugin's `options` table. Host, outside the loops.
    ///
    /// # Errors
    /// What is wrong, and with which key.
    fn read(options: &str) -> Result<Self, PluginError>;

    /// All keys with their meaning and default, for `tandem plugin list -v`.
    fn describe() -> Vec<OptionDoc>;
}

/// One key of a plugin's options, as people read it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct OptionDoc {
    /// The key, with its unit.
    pub key: String,
    /// What may stand there: `number`, `true or false`, or the words to choose from.
    pub values: String,
    /// What counts where it is not stated, as TOML; empty where nothing does.
    pub default: String,
    /// What it means.
    pub doc: String,
}

/// All options of a plugin, as they cross the border of a library.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct OptionDocs {
    #[serde(default)]
    pub option: Vec<OptionDoc>,
}

impl OptionDoc {
    /// The description of `key`, whose value is `default` where none is stated. `doc` are the lines of its comment.
    pub fn new<'de, T: Serialize + Deserialize<'de>>(key: &str, doc: &[&str], default: &T) -> Self {
        let default = toml::Value::try_from(default)
            .map(|value| value.to_string())
            .unwrap_or_default();
        let doc = doc
            .iter()
            .map(|line| line.trim())
            .collect::<Vec<_>>()
            .join(" ")
            .trim()
            .to_string();
        Self {
            key: key.to_string(),
            values: values::<T>(),
            default,
            doc,
        }
    }
}

/// For plugins without options: any key is refused.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NoOptions;

impl PluginOptions for NoOptions {
    fn read(options: &str) -> Result<Self, PluginError> {
        let table: toml::map::Map<String, toml::Value> = parse_options(options)?;
        let unknown = |key: &String| {
            Err(PluginError::of_option(
                key,
                "unknown: this plugin has no options",
            ))
        };
        table.keys().next().map_or(Ok(Self), unknown)
    }

    fn describe() -> Vec<OptionDoc> {
        vec![]
    }
}

/// The TOML text as it came, for a plugin that passes it on to another.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RawOptions(pub String);

impl PluginOptions for RawOptions {
    fn read(options: &str) -> Result<Self, PluginError> {
        Ok(Self(options.to_string()))
    }

    fn describe() -> Vec<OptionDoc> {
        vec![]
    }
}

/// Reads a plugin's options; an unknown key is an error where `T` denies unknown fields.
///
/// # Errors
/// What is wrong and with which key, in the TOML reader's words.
pub fn parse_options<T: DeserializeOwned>(options: &str) -> Result<T, PluginError> {
    toml::from_str(options).map_err(|error| {
        let key = error
            .span()
            .and_then(|span| key_at(options, span.start))
            .unwrap_or_default();
        PluginError::of_option(key, error.message())
    })
}

/// The dotted path of the key that is written at a place of a TOML text, or whose value is.
fn key_at(text: &str, place: usize) -> Option<String> {
    let table = DeTable::parse(text).ok()?;
    let path = path_in(table.get_ref(), place)?;
    Some(path.trim_start_matches('.').to_string())
}

fn path_in(table: &DeTable<'_>, place: usize) -> Option<String> {
    table.iter().find_map(|(key, value)| {
        let inner = path_in_value(value.get_ref(), place);
        let here = key.span().contains(&place) || value.span().contains(&place);
        inner
            .or(here.then(String::new))
            .map(|rest| format!(".{}{rest}", key.get_ref()))
    })
}

fn path_in_value(value: &DeValue<'_>, place: usize) -> Option<String> {
    match value {
        DeValue::Table(table) => path_in(table, place),
        DeValue::Array(elements) => elements.iter().enumerate().find_map(|(index, element)| {
            let inner = path_in_value(element.get_ref(), place);
            inner
                .or(element.span().contains(&place).then(String::new))
                .map(|rest| format!("[{index}]{rest}"))
        }),
        _ => None,
    }
}

/// Declares a structure of options: each field with its documentation and its default.
///
/// ```
/// tandem_sdk::options! {
///     /// Options of the planner.
///     pub struct Options {
///         /// Share of the acceleration limit that is used, 0.1 to 1.
///         pub acceleration_share: f64 = 0.8,
///         /// Blocks kept for looking ahead.
///         pub buffer_blocks: usize = 100,
///     }
/// }
///
/// use tandem_sdk::PluginOptions;
/// assert_eq!(Options::read("buffer_blocks = 7").unwrap().buffer_blocks, 7);
/// let error = Options::read("buffer = 7").unwrap_err();
/// assert_eq!(error.option(), Some("buffer"));
/// assert_eq!(Options::describe()[0].default, "0.8");
/// ```
///
/// The structure implements `Deserialize` with `deny_unknown_fields`, `Default`, `Clone`, `Debug` and `PartialEq`. A type
/// of a field needs `Serialize`, `Deserialize`, `Clone`, `Debug` and `PartialEq`.
#[macro_export]
macro_rules! options {
    (
        $(#[$meta:meta])*
        $visibility:vis struct $name:ident {
            $( $(#[doc = $doc:expr])* $field_visibility:vis $field:ident: $type:ty = $default:expr ),* $(,)?
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq, $crate::serde::Deserialize)]
        #[serde(crate = "tandem_sdk::serde", deny_unknown_fields, default)]
        $visibility struct $name {
            $( $(#[doc = $doc])* $field_visibility $field: $type, )*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $( $field: $default, )* }
            }
        }

        impl $crate::PluginOptions for $name {
            fn read(options: &str) -> ::core::result::Result<Self, $crate::PluginError> {
                $crate::parse_options(options)
            }

            fn describe() -> ::std::vec::Vec<$crate::OptionDoc> {
                let default = Self::default();
                ::std::vec![ $( $crate::OptionDoc::new(stringify!($field), &[$($doc),*], &default.$field) ),* ]
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Nested {
        list: Vec<Element>,
    }

    #[derive(Debug, PartialEq, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Element {
        size_mm: f64,
    }

    #[test]
    fn the_wrong_key_is_named_wherever_it_stands() {
        let wrong = |text: &str| {
            parse_options::<Nested>(text)
                .unwrap_err()
                .option()
                .map(str::to_string)
        };
        assert_eq!(
            wrong("list = [{ size_mm = 1 }, { size_um = 2 }]").as_deref(),
            Some("list[1].size_um")
        );
        assert_eq!(
            wrong("[[list]]\nsize_mm = \"big\"").as_deref(),
            Some("list[0].size_mm")
        );
        assert_eq!(wrong("lists = []").as_deref(), Some("lists"));
        assert_eq!(wrong("list = ["), None);
    }

    #[test]
    fn a_plugin_without_options_refuses_any() {
        assert_eq!(NoOptions::read(""), Ok(NoOptions));
        let error = NoOptions::read("depth_mm = 3").unwrap_err();
        assert_eq!(
            (error.option(), error.message()),
            (Some("depth_mm"), "unknown: this plugin has no options")
        );
    }
}
