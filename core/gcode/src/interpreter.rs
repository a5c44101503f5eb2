//! One line after the other to items.

use std::cell::Cell;
use std::sync::Arc;

use tandem_sdk::AxisVector;

use crate::bezier::Tail;
use crate::config::Config;
use crate::curve::Curve;
use crate::diagnostic::Diagnostic;
use crate::expression::Context;
use crate::fault::{Checked, Fault, Span};
use crate::item::Item;
use crate::letters::{AXIS_MASK, Letters};
use crate::orders::Orders;
use crate::parameters::Parameters;
use crate::parse::parse;
use crate::scan::Scanner;
use crate::state::{Motion, State};
use crate::words::{Target, Words};

/// Longest line, bytes.
pub const MAX_LINE_BYTES: usize = 4096;

/// How far a program is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Only empty lines so far.
    Fresh,
    /// The first line was `%`: another one must close the program.
    Opened,
    Running,
    Ended,
}

impl Phase {
    /// The phase behind a line with text on it.
    #[inline]
    fn after_text(self) -> Self {
        if self == Self::Fresh { Self::Running } else { self }
    }
}

/// The state of one part program and of the machine as the program knows it.
#[derive(Clone)]
pub struct Interpreter {
    pub(crate) config: Config,
    pub(crate) letters: Letters,
    pub(crate) state: State,
    pub(crate) words: Words,
    pub(crate) orders: Orders,
    pub(crate) parameters: Parameters,
    file: Arc<str>,
    phase: Phase,
    /// The line of the `%` that ended the program, and whether one had opened it.
    ended_by_percent: Option<(u32, bool)>,
    /// Whether a word of the program has been read; a program number may only come before.
    begun: bool,
    /// The curve whose lines are being read.
    pub(crate) curve: Option<Curve>,
    /// How the last G5 ended.
    pub(crate) bezier_tail: Option<Tail>,
    /// The axis words of the current line have been used up.
    pub(crate) moved: bool,
    /// A value of the current line follows from what the first pass has assumed.
    pub(crate) reads_assumed: Cell<bool>,
    /// Axes whose position was assumed before the current line.
    assumed_start: u32,
}

impl Interpreter {
    /// An interpreter at the start of a program on the machine `config`.
    pub fn new(config: Config) -> Self {
        Self {
            letters: Letters::new(&config.axes),
            state: State::new(&config),
            words: Words::default(),
            orders: Orders::new(),
            parameters: Parameters::new(),
            file: "program".into(),
            phase: Phase::Fresh,
            ended_by_percent: None,
            begun: false,
            curve: None,
            bezier_tail: None,
            moved: false,
            reads_assumed: Cell::new(false),
            assumed_start: 0,
            config,
        }
    }

    /// Names the program in diagnostics.
    pub fn set_file(&mut self, name: &str) {
        self.file = name.into();
    }

    /// Whether the program has ended: further lines are passed over.
    pub fn ended(&self) -> bool {
        self.phase == Phase::Ended
    }

    /// The line of the `%` that ended the program, and whether one had opened it; `None` where something else ended it.
    pub(crate) fn ended_by_percent(&self) -> Option<(u32, bool)> {
        self.ended_by_percent
    }

    /// Where the first text of a line is that would be driven or refused: what is no blank, no comment, no `%` and in no
    /// line that block delete leaves out.
    pub(crate) fn first_text(&self, line: &[u8]) -> Option<usize> {
        let mut scanner = Scanner::new(line, 0);
        // Ctrl-Z ends the text of old systems.
        while matches!(scanner.peek(), b' ' | b'\t' | 0x1a) {
            scanner.advance(1);
        }
        if scanner.peek() == b'%' || scanner.peek() == b'/' && !self.config.block_delete {
            scanner.advance(1);
        } else if scanner.peek() == b'/' {
            return None;
        }
        let start = scanner.at();
        // A comment that is not closed is no comment.
        let at = if scanner.skip_ignorable().is_ok() { scanner.at() } else { start };
        (at < line.len()).then_some(at)
    }

