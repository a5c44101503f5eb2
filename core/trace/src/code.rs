//! Rows of words in few bytes: what a straight line through the last two rows does not foretell.
//!
//! The bits of a double, read as a whole number, grow evenly where its value does, so at constant speed a position is
//! foretold to a few units in the last place. Whole-number arithmetic wraps, hence every bit comes back.

use crate::words::{MAX_WORDS, Words};

/// Most bytes of an encoded row: a length of four bits per word, and eight bytes each.
pub const MAX_ROW_BYTES: usize = MAX_WORDS.div_ceil(2) + 8 * MAX_WORDS;

/// The last two rows.
#[derive(Clone, Copy, Debug)]
pub struct History {
    last: Words,
    before: Words,
}

impl History {
    /// No row yet: all words are foretold as zero.
    pub const EMPTY: Self = Self { last: [0; MAX_WORDS], before: [0; MAX_WORDS] };

    /// A history of one row that stood still.
    pub fn after_key(row: Words) -> Self {
        Self { last: row, before: row }
    }

    /// Goes on by one row.
    pub fn push(&mut self, row: Words) {
        self.before = std::mem::replace(&mut self.last, row);
    }

    /// What the next row's word `index` would be if it went on as before.
    fn foretold(&self, index: usize) -> u64 {
        self.last[index].wrapping_add(self.last[index].wrapping_sub(self.before[index]))
    }

    /// Appends the first `count` words of a row to `bytes`.
    pub fn encode(&self, row: &Words, count: usize, bytes: &mut Vec<u8>) {
        let lengths = bytes.len();
        bytes.resize(lengths + count.div_ceil(2), 0);
        for (index, word) in row.iter().take(count).enumerate() {
            let rest = zigzag(word.wrapping_sub(self.foretold(index)));
            let length = 8 - rest.leading_zeros() as usize / 8;
            bytes[lengths + index / 2] |= (length as u8) << (4 * (index % 2));
            bytes.extend_from_slice(&rest.to_le_bytes()[..length]);
        }
    }

    /// The row of `count` words that `bytes` holds, all of them; `None` where they hold none.
    pub fn decode(&self, bytes: &[u8], count: usize) -> Option<Words> {
        let (lengths, mut rests) = bytes.split_at_checked(count.div_ceil(2))?;
        let mut row = [0; MAX_WORDS];
        for (index, word) in row.iter_mut().take(count).enumerate() {
            let length = usize::from(lengths[index / 2] >> (4 * (index % 2)) & 0xf);
            let (rest, others) = rests.split_at_checked(length)?;
            let mut eight = [0; 8];
            eight.get_mut(..length)?.copy_from_slice(rest);
            *word = self.foretold(index).wrapping_add(unzigzag(u64::from_le_bytes(eight)));
            rests = others;
        }
        rests.is_empty().then_some(row)
    }
}

/// Small differences of either sign become small numbers.
fn zigzag(difference: u64) -> u64 {
    let signed = difference.cast_signed();
    ((signed << 1) ^ (signed >> 63)).cast_unsigned()
}

fn unzigzag(number: u64) -> u64 {
    (number >> 1) ^ (number & 1).wrapping_neg()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_of_either_sign_come_back() {
        for difference in [0, 1, u64::MAX, 1 << 63, i64::MAX.cast_unsigned(), 0x1234_5678_9abc_def0] {
            assert_eq!(unzigzag(zigzag(difference)), difference);
        }
        assert_eq!([zigzag(0), zigzag(u64::MAX), zigzag(1)], [0, 1, 2]);
    }

    #[test]
    fn constant_speed_takes_hardly_a_byte() {
        let row = |k: u32| std::array::from_fn(|i| (100.0 + 0.05 * f64::from(k) + i as f64).to_bits());
        let mut history = History::after_key(row(0));
        history.push(row(1));
        let mut bytes = vec![];
        history.encode(&row(2), MAX_WORDS, &mut bytes);
        assert!(bytes.len() <= MAX_WORDS.div_ceil(2) + 2 * MAX_WORDS, "{} bytes", bytes.len());
        assert_eq!(history.decode(&bytes, MAX_WORDS), Some(row(2)));
    }

    #[test]
    fn a_length_above_eight_is_no_row() {
        assert_eq!(History::EMPTY.decode(&[0x09, 0, 0, 0, 0, 0, 0, 0, 0, 0], 1), None);
        assert_eq!(History::EMPTY.decode(&[0x01], 1), None);
        assert_eq!(History::EMPTY.decode(&[0x00, 7], 1), None);
        assert_eq!(History::EMPTY.decode(&[], 1), None);
    }
}
