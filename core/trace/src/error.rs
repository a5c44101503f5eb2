//! What makes a trace unreadable.

use std::io;

/// A trace cannot be read (or written) at all. Damage between records is no error: see [`crate::Damage`].
#[derive(Debug, thiserror::Error)]
#[error("byte {offset}: {cause}")]
pub struct TraceError {
    /// Where in the file, in bytes from its start.
    pub offset: u64,
    /// Why.
    #[source]
    pub cause: Cause,
}

/// Why a trace cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum Cause {
    /// The first bytes are not those of a trace.
    #[error("not a Tandem trace (its first bytes are others)")]
    Magic,
    /// Another format number.
    #[error("the trace has format {0}, this program reads formats 1 to {expected}", expected = crate::FORMAT)]
    Format(u32),
    /// The file ends within the header; nothing can be read without it.
    #[error("the file ends within its header")]
    Short,
    /// The header does not hold what it should, or its checksum differs.
    #[error("the header is damaged: {0}")]
    Header(&'static str),
    /// The system refuses.
    #[error("{0}")]
    Io(#[from] io::Error),
}

impl TraceError {
    pub(crate) fn at(offset: u64, cause: impl Into<Cause>) -> Self {
        Self {
            offset,
            cause: cause.into(),
        }
    }
}
