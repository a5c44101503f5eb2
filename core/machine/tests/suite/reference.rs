//! The table of keys, against what is really read.

use std::path::Path;

use crate::common::fixtures;
use tandem_machine::{Key, Machine, ValuePlace, keys, markdown, tool_keys};

/// The names that a key's path has in `good/full.toml`.
fn path(key: &Key) -> String {
    let rotary = key.path.contains("_deg");
    let (axis, joint) = if rotary { ("c", "c1") } else { ("x", "x2") };
    let names = [
        ("<axis>", axis),
        ("<joint>", joint),
        ("<driver>", "servo"),
        ("<input>", "door"),
        ("<name>", "vacuum"),
        ("<command>", "m100"),
    ];
    names
        .iter()
        .fold(key.path.replace("<analog>", "force"), |path, (from, to)| {
            path.replace(from, to)
        })
}

fn is_read_here(key: &Key) -> bool {
    let open = key.path.contains("<option>")
        || key.path.contains("<parameter>")
        || key.path.contains("<fault>");
    !open && key.path != "format" && key.path != "include"
}

#[test]
fn every_key_is_read() {
    for key in keys().iter().filter(|k| is_read_here(k)) {
        let path = path(key);
        let wrong = (path.clone(), "{ wrong = true }".to_owned());
        let error = Machine::read(&fixtures().join("good/full.toml"), &[wrong]).expect_err(&path);
        assert_eq!(
            error.problems[0].place,
            ValuePlace::Override(path.clone()),
            "{error}"
        );
        assert_eq!(error.problems[0].key, path, "{error}");
    }
}

#[test]
fn every_default_is_the_one_that_is_documented() {
    let minimal = fixtures().join("parts/mill.toml");
    // The defaults of an optional table show where the table is there.
    let policy = ("policy.script".to_owned(), "policy.wasm".to_owned());
    let output = ("outputs.vacuum.output".to_owned(), "7".to_owned());
    let input = ("inputs.vacuum.input".to_owned(), "9".to_owned());
    let tables = [policy, output, input];
    let implicit = Machine::read(&minimal, &tables).unwrap();
    let words = |key: &&Key| {
        key.default.starts_with(|c: char| c.is_ascii_digit()) || key.unit.contains(" or ")
    };
    let stated = keys()
        .iter()
        .filter(words)
        .filter(|k| k.default != "required" && is_read_here(k));
    let mut count = 0;
    for key in stated.filter(|k| !k.path.starts_with("joints.")) {
        let axis = if key.path.contains("_deg") { "a" } else { "x" };
        let path = key.path.replace("<axis>", axis).replace("<name>", "vacuum");
        let stated = [&tables[..], &[(path, key.default.to_owned())]].concat();
        let explicit = Machine::read(&minimal, &stated).unwrap();
        assert_eq!(described(&explicit), described(&implicit), "{}", key.path);
        count += 1;
    }
    assert!(count >= 14, "{count} defaults are tried");
}

/// Everything but where it was written.
fn described(machine: &Machine) -> String {
    let text = format!("{machine:?}");
    text.split(", effective: ")
        .next()
        .unwrap_or_default()
        .to_owned()
}

#[test]
fn every_key_of_the_examples_is_in_the_table() {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines");
    for file in std::fs::read_dir(directory).unwrap() {
        let text = std::fs::read_to_string(file.unwrap().path()).unwrap();
        let mut paths = Vec::new();
        leaves("", &text.parse().unwrap(), &mut paths);
        assert!(!paths.is_empty());
        for path in paths {
            assert!(
                keys().iter().any(|key| stands_for(key.path, &path)),
                "{path}"
            );
        }
    }
}

fn leaves(path: &str, table: &toml::Table, all: &mut Vec<String>) {
    for (key, value) in table {
        let path = if path.is_empty() {
            key.clone()
        } else {
            format!("{path}.{key}")
        };
        match value.as_table() {
            Some(table) => leaves(&path, table, all),
            None => all.push(path),
        }
    }
}

fn stands_for(pattern: &str, path: &str) -> bool {
    let (pattern, path): (Vec<_>, Vec<_>) =
        (pattern.split('.').collect(), path.split('.').collect());
    // An option may be a table of its own.
    let fits = pattern.len() == path.len()
        || (pattern.ends_with(&["<option>"]) && path.len() > pattern.len());
    fits && pattern
        .iter()
        .zip(&path)
        .all(|(a, b)| a.starts_with('<') || a == b)
}

#[test]
fn the_reference_has_a_row_for_every_key() {
    let text = markdown();
    for key in keys().iter().chain(tool_keys()) {
        assert!(!key.meaning.is_empty() && !key.unit.is_empty() && !key.default.is_empty());
        let row = format!(
            "| `{}` | {} | {} | {} |",
            key.path, key.unit, key.default, key.meaning
        );
        assert_eq!(row.matches('|').count(), 5, "no cell holds a bar: {row}");
        assert!(text.lines().any(|line| line == row));
    }
}
