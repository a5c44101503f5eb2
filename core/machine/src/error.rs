//! Refusals: what is wrong, and where.

use std::fmt;
use std::path::PathBuf;

use crate::shown::one_line;

/// Where a value comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ValuePlace {
    /// A place in a file.
    File {
        /// The file, as it was named.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column in characters, from 1.
        column: usize,
    },
    /// A file as a whole: it cannot be read.
    Whole(PathBuf),
    /// An override of the command line: the dotted path before the `=`.
    Override(String),
}

impl fmt::Display for ValuePlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File { path, line, column } => write!(f, "{}:{line}:{column}", path.display()),
            Self::Whole(path) => write!(f, "{}", path.display()),
            Self::Override(key) => write!(f, "--set {key}"),
        }
    }
}

/// One thing that is wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Where.
    pub place: ValuePlace,
    /// The dotted path of the key concerned; empty where the text is not TOML or cannot be read.
    pub key: String,
    /// What is wrong, and what would be right where that is known.
    pub what: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let said = matches!(&self.place, ValuePlace::Override(key) if *key == self.key);
        let key = if said || self.key.is_empty() {
            String::new()
        } else {
            format!("{}: ", self.key)
        };
        f.write_str(&one_line(&format!("{}: {key}{}", self.place, self.what)))
    }
}

/// Everything that is wrong with a machine's files and overrides, in the order of the files. Displayed one a line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MachineError {
    /// At least one.
    pub problems: Vec<Problem>,
}

impl fmt::Display for MachineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, problem) in self.problems.iter().enumerate() {
            let end = if index == 0 { "" } else { "\n" };
            write!(f, "{end}{problem}")?;
        }
        Ok(())
    }
}

impl std::error::Error for MachineError {}
