//! A file as lines, read in chunks of whole lines.

use std::hash::{DefaultHasher, Hasher};
use std::sync::Arc;

use super::{KnownChunk, Program, ProgramError};
use crate::diagnostic::Diagnostic;
use crate::interpreter::MAX_LINE_BYTES;
use crate::line_error::{LineError, Span};

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
    Bad(Box<Diagnostic>),
    /// No more lines.
    End,
}

/// Most chunks that are held: what a loop that crosses chunks needs at a time. A program without jumps holds one.
const MAX_HELD: usize = 8;

/// A place between two lines of a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Mark {
    chunk: usize,
    at: usize,
    /// Number of the line before.
    number: u32,
}

impl Mark {
    /// The place before the first line.
    pub const START: Self = Self {
        chunk: 0,
        at: 0,
        number: 0,
    };
}

/// A chunk of whole lines that has been read.
struct Chunk {
    /// Its place in the program.
    index: usize,
    text: Vec<u8>,
    /// End of its last line; what follows belongs to the next chunk.
    end: usize,
    last: bool,
}

/// The lines of a program in one pass: one after the other, or from a mark on.
pub(crate) struct Lines {
    pass: Pass,
    /// The chunks that are held; the one that is read is the last of them.
    held: Vec<Chunk>,
    /// How many chunks may be held.
    room: usize,
    at: usize,
    /// Number of the last line handed out.
    pub number: u32,
    /// The chunk has begun within a line that is too long.
    skipping: bool,
}

impl Lines {
    pub fn new(program: &mut Program, pass: Pass) -> Self {
        if pass == Pass::First {
            program.chunks = Some(Vec::new());
        }
        Self {
            pass,
            held: Vec::new(),
            room: 1,
            at: 0,
            number: 0,
            skipping: false,
        }
    }

    /// The text of a line.
    pub fn text(&self, line: &std::ops::Range<usize>) -> &[u8] {
        self.held
            .last()
            .map_or(&[], |chunk| &chunk.text[line.clone()])
    }

    /// Where the chunk that is read ends.
    fn end(&self) -> usize {
        self.held.last().map_or(0, |chunk| chunk.end)
    }

    /// The place before the next line.
    pub fn mark(&self) -> Mark {
        Mark {
            chunk: self.held.last().map_or(0, |chunk| chunk.index),
            at: self.at,
            number: self.number,
        }
    }

    /// Goes on behind `mark`.
    ///
    /// # Errors
    /// As [`Lines::next`].
    pub fn seek(&mut self, program: &mut Program, mark: Mark) -> Result<(), ProgramError> {
        self.room = MAX_HELD;
        if self
            .held
            .last()
            .is_none_or(|chunk| chunk.index != mark.chunk)
        {
            self.load(program, mark.chunk)?;
        }
        let begins = mark == Mark::START && self.text(&(0..self.end())).starts_with(BOM);
        self.at = if begins { BOM.len() } else { mark.at };
        self.number = mark.number;
        self.skipping = false;
        Ok(())
    }

    /// The next line.
    ///
    /// # Errors
    /// The file cannot be read, has changed, or is binary: nothing more can be read.
    #[inline]
    pub fn next(&mut self, program: &mut Program) -> Result<Next, ProgramError> {
        self.next_here()
            .map_or_else(|| self.next_anywhere(program), |line| Ok(Next::Line(line)))
    }

    /// The next line, where all of it lies in the chunk that is read, as nearly every line does.
    #[inline]
    fn next_here(&mut self) -> Option<std::ops::Range<usize>> {
        let chunk = self.held.last()?;
        let rest = chunk.text.get(self.at..chunk.end)?;
        let length = memchr::memchr(b'\n', rest)?;
        if self.skipping || length > MAX_LINE_BYTES {
            return None;
        }
        let from = self.at;
        let end = from + length - usize::from(rest[..length].ends_with(b"\r"));
        self.at += length + 1;
        self.number += 1;
        Some(from..end)
    }

    /// The next line, wherever it lies and whatever it is.
    #[inline(never)]
    fn next_anywhere(&mut self, program: &mut Program) -> Result<Next, ProgramError> {
        loop {
            let Some(chunk) = self.held.last().filter(|chunk| self.at < chunk.end) else {
                if self.next_chunk(program)? {
                    continue;
                }
                return Ok(Next::End);
            };
            let (range, after, closed) = piece(chunk, self.at);
            self.at = after;
            if std::mem::replace(&mut self.skipping, !closed) {
                continue;
            }
            self.number += 1;
            if range.len() > MAX_LINE_BYTES {
                return Ok(Next::Bad(Box::new(self.too_long(program, &range))));
            }
            return Ok(Next::Line(range));
        }
    }

    fn too_long(&self, program: &Program, range: &std::ops::Range<usize>) -> Diagnostic {
        let why = format!(
            "the line is longer than {MAX_LINE_BYTES} bytes: this is hardly a part program"
        );
        let error = LineError::new(Span::new(0, 1), "line-long", why);
        Diagnostic::new(&program.name, self.number, self.text(range), error)
    }

