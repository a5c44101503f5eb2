//! The values that a section reads: each is checked, and what is wrong is noted.

use crate::node::{Node, Value};
use crate::section::Section;
use crate::shown::shorten;

/// Beyond these a number is a slip, and products of it would overflow or vanish.
const LARGEST: f64 = 1e12;
const SMALLEST: f64 = 1e-9;

impl<'a> Section<'a> {
    /// A text that is not empty.
    pub fn text(&self, key: &str) -> Option<&'a str> {
        let node = self.right(key)?;
        match node.text() {
            Some("") => self.refuse(key, "must not be empty"),
            None => self.refuse_kind(key, "a string", node),
            Some(text) => return Some(text),
        }
        None
    }

    /// One of the given words, and what it stands for.
    pub fn choice<T: Copy>(&self, key: &str, words: &[(&str, T)]) -> Option<T> {
        let text = self.text(key)?;
        let found = words.iter().find(|(word, _)| *word == text);
        if found.is_none() {
            let all: Vec<_> = words
                .iter()
                .map(|(word, _)| format!("\"{word}\""))
                .collect();
            self.refuse(
                key,
                format!("must be {}, not \"{}\"", all.join(" or "), shorten(text)),
            );
        }
        found.map(|(_, meaning)| *meaning)
    }

    /// A whole number from `least` to `most`.
    pub fn whole(&self, key: &str, least: u32, most: u32) -> Option<u32> {
        let node = self.right(key)?;
        let number = match node.value {
            Value::Integer(number) => number,
            Value::Float(number) => {
                self.refuse(key, format!("must be a whole number, not {number:?}"));
                return None;
            }
            _ => {
                self.refuse_kind(key, "a whole number", node);
                return None;
            }
        };
        let fits = u32::try_from(number)
            .ok()
            .filter(|n| (least..=most).contains(n));
        if fits.is_none() {
            self.refuse(key, format!("must be from {least} to {most}, not {number}"));
        }
        fits
    }

    /// True or false.
    pub fn truth(&self, key: &str) -> Option<bool> {
        let node = self.right(key)?;
        if let Value::Bool(truth) = node.value {
            return Some(truth);
        }
        self.refuse_kind(key, "true or false", node);
        None
    }

    /// A finite number.
    pub fn number(&self, key: &str) -> Option<f64> {
        self.finite(key, self.right(key)?)
    }

    /// A finite number of at least `least`.
    pub fn at_least(&self, key: &str, least: f64) -> Option<f64> {
        let number = self.number(key)?;
        if number < least {
            self.refuse(key, format!("must be at least {least}, not {number}"));
        }
        Some(number).filter(|n| *n >= least)
    }

    /// A finite number above zero.
    pub fn positive(&self, key: &str) -> Option<f64> {
        let number = self.number(key)?;
        if number <= 0.0 {
            self.refuse(key, format!("must be above 0, not {number}"));
        } else if number < SMALLEST {
            self.refuse(
                key,
                format!("must be at least {SMALLEST:e}, not {number:e}"),
            );
        }
        Some(number).filter(|n| *n >= SMALLEST)
    }

    /// A lower and a higher number.
    pub fn range(&self, key: &str) -> Option<(f64, f64)> {
        let node = self.right(key)?;
        let Some([low, high]) = node.array() else {
            self.refuse(key, "must be [lowest, highest]");
            return None;
        };
        let (low, high) = (self.finite(key, low)?, self.finite(key, high)?);
        if low < high {
            return Some((low, high));
        }
        self.refuse(
            key,
            format!("the lowest, {low}, is not below the highest, {high}"),
        );
        None
    }

    fn finite(&self, key: &str, node: &Node) -> Option<f64> {
        match node.value {
            Value::Integer(number) => self.bounded(key, number as f64),
            Value::Float(number) => self.bounded(key, number),
            Value::Wrong => None,
            _ => {
                self.refuse_kind(key, "a number", node);
                None
            }
        }
    }

    fn bounded(&self, key: &str, number: f64) -> Option<f64> {
        if !number.is_finite() {
            self.refuse(key, format!("must be finite, not {number}"));
        } else if number.abs() > LARGEST {
            self.refuse(key, format!("must be at most {LARGEST:e}, not {number:e}"));
        }
        Some(number).filter(|n| n.abs() <= LARGEST)
    }

    fn refuse_kind(&self, key: &str, wanted: &str, node: &Node) {
        self.refuse(key, format!("must be {wanted}, not {}", node.kind()));
    }
}
