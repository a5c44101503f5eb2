//! Rows of words in few bytes: what a straight line through the last two rows does not foretell, and of the feedback
//! what its last distance from the command does not.
//!
//! The bits of a double, read as a whole number, grow evenly where its value does, so at constant speed a position is
//! foretold to a few units in the last place. Whole-number arithmetic wraps, hence every bit comes back.

use crate::words::{MAX_WORDS, Shape, Words};

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
    pub const EMPTY: Self = Self {
        last: [0; MAX_WORDS],
        before: [0; MAX_WORDS],
    };

    /// A history of one row that stood still.
    pub fn after_key(row: &Words) -> Self {
        Self {
            last: *row,
            before: *row,
        }
    }

    /// Goes on by one row.
    pub fn push(&mut self, row: &Words) {
        self.before = std::mem::replace(&mut self.last, *row);
    }

    /// What word `index` of the next row would be if all went on as before; the words before it are known.
    fn foretold(&self, row: &Words, index: usize, shape: Shape) -> u64 {
        let (from, before) = match shape.command_of(index) {
            Some(command) => (row[command], self.last[command]),
            None => (self.last[index], self.before[index]),
        };
        from.wrapping_add(self.last[index].wrapping_sub(before))
    }

    /// Appends the words of a row to `bytes`.
    pub fn encode(&self, row: &Words, shape: Shape, bytes: &mut Vec<u8>) {
        let (count, lengths) = (shape.words(), bytes.len());
        bytes.resize(lengths + count.div_ceil(2), 0);
        for (index, word) in row.iter().take(count).enumerate() {
            let rest = zigzag(word.wrapping_sub(self.foretold(row, index, shape)));
            let length = 8 - rest.leading_zeros() as usize / 8;
            bytes[lengths + index / 2] |= (length as u8) << (4 * (index % 2));
            bytes.extend_from_slice(&rest.to_le_bytes()[..length]);
        }
    }

    /// The row that `bytes` holds, all of them; `None` where they hold none.
    pub fn decode(&self, bytes: &[u8], shape: Shape) -> Option<Words> {
        let count = shape.words();
        let (lengths, mut rests) = bytes.split_at_checked(count.div_ceil(2))?;
        let mut row = [0; MAX_WORDS];
        for index in 0..count {
            let length = usize::from(lengths[index / 2] >> (4 * (index % 2)) & 0xf);
            let (rest, others) = rests.split_at_checked(length)?;
            let mut eight = [0; 8];
            eight.get_mut(..length)?.copy_from_slice(rest);
            row[index] = self
                .foretold(&row, index, shape)
                .wrapping_add(unzigzag(u64::from_le_bytes(eight)));
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

    const SHAPE: Shape = Shape {
        axes: 8,
        signals: 8,
        switched: true,
        aged: true,
    };

    #[test]
    fn differences_of_either_sign_come_back() {
        for difference in [
            0,
            1,
            u64::MAX,
            1 << 63,
            i64::MAX.cast_unsigned(),
            0x1234_5678_9abc_def0,
        ] {
            assert_eq!(unzigzag(zigzag(difference)), difference);
        }
        assert_eq!([zigzag(0), zigzag(u64::MAX), zigzag(1)], [0, 1, 2]);
    }

    #[test]
    fn constant_speed_takes_hardly_a_byte() {
        let row =
            |k: u32| std::array::from_fn(|i| (100.0 + 0.05 * f64::from(k) + i as f64).to_bits());
        let mut history = History::after_key(&row(0));
        history.push(&row(1));
        let mut bytes = vec![];
        history.encode(&row(2), SHAPE, &mut bytes);
        assert!(
            bytes.len() <= MAX_WORDS.div_ceil(2) + 2 * MAX_WORDS,
            "{} bytes",
            bytes.len()
        );
        assert_eq!(history.decode(&bytes, SHAPE), Some(row(2)));
    }

    #[test]
    fn what_is_no_row_is_none() {
        let shape = Shape {
            axes: 1,
            signals: 0,
            switched: false,
            aged: false,
        };
        let decoded = |bytes: &[u8]| History::EMPTY.decode(bytes, shape);
        assert!(decoded(&[0; 5]).is_some() && decoded(&[1, 0, 0, 0, 0, 7]).is_some());
        assert_eq!(
            decoded(&[9, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]),
            None
        );
        for bytes in [&[1, 0, 0, 0, 0][..], &[0; 6], &[0; 4], &[]] {
            assert_eq!(decoded(bytes), None);
        }
    }
}
