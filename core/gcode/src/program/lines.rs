//! A file as lines, read in chunks of whole lines.

use std::hash::{DefaultHasher, Hasher};
use std::io::Read;
use std::sync::Arc;

use super::{Program, ProgramError};
use crate::diagnostic::Diagnostic;
use crate::fault::{Fault, Span};
use crate::interpreter::MAX_LINE_BYTES;

const CHUNK: usize = 64 * 1024;
const BOM: &[u8] = b"\xef\xbb\xbf";

/// What the reader does with the hash of each chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pass {
    /// Keeps it.
    First,
    /// Compares it: a chunk that differs is not handed out.
    Second,
}

/// Where the next line lies.
pub(crate) enum Next {
    /// Bytes of the chunk, without the line end; see [`Lines::text`].
    Line(std::ops::Range<usize>),
    /// A line that cannot be one; reading goes on behind it.
    Bad(Diagnostic),
    /// No more lines.
    End,
}

/// The lines of a program in one pass.
pub(crate) struct Lines {
    pass: Pass,
    buffer: Vec<u8>,
    /// Bytes of the buffer that have been read from the file.
    filled: usize,
    /// End of the chunk: behind its last line end.
    end: usize,
    at: usize,
    /// Number of chunks read.
    chunks: usize,
    /// Number of the last line handed out.
    pub number: u32,
    /// The chunk has begun within a line that is too long.
    skipping: bool,
    at_end_of_file: bool,
}

impl Lines {
    pub fn new(program: &mut Program, pass: Pass) -> Result<Self, ProgramError> {
        program.rewind()?;
        if pass == Pass::First {
            program.hashes = Some(Vec::new());
        }
        Ok(Self {
            pass,
            buffer: vec![0; CHUNK],
            filled: 0,
            end: 0,
            at: 0,
            chunks: 0,
            number: 0,
            skipping: false,
            at_end_of_file: false,
        })
    }

    /// The text of a line.
    pub fn text(&self, line: &std::ops::Range<usize>) -> &[u8] {
        &self.buffer[line.clone()]
    }

    /// The next line.
    ///
    /// # Errors
    /// The file cannot be read, has changed, or is binary: nothing more can be read.
    #[inline]
    pub fn next(&mut self, program: &mut Program) -> Result<Next, ProgramError> {
        loop {
            if self.at == self.end && !self.read_chunk(program)? {
                return Ok(Next::End);
            }
            let (range, closed) = self.take_piece();
            if std::mem::replace(&mut self.skipping, !closed) {
                continue;
            }
            self.number += 1;
            if range.len() > MAX_LINE_BYTES {
                return Ok(Next::Bad(self.too_long(program, range.start, range.end)));
            }
            return Ok(Next::Line(range));
        }
    }

    /// The text up to the next line end, and whether there is one (or the file ends). A chunk without any line end is a
    /// piece of a line that is too long.
    #[inline]
    fn take_piece(&mut self) -> (std::ops::Range<usize>, bool) {
        let from = self.at;
        let newline = self.buffer[from..self.end].iter().position(|b| *b == b'\n');
        let to = newline.map_or(self.end, |length| from + length);
        self.at = (to + 1).min(self.end);
        let text = &self.buffer[from..to];
        let to = if text.ends_with(b"\r") { to - 1 } else { to };
        (from..to, newline.is_some() || self.at_end_of_file)
    }

    fn too_long(&self, program: &Program, from: usize, to: usize) -> Diagnostic {
        let why = format!("the line is longer than {MAX_LINE_BYTES} bytes: this is hardly a part program");
        let fault = Fault::new(Span::new(0, 1), "line-long", why);
        Diagnostic::new(&program.name, self.number, &self.buffer[from..to], fault)
    }

    /// Reads the next chunk; false at the end of the file.
    fn read_chunk(&mut self, program: &mut Program) -> Result<bool, ProgramError> {
        self.buffer.copy_within(self.end..self.filled, 0);
        self.filled -= self.end;
        self.fill(program)?;
        self.end = match self.buffer[..self.filled].iter().rposition(|b| *b == b'\n') {
            Some(newline) => newline + 1,
            None => self.filled,
        };
        if self.at_end_of_file {
            self.end = self.filled;
        }
        self.compare(program)?;
        self.at = if self.chunks == 0 && self.buffer[..self.end].starts_with(BOM) { BOM.len() } else { 0 };
        self.chunks += 1;
        self.refuse_binary(program)?;
        Ok(self.end > 0)
    }

    fn fill(&mut self, program: &mut Program) -> Result<(), ProgramError> {
        while self.filled < CHUNK && !self.at_end_of_file {
            match program.file.read(&mut self.buffer[self.filled..]) {
                Ok(0) => self.at_end_of_file = true,
                Ok(count) => self.filled += count,
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                Err(error) => return Err(ProgramError::Io { name: Arc::clone(&program.name), error }),
            }
        }
        Ok(())
    }

    /// Keeps the hash of the chunk, or refuses a chunk that is not what the first pass read.
    fn compare(&self, program: &mut Program) -> Result<(), ProgramError> {
        let mut hasher = DefaultHasher::new();
        hasher.write(&self.buffer[..self.end]);
        let hash = hasher.finish();
        let hashes = program.hashes.get_or_insert_default();
        if self.pass == Pass::First {
            hashes.push(hash);
        } else if hashes.get(self.chunks) != Some(&hash) {
            let first_line = self.number + 1;
            let last_line = self.number + self.buffer[..self.end].split(|b| *b == b'\n').count() as u32;
            return Err(ProgramError::Changed { name: Arc::clone(&program.name), first_line, last_line });
        }
        Ok(())
    }

    fn refuse_binary(&self, program: &Program) -> Result<(), ProgramError> {
        let chunk = &self.buffer[..self.end];
        // Nearly always all is plain text, which is seen without a branch for each byte.
        let plain = |b: &u8| *b >= b' ' && *b != 0x7f || *b == b'\n';
        if chunk.iter().fold(true, |all, b| all & plain(b)) {
            return Ok(());
        }
        // Ctrl-Z ends the text of old systems; the line reader meets it only behind the end of the program.
        let is_binary = |b: &u8| *b < b' ' && !matches!(b, b'\t' | b'\n' | b'\r' | 0x1a) || *b == 0x7f;
        let Some(at) = chunk.iter().position(is_binary) else { return Ok(()) };
        let start = chunk[..at].iter().rposition(|b| *b == b'\n').map_or(0, |newline| newline + 1);
        let length = chunk[start..].iter().position(|b| *b == b'\n').unwrap_or(chunk.len() - start);
        let lines_before = chunk[..start].split(|b| *b == b'\n').count() as u32 - 1;
        let line = self.number + u32::from(!self.skipping) + lines_before;
        let hint =
            if chunk.starts_with(b"\xff\xfe") || chunk.starts_with(b"\xfe\xff") { " (UTF-16 text?)" } else { "" };
        let why = format!("this is not a part program: it holds the byte 0x{:02x}{hint}", chunk[at]);
        let fault = Fault::new(Span::new(at - start, at - start + 1), "binary", why);
        let text = &chunk[start..start + length.min(MAX_LINE_BYTES).max(at - start)];
        Err(Diagnostic::new(&program.name, line, text, fault).into())
    }
}
