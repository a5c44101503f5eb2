//! Axis letters and positions.

/// The letters an axis may have; the index of a letter is the index of the axis in a [`Position`].
pub const LETTERS: [char; 9] = ['X', 'Y', 'Z', 'A', 'B', 'C', 'U', 'V', 'W'];

/// Machine coordinates by axis letter, mm (degrees of a rotary axis); axes that a machine lacks stay at 0.
pub type Position = [f64; LETTERS.len()];

/// A set of axis indices, in the order they were named.
pub type Axes = Vec<usize>;

/// Index of an axis letter, upper or lower case.
pub fn axis_index(letter: char) -> Option<usize> {
    LETTERS
        .iter()
        .position(|known| known.eq_ignore_ascii_case(&letter))
}

/// Index of an axis named by a single letter, as in a column or a table name.
pub(crate) fn axis_of_name(name: &str) -> Option<usize> {
    let mut letters = name.chars();
    let letter = letters.next()?;
    letters
        .next()
        .is_none()
        .then(|| axis_index(letter))
        .flatten()
}
