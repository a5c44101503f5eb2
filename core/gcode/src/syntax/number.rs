//! Decimal numbers: a sign, digits, a point, digits. There are no exponents in part programs.

use super::scan::{Scanner, byte_at, eight_at};
use crate::line_error::{Checked, LineError};

/// Most characters of a number.
const MAX_LENGTH: usize = 64;
/// Digits that always fit a 53-bit mantissa, so that the quotient by an exact power of ten is correctly rounded.
const EXACT_DIGITS: usize = 15;
const POWERS_OF_TEN: [f64; EXACT_DIGITS + 1] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
];

/// Whether a number begins at the cursor.
#[inline]
pub(crate) fn starts_here(scanner: &Scanner) -> bool {
    match scanner.peek() {
        b'0'..=b'9' | b'.' => true,
        b'+' | b'-' => matches!(scanner.peek_at(1), b'0'..=b'9' | b'.'),
        _ => false,
    }
}

/// Reads the number at the cursor, correctly rounded.
///
/// # Errors
/// No digit, a second point, or more than 64 characters.
pub(crate) fn read(scanner: &mut Scanner) -> Checked<f64> {
    let start = scanner.at();
    let Some((value, end)) = short(scanner.text(), start) else {
        return read_any(scanner);
    };
    scanner.advance(end - start);
    Ok(value)
}

/// The number that begins with byte `start` of `text`, and where it ends, where it is short and right.
#[inline(always)]
#[allow(
    clippy::inline_always,
    reason = "read for nearly every word, it takes longer to hand it over than to read it"
)]
pub(crate) fn short(text: &[u8], start: usize) -> Option<(f64, usize)> {
    let sign = byte_at(text, start);
    let digit = sign.wrapping_sub(b'0');
    if digit < 10 && !matches!(byte_at(text, start + 1), b'0'..=b'9' | b'.') {
        return Some((f64::from(digit), start + 1));
    }
    let from = start + usize::from(matches!(sign, b'+' | b'-'));
    let eight = eight_at(text, from);
    let whole = count_digits(eight);
    if whole == EIGHT || (eight >> (8 * whole)) as u8 != b'.' {
        // Eight digits may go on, and where there is none something is wrong.
        return (whole != 0 && whole != EIGHT)
            .then(|| (signed(sign, value_of(eight, whole), 0), from + whole));
    }
    // The point is taken out, and all digits are read at once.
    let before = (1 << (8 * whole)) - 1;
    let last = u64::from(byte_at(text, from + EIGHT)) << 56;
    let digits = eight & before | eight >> 8 & !before | last;
    let count = count_digits(digits);
    let end = from + count + 1;
    if count == EIGHT && byte_at(text, end).is_ascii_digit() {
        return of_more_digits(text, sign, (from, whole));
    }
    if count == 0 || byte_at(text, end) == b'.' {
        return None;
    }
    let magnitude = value_of(digits, count);
    Some((signed(sign, magnitude, count - whole), end))
}

/// A number of more than eight digits, of which the first `whole`, from byte `from` on, stand before the point.
#[inline(never)]
fn of_more_digits(text: &[u8], sign: u8, (from, whole): (usize, usize)) -> Option<(f64, usize)> {
    let below_one = eight_at(text, from + whole + 1);
    let fraction = count_digits(below_one);
    let end = from + whole + 1 + fraction;
    if fraction == EIGHT || fraction == 0 || byte_at(text, end) == b'.' {
        return None;
    }
    let before_point = match whole {
        0 => 0,
        _ => value_of(eight_at(text, from), whole),
    };
    let mantissa = before_point * POWERS_OF_TEN_WHOLE[fraction] + value_of(below_one, fraction);
    Some((signed(sign, mantissa, fraction), end))
}

/// The number with these digits, of which the last `fraction` stand behind the point.
#[inline]
fn signed(sign: u8, digits: u64, fraction: usize) -> f64 {
    let magnitude = digits.cast_signed() as f64 / POWERS_OF_TEN[fraction];
    if sign == b'-' { -magnitude } else { magnitude }
}

/// Digits that are read at a time.
const EIGHT: usize = 8;
const POWERS_OF_TEN_WHOLE: [u64; EIGHT + 1] = [
    1,
    10,
    100,
    1000,
    10_000,
    100_000,
    1_000_000,
    10_000_000,
    100_000_000,
];

/// How many of eight bytes are digits before the first that is none. The first byte is the lowest.
#[inline]
fn count_digits(eight: u64) -> usize {
    // Each byte becomes its digit; what is none is more than nine, and shows as the highest bit of its byte.
    let values = eight ^ 0x3030_3030_3030_3030;
    let others = (values.wrapping_add(0x7676_7676_7676_7676) | values) & 0x8080_8080_8080_8080;
    others.trailing_zeros() as usize / 8
}

