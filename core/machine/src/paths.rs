//! Files that a configuration names.

use std::path::{Path, PathBuf};

use crate::node::{Table, Value};

/// Keys whose value names a file, wherever it is stated from.
const FILES: [(&str, &str); 3] = [
    ("policy", "script"),
    ("tools", "table"),
    ("program", "subroutine_path"),
];

/// Tables that choose a plugin; `*` stands for any name.
const PLUGINS: [&[&str]; 7] = [
    &["kinematics"],
    &["planner"],
    &["feed_strategy"],
    &["driver"],
    &["driver", "stand_in"],
    &["drivers", "*"],
    &["drivers", "*", "stand_in"],
];

/// `name` relative to the directory of `file`.
pub fn beside(file: &Path, name: &str) -> PathBuf {
    file.parent()
        .map_or_else(|| PathBuf::from(name), |directory| directory.join(name))
}

/// Makes the files that `table` names independent of the file `path` it was read from and of the current directory.
pub fn resolve_paths(table: &mut Table, path: &Path) {
    for (section, key) in FILES {
        each_table(table, &[section], &mut |section| {
            resolve(section, key, path);
        });
    }
    each_table(table, &["user_commands"], &mut |section| {
        let commands: Vec<String> = section.iter().map(|(key, _)| key.clone()).collect();
        for key in &commands {
            resolve(section, key, path);
        }
    });
    for section in PLUGINS {
        each_table(table, section, &mut |section| {
            resolve(section, "plugin", path);
        });
    }
}

/// Hands every table at `parts` inside `table` to `work`.
fn each_table(table: &mut Table, parts: &[&str], work: &mut dyn FnMut(&mut Table)) {
    let Some((first, rest)) = parts.split_first() else {
        return work(table);
    };
    for (_, node) in table
        .iter_mut()
        .filter(|(name, _)| *first == "*" || first == name)
    {
        if let Value::Table(inner) = &mut node.value {
            each_table(inner, rest, work);
        }
    }
}

fn resolve(section: &mut Table, key: &str, path: &Path) {
    let Some(Value::Text(text)) = section.get_mut(key).map(|node| &mut node.value) else {
        return;
    };
    let is_file = if key == "plugin" {
        is_library(text)
    } else {
        !text.is_empty()
    };
    if is_file {
        let file = beside(path, text);
        *text = std::path::absolute(&file)
            .unwrap_or(file)
            .display()
            .to_string();
    }
}

/// Whether a plugin is named by its file rather than by its name.
pub fn is_library(plugin: &str) -> bool {
    let endings = ["so", "dylib", "dll"];
    let ending = Path::new(plugin).extension().and_then(|e| e.to_str());
    plugin.contains(['/', '\\']) || ending.is_some_and(|e| endings.contains(&e))
}
