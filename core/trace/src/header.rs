//! What a trace says of itself before the first record.

use std::io::{self, Read};

use tandem_sdk::{Axes, MAX_SIGNALS};

use crate::error::{Cause, TraceError};
use crate::source::Source;
use crate::words::Shape;

/// The first bytes of a trace: not text, and spoilt by whatever rewrites line ends.
pub const MAGIC: [u8; 8] = *b"\x89TTR\r\n\x1a\n";
/// The format that is written. Format 1, without commands and dry runs, format 2, without what is switched, and format 3,
/// without the age of feedback, are read too.
pub const FORMAT: u32 = 4;
/// Bytes before the body: magic, format, length of the body.
const FIXED_BYTES: usize = MAGIC.len() + 4 + 4;
/// Most bytes of the body, so that a damaged length asks for no memory.
const MAX_BODY_BYTES: usize = 1 << 16;

/// What a trace is of.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// Fine period, s: finite, above zero.
    pub fine_period_s: f64,
    /// The machine's axes; positions of rotary ones are in rad.
    pub axes: Axes,
    /// Name of the machine.
    pub machine: String,
    /// Name of the part program.
    pub program: String,
    /// Name of the planner.
    pub planner: String,
    /// Nothing was switched, and feed motion ran at the dry-run feed.
    pub dry_run: bool,
    /// Names of the feed strategy's signals, at most [`MAX_SIGNALS`].
    pub signals: Vec<String>,
}

/// Whether the samples of a trace of this format say what is switched, and the phase.
pub fn has_switched(format: u32) -> bool {
    format > 2
}

/// Whether the samples of a trace of this format say how old their feedback was.
pub fn has_age(format: u32) -> bool {
    format > 3
}

impl Header {
    /// Of the samples of this `format`.
    pub(crate) fn shape(&self, format: u32) -> Shape {
        Shape {
            axes: self.axes.count(),
            signals: self.signals.len(),
            switched: has_switched(format),
            aged: has_age(format),
        }
    }

    /// The header as bytes, its checksum last.
    pub(crate) fn to_bytes(&self) -> io::Result<(Vec<u8>, u32)> {
        let body = self.body();
        let has_time = self.fine_period_s.is_finite() && self.fine_period_s > 0.0;
        if !has_time || self.signals.len() > MAX_SIGNALS || body.len() > MAX_BODY_BYTES {
            let cause = "no trace has such a period, so many signals or such long names";
            return Err(io::Error::new(io::ErrorKind::InvalidInput, cause));
        }
        let mut bytes = [
            &MAGIC[..],
            &FORMAT.to_le_bytes(),
            &(body.len() as u32).to_le_bytes(),
            &body,
        ]
        .concat();
        let checksum = crc32fast::hash(&bytes);
        bytes.extend(checksum.to_le_bytes());
        Ok((bytes, checksum))
    }

    fn body(&self) -> Vec<u8> {
        let mut body = self.fine_period_s.to_le_bytes().to_vec();
        body.push(self.axes.count() as u8);
        for axis in 0..self.axes.count() {
            body.extend([
                self.axes.letter(axis) as u8,
                u8::from(self.axes.is_rotary(axis)),
            ]);
        }
        for name in [&self.machine, &self.program, &self.planner] {
            put_text(&mut body, name);
        }
        body.push(self.signals.len() as u8);
        for name in &self.signals {
            put_text(&mut body, name);
        }
        body.push(u8::from(self.dry_run));
        body
    }

    /// Takes the header, its format and its checksum from the start of a trace.
    pub(crate) fn take(source: &mut Source<impl Read>) -> Result<(Self, u32, u32), TraceError> {
        let bytes = source.peek(FIXED_BYTES).map_err(|e| TraceError::at(0, e))?;
        let (format, length) =
            fixed(bytes).map_err(|(offset, cause)| TraceError::at(offset, cause))?;
        if !(1..=FORMAT).contains(&format) {
            return Err(TraceError::at(MAGIC.len() as u64, Cause::Format(format)));
        }
        if length > MAX_BODY_BYTES {
            return Err(TraceError::at(12, Cause::Header("it cannot be so long")));
        }
        let whole = FIXED_BYTES + length + 4;
        let bytes = source.peek(whole).map_err(|e| TraceError::at(0, e))?;
        let short = TraceError::at(bytes.len() as u64, Cause::Short);
        let (body, rest) = bytes[FIXED_BYTES..].split_at_checked(length).ok_or(short)?;
        let Some(stored) = rest.first_chunk::<4>() else {
            return Err(TraceError::at(bytes.len() as u64, Cause::Short));
        };
        let checksum = crc32fast::hash(&bytes[..FIXED_BYTES + length]);
        if checksum != u32::from_le_bytes(*stored) {
            return Err(TraceError::at(0, Cause::Header("its checksum differs")));
        }
        let header = Self::parse(body, format)
            .map_err(|cause| TraceError::at(FIXED_BYTES as u64, Cause::Header(cause)))?;
        source.skip(whole);
        Ok((header, format, checksum))
    }

