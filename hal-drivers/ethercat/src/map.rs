//! Where the objects of a device lie in its process data.

/// An object in the process data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Entry {
    pub(crate) index: u16,
    pub(crate) sub: u8,
    pub(crate) bits: u8,
}

impl Entry {
    pub(crate) const fn new(index: u16, bits: u8) -> Self {
        Self {
            index,
            sub: 0,
            bits,
        }
    }

    /// As it stands in an object of a mapping.
    pub(crate) fn word(self) -> u32 {
        u32::from(self.index) << 16 | u32::from(self.sub) << 8 | u32::from(self.bits)
    }

    /// Out of an object of a mapping.
    pub(crate) fn of(word: u32) -> Self {
        Self {
            index: (word >> 16) as u16,
            sub: (word >> 8) as u8,
            bits: word as u8,
        }
    }
}

/// The objects of one direction, in their order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Map(pub(crate) Vec<Entry>);

impl Map {
    /// The byte at which an object begins; none where it is not there, or not with so many bits at whole bytes.
    pub(crate) fn place(&self, index: u16, bits: u8) -> Option<usize> {
        let mut bit = 0;
        for entry in &self.0 {
            if entry.index == index && entry.sub == 0 {
                return (entry.bits == bits && bit % 8 == 0).then_some(bit / 8);
            }
            bit += usize::from(entry.bits);
        }
        None
    }
}

pub(crate) fn u16_at(bytes: &[u8], at: usize) -> u16 {
    bytes
        .get(at..at + 2)
        .map_or(0, |b| u16::from_le_bytes([b[0], b[1]]))
}

pub(crate) fn i32_at(bytes: &[u8], at: usize) -> i32 {
    bytes
        .get(at..at + 4)
        .map_or(0, |b| i32::from_le_bytes([b[0], b[1], b[2], b[3]]))
}

/// Writes `value` where there is a place for it.
pub(crate) fn put(bytes: &mut [u8], at: Option<usize>, value: &[u8]) {
    if let Some(room) = at.and_then(|at| bytes.get_mut(at..at + value.len())) {
        room.copy_from_slice(value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_lie_behind_each_other() {
        let map = Map(vec![
            Entry::new(0x6041, 16),
            Entry::new(0x6061, 8),
            Entry::new(0, 8),
            Entry::new(0x6064, 32),
        ]);
        assert_eq!(
            (map.place(0x6041, 16), map.place(0x6064, 32)),
            (Some(0), Some(4))
        );
        assert_eq!((map.place(0x6064, 16), map.place(0x606C, 32)), (None, None));
        assert_eq!(
            Entry::of(
                Entry {
                    index: 0x6099,
                    sub: 1,
                    bits: 32
                }
                .word()
            ),
            Entry {
                index: 0x6099,
                sub: 1,
                bits: 32
            }
        );
    }
}
