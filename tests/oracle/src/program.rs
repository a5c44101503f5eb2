//! A small reader of part programs: geometry and feed, nothing more. What it does not know it refuses.

mod arc;
mod codes;
mod curve;
mod line;
mod motion;
mod state;

use std::fmt;

use line::Line;
use state::State;

use crate::{Machine, Options, Row, path::Path};

/// Why a program could not be read.
#[derive(Clone, Debug, PartialEq)]
pub struct Unread {
    /// The program line, from 1.
    pub line: usize,
    /// What is not known there, naming the word.
    pub cause: String,
}

impl fmt::Display for Unread {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "program line {}: {}", self.line, self.cause)
    }
}

/// Reads a program into the path of the machine's axes, from where the machine stands. Where a probe came to rest is
/// read off the trace.
pub fn read(
    program: &str,
    machine: &Machine,
    options: &Options,
    rows: &[Row],
) -> Result<Path, Unread> {
    let mut state = State::new(machine, rows);
    let program = program.strip_prefix('\u{feff}').unwrap_or(program);
    let mut percent = Percent::default();
    for (index, text) in program.lines().enumerate() {
        let unread = |cause| Unread {
            line: index + 1,
            cause,
        };
        let text = match text.trim_start().strip_prefix('/') {
            Some(_) if options.block_delete => continue,
            Some(rest) => rest,
            None => text,
        };
        match percent.meets(text).map_err(unread)? {
            Met::Over => break,
            Met::Nothing => continue,
            Met::Words => {}
        }
        let line = Line::parse(text).map_err(unread)?;
        if state.execute(line, index + 1).map_err(unread)? {
            break;
        }
    }
    state.into_path().map_err(|cause| Unread {
        line: program.lines().count(),
        cause,
    })
}

/// How far a program is between its percent signs.
#[derive(Debug, Default)]
struct Percent {
    /// Whether the first text was a `%`; unknown before any.
    opened: Option<bool>,
    /// A `%` has ended a program that none had opened.
    over: bool,
}

/// What a line is to [`Percent`].
enum Met {
    /// Nothing of it is driven.
    Nothing,
    /// A line to be read.
    Words,
    /// The end of a program that `%` had opened: what follows is none of it.
    Over,
}

impl Percent {
    /// Takes a line, without its block delete.
    fn meets(&mut self, text: &str) -> Result<Met, String> {
        let alone = line::without_comments(text)?;
        match (alone.as_str(), self.opened) {
            ("" | "\u{1a}", _) => Ok(Met::Nothing),
            ("%", None) => {
                self.opened = Some(true);
                Ok(Met::Nothing)
            }
            ("%", Some(true)) => Ok(Met::Over),
            ("%", Some(false)) => {
                self.over = true;
                Ok(Met::Nothing)
            }
            _ if self.over => {
                Err("text behind the % that ends a program that none had opened".into())
            }
            _ => {
                self.opened.get_or_insert(false);
                Ok(Met::Words)
            }
        }
    }
}
