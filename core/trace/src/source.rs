//! A stream with a view of its next bytes.

use std::io::{self, Read};

/// Bytes asked for at once.
const CHUNK_BYTES: usize = 1 << 16;

/// Reads ahead a little, and knows where it is.
pub struct Source<R> {
    inner: R,
    buffer: Vec<u8>,
    /// Bytes of the buffer that are already taken.
    taken: usize,
    /// Place of the next byte, from the start of the stream.
    offset: u64,
    ended: bool,
}

impl<R: Read> Source<R> {
    pub fn new(inner: R) -> Self {
        Self {
            inner,
            buffer: vec![],
            taken: 0,
            offset: 0,
            ended: false,
        }
    }

    /// Place of the next byte, in bytes from the start.
    pub fn offset(&self) -> u64 {
        self.offset
    }

    /// The next bytes: at least `count` of them, or all that are left.
    pub fn peek(&mut self, count: usize) -> io::Result<&[u8]> {
        if self.buffer.len() - self.taken < count && !self.ended {
            self.buffer.drain(..self.taken);
            self.taken = 0;
            self.fill(count)?;
        }
        Ok(&self.buffer[self.taken..])
    }

    /// Leaves `count` bytes that were looked at behind.
    pub fn skip(&mut self, count: usize) {
        let count = count.min(self.buffer.len() - self.taken);
        self.taken += count;
        self.offset += count as u64;
    }

    fn fill(&mut self, count: usize) -> io::Result<()> {
        while self.buffer.len() < count && !self.ended {
            let there = self.buffer.len();
            self.buffer.resize(there + CHUNK_BYTES, 0);
            let read = self.inner.read(&mut self.buffer[there..]);
            self.buffer.truncate(there + *read.as_ref().unwrap_or(&0));
            match read {
                Ok(bytes) => self.ended = bytes == 0,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}
