//! Little-endian numbers in byte slices, as every register, mailbox and process datum has them.

/// The number at `at`, 0 where the slice ends before.
pub(crate) fn u16_at(bytes: &[u8], at: usize) -> u16 {
    number_at(bytes, at, 2) as u16
}

/// The number at `at`, 0 where the slice ends before.
pub(crate) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    number_at(bytes, at, 4) as u32
}

/// The number at `at`, 0 where the slice ends before.
pub(crate) fn u64_at(bytes: &[u8], at: usize) -> u64 {
    number_at(bytes, at, 8)
}

/// A number of `length` bytes, at most 8, at `at`; bytes that are not there are 0.
pub(crate) fn number_at(bytes: &[u8], at: usize, length: usize) -> u64 {
    let there = bytes.get(at..).unwrap_or_default();
    match there[..there.len().min(length)] {
        [] => 0,
        [a] => u64::from(a),
        [a, b] => u64::from(u16::from_le_bytes([a, b])),
        [a, b, c, d] => u64::from(u32::from_le_bytes([a, b, c, d])),
        ref some => {
            let mut whole = [0; 8];
            let count = some.len().min(8);
            whole[..count].copy_from_slice(&some[..count]);
            u64::from_le_bytes(whole)
        }
    }
}

/// Writes the low bytes of `value` over `into`, at most 8.
pub(crate) fn put(into: &mut [u8], value: u64) {
    for (byte, new) in into.iter_mut().zip(value.to_le_bytes()) {
        *byte = new;
    }
}

/// Copies `bits` bits from bit `from_bit` of `from` to bit `to_bit` of `to`; what lies outside of either is left alone.
pub(crate) fn copy_bits(from: &[u8], from_bit: usize, to: &mut [u8], to_bit: usize, bits: usize) {
    if from_bit.is_multiple_of(8) && to_bit.is_multiple_of(8) && bits.is_multiple_of(8) {
        let count = bits / 8;
        let source = from.get(from_bit / 8..).unwrap_or_default();
        let target = to.get_mut(to_bit / 8..).unwrap_or_default();
        let count = count.min(source.len()).min(target.len());
        target[..count].copy_from_slice(&source[..count]);
        return;
    }
    for bit in 0..bits {
        let (source, target) = (from_bit + bit, to_bit + bit);
        let (Some(byte), Some(into)) = (from.get(source / 8), to.get_mut(target / 8)) else {
            return;
        };
        let mask = 1 << (target % 8);
        *into = if byte >> (source % 8) & 1 == 1 {
            *into | mask
        } else {
            *into & !mask
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_copied_across_bytes_and_no_further() {
        let mut to = [0xff, 0xff];
        copy_bits(&[0b0010_1000, 0], 3, &mut to, 6, 4);
        assert_eq!(to, [0b0111_1111, 0b1111_1101]);
        copy_bits(&[0], 5, &mut to, 14, 20);
        assert_eq!(to, [0b0111_1111, 0b0011_1101]);
        assert_eq!(number_at(&[1, 2], 1, 4), 2);
    }
}
