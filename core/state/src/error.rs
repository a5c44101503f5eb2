//! What can go wrong with the state file.

use std::path::{Path, PathBuf};

/// Why the state of a machine cannot be read or written: the file, what is wrong, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StateError {
    /// It cannot be opened at all.
    #[error("{path}: the state of the machine cannot be opened: {why}", path = path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// The system's words.
        why: String,
    },
    /// There is none.
    #[error("{path}: there is no such file; `tandem serve` makes it, and --state names another", path = path.display())]
    Missing {
        /// The file.
        path: PathBuf,
    },
    /// It is no SQLite file, or its pages or values contradict each other.
    #[error(
        "{path}: the state of the machine is damaged ({what}): nothing of it is used. Move the file away together with \
         {path}-wal; the next start makes a new one with the values of the machine file, into which `tandem state import` \
         reads an export",
        path = path.display()
    )]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// It is a database of another program.
    #[error("{path}: this is no state of a machine ({what}): name another file with --state", path = path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What it is instead.
        what: String,
    },
    /// A later version of Tandem has written it.
    #[error(
        "{path}: the state was written by a later version of Tandem (its format is {found}, this version knows {known}): \
         install that version, or go back to the copy that it made when it changed the format, {path}.format-{known}",
        path = path.display()
    )]
    Newer {
        /// The file.
        path: PathBuf,
        /// Number of its format.
        found: i64,
        /// Highest number that this version knows.
        known: i64,
    },
    /// It belongs to another machine.
    #[error(
        "{path}: this is the state of another machine: {what}. Name another file with --state; where the machine itself was \
         changed, carry over what still holds: `tandem state export`, move the file away, `tandem state import`",
        path = path.display()
    )]
    OtherMachine {
        /// The file.
        path: PathBuf,
        /// What differs.
        what: String,
    },
    /// Another process writes it.
    #[error(
        "{path}: another process has the state of this machine open: one controller a machine. Stop it first, or ask it",
        path = path.display()
    )]
    InUse {
        /// The file.
        path: PathBuf,
    },
    /// A value that cannot last.
    #[error("{what} cannot be kept: {why}")]
    Value {
        /// The value.
        what: String,
        /// What is wrong with it.
        why: String,
    },
    /// It could not be written. What was to be written is as before.
    #[error("{path}: the state of the machine cannot be written: {why}", path = path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do.
        why: String,
    },
    /// The store is closed.
    #[error("{path}: the state of the machine is closed", path = path.display())]
    Closed {
        /// The file.
        path: PathBuf,
    },
    /// There is no folder for it.
    #[error(
        "there is no folder for the state of the machine: neither STATE_DIRECTORY, XDG_STATE_HOME nor HOME is set; name a file with --state"
    )]
    Nowhere,
}

impl StateError {
    /// An error of SQLite while the file at `path` is read.
    pub(crate) fn reading(path: &Path, error: &rusqlite::Error) -> Self {
        use rusqlite::ErrorCode as Code;
        let path = path.to_path_buf();
        match error.sqlite_error_code() {
            Some(Code::NotADatabase) => Self::Foreign {
                path,
                what: "it is no SQLite file".into(),
            },
            Some(Code::DatabaseCorrupt) | None => Self::Damaged {
                path,
                what: error.to_string(),
            },
            Some(Code::DatabaseBusy | Code::DatabaseLocked) => Self::InUse { path },
            Some(_) => Self::Open {
                path,
                why: words(error),
            },
        }
    }

    /// An error of SQLite while the file at `path` is written.
    pub(crate) fn writing(path: &Path, error: &rusqlite::Error) -> Self {
        Self::Write {
            path: path.to_path_buf(),
            why: words(error),
        }
    }
}

/// What SQLite means, and what to do.
fn words(error: &rusqlite::Error) -> String {
    use rusqlite::ErrorCode as Code;
    match error.sqlite_error_code() {
        Some(Code::DiskFull) => "the disk is full; make room, it goes on by itself".into(),
        Some(Code::ReadOnly) => {
            "the file or its folder is read-only; SQLite needs both writable".into()
        }
        Some(Code::CannotOpen) => {
            "the file or its folder cannot be opened; SQLite needs both readable and writable"
                .into()
        }
        Some(Code::PermissionDenied) => "this user may not".into(),
        Some(Code::SystemIoFailure) => format!("the disk fails ({error})"),
        _ => error.to_string(),
    }
}
