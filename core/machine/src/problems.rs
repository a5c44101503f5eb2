//! The texts read so far, and what was found wrong in them.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use crate::error::{MachineError, Problem, ValuePlace};

/// After so many problems the rest is not looked for: it would hide the first ones.
const MAX_PROBLEMS: usize = 100;

/// Where a value was written: which text, and the byte in it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Origin {
    pub source: usize,
    pub offset: usize,
}

/// A text that values come from.
#[derive(Clone, Debug)]
pub enum Source {
    File { path: PathBuf, text: String },
    Unreadable(PathBuf),
    Override(String),
}

#[derive(Clone)]
struct Found {
    origin: Origin,
    key: String,
    what: String,
}

/// Collects problems while everything else goes on, so that all of a file's are told at once.
#[derive(Default)]
pub struct Problems {
    sources: RefCell<Vec<Source>>,
    found: RefCell<Vec<Found>>,
    suggested: RefCell<Vec<String>>,
}

impl Problems {
    /// Keeps the text of a file, for line numbers.
    pub fn add_file(&self, path: &Path, text: String) -> usize {
        self.add(Source::File {
            path: path.to_owned(),
            text,
        })
    }

    /// A file of which there is no text.
    pub fn add_unreadable(&self, path: &Path) -> usize {
        self.add(Source::Unreadable(path.to_owned()))
    }

    /// An override of the command line.
    pub fn add_override(&self, key: &str) -> usize {
        self.add(Source::Override(key.to_owned()))
    }

    fn add(&self, source: Source) -> usize {
        let mut sources = self.sources.borrow_mut();
        sources.push(source);
        sources.len() - 1
    }

    /// Notes that `key`, written at `origin`, is wrong.
    pub fn report(&self, origin: Origin, key: &str, what: impl Into<String>) {
        if !self.is_full() {
            self.found.borrow_mut().push(Found {
                origin,
                key: key.to_owned(),
                what: what.into(),
            });
        }
    }

    /// Whether nothing is wrong so far.
    pub fn is_empty(&self) -> bool {
        self.found.borrow().is_empty()
    }

    /// Whether so much is wrong that looking further helps nobody.
    pub fn is_full(&self) -> bool {
        self.found.borrow().len() >= MAX_PROBLEMS
    }

    /// Notes that `key` was proposed in place of an unknown one: it need not be reported as missing too.
    pub fn suggest(&self, key: &str) {
        self.suggested.borrow_mut().push(key.to_owned());
    }

    /// Whether `key` was proposed in place of an unknown one.
    pub fn is_suggested(&self, key: &str) -> bool {
        self.suggested.borrow().iter().any(|s| s == key)
    }

    /// The place that people read.
    pub fn place(&self, origin: Origin) -> ValuePlace {
        place(&self.sources.borrow(), origin)
    }

    /// The texts read, where they are no longer added to.
    pub fn into_sources(self) -> Vec<Source> {
        self.sources.into_inner()
    }

    /// `value` where nothing is wrong.
    ///
    /// # Errors
    /// Everything reported, in the order of the texts.
    pub fn verdict<T>(&self, value: Option<T>) -> Result<T, MachineError> {
        let mut found = self.found.borrow().clone();
        found.sort_by_key(|f| f.origin);
        let mut problems: Vec<_> = found.into_iter().map(|f| self.problem(f)).collect();
        if self.is_full() {
            problems.extend(problems.last().cloned().map(|last| Problem {
                key: String::new(),
                what: format!("{MAX_PROBLEMS} problems so far; the rest is not listed"),
                ..last
            }));
        }
        value
            .filter(|_| problems.is_empty())
            .ok_or(MachineError { problems })
    }

    fn problem(&self, found: Found) -> Problem {
        Problem {
            place: self.place(found.origin),
            key: found.key,
            what: found.what,
        }
    }
}

/// The place that people read.
pub fn place(sources: &[Source], origin: Origin) -> ValuePlace {
    match sources.get(origin.source) {
        Some(Source::File { path, text }) => {
            let (line, column) = position(text, origin.offset);
            ValuePlace::File {
                path: path.clone(),
                line,
                column,
            }
        }
        Some(Source::Unreadable(path)) => ValuePlace::Whole(path.clone()),
        Some(Source::Override(key)) => ValuePlace::Override(key.clone()),
        None => ValuePlace::Whole(PathBuf::new()),
    }
}

/// Line and column, both from 1, of a byte of `text`.
fn position(text: &str, offset: usize) -> (usize, usize) {
    let before = text.get(..offset).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    let start = before.rfind('\n').map_or(0, |i| i + 1);
    // A byte order mark is not a column that an editor shows.
    let column = before[start..]
        .trim_start_matches('\u{feff}')
        .chars()
        .count()
        + 1;
    (line, column)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_count_characters_from_one() {
        assert_eq!(position("", 0), (1, 1));
        assert_eq!(position("a = 1\nµ = é!", 13), (2, 6));
        assert_eq!(position("\u{feff}a = 1", 7), (1, 5));
        assert_eq!(
            position("é", 1),
            (1, 2),
            "an offset inside a character does not panic"
        );
    }
}
