//! The text of a program: one open file, read twice.
//!
//! Memory is bounded whatever the size of the program: one chunk of 64 KiB, and 8 bytes (a hash) for each chunk of the
//! file. A program of a million lines of 30 bytes needs 64 KiB + 4 KiB.

pub(crate) mod lines;

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::Arc;

use crate::diagnostic::Diagnostic;

/// Why a program cannot be read, or not go on.
#[derive(Debug, thiserror::Error)]
pub enum ProgramError {
    /// The system refused.
    #[error("{name}: {error}")]
    Io {
        /// Name of the program.
        name: Arc<str>,
        /// What the system said.
        error: io::Error,
    },
    /// The file is not what the first pass read.
    #[error("{name}: the file has changed since it was checked, between the lines {first_line} and {last_line}")]
    Changed {
        /// Name of the program.
        name: Arc<str>,
        /// First line of the part that changed; nothing of it has been handed out.
        first_line: u32,
        /// Last line of that part, as the file is now.
        last_line: u32,
    },
    /// The stream was opened before the program was checked.
    #[error("{0}: the program has not been checked")]
    Unchecked(Arc<str>),
    /// The stream was asked for more before the input of M66 was provided.
    #[error("{0}: the program waits for an input (M66)")]
    WaitsForInput(Arc<str>),
    /// The stream was asked for more before the result of a probe was provided.
    #[error("{0}: the program waits for the result of a probe")]
    WaitsForProbe(Arc<str>),
    /// An error in the text.
    #[error(transparent)]
    Text(#[from] Diagnostic),
}

/// A part program: a file kept open, so that both passes read the same one.
#[derive(Debug)]
pub struct Program {
    pub(crate) name: Arc<str>,
    pub(crate) file: File,
    /// A hash of each chunk the first pass has read; `None` before it.
    pub(crate) hashes: Option<Vec<u64>>,
}

impl Program {
    /// Opens the file at `path`. What is not a plain file (a pipe) is copied to a temporary one first.
    ///
    /// # Errors
    /// The file cannot be opened or read, or is a directory.
    pub fn open(path: &Path) -> Result<Self, ProgramError> {
        let name: Arc<str> = path.display().to_string().into();
        let io = |error| ProgramError::Io { name: Arc::clone(&name), error };
        let file = File::open(path).map_err(io)?;
        let kind = file.metadata().map_err(io)?.file_type();
        if kind.is_dir() {
            return Err(io(io::ErrorKind::IsADirectory.into()));
        }
        if !kind.is_file() {
            return Self::spool(&name, file);
        }
        Ok(Self { name, file, hashes: None })
    }

    /// Copies `reader` to an unnamed temporary file; `name` is for messages.
    ///
    /// # Errors
    /// Reading or writing fails.
    pub fn spool(name: &str, mut reader: impl Read) -> Result<Self, ProgramError> {
        let name: Arc<str> = name.into();
        let io = |error| ProgramError::Io { name: Arc::clone(&name), error };
        let mut file = tempfile::tempfile().map_err(io)?;
        io::copy(&mut reader, &mut file).map_err(io)?;
        Ok(Self { name, file, hashes: None })
    }

    /// The name of the program, as it was opened.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Goes back to the first byte.
    pub(crate) fn rewind(&mut self) -> Result<(), ProgramError> {
        let rewound = self.file.seek(SeekFrom::Start(0));
        rewound.map(|_| ()).map_err(|error| ProgramError::Io { name: Arc::clone(&self.name), error })
    }
}
