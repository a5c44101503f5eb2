//! `--set key=value`: any key from the command line.

use toml::de::DeValue;

use crate::convert::{Convert, MAX_DEPTH};
use crate::node::{Node, Table, Value};
use crate::problems::{Origin, Problems};

/// Sets `key` (a dotted path) in `root` to `value`, which is read as TOML; what is not TOML is a string.
///
/// A key that exists keeps its place, so that the order of the axes stays that of the file.
pub fn apply(root: &mut Table, key: &str, value: &str, problems: &Problems) {
    let origin = Origin {
        source: problems.add_override(key),
        offset: 0,
    };
    let path: Vec<&str> = key.split('.').map(str::trim).collect();
    if let Some(what) = refusal(&path) {
        problems.report(origin, key, what);
        return;
    }
    let value = read(&path, value, origin, problems);
    put(root, &path, Node { origin, value });
}

fn refusal(path: &[&str]) -> Option<&'static str> {
    match path.first() {
        _ if path.contains(&"") => Some("a part of the path is empty"),
        _ if path.len() > MAX_DEPTH => Some("the path is nested too deep"),
        Some(&"format" | &"include") => Some("belongs to the file and cannot be overridden"),
        _ => None,
    }
}

fn read(path: &[&str], text: &str, origin: Origin, problems: &Problems) -> Value {
    let path = path.iter().map(|part| (*part).to_owned()).collect();
    match DeValue::parse(text.trim()) {
        Ok(value) => Convert::new(origin.source, problems, path).value(value.get_ref(), origin),
        Err(_) => Value::Text(text.to_owned()),
    }
}

fn put(table: &mut Table, path: &[&str], node: Node) {
    let Some((name, rest)) = path.split_first() else {
        return;
    };
    if rest.is_empty() {
        table.insert((*name).to_owned(), node);
        return;
    }
    let empty = || Node {
        origin: node.origin,
        value: Value::Table(Table::new()),
    };
    let inner = table.entry(*name).or_insert_with(empty);
    if inner.table().is_none() {
        *inner = empty();
    }
    if let Value::Table(inner) = &mut inner.value {
        put(inner, rest, node);
    }
}
