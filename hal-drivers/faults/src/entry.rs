//! One table of `[faults]`: its keys by type, each refusal with the key's dotted path.
//!
//! Read by hand and not by `serde`, so that a refusal knows the entry and the key, and with them line and column.

use toml::{Table, Value};

use crate::nearest::unknown;

/// What is wrong, and the dotted path of the key concerned.
#[derive(Debug, PartialEq)]
pub struct Refusal {
    /// As in `faults.wrap[0].every`.
    pub key: String,
    /// What is wrong.
    pub cause: String,
}

/// A table and where it stands.
pub struct Entry<'a> {
    /// The table.
    pub table: &'a Table,
    /// Its dotted path.
    pub path: String,
}

impl Entry<'_> {
    /// Refuses keys that are not in `keys`; `elsewhere` says which of those mean something in other entries.
    pub fn permit(&self, keys: &[&str], elsewhere: impl Fn(&str) -> bool) -> Result<(), Refusal> {
        let Some(key) = self.table.keys().find(|key| !keys.contains(&key.as_str())) else {
            return Ok(());
        };
        match self.table.get("kind").and_then(Value::as_str) {
            Some(kind) if elsewhere(key) => {
                self.refuse(key, &format!("does not go with kind = \"{kind}\""))
            }
            _ => self.refuse(key, &unknown("key", key, keys)),
        }
    }

    /// A whole number of at least `least`.
    pub fn count(&self, key: &str, least: u64) -> Result<Option<u64>, Refusal> {
        let Some(value) = self.table.get(key) else {
            return Ok(None);
        };
        let count = value
            .as_integer()
            .and_then(|value| u64::try_from(value).ok())
            .filter(|count| *count >= least);
        count.map_or_else(
            || {
                self.refuse(
                    key,
                    &format!("must be a whole number from {least}, not {value}"),
                )
            },
            |c| Ok(Some(c)),
        )
    }

    /// A finite number.
    pub fn number(&self, key: &str) -> Result<Option<f64>, Refusal> {
        let Some(value) = self.table.get(key) else {
            return Ok(None);
        };
        let number = value
            .as_float()
            .or_else(|| value.as_integer().map(|i| i as f64))
            .filter(|v| v.is_finite());
        number.map_or_else(
            || self.refuse(key, &format!("must be a number, not {value}")),
            |n| Ok(Some(n)),
        )
    }

    /// A string.
    pub fn text(&self, key: &str) -> Result<Option<&str>, Refusal> {
        let Some(value) = self.table.get(key) else {
            return Ok(None);
        };
        value.as_str().map_or_else(
            || self.refuse(key, &format!("must be a string, not {value}")),
            |t| Ok(Some(t)),
        )
    }

    /// A refusal of `key`, or of the whole table where it is empty.
    pub fn refuse<T>(&self, key: &str, cause: &str) -> Result<T, Refusal> {
        let key = if key.is_empty() {
            self.path.clone()
        } else {
            format!("{}.{key}", self.path)
        };
        Err(Refusal {
            key,
            cause: cause.to_string(),
        })
    }
}
