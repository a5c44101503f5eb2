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
pub fn read(program: &str, machine: &Machine, options: &Options, rows: &[Row]) -> Result<Path, Unread> {
    let mut state = State::new(machine, rows);
    let program = program.strip_prefix('\u{feff}').unwrap_or(program);
    let mut percent_signs = 0;
    for (index, text) in program.lines().enumerate() {
        let unread = |cause| Unread { line: index + 1, cause };
        let text = match text.trim_start().strip_prefix('/') {
            Some(_) if options.block_delete => continue,
            Some(rest) => rest,
            None => text,
        };
        if text.trim() == "%" {
            percent_signs += 1;
            if percent_signs == 2 {
                break;
            }
            continue;
        }
        let line = Line::parse(text).map_err(unread)?;
        if state.execute(line, index + 1).map_err(unread)? {
            break;
        }
    }
    state.into_path().map_err(|cause| Unread { line: program.lines().count(), cause })
}
