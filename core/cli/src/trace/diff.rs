//! `tandem trace diff`.

use std::error::Error;
use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;

use super::samples::{Cell, Row, Samples};

/// Exit status: the traces differ.
const DIFFERENT: u8 = 1;

/// Compares two traces column by column, each with the one of its name: bit for bit where both are binary, else as a CSV
/// shows them. With `commands_only` the command samples alone.
pub fn diff(a: &Path, b: &Path, commands_only: bool) -> Result<u8, Box<dyn Error>> {
    let (mut left, mut right) = (Samples::open(a)?, Samples::open(b)?);
    let found = compare(&mut left, &mut right, commands_only)?;
    // A reader that has gone away (a closed pipe) is no reason to fail.
    let _ = write!(std::io::stdout().lock(), "{}", found.text());
    if !found.is_same() {
        return Ok(DIFFERENT);
    }
    // The same as far as they can be read, but that is not all.
    Ok(left.conclude().max(right.conclude()))
}

/// What a comparison found.
#[derive(Default)]
struct Found {
    /// The first difference, in words.
    first: Option<String>,
    /// Samples compared.
    count: u64,
    columns: Vec<Column>,
    /// Columns that only A, and only B has.
    lone: [Vec<String>; 2],
}

/// A column that both traces have.
struct Column {
    name: String,
    /// Its place in A and in B.
    places: [usize; 2],
    /// Samples that differ in it.
    differing: u64,
    /// The greatest difference of numbers, and its place in words.
    most: Option<(f64, String)>,
}

fn compare(left: &mut Samples, right: &mut Samples, commands_only: bool) -> Result<Found, String> {
    let bits = left.is_binary() && right.is_binary();
    let mut found = Found::of([left.columns(!bits), right.columns(!bits)], commands_only);
    loop {
        let (a, b) = match (left.next(!bits)?, right.next(!bits)?) {
            (Some(a), Some(b)) => (a, b),
            (None, None) => return Ok(found),
            (Some(row), None) => return Ok(found.ends_at(&row, "only in A; B")),
            (None, Some(row)) => return Ok(found.ends_at(&row, "only in B; A")),
        };
        if !found.rows(&a, &b, bits) {
            return Ok(found);
        }
    }
}

impl Found {
    fn of(names: [Vec<String>; 2], commands_only: bool) -> Self {
        let names = names.map(|names| {
            let all = names.into_iter().enumerate();
            all.filter(|(_, name)| !commands_only || name.contains("_cmd_"))
                .collect::<Vec<_>>()
        });
        let mut found = Self::default();
        for (place, name) in &names[0] {
            match names[1].iter().find(|(_, other)| other == name) {
                Some((other, _)) => {
                    let (name, places) = (name.clone(), [*place, *other]);
                    found.columns.push(Column {
                        name,
                        places,
                        differing: 0,
                        most: None,
                    });
                }
                None => found.lone[0].push(name.clone()),
            }
        }
        let lone = names[1]
            .iter()
            .filter(|(_, name)| !names[0].iter().any(|(_, other)| other == name));
        found.lone[1].extend(lone.map(|(_, name)| name.clone()));
        found
    }

    fn is_same(&self) -> bool {
        self.first.is_none() && self.lone.iter().all(Vec::is_empty)
    }

    fn ends_at(mut self, row: &Row, words: &str) -> Self {
        let text = format!("{}: {words} ends after {} samples", at(row), self.count);
        self.first.get_or_insert(text);
        self
    }

    /// Compares two rows; false where they are of different times, and nothing behind them can be compared.
    fn rows(&mut self, a: &Row, b: &Row, bits: bool) -> bool {
        if !same(a.t_s, b.t_s, bits) {
            let text = format!("{}: t_s: {:.16e} in A, {:.16e} in B", at(a), a.t_s, b.t_s);
            self.first.get_or_insert(text);
            return false;
        }
        self.count += 1;
        for column in &mut self.columns {
            let [left, right] =
                [(a, 0), (b, 1)].map(|(row, trace)| &row.cells[column.places[trace]]);
            let (by, words) = match (left, right) {
                (Cell::Number(a), Cell::Number(b)) if same(*a, *b, bits) => continue,
                (Cell::Word(a), Cell::Word(b)) if a == b => continue,
                (Cell::Number(a), Cell::Number(b)) => {
                    (Some((a - b).abs()), [a, b].map(|v| format!("{v:.16e}")))
                }
                _ => (None, [left, right].map(Cell::shown)),
            };
            column.differing += 1;
            // What is no number is further off than any number.
            let most = column.most.as_ref().map(|(most, _)| *most);
            if let Some(by) = by
                && most.is_none_or(|most| by > most || by.is_nan() && !most.is_nan())
            {
                column.most = Some((by, at(a)));
            }
            let [a_value, b_value] = words;
            let name = &column.name;
            self.first.get_or_insert_with(|| {
                format!("{}: {name}: {a_value} in A, {b_value} in B", at(a))
            });
        }
        true
    }

