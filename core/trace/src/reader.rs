//! Reading a trace, whatever has become of it.

use std::io::Read;

use tandem_rings::Sample;
use tandem_sdk::MAX_SIGNALS;

use crate::code::History;
use crate::error::TraceError;
use crate::frame::{self, Flaw, Frame, HEAD_BYTES, Kind, MARKER, MAX_FRAME_BYTES, Seeds};
use crate::header::Header;
use crate::source::Source;
use crate::words::{Shape, Words};

/// One sample as it was written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// Its number in the trace, from 0.
    pub number: u64,
    /// Where it begins, in bytes from the start of the file.
    pub offset: u64,
    /// The sample; fields that a trace does not keep are zero.
    pub sample: Sample,
    /// The strategy's signals; those past the header's names are zero.
    pub signals: [f64; MAX_SIGNALS],
}

/// A stretch of the file that holds no sound record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Damage {
    /// Its first byte.
    pub from: u64,
    /// The byte after its last.
    pub to: u64,
    /// How many records are lost; `None` where no later one says so.
    pub lost_records: Option<u64>,
    /// What is wrong with it, in words.
    pub cause: &'static str,
}

/// What a trace holds.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // nearly every item is the large one, and none is kept
pub enum Item {
    /// A sample.
    Record(Record),
    /// A command of the operator, as a line of a command file; it stands before the sample of its tick.
    Command(String),
    /// Something that is none.
    Damage(Damage),
}

/// How a trace ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// With its closing record.
    Complete,
    /// Without it.
    Truncated {
        /// The byte after the last sound record.
        byte: u64,
    },
}

/// Reads a trace record by record, in a stream. An iterator: after an error, or the end, it yields nothing more.
pub struct Reader<R> {
    source: Source<R>,
    header: Header,
    format: u32,
    seeds: Seeds,
    history: History,
    /// Number of the next record.
    next: u64,
    ending: Option<Ending>,
    failed: bool,
}

impl<R: Read> Reader<R> {
    /// Reads the header.
    ///
    /// # Errors
    /// It is no trace, of another format, or its header is damaged: nothing can be read then.
    pub fn new(inner: R) -> Result<Self, TraceError> {
        let mut source = Source::new(inner);
        let (header, format, checksum) = Header::take(&mut source)?;
        let seeds = Seeds {
            header: checksum,
            previous: None,
        };
        Ok(Self {
            source,
            header,
            format,
            seeds,
            history: History::EMPTY,
            next: 0,
            ending: None,
            failed: false,
        })
    }

    /// What the trace is of.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Number of the format that it is written in.
    pub fn format(&self) -> u32 {
        self.format
    }

    /// How the trace ends; known once everything is read.
    pub fn ending(&self) -> Option<Ending> {
        self.ending
    }

    fn read(&mut self) -> Result<Option<Item>, TraceError> {
        let from = self.source.offset();
        match self.look()? {
            Ok(found) if found.number == self.next => self.take(found),
            Ok(found) => Ok(Some(self.damage(from, &found, "records are missing here"))),
            Err(flaw) => self.search(from, flaw),
        }
    }

    /// The record that begins here, if one does.
    fn look(&mut self) -> Result<Result<Found, Flaw>, TraceError> {
        let offset = self.source.offset();
        let bytes = self
            .source
            .peek(MAX_FRAME_BYTES)
            .map_err(|e| TraceError::at(offset, e))?;
        let frame = frame::get(bytes, self.seeds);
        Ok(frame.and_then(|frame| {
            Found::decode(
                &frame,
                self.next,
                &self.history,
                self.header.shape(self.format),
            )
        }))
    }

    fn take(&mut self, found: Found) -> Result<Option<Item>, TraceError> {
        let offset = self.source.offset();
        self.source.skip(found.length);
        let (row, sample, signals) = match found.content {
            Content::Row(row, sample, signals) => (row, sample, signals),
            Content::Command(text) => {
                // Behind damage the next sample still needs a key: a command has no row to go on from.
                self.seeds.previous = self.seeds.previous.map(|_| found.checksum);
                return Ok(Some(Item::Command(text)));
            }
            Content::End => {
                self.ending = Some(Ending::Complete);
                return self.rest();
            }
        };
        self.seeds.previous = Some(found.checksum);
        if found.kind == Kind::Key {
            self.history = History::after_key(&row);
        } else {
            self.history.push(&row);
        }
        self.next += 1;
        Ok(Some(Item::Record(Record {
            number: found.number,
            offset,
            sample,
            signals,
        })))
    }