    /// Manual input: lines are taken again after M2 or M30.
    pub fn go_on(&mut self) {
        if self.ended() {
            self.phase = Phase::Running;
        }
    }

    /// The programmed position, machine coordinates, mm or rad.
    pub fn position(&self) -> AxisVector {
        self.state.position
    }

    /// Tells where the machine really stands after an abort or a jog, machine coordinates, mm or rad.
    pub fn set_position(&mut self, position: AxisVector) {
        self.state.position = position;
        self.state.last_end = position;
        self.state.uncertain = 0;
        self.state.assumed.position = 0;
        self.state.at_rest = true;
    }

    /// Manual input: an abort, a fault or an emergency stop has switched spindle and coolant off, and outputs as the machine file
    /// says; what the next line asks for is sent, whatever it was before.
    pub fn set_switched_off(&mut self) {
        self.state.spindle.direction = 0;
        (self.state.mist, self.state.flood) = (false, false);
        self.state.outputs_set = 0;
    }

    /// The answer to [`Item::Wait`]: 1 or 0, or −1 after the time-out. It becomes #5399.
    pub fn provide_input(&mut self, value: f64) {
        self.state.input = value;
        self.state.assumed.input = false;
    }

    /// The first pass: M66 is taken to have timed out, and what follows from that to be unknown.
    pub(crate) fn assume_input(&mut self) {
        self.state.input = -1.0;
        self.state.assumed.input = true;
    }

    /// Whether what the last line does follows from an assumed answer, so that only the run can judge its numbers.
    pub(crate) fn is_assumed(&self) -> bool {
        let named = self.letters.axes_of(self.words.present & AXIS_MASK) & self.state.assumed.position;
        // Where a line ends is its axis words; an arc and a probe also depend on where they begin.
        let moves = match self.orders.motion {
            Some(Motion::Rapid | Motion::Line) | None => named != 0,
            Some(_) => (self.assumed_start | self.state.assumed.position) != 0,
        };
        self.reads_assumed.get() || self.moved && moves
    }

    /// Interprets line `number` (from 1), given without its line end, and appends what it orders to `out`. Blocks are
    /// numbered through from 0.
    ///
    /// # Errors
    /// The first error of the line; `out` is then as before. The interpreter can go on with the next line (to find
    /// more errors), at the programmed end of this one where that is known.
    pub fn line(&mut self, number: u32, text: &[u8], out: &mut Vec<Item>) -> Result<(), Diagnostic> {
        if self.phase == Phase::Ended {
            return Ok(());
        }
        let before = (out.len(), self.state.next_index, self.state.at_rest);
        self.state.line = number;
        self.run(text, out).map_err(|fault| {
            out.truncate(before.0);
            (self.state.next_index, self.state.at_rest) = (before.1, before.2);
            self.state.last_end = self.state.position;
            Diagnostic::new(&self.file, number, text, fault)
        })
    }

    /// Ends the program at the end of its text, as M2 would.
    ///
    /// # Errors
    /// A program that `%` has opened and nothing has closed: it is truncated.
    pub fn finish(&mut self, out: &mut Vec<Item>) -> Result<(), Diagnostic> {
        match self.phase {
            Phase::Ended => Ok(()),
            Phase::Opened => {
                self.phase = Phase::Ended;
                let why = "the program is truncated: % opened it, and neither %, M2 nor M30 ends it";
                Err(Diagnostic::whole_line(&self.file, self.state.line.max(1), b"", "truncated", why.into()))
            }
            Phase::Fresh | Phase::Running => {
                let open = self.no_curve_open();
                self.end(out);
                open.map_err(|fault| Diagnostic::new(&self.file, self.state.line.max(1), b"", fault))
            }
        }
    }

    /// Switches off what still runs and ends the stream.
    pub(crate) fn end(&mut self, out: &mut Vec<Item>) {
        self.switch_off(out);
        out.push(Item::End);
        self.phase = Phase::Ended;
    }

