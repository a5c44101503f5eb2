//! Units that map logical addresses, bit by bit, onto the memory of a device.

use crate::bytes::{u16_at, u32_at};

/// One unit as its 16 registers set it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Fmmu {
    /// First logical bit, and one behind the last.
    start_bit: u64,
    end_bit: u64,
    /// First bit of the device's memory.
    physical_bit: usize,
    pub(crate) reads: bool,
    pub(crate) writes: bool,
}

/// The part of a datagram that a unit maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Overlap {
    /// First bit within the datagram.
    pub(crate) data_bit: usize,
    /// First bit of the device's memory.
    pub(crate) physical_bit: usize,
    pub(crate) bits: usize,
}

impl Overlap {
    /// Whether it begins and ends with whole bytes on both sides.
    pub(crate) fn is_of_bytes(&self) -> bool {
        (self.data_bit | self.physical_bit | self.bits).is_multiple_of(8)
    }
}

impl Fmmu {
    /// Reads the registers of a unit.
    pub(crate) fn of(registers: &[u8]) -> Self {
        let start = u64::from(u32_at(registers, 0));
        let length = u64::from(u16_at(registers, 4));
        let (first, last) = (u64::from(registers[6] & 7), u64::from(registers[7] & 7));
        let active = registers[12] & 1 == 1 && length > 0;
        let start_bit = start * 8 + first;
        let end_bit = if active {
            (start + length - 1) * 8 + last + 1
        } else {
            start_bit
        };
        Self {
            start_bit,
            end_bit: end_bit.max(start_bit),
            physical_bit: usize::from(u16_at(registers, 8)) * 8 + usize::from(registers[10] & 7),
            reads: registers[11] & 1 == 1,
            writes: registers[11] & 2 == 2,
        }
    }

    /// Whether it maps anything.
    pub(crate) fn is_active(&self) -> bool {
        self.start_bit < self.end_bit
    }

    /// What a datagram of `length` bytes at logical address `address` shares with this unit.
    pub(crate) fn overlap(&self, address: u32, length: usize) -> Option<Overlap> {
        let begins = u64::from(address) * 8;
        let from = begins.max(self.start_bit);
        let to = (begins + 8 * length as u64).min(self.end_bit);
        (from < to).then(|| Overlap {
            data_bit: (from - begins) as usize,
            physical_bit: self.physical_bit + (from - self.start_bit) as usize,
            bits: (to - from) as usize,
        })
    }
}
