//! EtherCAT frames: Ethernet header, EtherCAT header, datagrams, each with a working counter at its end.

use crate::bytes::{number_at, u16_at, u32_at};

/// Protocol number of EtherCAT in an Ethernet header.
pub const ETHERTYPE: u16 = 0x88A4;
/// Longest Ethernet frame without its check sum, in bytes.
pub const MAX_FRAME: usize = 1514;
/// Most data of one datagram, in bytes.
pub(crate) const MAX_DATA: usize = 1486;
/// Where the first datagram begins.
const FIRST_DATAGRAM: usize = 16;
/// Bytes of a datagram's header, and of its working counter.
const HEADER: usize = 10;
const COUNTER: usize = 2;

/// What a datagram asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Command {
    /// Nothing, or a command that no device knows.
    None,
    /// Read, write or both, by place in the ring.
    Position { reads: bool, writes: bool },
    /// Read, write or both, by station address.
    Station { reads: bool, writes: bool },
    /// Read, write or both, at every device.
    Broadcast { reads: bool, writes: bool },
    /// Read, write or both, by logical address.
    Logical { reads: bool, writes: bool },
    /// The device at a place reads, all others write what it read.
    PositionReadOthersWrite,
    /// The device with a station address reads, all others write what it read.
    StationReadOthersWrite,
}

impl Command {
    fn of(number: u8) -> Self {
        let (reads, writes) = match number {
            1 | 4 | 7 | 10 => (true, false),
            2 | 5 | 8 | 11 => (false, true),
            _ => (true, true),
        };
        match number {
            1..=3 => Self::Position { reads, writes },
            4..=6 => Self::Station { reads, writes },
            7..=9 => Self::Broadcast { reads, writes },
            10..=12 => Self::Logical { reads, writes },
            13 => Self::PositionReadOthersWrite,
            14 => Self::StationReadOthersWrite,
            _ => Self::None,
        }
    }
}

/// Where a datagram lies in its frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Datagram {
    pub(crate) command: Command,
    /// First byte of its header.
    start: usize,
    /// Bytes of data.
    length: usize,
}

impl Datagram {
    /// Station address, or count of the place.
    pub(crate) fn station(&self, frame: &[u8]) -> u16 {
        u16_at(frame, self.start + 2)
    }

    /// Counts one device further.
    pub(crate) fn pass(&self, frame: &mut [u8]) {
        let next = self.station(frame).wrapping_add(1);
        frame[self.start + 2..self.start + 4].copy_from_slice(&next.to_le_bytes());
    }

    /// Address in the device's memory.
    pub(crate) fn address(&self, frame: &[u8]) -> usize {
        usize::from(u16_at(frame, self.start + 4))
    }

    /// Logical address.
    pub(crate) fn logical_address(&self, frame: &[u8]) -> u32 {
        u32_at(frame, self.start + 2)
    }

    /// Data.
    pub(crate) fn data<'a>(&self, frame: &'a mut [u8]) -> &'a mut [u8] {
        &mut frame[self.start + HEADER..][..self.length]
    }

    /// The working counter.
    pub(crate) fn counter(&self, frame: &[u8]) -> u16 {
        u16_at(frame, self.start + HEADER + self.length)
    }

    /// Replaces the working counter.
    pub(crate) fn set_counter(&self, frame: &mut [u8], counter: u16) {
        frame[self.start + HEADER + self.length..][..COUNTER]
            .copy_from_slice(&counter.to_le_bytes());
    }

    /// Adds to the working counter.
    pub(crate) fn count(&self, frame: &mut [u8], more: u16) {
        self.set_counter(frame, self.counter(frame).wrapping_add(more));
    }
}

/// Whether this is a frame of EtherCAT datagrams.
pub fn is_ethercat(frame: &[u8]) -> bool {
    let protocol = u16::from_be_bytes([
        frame.get(12).copied().unwrap_or(0),
        frame.get(13).copied().unwrap_or(0),
    ]);
    let kind = number_at(frame, 14, 2) >> 12;
    protocol == ETHERTYPE && kind == 1 && frame.len() <= MAX_FRAME
}

/// The datagrams of a frame, up to the first that does not fit.
pub(crate) fn datagrams(frame: &[u8]) -> Datagrams<'_> {
    let stated = usize::from(u16_at(frame, 14) & 0x7ff);
    let end = (FIRST_DATAGRAM + stated).min(frame.len());
    Datagrams {
        frame: &frame[..end],
        at: Some(FIRST_DATAGRAM),
    }
}

/// Walks over the datagrams of a frame.
pub(crate) struct Datagrams<'a> {
    frame: &'a [u8],
    at: Option<usize>,
}

impl Iterator for Datagrams<'_> {
    type Item = Datagram;

    fn next(&mut self) -> Option<Datagram> {
        let start = self.at.take()?;
        let size = usize::from(u16_at(self.frame, start + 6));
        let length = (size & 0x7ff).min(MAX_DATA);
        let end = start + HEADER + length + COUNTER;
        if end > self.frame.len() {
            return None;
        }
        if size & 0x8000 != 0 {
            self.at = Some(end);
        }
        Some(Datagram {
            command: Command::of(self.frame[start]),
            start,
            length,
        })
    }
}
