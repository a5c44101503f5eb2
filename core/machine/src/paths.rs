//! Files that a configuration names.

use std::path::{Path, PathBuf};

use crate::node::{Table, Value};

/// Keys whose value names a file, wherever it is stated from.
const FILES: [(&str, &str); 2] = [("policy", "script"), ("tools", "table")];

/// Tables that choose a plugin.
const PLUGINS: [&str; 4] = ["kinematics", "planner", "feed_strategy", "driver"];

/// `name` relative to the directory of `file`.
pub fn beside(file: &Path, name: &str) -> PathBuf {
    file.parent().map_or_else(|| PathBuf::from(name), |directory| directory.join(name))
}

/// Makes the files that `table` names independent of the file `path` it was read from and of the current directory.
pub fn resolve_paths(table: &mut Table, path: &Path) {
    let plugins = PLUGINS.map(|table| (table, "plugin"));
    for (section, key) in plugins.iter().chain(&FILES) {
        let section = table.get_mut(*section).map(|node| &mut node.value);
        let Some(Value::Table(section)) = section else { continue };
        let Some(Value::Text(text)) = section.get_mut(*key).map(|node| &mut node.value) else { continue };
        let is_file = if *key == "plugin" { is_library(text) } else { !text.is_empty() };
        if is_file {
            let file = beside(path, text);
            *text = std::path::absolute(&file).unwrap_or(file).display().to_string();
        }
    }
}

/// Whether a plugin is named by its file rather than by its name.
pub fn is_library(plugin: &str) -> bool {
    let endings = ["so", "dylib", "dll"];
    let ending = Path::new(plugin).extension().and_then(|e| e.to_str());
    plugin.contains(['/', '\\']) || ending.is_some_and(|e| endings.contains(&e))
}
