//! The text of a program: one open file, read twice.
//!
//! Memory is bounded whatever the size of the program: one chunk of 64 KiB, and 16 bytes (a hash and a place) for each
//! chunk of the file. A program of a million lines of 30 bytes needs 64 KiB + 8 KiB. One that jumps holds eight chunks.

pub(crate) mod lines;

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
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
    #[error(
        "{name}: the file has changed since it was checked, between the lines {first_line} and {last_line}"
    )]
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
    Text(#[from] Box<Diagnostic>),
}

impl From<Diagnostic> for ProgramError {
    fn from(diagnostic: Diagnostic) -> Self {
        Self::Text(Box::new(diagnostic))
    }
}

/// A part program: a file kept open, so that both passes read the same one.
#[derive(Debug)]
pub struct Program {
    pub(crate) name: Arc<str>,
    file: File,
    /// Each chunk that the first pass has read; `None` before it.
    pub(crate) chunks: Option<Vec<KnownChunk>>,
    /// Where the file lies; `None` for text that is no file.
    pub(crate) folder: Option<PathBuf>,
    /// Files of subroutines that the first pass has opened, with the labels that they were looked up by.
    pub(crate) subroutines: Vec<(String, Program)>,
}

/// What is kept of a chunk of text.
#[derive(Clone, Copy, Debug)]
pub(crate) struct KnownChunk {
    /// Where it ends in the file.
    pub end: u64,
    pub hash: u64,
}

impl Program {
    /// Opens the file at `path`. What is not a plain file (a pipe) is copied to a temporary one first.
    ///
    /// # Errors
    /// The file cannot be opened or read, or is a directory.
    pub fn open(path: &Path) -> Result<Self, ProgramError> {
        let name: Arc<str> = path.display().to_string().into();
        let io = |error| ProgramError::Io {
            name: Arc::clone(&name),
            error,
        };
        let file = File::open(path).map_err(io)?;
        let kind = file.metadata().map_err(io)?.file_type();
        if kind.is_dir() {
            return Err(io(io::ErrorKind::IsADirectory.into()));
        }
        if !kind.is_file() {
            return Self::spool(&name, file);
        }
        Ok(Self {
            name,
            file,
            chunks: None,
            folder: path.parent().map(Path::to_path_buf),
            subroutines: Vec::new(),
        })
    }

    /// Copies `reader` to an unnamed temporary file; `name` is for messages.
    ///
    /// # Errors
    /// Reading or writing fails.
    pub fn spool(name: &str, mut reader: impl Read) -> Result<Self, ProgramError> {
        let name: Arc<str> = name.into();
        let io = |error| ProgramError::Io {
            name: Arc::clone(&name),
            error,
        };
        let mut file = tempfile::tempfile().map_err(io)?;
        io::copy(&mut reader, &mut file).map_err(io)?;
        Ok(Self {
            name,
            file,
            chunks: None,
            folder: None,
            subroutines: Vec::new(),
        })
    }

    /// The name of the program, as it was opened.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Reads from byte `offset` on until `text` is full or the file ends; how many bytes that were.
    pub(crate) fn read_at(&mut self, offset: u64, text: &mut [u8]) -> Result<usize, ProgramError> {
        let io = |error| ProgramError::Io {
            name: Arc::clone(&self.name),
            error,
        };
        self.file.seek(SeekFrom::Start(offset)).map_err(io)?;
        let mut filled = 0;
        while filled < text.len() {
            match self.file.read(&mut text[filled..]) {
                Ok(0) => break,
                Ok(count) => filled += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => {
                    return Err(ProgramError::Io {
                        name: Arc::clone(&self.name),
                        error,
                    });
                }
            }
        }
        Ok(filled)
    }
}
