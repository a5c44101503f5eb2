//! `tandem trace diff`.

use std::error::Error;
use std::io::Write;
use std::path::Path;

use super::samples::{Row, Samples};

/// Exit status: the traces differ.
const DIFFERENT: u8 = 1;

/// Compares the command samples of two traces: bit for bit where both are binary, else as a CSV shows them.
pub fn diff(a: &Path, b: &Path) -> Result<u8, Box<dyn Error>> {
    let (mut left, mut right) = (Samples::open(a)?, Samples::open(b)?);
    let found = compare(&mut left, &mut right)?;
    let (text, status) = match found {
        Found::Same(count) => (format!("the same {count} command samples"), 0),
        Found::Difference(text) => (text, DIFFERENT),
    };
    // A reader that has gone away (a closed pipe) is no reason to fail.
    let _ = writeln!(std::io::stdout().lock(), "{text}");
    if status != 0 {
        return Ok(status);
    }
    // The same as far as they can be read, but that is not all.
    Ok(left.conclude().max(right.conclude()))
}

enum Found {
    /// So many samples are the same.
    Same(u64),
    /// The first difference, in words.
    Difference(String),
}

fn compare(left: &mut Samples, right: &mut Samples) -> Result<Found, String> {
    let bits = left.is_binary() && right.is_binary();
    let columns = left.columns(!bits);
    let others = right.columns(!bits);
    if columns != others {
        let text = format!("other columns: {} in A, {} in B", columns.join(","), others.join(","));
        return Ok(Found::Difference(text));
    }
    let mut count = 0;
    loop {
        let text = match (left.next(!bits)?, right.next(!bits)?) {
            (None, None) => return Ok(Found::Same(count)),
            (Some(row), None) => format!("first difference: {}: only in A; B ends after {count} samples", at(&row)),
            (None, Some(row)) => format!("first difference: {}: only in B; A ends after {count} samples", at(&row)),
            (Some(a), Some(b)) => {
                let Some(text) = difference(&a, &b, &columns, bits) else {
                    count += 1;
                    continue;
                };
                text
            }
        };
        return Ok(Found::Difference(text));
    }
}

/// The first column in which two rows differ.
fn difference(a: &Row, b: &Row, columns: &[String], bits: bool) -> Option<String> {
    let same = |a: f64, b: f64| if bits { a.to_bits() == b.to_bits() } else { a == b || a.is_nan() && b.is_nan() };
    let names = ["t_s"].into_iter().chain(columns.iter().map(String::as_str));
    let values = |row: &Row| [&[row.t_s], &row.values[..]].concat();
    let (name, a_value, b_value) = names
        .zip(values(a).into_iter().zip(values(b)))
        .map(|(name, (a, b))| (name, a, b))
        .find(|(_, a, b)| !same(*a, *b))?;
    Some(format!("first difference: {}: {name}: {a_value:.16e} in A, {b_value:.16e} in B", at(a)))
}

fn at(row: &Row) -> String {
    row.tick.map_or_else(|| format!("t_s {}", row.t_s), |tick| format!("tick {tick} (t_s {})", row.t_s))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(x: f64) -> Row {
        Row { tick: Some(7), t_s: 0.007, values: vec![1.0, x] }
    }

    #[test]
    fn one_bit_is_a_difference_and_the_sign_of_zero_only_where_bits_are_known() {
        let columns = ["x_cmd_mm".to_string(), "y_cmd_mm".to_string()];
        let differ = |a: f64, b: f64, bits| difference(&row(a), &row(b), &columns, bits);
        assert_eq!(differ(2.0, 2.0, true), None);
        assert_eq!(differ(f64::NAN, f64::NAN, true), None);
        assert_eq!(differ(0.0, -0.0, false), None);
        assert!(differ(0.0, -0.0, true).is_some());
        let text = differ(2.0, f64::from_bits(2.0_f64.to_bits() ^ 1), false).unwrap();
        let said = "tick 7 (t_s 0.007): y_cmd_mm: 2.0000000000000000e0 in A, 2.0000000000000004e0 in B";
        assert_eq!(text, format!("first difference: {said}"));
    }
}
