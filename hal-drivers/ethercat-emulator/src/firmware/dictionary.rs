//! The object dictionary: what a device lets be read and written, and what its process data map.

use std::collections::BTreeMap;

use crate::bytes::{number_at, put};
use crate::description::ObjectDescription;

/// Where an entry lies in the dictionary.
pub(crate) type Slot = usize;

/// The type of an entry, by its number in CAN over EtherCAT.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Bits(u8),
    I8,
    I16,
    I32,
    U8,
    U16,
    U32,
    Text,
    Bytes,
}

impl Kind {
    /// Its number.
    pub(crate) fn number(self) -> u16 {
        match self {
            Self::Bits(bits) => u16::from(crate::sii::type_of(bits)),
            Self::I8 => 2,
            Self::I16 => 3,
            Self::I32 => 4,
            Self::U8 => 5,
            Self::U16 => 6,
            Self::U32 => 7,
            Self::Text => 9,
            Self::Bytes => 10,
        }
    }

    fn bits(self) -> Option<usize> {
        match self {
            Self::Bits(bits) => Some(usize::from(bits)),
            Self::I8 | Self::U8 => Some(8),
            Self::I16 | Self::U16 => Some(16),
            Self::I32 | Self::U32 => Some(32),
            Self::Text | Self::Bytes => None,
        }
    }
}

/// Who may do what with an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Access {
    ReadOnly,
    ReadWrite,
    /// Written in PRE-OPERATIONAL only.
    Setup,
}

/// One entry.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub(crate) index: u16,
    pub(crate) sub: u8,
    pub(crate) kind: Kind,
    pub(crate) access: Access,
    pub(crate) value: Vec<u8>,
}

impl Entry {
    pub(crate) fn bits(&self) -> usize {
        self.kind.bits().unwrap_or(self.value.len() * 8)
    }

    /// Whether a value of so many bytes can be written: texts and octets may be shorter.
    pub(crate) fn takes(&self, bytes: usize) -> Result<(), Abort> {
        let room = self.value.len();
        match self.kind {
            Kind::Text | Kind::Bytes if bytes <= MAX_TEXT => Ok(()),
            _ if bytes > room => Err(Abort::TOO_LONG),
            _ if bytes < room => Err(Abort::TOO_SHORT),
            _ => Ok(()),
        }
    }
}

/// Most bytes of a text or of octets.
const MAX_TEXT: usize = 4096;

/// Why an SDO is refused, as the code that goes back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Abort(pub(crate) u32);

impl Abort {
    pub(crate) const TOGGLE: Self = Self(0x0503_0000);
    pub(crate) const COMMAND: Self = Self(0x0504_0001);
    pub(crate) const UNSUPPORTED: Self = Self(0x0601_0000);
    pub(crate) const READ_ONLY: Self = Self(0x0601_0002);
    pub(crate) const NO_OBJECT: Self = Self(0x0602_0000);
    pub(crate) const NOT_MAPPABLE: Self = Self(0x0604_0041);
    pub(crate) const MAPPED_TOO_LONG: Self = Self(0x0604_0042);
    pub(crate) const TOO_LONG: Self = Self(0x0607_0012);
    pub(crate) const TOO_SHORT: Self = Self(0x0607_0013);
    pub(crate) const NO_SUB: Self = Self(0x0609_0011);
    pub(crate) const VALUE: Self = Self(0x0609_0030);
    pub(crate) const STATE: Self = Self(0x0800_0022);
}

/// Objects with their entries, ordered by index and sub-index. It does not change its shape after it is built, so slots stay.
#[derive(Clone, Debug, Default)]
pub(crate) struct Dictionary {
    entries: Vec<Entry>,
    names: BTreeMap<u16, String>,
}

impl Dictionary {
    /// Adds an entry; one that is there already stays.
    pub(crate) fn add(&mut self, index: u16, sub: u8, kind: Kind, access: Access, value: i64) {
        let bytes = kind.bits().unwrap_or(0).div_ceil(8);
        let mut entry = Entry {
            index,
            sub,
            kind,
            access,
            value: vec![0; bytes],
        };
        put(&mut entry.value, value as u64);
        self.insert(entry);
    }

