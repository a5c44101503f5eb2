//! Writing a trace.

use std::io::{self, Write};

use tandem_rings::Sample;

use crate::code::{History, MAX_ROW_BYTES};
use crate::frame::{self, Kind};
use crate::header::{FORMAT, Header};
use crate::words::Shape;

/// Every so many records one stands on its own: the most that damage in one place can cost, beside itself.
pub const KEY_INTERVAL: u64 = 256;

/// Writes a trace. Belongs on the soft side.
pub struct Writer<W> {
    out: W,
    shape: Shape,
    /// Checksum of the header.
    header: u32,
    /// Checksum of the last record.
    previous: u32,
    history: History,
    records: u64,
    bytes: Vec<u8>,
}

impl<W: Write> Writer<W> {
    /// Starts a trace with its header.
    ///
    /// # Errors
    /// `out` refuses; the header is none that could be read (period, number of signals, length of names).
    pub fn new(mut out: W, header: &Header) -> io::Result<Self> {
        let (bytes, checksum) = header.to_bytes()?;
        out.write_all(&bytes)?;
        let (shape, history) = (header.shape(FORMAT), History::EMPTY);
        Ok(Self {
            out,
            shape,
            header: checksum,
            previous: checksum,
            history,
            records: 0,
            bytes,
        })
    }

    /// Adds a sample and the strategy's signals, as many as the header names.
    ///
    /// Tick, block, line, state, command, feedback, its greatest age, feed, sigma, ratio, what is switched and the phase are
    /// kept; the other fields are not.
    ///
    /// # Errors
    /// `out` refuses; another number of signals.
    pub fn sample(&mut self, sample: &Sample, signals: &[f64]) -> io::Result<()> {
        if signals.len() != self.shape.signals {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                "not as many signals as the header names",
            ));
        }
        let row = self.shape.to_words(sample, signals);
        let is_key = self.records.is_multiple_of(KEY_INTERVAL);
        if is_key {
            // What is written so far outlives the process, should it be killed.
            self.out.flush()?;
            self.history = History::EMPTY;
        }
        let (kind, seed) = if is_key {
            (Kind::Key, self.header)
        } else {
            (Kind::Sample, self.previous)
        };
        self.put(kind, seed, |history, shape, bytes| {
            history.encode(&row, shape, bytes);
        })?;
        self.records += 1;
        if is_key {
            self.history = History::after_key(&row);
        } else {
            self.history.push(&row);
        }
        Ok(())
    }

    /// Adds a command of the operator, in the words of a command file. It belongs before the sample of its tick.
    ///
    /// # Errors
    /// `out` refuses; a text longer than a record.
    pub fn command(&mut self, text: &str) -> io::Result<()> {
        if text.len() > MAX_ROW_BYTES {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                "no command is so long",
            ));
        }
        self.put(Kind::Command, self.header, |_, _, bytes| {
            bytes.extend(text.as_bytes());
        })
    }

    /// Closes the trace and returns what it was written to.
    ///
    /// # Errors
    /// `out` refuses.
    pub fn finish(mut self) -> io::Result<W> {
        self.end()?;
        Ok(self.out)
    }

    /// Writes the closing record; nothing may follow it.
    ///
    /// # Errors
    /// `out` refuses.
    pub fn end(&mut self) -> io::Result<()> {
        self.put(Kind::End, self.header, |_, _, _| {})?;
        self.out.flush()
    }

    /// What the trace is written to.
    pub fn out(&mut self) -> &mut W {
        &mut self.out
    }

    /// What the trace was written to, without its closing record where [`Writer::end`] has not come before.
    pub fn into_inner(self) -> W {
        self.out
    }

    fn put(
        &mut self,
        kind: Kind,
        seed: u32,
        row: impl FnOnce(&History, Shape, &mut Vec<u8>),
    ) -> io::Result<()> {
        self.bytes.clear();
        let fill = |bytes: &mut Vec<u8>| row(&self.history, self.shape, bytes);
        self.previous = frame::put(kind, self.records, seed, &mut self.bytes, fill);
        self.out.write_all(&self.bytes)
    }
}
