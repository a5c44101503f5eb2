//! The cursor over the bytes of one line.

use crate::line_error::{Checked, LineError, Span};

/// A cursor over one line. Blanks and comments may stand between any two words.
pub(crate) struct Scanner<'t> {
    text: &'t [u8],
    at: usize,
    /// The first comment `(ABORT, …)` that has been passed, with its parentheses.
    abort: Option<Span>,
}

impl<'t> Scanner<'t> {
    pub fn new(text: &'t [u8], at: usize) -> Self {
        Self {
            text,
            at,
            abort: None,
        }
    }

    pub fn at(&self) -> usize {
        self.at
    }

    /// The first comment `(ABORT, …)` that has been passed, with its parentheses.
    pub fn abort(&self) -> Option<Span> {
        self.abort
    }

    /// The line.
    pub fn text(&self) -> &'t [u8] {
        self.text
    }

    /// The rest of the line.
    pub fn rest(&self) -> &'t [u8] {
        &self.text[self.at..]
    }

    /// The next byte; 0 at the end of the line, where no valid text has it.
    #[inline]
    pub fn peek(&self) -> u8 {
        self.text.get(self.at).copied().unwrap_or(0)
    }

    /// The byte `ahead` of the next one, upper case.
    pub fn peek_at(&self, ahead: usize) -> u8 {
        self.text
            .get(self.at + ahead)
            .copied()
            .unwrap_or(0)
            .to_ascii_uppercase()
    }

    pub fn at_end(&self) -> bool {
        self.at >= self.text.len()
    }

    #[inline]
    pub fn advance(&mut self, count: usize) {
        self.at = (self.at + count).min(self.text.len());
    }

    /// Takes `byte` if it comes next after blanks.
    pub fn take(&mut self, byte: u8) -> bool {
        self.skip_blanks();
        let found = self.peek() == byte && !self.at_end();
        if found {
            self.at += 1;
        }
        found
    }

    #[inline]
    pub fn skip_blanks(&mut self) {
        while matches!(self.peek(), b' ' | b'\t') {
            self.at += 1;
        }
    }

    /// Skips blanks and comments.
    #[inline]
    pub fn skip_ignorable(&mut self) -> Checked<()> {
        loop {
            self.skip_blanks();
            match self.peek() {
                b'(' => self.skip_comment()?,
                b';' => self.at = self.text.len(),
                _ => return Ok(()),
            }
        }
    }

    /// Comments may hold pairs of parentheses: `(z = sin(x))`.
    fn skip_comment(&mut self) -> Checked<()> {
        let start = self.at;
        let mut depth = 0;
        for byte in &self.text[start..] {
            self.at += 1;
            match byte {
                b'(' => depth += 1,
                b')' if depth == 1 => {
                    if self.abort.is_none() && aborts(&self.text[start + 1..]) {
                        self.abort = Some(self.since(start));
                    }
                    self.skip_unopened();
                    return Ok(());
                }
                b')' => depth -= 1,
                _ => {}
            }
        }
        let nested = self.text[start + 1..].contains(&b'(');
        let message = if nested {
            "the comment is not closed: it holds more ( than )"
        } else {
            "the comment is not closed: ) is missing"
        };
        Err(LineError::new(self.since(start), "comment", message))
    }

    /// `)` behind a comment is part of it: `(FirstOp-T1))`.
    fn skip_unopened(&mut self) {
        while matches!(self.peek(), b')' | b' ' | b'\t') {
            self.at += 1;
        }
    }

    /// The run of letters that comes next, at most 8, upper case, zero-padded; the cursor stays.
    pub fn name(&self) -> ([u8; 8], usize) {
        let mut name = [0; 8];
        let mut length = 0;
        while length < 8 && self.peek_at(length).is_ascii_uppercase() {
            name[length] = self.peek_at(length);
            length += 1;
        }
        (name, length)
    }

    /// From `start` to the cursor.
    pub fn since(&self, start: usize) -> Span {
        Span::new(start, self.at)
    }

    /// The next character (all bytes of it, so that it can be shown).
    pub fn here(&self) -> Span {
        let tail = self
            .rest()
            .iter()
            .skip(1)
            .take_while(|b| **b & 0xc0 == 0x80)
            .count();
        Span::new(self.at, (self.at + 1 + tail).min(self.text.len()))
    }
}

/// The byte of `text` at `at`; 0 behind the end.
#[inline]
pub(crate) fn byte_at(text: &[u8], at: usize) -> u8 {
    text.get(at).copied().unwrap_or(0)
}

/// Eight bytes of `text` from `at` on, the first one lowest; 0 behind the end.
#[inline]
pub(crate) fn eight_at(text: &[u8], at: usize) -> u64 {
    if let Some(eight) = text.get(at..).and_then(<[u8]>::first_chunk) {
        return u64::from_le_bytes(*eight);
    }
    // The last eight bytes of the line, moved down.
    match text.last_chunk() {
        Some(last) if at < text.len() => u64::from_le_bytes(*last) >> (8 * (at + 8 - text.len())),
        _ => few_at(text, at),
    }
}

/// The same in a line that is shorter.
#[cold]
fn few_at(text: &[u8], at: usize) -> u64 {
    (0..8).fold(0, |eight, i| {
        eight | u64::from(byte_at(text, at + i)) << (8 * i)
    })
}

/// What a comment begins with that ends the program.
pub(crate) const ABORT: &str = "abort,";

/// Whether a comment is `(ABORT, …)`.
fn aborts(comment: &[u8]) -> bool {
    comment
        .trim_ascii_start()
        .get(..ABORT.len())
        .is_some_and(|start| start.eq_ignore_ascii_case(ABORT.as_bytes()))
}