    /// Adds a text.
    pub(crate) fn add_text(&mut self, index: u16, text: &str) {
        let value = text.as_bytes().to_vec();
        self.insert(Entry {
            index,
            sub: 0,
            kind: Kind::Text,
            access: Access::ReadOnly,
            value,
        });
    }

    /// Adds octets that can be written.
    pub(crate) fn add_bytes(&mut self, index: u16, value: Vec<u8>) {
        self.insert(Entry {
            index,
            sub: 0,
            kind: Kind::Bytes,
            access: Access::ReadWrite,
            value,
        });
    }

    /// Adds what a file describes.
    pub(crate) fn add_value(&mut self, of: &ObjectDescription) {
        let kind = match of.value.len() {
            1 => Kind::U8,
            2 => Kind::U16,
            4 => Kind::U32,
            _ => Kind::Bytes,
        };
        let access = if of.writable {
            Access::ReadWrite
        } else {
            Access::ReadOnly
        };
        self.insert(Entry {
            index: of.index,
            sub: of.sub,
            kind,
            access,
            value: of.value.clone(),
        });
    }

    fn insert(&mut self, entry: Entry) {
        if let Err(place) = self.search(entry.index, entry.sub) {
            self.entries.insert(place, entry);
        }
    }

    /// Names an object.
    pub(crate) fn name(&mut self, index: u16, name: &str) {
        self.names.insert(index, name.to_string());
    }

    pub(crate) fn name_of(&self, index: u16) -> &str {
        self.names.get(&index).map_or("", String::as_str)
    }

    fn search(&self, index: u16, sub: u8) -> Result<Slot, usize> {
        self.entries
            .binary_search_by_key(&(index, sub), |entry| (entry.index, entry.sub))
    }

    /// Where an entry lies.
    pub(crate) fn slot(&self, index: u16, sub: u8) -> Option<Slot> {
        self.search(index, sub).ok()
    }

    /// Where an entry lies, or why there is none.
    pub(crate) fn find(&self, index: u16, sub: u8) -> Result<Slot, Abort> {
        let slot = self.slot(index, sub);
        slot.ok_or(if self.of_object(index).is_empty() {
            Abort::NO_OBJECT
        } else {
            Abort::NO_SUB
        })
    }

    pub(crate) fn entry(&self, slot: Slot) -> &Entry {
        &self.entries[slot]
    }

    pub(crate) fn entry_mut(&mut self, slot: Slot) -> &mut Entry {
        &mut self.entries[slot]
    }

    /// The entries of an object.
    pub(crate) fn of_object(&self, index: u16) -> &[Entry] {
        let from = self.entries.partition_point(|entry| entry.index < index);
        let to = self.entries.partition_point(|entry| entry.index <= index);
        &self.entries[from..to]
    }

    /// The indexes of all objects.
    pub(crate) fn objects(&self) -> impl Iterator<Item = u16> {
        self.entries
            .chunk_by(|one, other| one.index == other.index)
            .map(|object| object[0].index)
    }

    /// An entry as an unsigned number.
    pub(crate) fn unsigned(&self, slot: Slot) -> u64 {
        number_at(&self.entries[slot].value, 0, 8)
    }

    /// An entry as a signed number of its own width.
    pub(crate) fn signed(&self, slot: Slot) -> i64 {
        let value = &self.entries[slot].value;
        let unused = 64 - 8 * value.len().min(8) as u32;
        number_at(value, 0, 8)
            .unbounded_shl(unused)
            .cast_signed()
            .unbounded_shr(unused)
    }

    /// Sets an entry from inside of the device.
    pub(crate) fn set(&mut self, slot: Slot, value: i64) {
        put(&mut self.entries[slot].value, value as u64);
    }

    /// An entry as a number by its address; 0 where there is none.
    pub(crate) fn number(&self, index: u16, sub: u8) -> u64 {
        self.slot(index, sub).map_or(0, |slot| self.unsigned(slot))
    }
}
