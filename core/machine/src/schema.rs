//! Which keys are known, and what an unknown one was probably meant to be.

use crate::error::ValuePlace;
use crate::keys::{Key, agree, is_open};
use crate::nearest::nearest;
use crate::node::{Node, Table, Value};
use crate::problems::Problems;
use crate::shown::dotted;

/// What a dotted path is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Known {
    /// A key with a value.
    Key,
    /// A table of known keys.
    Table,
    /// Something that a plugin or script reads.
    Open,
    /// Nothing.
    No,
}

/// What `path` is among `keys`.
pub fn classify(keys: &[Key], path: &[&str]) -> Known {
    let Some(key) = keys.iter().find(|k| agree(k.path, path)) else {
        return Known::No;
    };
    let length = key.path.split('.').count();
    match path.len() {
        here if here < length => Known::Table,
        _ if is_open(key.path) => Known::Open,
        here if here == length => Known::Key,
        _ => Known::No,
    }
}

/// Reports every key of `table`, which stands at `path`, that is not among `keys`.
pub fn check<'a>(keys: &[Key], path: &mut Vec<&'a str>, table: &'a Table, problems: &Problems) {
    let rotary = table.get("kind").map(|kind| kind.text() == Some("rotary"));
    for (key, node) in table {
        if problems.is_full() {
            return;
        }
        path.push(key);
        match (classify(keys, path), node.table()) {
            (Known::Table, Some(table)) => check(keys, path, table, problems),
            (Known::Table, None) => must_be_table(path, node, problems),
            (Known::No, _) => unknown(keys, path, node, rotary.unwrap_or(false), problems),
            (Known::Key | Known::Open, _) => {}
        }
        path.pop();
    }
}

fn must_be_table(path: &[&str], node: &Node, problems: &Problems) {
    if matches!(node.value, Value::Wrong) {
        return;
    }
    problems.report(
        node.origin,
        &dotted(path),
        format!("must be a table, not {}", node.kind()),
    );
}

fn unknown(keys: &[Key], path: &[&str], node: &Node, rotary: bool, problems: &Problems) {
    let hint = nearest(keys, path, rotary).map(|found| {
        problems.suggest(&found.path);
        // A name in the same table is told alone, as it would be written there; an override is always a whole path.
        let whole = matches!(problems.place(node.origin), ValuePlace::Override(_));
        let name = if whole { &found.path } else { found.name() };
        let verb = if found.close {
            "did you mean"
        } else {
            "the nearest known key is"
        };
        format!("; {verb} `{name}`{}", if found.close { "?" } else { "" })
    });
    problems.report(
        node.origin,
        &dotted(path),
        format!("unknown key{}", hint.unwrap_or_default()),
    );
}
