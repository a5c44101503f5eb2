//! One record as bytes: a head of kind and length, a checksum, the content.

use crate::code::MAX_ROW_BYTES;

/// Begins the content of a record at which reading can begin.
pub const MARKER: [u8; 4] = [0xa7, b'T', b'K', 0xe9];
/// Bytes before the content: kind and length (2), checksum (4).
pub const HEAD_BYTES: usize = 6;
/// Bytes of marker and number.
const SYNC_BYTES: usize = MARKER.len() + 8;
/// Most bytes of a record.
pub const MAX_FRAME_BYTES: usize = HEAD_BYTES + SYNC_BYTES + MAX_ROW_BYTES;

/// Bits of the length in the first word.
const LENGTH_BITS: u32 = 14;

/// What a record is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A command of the operator, as text.
    Command = 0,
    /// A sample, as what differs from the ones before.
    Sample = 1,
    /// A sample on its own, with its number.
    Key = 2,
    /// The end of a trace that was completed, with the number of samples.
    End = 3,
}

impl Kind {
    fn from_number(number: u16) -> Option<Self> {
        [Self::Command, Self::Sample, Self::Key, Self::End]
            .into_iter()
            .find(|kind| *kind as u16 == number)
    }

    /// Whether reading can begin here.
    fn is_sync(self) -> bool {
        self != Self::Sample
    }
}

/// A record taken from bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    pub kind: Kind,
    /// The record's number; `None` where it goes on from the one before.
    pub number: Option<u64>,
    /// The encoded row.
    pub row: &'a [u8],
    /// The checksum, on which the next record's builds.
    pub checksum: u32,
    /// Bytes of the whole record.
    pub length: usize,
}

/// Why bytes are no record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flaw {
    /// There are too few.
    Short,
    /// They are wrong, in words.
    Wrong(&'static str),
}

/// Checksums on which the next record's may build.
#[derive(Clone, Copy, Debug)]
pub struct Seeds {
    /// Of the header: for records at which reading can begin.
    pub header: u32,
    /// Of the record before: for the others. `None` where it is lost.
    pub previous: Option<u32>,
}

/// Appends a record to `bytes`, and returns its checksum. `number` goes with keys and the end.
pub fn put(
    kind: Kind,
    number: u64,
    seed: u32,
    bytes: &mut Vec<u8>,
    row: impl FnOnce(&mut Vec<u8>),
) -> u32 {
    let start = bytes.len();
    bytes.extend([0; HEAD_BYTES]);
    if kind.is_sync() {
        bytes.extend(MARKER);
        bytes.extend(number.to_le_bytes());
    }
    row(bytes);
    let content = start + HEAD_BYTES;
    let first = (kind as u16) << LENGTH_BITS | (bytes.len() - content) as u16;
    bytes[start..start + 2].copy_from_slice(&first.to_le_bytes());
    let checksum = checksum(seed, first, &bytes[content..]);
    bytes[start + 2..content].copy_from_slice(&checksum.to_le_bytes());
    checksum
}

/// The record with which `bytes` begin.
pub fn get(bytes: &[u8], seeds: Seeds) -> Result<Frame<'_>, Flaw> {
    let (first, rest) = bytes.split_first_chunk::<2>().ok_or(Flaw::Short)?;
    let first = u16::from_le_bytes(*first);
    let kind = Kind::from_number(first >> LENGTH_BITS).ok_or(Flaw::Wrong("no kind of record"))?;
    let length = usize::from(first & ((1 << LENGTH_BITS) - 1));
    if HEAD_BYTES + length > MAX_FRAME_BYTES {
        return Err(Flaw::Wrong("a record cannot be so long"));
    }
    let (stored, rest) = rest.split_first_chunk::<4>().ok_or(Flaw::Short)?;
    let content = rest.get(..length).ok_or(Flaw::Short)?;
    let seed = if kind.is_sync() {
        Some(seeds.header)
    } else {
        seeds.previous
    };
    let seed = seed.ok_or(Flaw::Wrong("the record before is lost"))?;
    let checksum = checksum(seed, first, content);
    if checksum != u32::from_le_bytes(*stored) {
        return Err(Flaw::Wrong("the checksum differs"));
    }
    let (number, row) = if kind.is_sync() {
        number(content)?
    } else {
        (None, content)
    };
    Ok(Frame {
        kind,
        number,
        row,
        checksum,
        length: HEAD_BYTES + length,
    })
}

/// Splits the content of a record at which reading can begin.
fn number(content: &[u8]) -> Result<(Option<u64>, &[u8]), Flaw> {
    let numbered = content
        .strip_prefix(&MARKER)
        .and_then(<[u8]>::split_first_chunk::<8>);
    let (number, row) = numbered.ok_or(Flaw::Wrong("the marker is missing"))?;
    Ok((Some(u64::from_le_bytes(*number)), row))
}

fn checksum(seed: u32, first: u16, content: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new_with_initial(seed);
    hasher.update(&first.to_le_bytes());
    hasher.update(content);
    hasher.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kind_of_a_record_and_its_length_are_under_its_checksum() {
        let mut bytes = vec![];
        put(Kind::Command, 3, 7, &mut bytes, |row| row.extend(b"text"));
        let seeds = Seeds {
            header: 7,
            previous: None,
        };
        let found = get(&bytes, seeds).unwrap();
        assert_eq!((found.kind, found.number), (Kind::Command, Some(3)));
        // Two bits above the length say the kind: this is what a key would have.
        bytes[1] ^= 0x80;
        assert_eq!(get(&bytes, seeds), Err(Flaw::Wrong("the checksum differs")));
        // As long as no record is.
        bytes[1] |= 0x3f;
        bytes.resize(1 << 15, 0);
        assert_eq!(
            get(&bytes, seeds),
            Err(Flaw::Wrong("a record cannot be so long"))
        );
    }

    #[test]
    fn the_longest_record_is_read() {
        let mut bytes = vec![];
        let row = MAX_FRAME_BYTES - HEAD_BYTES - MARKER.len() - 8;
        put(Kind::Key, 3, 7, &mut bytes, |to| {
            to.resize(to.len() + row, 1);
        });
        assert_eq!(bytes.len(), MAX_FRAME_BYTES);
        let seeds = Seeds {
            header: 7,
            previous: None,
        };
        assert_eq!(get(&bytes, seeds).unwrap().length, MAX_FRAME_BYTES);
    }
}