    fn run(&mut self, text: &[u8], out: &mut Vec<Item>) -> Checked<()> {
        if text.len() > MAX_LINE_BYTES {
            return Err(too_long(text.len()));
        }
        let Some(from) = self.lead(text, out)? else { return Ok(()) };
        self.words.clear();
        self.moved = false;
        self.reads_assumed.set(false);
        self.assumed_start = self.state.assumed.position;
        let context = Context {
            parameters: &self.parameters,
            state: &self.state,
            letters: &self.letters,
            reads_assumed: &self.reads_assumed,
        };
        let parsed = parse(text, from, &context, &mut self.words);
        let goes_on = self.goes_on();
        if let Ok(true) = goes_on {
            let done = parsed.and_then(|()| self.assign()).and_then(|()| self.curve_line(out));
            self.note_curve_line(text);
            if let (Err(_), Some(curve)) = (&done, &mut self.curve) {
                curve.broken = true;
            }
            return done;
        }
        let sorted = self.orders.sort(&self.words, self.state.motion, &self.letters);
        let complete = parsed.is_ok();
        let done = parsed.and(goes_on).and(sorted).and_then(|()| self.obey(out));
        self.note_curve_line(text);
        if done.is_err() {
            self.recover(complete);
        }
        done
    }

    fn obey(&mut self, out: &mut Vec<Item>) -> Checked<()> {
        self.assign()?;
        if self.words.has(b'O') && self.begun {
            return Err(self.words.fault(b'O', "o-word", crate::parse::O_WORDS));
        }
        self.begun |=
            self.words.present != 0 || !self.words.g.as_slice().is_empty() || !self.words.m.as_slice().is_empty();
        self.execute(out)
    }

    /// Deals with what may stand at the start of a line. Where the words begin; `None` where there are none.
    #[inline]
    fn lead(&mut self, text: &[u8], out: &mut Vec<Item>) -> Checked<Option<usize>> {
        let mut scanner = Scanner::new(text, 0);
        scanner.skip_blanks();
        match scanner.peek() {
            _ if scanner.at_end() => return Ok(None),
            b'%' => return self.percent(&mut scanner, out),
            b'/' if self.config.block_delete => return Ok(None),
            b'/' => {
                scanner.advance(1);
                self.phase = Phase::after_text(self.phase);
            }
            b'(' | b';' => {}
            _ => self.phase = Phase::after_text(self.phase),
        }
        Ok(Some(scanner.at()))
    }

    fn percent(&mut self, scanner: &mut Scanner, out: &mut Vec<Item>) -> Checked<Option<usize>> {
        let start = scanner.at();
        scanner.advance(1);
        scanner.skip_ignorable()?;
        if !scanner.at_end() {
            return Err(Fault::new(scanner.since(start), "percent", "% stands on a line of its own"));
        }
        if self.phase == Phase::Fresh {
            self.phase = Phase::Opened;
        } else {
            self.ended_by_percent = Some((self.state.line, self.phase == Phase::Opened));
            let open = self.no_curve_open();
            self.end(out);
            open?;
        }
        Ok(None)
    }

    /// After an erroneous line: what it would have assigned exists, so that no later line complains of that.
    pub(crate) fn assign_anyway(&mut self) {
        let _ = self.assign();
    }

    fn assign(&mut self) -> Checked<()> {
        let assumed = self.reads_assumed.get();
        for assignment in &self.words.assignments {
            match &assignment.target {
                Target::Numbered(number) => self.parameters.set_numbered(*number, assignment.value, assumed),
                Target::Named(range) => {
                    if !self.parameters.set_named(&self.words.names[range.clone()], assignment.value, assumed) {
                        return Err(Fault::new(
                            assignment.span,
                            "parameter-name",
                            "there are too many named parameters",
                        ));
                    }
                }
            }
        }
        Ok(())
    }
}

#[cold]
fn too_long(length: usize) -> Fault {
    let message = format!("the line has {length} bytes, {MAX_LINE_BYTES} are allowed: this is hardly a part program");
    Fault::new(Span::new(0, 1), "line-long", message)
}
