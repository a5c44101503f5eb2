//! Where each key of a machine was written, for those who find later that a value does not suit them.

use std::collections::BTreeMap;

use crate::error::ValuePlace;
use crate::node::{Node, Table};
use crate::problems::{Origin, Source, place};

/// The origin of every key, by dotted path.
#[derive(Clone, Debug)]
pub struct Places {
    sources: Vec<Source>,
    origins: BTreeMap<String, Origin>,
}

impl Places {
    /// The places of all keys of `root`.
    pub fn new(sources: Vec<Source>, root: &Table) -> Self {
        let mut this = Self {
            sources,
            origins: BTreeMap::new(),
        };
        this.add("", root);
        this
    }

    fn add(&mut self, path: &str, table: &Table) {
        for (key, node) in table {
            let path = if path.is_empty() {
                key.clone()
            } else {
                format!("{path}.{key}")
            };
            self.add_node(path, node);
        }
    }

    /// A value and what is in it; the elements of an array are `key[0]`, `key[1]` and so on.
    fn add_node(&mut self, path: String, node: &Node) {
        if let Some(table) = node.table() {
            self.add(&path, table);
        }
        for (index, element) in node.array().unwrap_or_default().iter().enumerate() {
            self.add_node(format!("{path}[{index}]"), element);
        }
        self.origins.insert(path, node.origin);
    }

    /// Whether `key` was written.
    pub fn has(&self, key: &str) -> bool {
        self.origins.contains_key(key)
    }

    /// Where `key` was written, else the table around it, else the beginning of the machine's file.
    pub fn of(&self, key: &str) -> ValuePlace {
        let parents = std::iter::successors(Some(key), |key| {
            key.rsplit_once('.').map(|(parent, _)| parent)
        });
        let origin = parents.into_iter().find_map(|key| self.origins.get(key));
        place(&self.sources, origin.copied().unwrap_or_default())
    }
}
