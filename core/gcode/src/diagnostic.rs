//! Errors as people read them: file, line, column, cause, and the line itself with a caret.

use std::fmt::{self, Write as _};
use std::sync::Arc;

use crate::line_error::{LineError, Sketch, Span};

/// Most characters of a line that are shown on either side of the column.
const CONTEXT: usize = 60;

/// How grave a [`Diagnostic`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// The program is not driven.
    Error,
    /// The program is driven; this is worth to be known.
    Warning,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Error => "error",
            Self::Warning => "warning",
        })
    }
}

/// One error of a part program, or a warning.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostic {
    /// Whether it stops the program.
    pub severity: Severity,
    /// Name of the program, as it was opened.
    pub file: Arc<str>,
    /// Line, from 1.
    pub line: u32,
    /// First column of the offending text, in characters from 1.
    pub column: u32,
    /// Column after the offending text.
    pub end_column: u32,
    /// Short stable name of the error, for tools: `arc-radius`, `travel`, …
    pub code: &'static str,
    /// The cause in words.
    pub message: String,
    /// The line, shortened around the column where it is long, what is not text and cannot be seen escaped.
    pub excerpt: String,
    /// Characters of [`Diagnostic::excerpt`] before the caret.
    pub caret: u32,
    /// What is to be drawn of it: where radius compensation finds no way for the tool.
    pub sketch: Option<Box<Sketch>>,
}

impl Diagnostic {
    /// An error that concerns `line` of `file` as a whole.
    pub fn whole_line(
        file: &Arc<str>,
        line: u32,
        text: &[u8],
        code: &'static str,
        message: String,
    ) -> Self {
        Self::new(
            file,
            line,
            text,
            LineError::new(Span::new(0, text.len()), code, message),
        )
    }

    /// The error in `line`, or in the line before it that `error` names.
    pub(crate) fn new(file: &Arc<str>, line: u32, text: &[u8], error: LineError) -> Self {
        let error = error.into_details();
        let (line, text) = error
            .line
            .as_ref()
            .map_or((line, text), |before| (before.number, &before.text));
        let start = text.len().min(error.span.start as usize);
        let end = text.len().min(error.span.end as usize).max(start);
        let column = 1 + characters(&text[..start]);
        let (excerpt, caret) = excerpt(text, start);
        Self {
            severity: Severity::Error,
            file: Arc::clone(file),
            line,
            column,
            end_column: column + characters(&text[start..end]).max(1),
            code: error.code,
            message: error.message,
            excerpt,
            caret,
            sketch: error.sketch,
        }
    }
}

fn characters(bytes: &[u8]) -> u32 {
    String::from_utf8_lossy(bytes).chars().count() as u32
}

/// The text around byte `at`, and the number of characters before it.
fn excerpt(text: &[u8], at: usize) -> (String, u32) {
    let from = at.saturating_sub(CONTEXT);
    let to = text.len().min(at + CONTEXT);
    let mut shown = String::new();
    if from > 0 {
        shown.push('…');
    }
    escape(&text[from..at], &mut shown);
    let caret = shown.chars().count() as u32;
    escape(&text[at..to], &mut shown);
    if to < text.len() {
        shown.push('…');
    }
    (shown, caret)
}

fn escape(bytes: &[u8], to: &mut String) {
    for chunk in bytes.utf8_chunks() {
        for character in chunk.valid().chars() {
            match character {
                '\t' => to.push(' '),
                '"' | '\'' | '\\' => to.push(character),
                c if c.is_control() => to.extend(c.escape_unicode()),
                // What cannot be seen (marks of direction, blanks of no width) would deceive who reads the message.
                c => to.extend(c.escape_debug()),
            }
        }
        for byte in chunk.invalid() {
            let _ = write!(to, "\\x{byte:02x}");
        }
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}:{}:{}: {}: {}",
            self.file, self.line, self.column, self.severity, self.message
        )?;
        if self.excerpt.is_empty() {
            return Ok(());
        }
        writeln!(f, "\n  {}", self.excerpt)?;
        let room = (CONTEXT as u32)
            .min((self.excerpt.chars().count() as u32).saturating_sub(self.caret))
            .max(1);
        let width = (self.end_column - self.column).clamp(1, room);
        write!(
            f,
            "  {}{}",
            " ".repeat(self.caret as usize),
            "^".repeat(width as usize)
        )
    }
}

impl std::error::Error for Diagnostic {}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(text: &[u8], start: usize, end: usize) -> String {
        let error = LineError::new(Span::new(start, end), "test", "no good");
        Diagnostic::new(&"part.ngc".into(), 7, text, error).to_string()
    }

    #[test]
    fn the_caret_points_at_the_text() {
        assert_eq!(
            shown(b"G1 X1 Q2", 6, 8),
            "part.ngc:7:7: error: no good\n  G1 X1 Q2\n        ^^"
        );
        assert_eq!(shown(b"", 0, 0), "part.ngc:7:1: error: no good");
    }

    #[test]
    fn columns_count_characters_and_control_bytes_are_escaped() {
        assert_eq!(
            shown("(ä)\u{7}".as_bytes(), 4, 5),
            "part.ngc:7:4: error: no good\n  (ä)\\u{7}\n     ^"
        );
        assert_eq!(
            shown(b"(\xff)Q", 3, 4),
            "part.ngc:7:4: error: no good\n  (\\xff)Q\n        ^"
        );
        let hidden = shown("(\u{202e}'\u{9b}\\)".as_bytes(), 0, 1);
        assert_eq!(
            hidden,
            "part.ngc:7:1: error: no good\n  (\\u{202e}'\\u{9b}\\)\n  ^"
        );
    }

    #[test]
    fn long_lines_are_shortened_around_the_column() {
        let text = [b'1'; 4000];
        let shown = shown(&text, 2000, 4000);
        let lines: Vec<_> = shown.lines().collect();
        assert_eq!(lines[1].chars().count(), 2 + 122);
        assert!(
            lines[1].starts_with("  …1") && lines[1].ends_with("1…"),
            "{shown}"
        );
        assert_eq!(lines[2].find('^'), Some(2 + 61));
    }
}
