//! What can go wrong while an input is read.

/// An input that could not be read, with its place and the cause.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The file could not be opened or read.
    #[error("{file}: {cause}")]
    Open {
        /// The file.
        file: String,
        /// What the system said.
        cause: String,
    },
    /// A line of a file makes no sense.
    #[error("{file}:{line}: {cause}")]
    Line {
        /// The file.
        file: String,
        /// The line, from 1.
        line: u64,
        /// What is wrong there.
        cause: String,
    },
    /// A key of `machine.toml` is missing or has a value of the wrong kind.
    #[error("{file}: {key}: {cause}")]
    Key {
        /// The file.
        file: String,
        /// The dotted key.
        key: String,
        /// What is wrong with it.
        cause: String,
    },
}

impl Error {
    pub(crate) fn open(file: &str, cause: impl Into<String>) -> Self {
        Self::Open {
            file: file.into(),
            cause: cause.into(),
        }
    }

    pub(crate) fn line(file: &str, line: u64, cause: impl Into<String>) -> Self {
        Self::Line {
            file: file.into(),
            line,
            cause: cause.into(),
        }
    }

    pub(crate) fn key(file: &str, key: &str, cause: impl Into<String>) -> Self {
        Self::Key {
            file: file.into(),
            key: key.into(),
            cause: cause.into(),
        }
    }
}