    fn text(&self) -> String {
        let (count, columns) = (self.count, self.columns.len());
        let mut text = match &self.first {
            Some(first) => format!("first difference: {first}\n"),
            None => format!("the same {count} samples in {columns} columns\n"),
        };
        for column in self.columns.iter().filter(|column| column.differing > 0) {
            let by = match &column.most {
                Some((most, place)) => format!(", by at most {most:e}, at {place}"),
                None => String::new(),
            };
            // A string takes all.
            let _ = writeln!(
                text,
                "{}: {} of {count} samples differ{by}",
                column.name, column.differing
            );
        }
        for (trace, lone) in ["A", "B"]
            .iter()
            .zip(&self.lone)
            .filter(|(_, lone)| !lone.is_empty())
        {
            let _ = writeln!(text, "only in {trace}: {}", lone.join(", "));
        }
        text
    }
}

impl Cell {
    fn shown(&self) -> String {
        match self {
            Self::Number(value) => format!("{value:.16e}"),
            Self::Word(word) => word.to_string(),
        }
    }
}

fn same(a: f64, b: f64, bits: bool) -> bool {
    if bits {
        a.to_bits() == b.to_bits()
    } else {
        a == b || a.is_nan() && b.is_nan()
    }
}

fn at(row: &Row) -> String {
    row.tick.map_or_else(
        || format!("t_s {}", row.t_s),
        |tick| format!("tick {tick} (t_s {})", row.t_s),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(x: f64, state: &'static str) -> Row {
        let cells = vec![Cell::Number(1.0), Cell::Number(x), Cell::Word(state.into())];
        Row {
            tick: Some(7),
            t_s: 0.007,
            cells,
        }
    }

    fn compared(a: &Row, b: &Row, bits: bool) -> Found {
        let names = ["x_cmd_mm", "y_cmd_mm", "state"].map(String::from).to_vec();
        let mut found = Found::of([names.clone(), names], false);
        found.rows(a, b, bits);
        found
    }

    #[test]
    fn one_bit_is_a_difference_and_the_sign_of_zero_only_where_bits_are_known() {
        let differ = |a: f64, b: f64, bits| {
            !compared(&row(a, "running"), &row(b, "running"), bits).is_same()
        };
        assert!(!differ(2.0, 2.0, true) && !differ(f64::NAN, f64::NAN, true));
        assert!(!differ(0.0, -0.0, false) && differ(0.0, -0.0, true));
        let next = f64::from_bits(2.0_f64.to_bits() ^ 1);
        let text = compared(&row(2.0, "running"), &row(next, "holding"), true).text();
        let expected = "first difference: tick 7 (t_s 0.007): y_cmd_mm: 2.0000000000000000e0 in A, 2.0000000000000004e0 in B\n\
                        y_cmd_mm: 1 of 1 samples differ, by at most 4.440892098500626e-16, at tick 7 (t_s 0.007)\n\
                        state: 1 of 1 samples differ\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn columns_are_compared_by_name_and_lone_ones_are_named() {
        let names = |list: &[&str]| list.iter().map(ToString::to_string).collect::<Vec<_>>();
        let a = names(&["line", "x_cmd_mm", "sig_load"]);
        let b = names(&["x_cmd_mm", "line", "ratio"]);
        let mut found = Found::of([a.clone(), b.clone()], false);
        let cells = |values: [f64; 3]| Row {
            tick: Some(0),
            t_s: 0.0,
            cells: values.map(Cell::Number).to_vec(),
        };
        assert!(found.rows(&cells([3.0, 5.0, 1.0]), &cells([5.0, 3.0, 2.0]), true));
        assert!(!found.is_same());
        assert_eq!(
            found.text(),
            "the same 1 samples in 2 columns\nonly in A: sig_load\nonly in B: ratio\n"
        );
        assert!(Found::of([a, b], true).is_same(), "command samples alone");
    }
}