    /// Goes on with the next chunk; false at the end of the file.
    fn next_chunk(&mut self, program: &mut Program) -> Result<bool, ProgramError> {
        let index = match self.held.last() {
            Some(chunk) if chunk.last => return Ok(false),
            Some(chunk) => chunk.index + 1,
            None => 0,
        };
        self.load(program, index)?;
        let chunk = self
            .held
            .last()
            .map_or(&[][..], |chunk| &chunk.text[..chunk.end]);
        self.at = if index == 0 && chunk.starts_with(BOM) {
            BOM.len()
        } else {
            0
        };
        Ok(!chunk.is_empty())
    }

    /// Makes the chunk `index` the one that is read: from those that are held, or from the file.
    fn load(&mut self, program: &mut Program, index: usize) -> Result<(), ProgramError> {
        if let Some(place) = self.held.iter().position(|chunk| chunk.index == index) {
            let chunk = self.held.remove(place);
            self.held.push(chunk);
            return Ok(());
        }
        let text = if self.held.len() < self.room {
            vec![0; CHUNK]
        } else {
            self.held.remove(0).text
        };
        let offset = match index.checked_sub(1) {
            Some(before) => program
                .chunks
                .as_ref()
                .and_then(|chunks| chunks.get(before))
                .map_or(0, |c| c.end),
            None => 0,
        };
        let mut chunk = Chunk {
            index,
            text,
            end: 0,
            last: false,
        };
        let filled = program.read_at(offset, &mut chunk.text)?;
        chunk.last = filled < CHUNK;
        let newline = memchr::memrchr(b'\n', &chunk.text[..filled]);
        chunk.end = if chunk.last {
            filled
        } else {
            newline.map_or(filled, |newline| newline + 1)
        };
        let new = self.compare(program, &chunk, offset)?;
        if new {
            self.refuse_binary(program, &chunk)?;
        }
        self.held.push(chunk);
        Ok(())
    }

    /// Keeps the hash of a chunk that has not been read before, or refuses one that is not what was read then. Whether it
    /// is new.
    fn compare(
        &self,
        program: &mut Program,
        chunk: &Chunk,
        offset: u64,
    ) -> Result<bool, ProgramError> {
        let mut hasher = DefaultHasher::new();
        hasher.write(&chunk.text[..chunk.end]);
        let hash = hasher.finish();
        let known = program.chunks.get_or_insert_default();
        match known.get(chunk.index) {
            Some(before) if before.hash == hash => Ok(false),
            None if self.pass == Pass::First => {
                known.push(KnownChunk {
                    end: offset + chunk.end as u64,
                    hash,
                });
                Ok(true)
            }
            _ => {
                let lines = chunk.text[..chunk.end].split(|b| *b == b'\n').count() as u32;
                let name = Arc::clone(&program.name);
                let (first_line, last_line) = (self.number + 1, self.number + lines);
                Err(ProgramError::Changed {
                    name,
                    first_line,
                    last_line,
                })
            }
        }
    }

    fn refuse_binary(&self, program: &Program, chunk: &Chunk) -> Result<(), ProgramError> {
        let chunk = &chunk.text[..chunk.end];
        // Nearly always all is plain text, which is seen without a branch for each byte.
        let plain = |b: &u8| *b >= b' ' && *b != 0x7f || *b == b'\n';
        if chunk.iter().fold(true, |all, b| all & plain(b)) {
            return Ok(());
        }
        // Ctrl-Z ends the text of old systems; the line reader meets it only behind the end of the program.
        let is_binary =
            |b: &u8| *b < b' ' && !matches!(b, b'\t' | b'\n' | b'\r' | 0x1a) || *b == 0x7f;
        let Some(at) = chunk.iter().position(is_binary) else {
            return Ok(());
        };
        let start = chunk[..at]
            .iter()
            .rposition(|b| *b == b'\n')
            .map_or(0, |newline| newline + 1);
        let length = chunk[start..]
            .iter()
            .position(|b| *b == b'\n')
            .unwrap_or(chunk.len() - start);
        let lines_before = chunk[..start].split(|b| *b == b'\n').count() as u32 - 1;
        let line = self.number + u32::from(!self.skipping) + lines_before;
        let hint = if chunk.starts_with(b"\xff\xfe") || chunk.starts_with(b"\xfe\xff") {
            " (UTF-16 text?)"
        } else {
            ""
        };
        let why = format!(
            "this is not a part program: it holds the byte 0x{:02x}{hint}",
            chunk[at]
        );
        let error = LineError::new(Span::new(at - start, at - start + 1), "binary", why);
        let text = &chunk[start..start + length.min(MAX_LINE_BYTES).max(at - start)];
        Err(Diagnostic::new(&program.name, line, text, error).into())
    }
}

/// The text from `at` to the next line end, where the line after it begins, and whether there is a line end (or the file
/// ends). A chunk without any line end is a piece of a line that is too long.
#[inline]
fn piece(chunk: &Chunk, at: usize) -> (std::ops::Range<usize>, usize, bool) {
    let newline = memchr::memchr(b'\n', &chunk.text[at..chunk.end]);
    let to = newline.map_or(chunk.end, |length| at + length);
    let after = (to + 1).min(chunk.end);
    let length = if chunk.text[at..to].ends_with(b"\r") {
        to - 1
    } else {
        to
    };
    (at..length, after, newline.is_some() || chunk.last)
}
