//! A file that could not be written any further.

use std::fmt;
use std::path::Path;

use serde::Serialize;
use tandem_rings::Sample;

use super::output::Output;

/// A file that a run writes and that cannot be written any further: a full disk, a reader that has gone away.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct RecordError {
    /// What it was to hold: `trace`, `blocks`, `events`, `report`, `summary`.
    pub what: &'static str,
    /// The file.
    pub file: String,
    /// Why, in the system's words.
    pub cause: String,
    /// Fine period of the first sample that is missing, where the motion was still going on.
    pub tick: Option<u64>,
    /// Its program line.
    pub line: Option<u32>,
    /// Where that lies which was written before; none where nothing is left of it.
    pub kept_as: Option<String>,
}

impl RecordError {
    /// That `what` could not be written to `out`, because of `cause`; nothing is left of it.
    pub fn lost(what: &'static str, file: &Path, cause: impl fmt::Display) -> Self {
        let (file, cause) = (file.display().to_string(), cause.to_string());
        Self { what, file, cause, tick: None, line: None, kept_as: None }
    }

    /// That `what` could not be written to `out`, because of `cause`. What was written of it stays where it is.
    pub fn of(what: &'static str, out: &mut Output, cause: impl fmt::Display) -> Self {
        let kept_as = out.keep().map(|part| part.display().to_string());
        Self { kept_as, ..Self::lost(what, out.path(), cause) }
    }

    /// The same, with the first sample that is missing.
    #[must_use]
    pub fn at(self, sample: &Sample) -> Self {
        Self { tick: Some(sample.tick), line: Some(sample.line), ..self }
    }
}

impl fmt::Display for RecordError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}: it cannot be written any further", self.what, self.file)?;
        match (self.tick, self.line) {
            (Some(tick), Some(line)) => write!(f, ", from tick {tick}, line {line}")?,
            (None, Some(line)) => write!(f, ", from line {line}")?,
            _ => {}
        }
        write!(f, ": {}", self.cause)?;
        match &self.kept_as {
            Some(part) => write!(f, "; what is written stays in {part}"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for RecordError {}
