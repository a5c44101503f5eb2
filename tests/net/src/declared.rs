//! Changes of messages that are meant.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// The rows of the list.
#[derive(Debug, Default)]
pub struct Declared(Vec<Row>);

#[derive(Debug)]
struct Row {
    old: String,
    new: String,
    met: AtomicBool,
}

impl Declared {
    /// Reads the list.
    ///
    /// # Errors
    /// The file cannot be read, or a row has no `old` and `new`.
    pub fn read(path: &Path) -> Result<Self, String> {
        let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
        let table: toml::Table = text
            .parse()
            .map_err(|e| format!("{}: {e}", path.display()))?;
        let rows = table
            .get("changed")
            .and_then(toml::Value::as_array)
            .map_or(&[][..], Vec::as_slice);
        let row = |row: &toml::Value| {
            let word = |key: &str| {
                row.get(key)
                    .and_then(toml::Value::as_str)
                    .map(ToString::to_string)
            };
            let (old, new) = word("old")
                .zip(word("new"))
                .ok_or("a row of the declared changes has no old or no new")?;
            Ok(Row {
                old,
                new,
                met: AtomicBool::new(false),
            })
        };
        rows.iter()
            .map(row)
            .collect::<Result<_, String>>()
            .map(Self)
    }

    /// A text of the old build as the new one is expected to say it.
    pub fn expected(&self, old: &str) -> String {
        let mut text = old.to_string();
        for row in self.0.iter().filter(|row| !row.old.is_empty()) {
            if text.contains(&row.old) {
                row.met.store(true, Ordering::Relaxed);
                text = text.replace(&row.old, &row.new);
            }
        }
        text
    }

    /// The old texts that were met nowhere.
    pub fn unused(&self) -> impl Iterator<Item = &str> {
        self.0
            .iter()
            .filter(|row| !row.met.load(Ordering::Relaxed))
            .map(|row| row.old.as_str())
    }
}
