//! Reading one table: every value is checked as it is read, and what is wrong is noted.

use crate::node::{Node, Table, Value};
use crate::problems::{Origin, Problems};
use crate::shown::{dotted, shorten};

/// Beyond these a number is a slip, and products of it would overflow or vanish.
const LARGEST: f64 = 1e12;
const SMALLEST: f64 = 1e-9;

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
    pub fn new(path: Vec<String>, origin: Origin, table: &'a Table, problems: &'a Problems) -> Self {
        Self { path, origin, table: Some(table), broken: false, problems }
    }

    /// The table `key` inside this one.
    pub fn section(&self, key: &str) -> Self {
        let node = self.node(key);
        let mut path = self.path.clone();
        path.push(key.to_owned());
        let origin = node.map_or(self.origin, |n| n.origin);
        let table = node.and_then(Node::table);
        let broken = self.broken || (node.is_some() && table.is_none());
        Self { path, origin, table, broken, problems: self.problems }
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
        self.table.into_iter().flat_map(|table| table.keys().map(String::as_str))
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
    fn right(&self, key: &str) -> Option<&'a Node> {
        self.node(key).filter(|node| !matches!(node.value, Value::Wrong))
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

    /// A text that is not empty.
    pub fn text(&self, key: &str) -> Option<&'a str> {
        let node = self.right(key)?;
        match node.text() {
            Some("") => self.refuse(key, "must not be empty"),
            None => self.refuse_kind(key, "a string", node),
            Some(text) => return Some(text),
        }
        None
    }

    /// One of the given words, and what it stands for.
    pub fn choice<T: Copy>(&self, key: &str, words: &[(&str, T)]) -> Option<T> {
        let text = self.text(key)?;
        let found = words.iter().find(|(word, _)| *word == text);
        if found.is_none() {
            let all: Vec<_> = words.iter().map(|(word, _)| format!("\"{word}\"")).collect();
            self.refuse(key, format!("must be {}, not \"{}\"", all.join(" or "), shorten(text)));
        }
        found.map(|(_, meaning)| *meaning)
    }

    /// A whole number from `least` to `most`.
    pub fn whole(&self, key: &str, least: u32, most: u32) -> Option<u32> {
        let node = self.right(key)?;
        let number = match node.value {
            Value::Integer(number) => number,
            Value::Float(number) => {
                self.refuse(key, format!("must be a whole number, not {number:?}"));
                return None;
            }
            _ => {
                self.refuse_kind(key, "a whole number", node);
                return None;
            }
        };
        let fits = u32::try_from(number).ok().filter(|n| (least..=most).contains(n));
        if fits.is_none() {
            self.refuse(key, format!("must be from {least} to {most}, not {number}"));
        }
        fits
    }

    /// A finite number.
    pub fn number(&self, key: &str) -> Option<f64> {
        self.finite(key, self.right(key)?)
    }

    /// A finite number of at least `least`.
    pub fn at_least(&self, key: &str, least: f64) -> Option<f64> {
        let number = self.number(key)?;
        if number < least {
            self.refuse(key, format!("must be at least {least}, not {number}"));
        }
        Some(number).filter(|n| *n >= least)
    }

    /// A finite number above zero.
    pub fn positive(&self, key: &str) -> Option<f64> {
        let number = self.number(key)?;
        if number <= 0.0 {
            self.refuse(key, format!("must be above 0, not {number}"));
        } else if number < SMALLEST {
            self.refuse(key, format!("must be at least {SMALLEST:e}, not {number:e}"));
        }
        Some(number).filter(|n| *n >= SMALLEST)
    }

    /// A lower and a higher number.
    pub fn range(&self, key: &str) -> Option<(f64, f64)> {
        let node = self.right(key)?;
        let Some([low, high]) = node.array() else {
            self.refuse(key, "must be [lowest, highest]");
            return None;
        };
        let (low, high) = (self.finite(key, low)?, self.finite(key, high)?);
        if low < high {
            return Some((low, high));
        }
        self.refuse(key, format!("the lowest, {low}, is not below the highest, {high}"));
        None
    }

    fn finite(&self, key: &str, node: &Node) -> Option<f64> {
        match node.value {
            Value::Integer(number) => self.bounded(key, number as f64),
            Value::Float(number) => self.bounded(key, number),
            Value::Wrong => None,
            _ => {
                self.refuse_kind(key, "a number", node);
                None
            }
        }
    }

    fn bounded(&self, key: &str, number: f64) -> Option<f64> {
        if !number.is_finite() {
            self.refuse(key, format!("must be finite, not {number}"));
        } else if number.abs() > LARGEST {
            self.refuse(key, format!("must be at most {LARGEST:e}, not {number:e}"));
        }
        Some(number).filter(|n| n.abs() <= LARGEST)
    }

    fn refuse_kind(&self, key: &str, wanted: &str, node: &Node) {
        self.refuse(key, format!("must be {wanted}, not {}", node.kind()));
    }

    /// The dotted path of `key`.
    pub fn path_of(&self, key: &str) -> String {
        let parts: Vec<_> = self.path.iter().map(String::as_str).chain([key]).collect();
        dotted(&parts)
    }
}