    /// What follows the closing record, which should be nothing.
    fn rest(&mut self) -> Result<Option<Item>, TraceError> {
        let from = self.source.offset();
        while !self.is_at_end()? {
            self.source.skip(MAX_FRAME_BYTES);
        }
        let to = self.source.offset();
        let damage = Damage {
            from,
            to,
            lost_records: Some(0),
            cause: "bytes after the closing record",
        };
        Ok((to > from).then_some(Item::Damage(damage)))
    }

    /// Finds the next record at which reading can begin.
    fn search(&mut self, from: u64, flaw: Flaw) -> Result<Option<Item>, TraceError> {
        self.seeds.previous = None;
        let cause = match flaw {
            Flaw::Short => "a record's length leads beyond the end of the file",
            Flaw::Wrong(cause) => cause,
        };
        while !self.is_at_end()? {
            self.source.skip(1);
            if self.is_at_marker()?
                && let Ok(found) = self.look()?
            {
                return Ok(Some(self.damage(from, &found, cause)));
            }
        }
        self.ending = Some(Ending::Truncated { byte: from });
        let damage = Damage {
            from,
            to: self.source.offset(),
            lost_records: None,
            cause,
        };
        Ok((flaw != Flaw::Short).then_some(Item::Damage(damage)))
    }

    /// Goes on at `found`, which begins here; what was lost began at `from`.
    fn damage(&mut self, from: u64, found: &Found, cause: &'static str) -> Item {
        let lost_records = Some(found.number - self.next);
        self.next = found.number;
        Item::Damage(Damage {
            from,
            to: self.source.offset(),
            lost_records,
            cause,
        })
    }

    fn is_at_marker(&mut self) -> Result<bool, TraceError> {
        let offset = self.source.offset();
        let bytes = self
            .source
            .peek(MAX_FRAME_BYTES)
            .map_err(|e| TraceError::at(offset, e))?;
        Ok(bytes
            .get(HEAD_BYTES..)
            .is_some_and(|content| content.starts_with(&MARKER)))
    }

    fn is_at_end(&mut self) -> Result<bool, TraceError> {
        let offset = self.source.offset();
        Ok(self
            .source
            .peek(MAX_FRAME_BYTES)
            .map_err(|e| TraceError::at(offset, e))?
            .is_empty())
    }
}

impl<R: Read> Iterator for Reader<R> {
    type Item = Result<Item, TraceError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.failed || self.ending.is_some() {
            return None;
        }
        let item = self.read();
        self.failed = item.is_err();
        item.transpose()
    }
}

/// What a sound record holds.
#[allow(clippy::large_enum_variant)] // nearly every record is the large one, and none is kept
enum Content {
    Row(Words, Sample, [f64; MAX_SIGNALS]),
    Command(String),
    End,
}

/// A sound record.
struct Found {
    kind: Kind,
    number: u64,
    content: Content,
    checksum: u32,
    /// Bytes.
    length: usize,
}

impl Found {
    /// Decodes a record whose checksum holds. `next` is the number that it should have.
    fn decode(frame: &Frame<'_>, next: u64, history: &History, shape: Shape) -> Result<Self, Flaw> {
        let Frame {
            kind,
            checksum,
            length,
            ..
        } = *frame;
        let number = frame.number.unwrap_or(next);
        if number < next {
            return Err(Flaw::Wrong("a record's number goes back"));
        }
        let content = match kind {
            Kind::End => Content::End,
            Kind::Command => Content::Command(text(frame.row)?),
            Kind::Key => decode(frame.row, &History::EMPTY, shape)?,
            Kind::Sample => decode(frame.row, history, shape)?,
        };
        Ok(Self {
            kind,
            number,
            content,
            checksum,
            length,
        })
    }
}

fn text(row: &[u8]) -> Result<String, Flaw> {
    String::from_utf8(row.to_vec()).map_err(|_| Flaw::Wrong("a command is not UTF-8"))
}

fn decode(row: &[u8], history: &History, shape: Shape) -> Result<Content, Flaw> {
    let words = history
        .decode(row, shape)
        .ok_or(Flaw::Wrong("a record holds no row of numbers"))?;
    let (sample, signals) = shape
        .to_sample(&words)
        .ok_or(Flaw::Wrong("a record holds no sample"))?;
    Ok(Content::Row(words, sample, signals))
}
