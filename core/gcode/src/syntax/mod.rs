//! The text of a line: its characters, numbers, expressions and words.

pub(crate) mod expression;
mod function;
pub(crate) mod line_words;
mod number;
pub(crate) mod parse;
pub(crate) mod scan;
