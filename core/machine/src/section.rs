//! Reading one table: every value is checked as it is read, and what is wrong is noted.

use crate::error::ValuePlace;
use crate::node::{Node, Table, Value};
use crate::problems::{Origin, Problems};
use crate::shown::dotted;

/// A table of the configuration, present or not.
///
/// A reader gives `None` for a key that is absent or wrong; the latter is reported, so that reading can go on.
#[derive(Clone)]
pub struct Section<'a> {
    path: Vec<String>,
    origin: Origin,
    table: Option<&'a Table>,
    /// Something else stands where the table should: reported by the schema, so nothing in it is missing.
    broken: bool,
    problems: &'a Problems,
}

impl<'a> Section<'a> {
    /// The root, or a table at `path` that is written at `origin`.
    pub fn new(
        path: Vec<String>,
        origin: Origin,
        table: &'a Table,
        problems: &'a Problems,
    ) -> Self {
        Self {
            path,
            origin,
            table: Some(table),
            broken: false,
            problems,
        }
    }

    /// The table `key` inside this one.
    pub fn section(&self, key: &str) -> Self {
        let node = self.node(key);
        let mut path = self.path.clone();
        path.push(key.to_owned());
        let origin = node.map_or(self.origin, |n| n.origin);
        let table = node.and_then(Node::table);
        let broken = self.broken || (node.is_some() && table.is_none());
        Self {
            path,
            origin,
            table,
            broken,
            problems: self.problems,
        }
    }

    /// Whether the file has something other than a table where this one should be.
    pub fn is_broken(&self) -> bool {
        self.broken
    }

    /// Whether the file has this table.
    pub fn exists(&self) -> bool {
        self.table.is_some()
    }

    /// The keys, in the order of the file.
    pub fn keys(&self) -> impl Iterator<Item = &'a str> + use<'a> {
        self.table
            .into_iter()
            .flat_map(|table| table.keys().map(String::as_str))
    }

    /// The table itself.
    pub fn table(&self) -> Option<&'a Table> {
        self.table
    }

    /// The value of `key`.
    pub fn node(&self, key: &str) -> Option<&'a Node> {
        self.table.and_then(|table| table.get(key))
    }

    /// The value of `key` where it was not reported already.
    pub fn right(&self, key: &str) -> Option<&'a Node> {
        self.node(key)
            .filter(|node| !matches!(node.value, Value::Wrong))
    }

    /// Whether `key` is stated.
    pub fn has(&self, key: &str) -> bool {
        self.node(key).is_some()
    }

    /// Notes that `key` is wrong.
    pub fn refuse(&self, key: &str, what: impl Into<String>) {
        let origin = self.node(key).map_or(self.origin, |n| n.origin);
        self.problems.report(origin, &self.path_of(key), what);
    }

    /// Notes that `node`, which is inside the value of `key`, is wrong.
    pub fn refuse_node(&self, key: &str, node: &Node, what: impl Into<String>) {
        self.problems.report(node.origin, &self.path_of(key), what);
    }

    /// Notes that the table at a dotted path inside this one is wrong; told at this one where there is none.
    pub fn refuse_dotted(&self, path: &str, what: impl Into<String>) {
        path.split('.')
            .fold(self.clone(), |section, key| section.section(key))
            .refuse_whole(what);
    }

    /// Where `key` is written, else this table.
    pub fn place(&self, key: &str) -> ValuePlace {
        self.problems
            .place(self.node(key).map_or(self.origin, |node| node.origin))
    }

    /// Where `node` is written.
    pub fn place_of(&self, node: &Node) -> ValuePlace {
        self.problems.place(node.origin)
    }

    /// Notes that the table as a whole is wrong.
    pub fn refuse_whole(&self, what: impl Into<String>) {
        self.problems.report(self.origin, &dotted(&self.path), what);
    }

    /// Notes that `key` was proposed in place of a wrong one, so that it is not reported as missing too.
    pub fn suggest(&self, key: &str) {
        self.problems.suggest(&self.path_of(key));
    }

    /// Reads `key` with `read`; that it is absent is reported.
    pub fn required<T>(&self, key: &str, read: impl FnOnce(&Self, &str) -> Option<T>) -> Option<T> {
        if self.has(key) {
            return read(self, key);
        }
        if !self.broken && !self.problems.is_suggested(&self.path_of(key)) {
            self.refuse(key, "missing, and there is no default");
        }
        None
    }

    /// The dotted path of `key`.
    pub fn path_of(&self, key: &str) -> String {
        let parts: Vec<_> = self.path.iter().map(String::as_str).chain([key]).collect();
        dotted(&parts)
    }
}
