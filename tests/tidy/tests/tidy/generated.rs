//! Parts of the documentation that the code writes.

use crate::tree::{read, root};

const BEGIN: &str = "<!-- generated: UPDATE_DOCS=1 cargo test -p tandem-tidy -->\n";
const END: &str = "<!-- end of the generated part -->\n";

/// Compares the generated part of `file` with `text`, or replaces it.
fn is_up_to_date(file: &str, text: &str) {
    let page = read(file);
    let (before, rest) = page
        .split_once(BEGIN)
        .unwrap_or_else(|| panic!("{file}: no line {BEGIN}"));
    let (there, after) = rest
        .split_once(END)
        .unwrap_or_else(|| panic!("{file}: no line {END}"));
    let wanted = format!("\n{text}\n");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(
            root().join(file),
            [before, BEGIN, &wanted, END, after].concat(),
        )
        .unwrap();
    } else if let Some(number) = difference(there, &wanted) {
        let line = before.lines().count() + 1 + number;
        panic!(
            "{file}:{line}: not what the code says; UPDATE_DOCS=1 cargo test -p tandem-tidy rewrites it"
        );
    }
}

/// The first line, from 1, in which two texts differ.
fn difference(one: &str, other: &str) -> Option<usize> {
    let (mut left, mut right) = (one.lines(), other.lines());
    (1..).find_map(|number| match (left.next(), right.next()) {
        (None, None) => Some(None),
        (a, b) if a == b => None,
        _ => Some(Some(number)),
    })?
}

#[test]
fn the_table_of_words_is_the_interpreters() {
    is_up_to_date("docs/gcode.md", &tandem_gcode::docs());
}

#[test]
fn the_table_of_keys_is_the_readers() {
    is_up_to_date("docs/machine-toml.md", &tandem_machine::markdown());
}

#[test]
fn the_first_difference_is_found() {
    assert_eq!(difference("a\nb\n", "a\nb\n"), None);
    assert_eq!(difference("a\nb\n", "a\nc\n"), Some(2));
    assert_eq!(difference("a\n", "a\nc\n"), Some(2));
}