    fn parse(body: &[u8], format: u32) -> Result<Self, &'static str> {
        let mut body = Body(body);
        let fine_period_s = f64::from_le_bytes(*body.chunk::<8>()?);
        let axes = body.axes()?;
        let [machine, program, planner] = [body.text()?, body.text()?, body.text()?];
        let [count] = *body.chunk::<1>()?;
        let signals = (0..count)
            .map(|_| body.text())
            .collect::<Result<Vec<_>, _>>()?;
        let dry_run = format > 1 && *body.chunk::<1>()? == [1];
        if !body.0.is_empty() || signals.len() > MAX_SIGNALS {
            return Err("it holds more than it should");
        }
        if !fine_period_s.is_finite() || fine_period_s <= 0.0 {
            return Err("its period is none");
        }
        Ok(Self {
            fine_period_s,
            axes,
            machine,
            program,
            planner,
            dry_run,
            signals,
        })
    }
}

/// Format and length of the body.
fn fixed(bytes: &[u8]) -> Result<(u32, usize), (u64, Cause)> {
    let magic = &bytes[..bytes.len().min(MAGIC.len())];
    if magic.is_empty() || !MAGIC.starts_with(magic) {
        return Err((0, Cause::Magic));
    }
    let numbers = bytes
        .get(MAGIC.len()..FIXED_BYTES)
        .ok_or((bytes.len() as u64, Cause::Short))?;
    let number = |at: usize| {
        u32::from_le_bytes([
            numbers[at],
            numbers[at + 1],
            numbers[at + 2],
            numbers[at + 3],
        ])
    };
    Ok((number(0), number(4) as usize))
}

fn put_text(body: &mut Vec<u8>, text: &str) {
    body.extend((text.len() as u32).to_le_bytes());
    body.extend(text.as_bytes());
}

/// What is left of the body.
struct Body<'a>(&'a [u8]);

impl<'a> Body<'a> {
    fn chunk<const N: usize>(&mut self) -> Result<&'a [u8; N], &'static str> {
        let (chunk, rest) = self
            .0
            .split_first_chunk()
            .ok_or("it holds less than it should")?;
        self.0 = rest;
        Ok(chunk)
    }

    fn text(&mut self) -> Result<String, &'static str> {
        let length = u32::from_le_bytes(*self.chunk()?) as usize;
        let (text, rest) = self
            .0
            .split_at_checked(length)
            .ok_or("it holds less than it should")?;
        self.0 = rest;
        String::from_utf8(text.to_vec()).map_err(|_| "a name is not UTF-8")
    }

    fn axes(&mut self) -> Result<Axes, &'static str> {
        let [count] = *self.chunk::<1>()?;
        let mut axes = vec![];
        for _ in 0..count {
            let [letter, rotary] = *self.chunk::<2>()?;
            axes.push((char::from(letter), rotary == 1));
        }
        Axes::new(&axes).map_err(|_| "its axes are none of a machine's")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(fine_period_s: f64) -> Header {
        Header {
            fine_period_s,
            axes: Axes::new(&[('X', false)]).unwrap(),
            machine: "m".into(),
            program: "p".into(),
            planner: "look-ahead".into(),
            signals: vec![],
            dry_run: false,
        }
    }

    /// The first format says nothing of dry runs.
    #[test]
    fn a_dry_run_is_known_from_the_second_format_on() {
        let mut dry = header(0.001);
        dry.dry_run = true;
        let body = dry.body();
        for format in 2..=FORMAT {
            assert!(Header::parse(&body, format).unwrap().dry_run, "{format}");
        }
        assert!(!Header::parse(&header(0.001).body(), 2).unwrap().dry_run);
        let (_, first) = body.split_last().unwrap();
        assert!(!Header::parse(first, 1).unwrap().dry_run);
        assert!(Header::parse(first, 2).is_err());
        assert!(Header::parse(&body, 1).is_err());
    }

    /// What is written is read again, up to the longest.
    #[test]
    fn a_header_may_be_as_long_as_the_longest_and_no_longer() {
        let mut long = header(0.001);
        long.program = "p".repeat(MAX_BODY_BYTES - long.body().len() + 1);
        assert_eq!(long.body().len(), MAX_BODY_BYTES);
        let (bytes, _) = long.to_bytes().unwrap();
        let (read, ..) = Header::take(&mut Source::new(&bytes[..])).unwrap();
        assert_eq!(read.program.len(), long.program.len());
        long.program.push('p');
        assert!(long.to_bytes().is_err());
    }

    #[test]
    fn a_body_whose_period_is_no_time_is_refused() {
        assert!(Header::parse(&header(0.001).body(), FORMAT).is_ok());
        for none_s in [0.0, -0.001, f64::INFINITY, f64::NAN] {
            let parsed = Header::parse(&header(none_s).body(), FORMAT);
            assert_eq!(parsed.unwrap_err(), "its period is none");
        }
    }
}
