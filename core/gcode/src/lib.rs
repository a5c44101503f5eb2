//! Part programs to blocks and events.
//!
//! The language is RS274/NGC as LinuxCNC reads it and Fanuc-style CAM output writes it. What is
//! supported and what is refused stands in one table; [`docs`] prints it. Two passes make a run: [`check`] reads the
//! whole program and lists its errors, [`Stream`] hands out its items on demand. [`Interpreter`] is the part in
//! between for single lines.
//!
//! ```
//! use tandem_gcode::{Config, Item, Program, Stream, check};
//! use tandem_sdk::Axes;
//!
//! let config = Config::new(Axes::new(&[('X', false), ('Y', false)]).unwrap());
//! let mut program = Program::spool("part.ngc", &b"G21 F600\nG1 X10\nG2 X20 I5\nM2\n"[..]).unwrap();
//! let report = check(&mut program, &config, &mut |_block, _curve| Ok(())).unwrap();
//! assert!(report.is_ok() && report.blocks == 3);
//!
//! let mut stream = Stream::new(program, &config).unwrap();
//! let mut items = Vec::new();
//! while stream.next_items(&mut items).unwrap() {}
//! assert!(matches!(items.last(), Some(Item::End)));
//! ```
//!
//! Where the dialects differ:
//! - G4 P is in seconds, as in LinuxCNC. `TA` is a time constant in ms.
//! - The units (G20, G21) and the feed mode (G93, G94) of a line hold for all its words.
//! - G80 beside a motion word only cancels canned cycles (the usual first line of CAM output); alone it ends the motion
//!   mode as in LinuxCNC.
//! - G0 or G1 without axis words sets the mode. G0 or G1 beside G28 or G30 sets the mode too, the axis words are G28's.
//! - G64 without P, or with P0, takes the machine's tolerance. G64 Q is accepted and has no effect.
//! - M6 stops the spindle.
//! - G38.2 to G38.5 are modal as in LinuxCNC, G31 holds for its line as on Fanuc. None of them goes with G93 or G53.
//! - EQ and NE forgive a difference of 0.0001, as in LinuxCNC. A blank within a number is an error.
//! - A comment may hold pairs of parentheses. What a comment says (MSG, PRINT, LOG) is not acted upon,
//!   but for the names of [`Config::watched`].
//! - Stored positions and offsets (#5161 to #5410) read in mm and degrees, the current position (#5420…) in program
//!   units. A run writes no parameter file.

#![allow(clippy::doc_markdown, reason = "LinuxCNC is a name, not code")]

#[cfg(test)]
extern crate self as tandem_gcode;

mod check;
mod config;
mod diagnostic;
mod flow;
mod interpreter;
mod item;
mod line;
mod line_error;
mod persistent;
mod program;
mod state;
mod stated;
mod stream;
mod syntax;
#[cfg(test)]
#[path = "../tests/common/mod.rs"]
mod testing;
mod words;

pub use check::{CheckReport, MAX_DIAGNOSTICS, check};
pub use config::{
    Config, DEFAULT_MAX_STEPS, FIRST_USER_COMMAND, LAST_USER_COMMAND, Lines, ProbeInput, Tool,
    ToolChange,
};
pub use diagnostic::{Diagnostic, Severity};
pub use interpreter::{Interpreter, MAX_LINE_BYTES};
pub use item::{Input, InputMode, InputWait, Item, ProbeResult, UserCommand};
pub use line_error::Sketch;
pub use persistent::{
    InForce, PersistentData, StateTag, StateTags, SwitchedOn, WORK_SYSTEMS, system_code,
};
pub use program::{Program, ProgramError};
pub use stated::Watched;
pub use stream::Stream;
pub use words::{KnownWord, docs, known_words};