/// The number that the first `count` of eight bytes are, which are digits; there is at least one.
#[inline]
fn value_of(eight: u64, count: usize) -> u64 {
    // Set to the right with zeros before them, and added up: in pairs, then fours, then all eight.
    let digits = (eight ^ 0x3030_3030_3030_3030) << (64 - 8 * count);
    let pairs = digits.wrapping_mul(10 << 8 | 1) >> 8 & 0x00ff_00ff_00ff_00ff;
    let fours = pairs.wrapping_mul(100 << 16 | 1) >> 16 & 0x0000_ffff_0000_ffff;
    fours.wrapping_mul(10_000 << 32 | 1) >> 32
}

/// Reads any number, digit by digit.
#[cold]
fn read_any(scanner: &mut Scanner) -> Checked<f64> {
    let text = scanner.rest();
    let signed = usize::from(matches!(text.first(), Some(b'+' | b'-')));
    let (mut mantissa, whole) = digits(&text[signed..], 0);
    let mut length = signed + whole;
    let mut fraction = 0;
    if text.get(length) == Some(&b'.') {
        (mantissa, fraction) = digits(&text[length + 1..], mantissa);
        length += 1 + fraction;
    }
    let start = scanner.at();
    scanner.advance(length);
    if whole + fraction == 0 || length > MAX_LENGTH || scanner.peek() == b'.' {
        return Err(refuse(scanner, start, whole + fraction, length));
    }
    if whole + fraction > EXACT_DIGITS {
        // The bytes are ASCII digits, a sign and a point, which `parse` always understands.
        return Ok(std::str::from_utf8(&text[..length])
            .ok()
            .and_then(|t| t.parse().ok())
            .unwrap_or(f64::NAN));
    }
    let magnitude = mantissa as f64 / POWERS_OF_TEN[fraction];
    Ok(if text[0] == b'-' {
        -magnitude
    } else {
        magnitude
    })
}

/// The digits at the start of `text`, set behind `mantissa` (which wraps where they are too many), and how many they are.
fn digits(text: &[u8], mut mantissa: u64) -> (u64, usize) {
    let mut count = 0;
    for byte in text {
        let digit = byte.wrapping_sub(b'0');
        if digit > 9 {
            break;
        }
        mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
        count += 1;
    }
    (mantissa, count)
}

#[cold]
fn refuse(scanner: &Scanner, start: usize, digits: usize, length: usize) -> LineError {
    if length > MAX_LENGTH {
        let message = format!("the number has {length} characters, {MAX_LENGTH} are allowed");
        LineError::new(scanner.since(start), "number-long", message)
    } else if digits == 0 {
        LineError::new(
            scanner.since(start),
            "number",
            "a number needs at least one digit",
        )
    } else {
        LineError::new(
            scanner.here(),
            "number",
            "a number has one decimal point only",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn number(text: &str) -> Result<f64, String> {
        let mut scanner = Scanner::new(text.as_bytes(), 0);
        let value = read(&mut scanner).map_err(|f| f.message.clone())?;
        assert!(scanner.at_end());
        Ok(value)
    }

    #[test]
    fn forms_of_a_number() {
        for (text, value) in [
            ("1", 1.0),
            ("-.5", -0.5),
            ("+3.", 3.0),
            ("007.2500", 7.25),
            ("0", 0.0),
        ] {
            assert_eq!(number(text), Ok(value), "{text}");
        }
        assert!(number(".").unwrap_err().contains("digit"));
        assert!(number("1.2.3").unwrap_err().contains("one decimal point"));
        assert!(
            number(&"1".repeat(65))
                .unwrap_err()
                .contains("65 characters")
        );
    }

    /// What comes behind a number, and how long the line is, changes nothing.
    #[test]
    fn a_number_ends_where_its_digits_end() {
        for number in [
            "7",
            "-0.5",
            "12345678",
            "1.2345678",
            "+1234567.1234567",
            "123456789.5",
            "-.0",
        ] {
            for behind in [
                "",
                "X",
                " 1",
                "Y-3.25Z1",
                "/]:;@",
                "\u{ff}9",
                "a(1234567890)",
            ] {
                let text = format!("{number}{behind}");
                let mut scanner = Scanner::new(text.as_bytes(), 0);
                let value = read(&mut scanner).unwrap();
                assert_eq!(
                    value.to_bits(),
                    number.parse::<f64>().unwrap().to_bits(),
                    "{text}"
                );
                assert_eq!(scanner.at(), number.len(), "{text}");
            }
        }
    }

    proptest! {
        #[test]
        fn every_number_is_correctly_rounded(text in r"[+-]?[0-9]{1,20}(\.[0-9]{0,20})?") {
            prop_assert_eq!(number(&text), Ok(text.parse().unwrap()));
        }

        #[test]
        fn short_numbers_are_correctly_rounded(text in r"[+-]?[0-9]{0,9}\.[0-9]{1,9}") {
            prop_assert_eq!(number(&text).map(f64::to_bits), Ok(text.parse::<f64>().unwrap().to_bits()));
        }
    }
}
