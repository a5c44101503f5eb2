//! One line after the other to items.

use std::cell::Cell;
use std::sync::Arc;

use tandem_sdk::AxisVector;

use crate::config::Config;
use crate::diagnostic::{Diagnostic, Severity};
use crate::flow::{by_hand, o_word};
use crate::item::{Item, ProbeResult};
use crate::line::Line;
use crate::line_error::{Checked, LineError, Span};
use crate::persistent::SwitchedOn;
use crate::state::State;
use crate::state::letters::Letters;
use crate::state::parameters::{Parameters, Value};
use crate::stated::{self, Unknown};
use crate::syntax::expression::Context;
use crate::syntax::line_words::{LineWords, Target};
use crate::syntax::parse::{O_WORDS, parse, plain_words};
use crate::syntax::scan::{ABORT, Scanner};
use crate::words::compensation::{self, Compensation};
use crate::words::coolant::Coolant;
use crate::words::orders::{Orders, polar_misplaced};
use crate::words::subprogram::Jump;
use crate::words::{curve, modal, probe, stop};

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
}

impl Phase {
    /// The phase behind a line with text on it.
    #[inline]
    fn after_text(self) -> Self {
        if self == Self::Fresh {
            Self::Running
        } else {
            self
        }
    }
}

/// The state of one part program and of the machine as the program knows it.
#[derive(Clone)]
pub struct Interpreter {
    config: Config,
    letters: Letters,
    pub(crate) state: State,
    pub(crate) parameters: Parameters,
    /// The words of the current line, and what they order.
    words: LineWords,
    orders: Orders,
    file: Arc<str>,
    phase: Phase,
    /// The line of the `%` that ended the program, and whether one had opened it.
    ended_by_percent: Option<(u32, bool)>,
    /// Whether a word of the program has been read; its name may only come before.
    begun: bool,
    /// A value of the current line follows from what the first pass has assumed.
    reads_assumed: Cell<bool>,
    /// The line that blocks and events bear, where it is not the one that is read: lines of a subroutine's own file bear
    /// that of the call.
    pub(crate) reported_line: Option<u32>,
    /// The first comment that states what cannot be read for a name that is watched.
    unknown: Option<Unknown>,
}

impl Interpreter {
    /// An interpreter at the start of a program on the machine `config`.
    pub fn new(config: Config) -> Self {
        let persistent = config.persistent.clone();
        let on = config.on;
        let mut new = Self::without_persistent_data(config);
        (new.state.spindle, new.state.coolant) = (on.spindle, on.coolant);
        if let Some(persistent) = persistent {
            new.set_persistent_data(&persistent);
        }
        new
    }

    fn without_persistent_data(config: Config) -> Self {
        Self {
            letters: Letters::new(&config.axes),
            state: State::new(&config),
            parameters: Parameters::new(),
            words: LineWords::default(),
            orders: Orders::new(),
            file: "program".into(),
            phase: Phase::Fresh,
            ended_by_percent: None,
            begun: false,
            reads_assumed: Cell::new(false),
            reported_line: None,
            unknown: None,
            config,
        }
    }

    /// Spindle and coolant behind what was read, for a program that begins with them.
    pub fn switched_on(&self) -> SwitchedOn {
        SwitchedOn {
            spindle: self.state.spindle,
            coolant: self.state.coolant,
        }
    }

    /// Names the program in diagnostics.
    pub fn set_file(&mut self, name: &str) {
        self.file = name.into();
    }

    /// Whether the program has ended: further lines are passed over.
    pub fn ended(&self) -> bool {
        self.state.ended
    }

    /// The name of the program in diagnostics.
    pub(crate) fn file(&self) -> &Arc<str> {
        &self.file
    }

    pub(crate) fn config(&self) -> &Config {
        &self.config
    }

    /// Whether a word of the program has been read.
    pub(crate) fn has_begun(&self) -> bool {
        self.begun
    }

    /// A line with an O-word is executed instead of being interpreted.
    pub(crate) fn begin_o_word(&mut self, number: u32) {
        self.phase = Phase::after_text(self.phase);
        self.begun = true;
        self.state.line = self.reported_line.unwrap_or(number);
        self.words.clear();
        self.orders.clear();
        self.state.path.begin_line();
        self.reads_assumed.set(false);
    }

    /// What is worth to be known of the program as a whole: that lengths of tools were taken as zero, that a comment states
    /// for a watched name what cannot be read.
    pub(crate) fn notes(&self) -> impl Iterator<Item = Diagnostic> {
        let note = |line, code, message| Diagnostic {
            severity: Severity::Warning,
            ..Diagnostic::whole_line(&self.file, line, b"", code, message)
        };
        let lengths = self.state.tools.assumed_zero.map(|line| {
            let message =
                "the machine has no tool table: the length of every tool is taken as zero";
            note(line, "tool-length", message.to_owned())
        });
        let stated = self.unknown.as_ref();
        let stated = stated.map(|unknown| note(unknown.line, "stated", unknown.message.clone()));
        lengths.into_iter().chain(stated)
    }

    /// A subroutine begins.
    pub(crate) fn enter_sub(&mut self, arguments: &[Value]) {
        self.parameters.enter(arguments);
        self.state.saved.enter();
    }

    /// Somebody executes M98 and M99, by [`Self::take_jump`].
    pub(crate) fn obey_jumps(&mut self) {
        self.state.subprograms.obeyed = true;
    }

    /// Where the line that was executed last says that the program goes on, and whether that follows from what has been
    /// assumed.
    #[inline]
    pub(crate) fn take_jump(&mut self) -> Option<(Jump, bool)> {
        let jump = self.state.subprograms.jump.take()?;
        Some((jump, self.reads_assumed.get()))
    }

    /// What was called by hand is over: what belongs to a program is again as `before` the call.
    pub(crate) fn end_by_hand(&mut self, before: &Self) {
        self.parameters.leave_all();
        self.state.saved.leave_all();
        self.state.subprograms = before.state.subprograms;
        self.state.line = before.state.line;
        self.file = Arc::clone(&before.file);
        (self.phase, self.begun, self.reported_line) =
            (before.phase, before.begun, before.reported_line);
        self.ended_by_percent = before.ended_by_percent;
    }

    /// A subprogram begins.
    pub(crate) fn enter_subprogram(&mut self) {
        self.parameters.enter_subprogram();
        self.state.saved.enter();
    }

    /// The program begins again with its first line.
    pub(crate) fn begin_again(&mut self) {
        self.phase = Phase::Fresh;
    }

    /// A subroutine ends; what is restored then goes to `out`.
    pub(crate) fn leave_sub(&mut self, value: Option<Value>, out: &mut Vec<Item>) {
        self.parameters.leave(value);
        modal::leave(&mut self.execution(out));
    }

    /// What values are made of.
    pub(crate) fn context(&self) -> Context<'_> {
        Context {
            parameters: &self.parameters,
            state: &self.state,
            letters: &self.letters,
            reads_assumed: &self.reads_assumed,
        }
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
        let at = if scanner.skip_ignorable().is_ok() {
            scanner.at()
        } else {
            start
        };
        (at < line.len()).then_some(at)
    }

    /// Manual input: lines are taken again after M2 or M30.
    pub fn go_on(&mut self) {
        self.state.ended = false;
    }

    /// The programmed position, machine coordinates, mm or rad.
    pub fn position(&self) -> AxisVector {
        self.state.path.position
    }

    /// Tells where the machine really stands after an abort or a jog, machine coordinates, mm or rad.
    pub fn set_position(&mut self, position: AxisVector) {
        self.state.path.set(position);
        self.state.compensation = Compensation::default();
    }

    /// Manual input: an abort, an error or an emergency stop has switched spindle and coolant off, and outputs as the machine file
    /// says; what the next line asks for is sent, whatever it was before.
    pub fn set_switched_off(&mut self) {
        self.state.spindle.direction = 0;
        self.state.coolant = Coolant::default();
        self.state.outputs.forget();
    }

    /// The answer to [`Item::Wait`]: 1 or 0, or −1 after the time-out. It becomes #5399.
    pub fn provide_input(&mut self, value: f64) {
        self.state.outputs.answer = value;
        self.state.outputs.answer_assumed = false;
    }

    /// The first pass: M66 is taken to have timed out, and what follows from that to be unknown.
    pub(crate) fn assume_input(&mut self) {
        self.state.outputs.answer = -1.0;
        self.state.outputs.answer_assumed = true;
    }

    /// What became of the probe. #5061 to #5069 get the touched position in program coordinates and units, the
    /// programmed end where nothing touched; #5070 says which. The program goes on from where the machine rests.
    pub fn provide_probe(&mut self, result: &ProbeResult) {
        probe::provide(&mut self.state, &mut self.parameters, &self.letters, result);
    }

    /// The first pass: the probe is taken to touch at its end, and what follows from that to be unknown.
    pub(crate) fn assume_probe(&mut self) {
        let named = self.letters.axes_of(self.words.named());
        probe::assume(&mut self.state, &mut self.parameters, &self.letters, named);
    }

    /// Whether what the last line does follows from an assumed answer, so that only the run can judge its numbers.
    #[inline]
    pub(crate) fn is_assumed(&mut self) -> bool {
        self.execution(&mut Vec::new()).is_assumed()
    }

    /// Interprets line `number` (from 1), given without its line end, and appends what it orders to `out`. Blocks are
    /// numbered through from 0.
    ///
    /// # Errors
    /// The first error of the line; `out` is then as before. The interpreter can go on with the next line (to find
    /// more errors), at the programmed end of this one where that is known.
    pub fn line(
        &mut self,
        number: u32,
        text: &[u8],
        out: &mut Vec<Item>,
    ) -> Result<(), Diagnostic> {
        if self.state.ended {
            return Ok(());
        }
        if self.calls_sub(text) {
            return by_hand::call(self, number, text, out);
        }
        if self.may_change_tool(text) {
            return by_hand::with_tool_change(self, number, text, out);
        }
        self.plain_line(number, text, out)
    }

    /// A line that calls nothing, or whose call somebody else obeys.
    #[inline]
    pub(crate) fn plain_line(
        &mut self,
        number: u32,
        text: &[u8],
        out: &mut Vec<Item>,
    ) -> Result<(), Diagnostic> {
        let items_before = out.len();
        let (next_index, at_rest) = (self.state.path.next_index, self.state.path.at_rest);
        self.state.line = self.reported_line.unwrap_or(number);
        self.run(text, out).map_err(|error| {
            out.truncate(items_before);
            let path = &mut self.state.path;
            path.next_index = next_index;
            path.at_rest = at_rest;
            path.last_end = path.position;
            Diagnostic::new(&self.file, number, text, error)
        })
    }

    /// Whether [`Self::line`] may execute a subroutine for `text`, and read its file.
    pub fn calls(&self, text: &[u8]) -> bool {
        self.calls_sub(text) || self.may_change_tool(text)
    }

    #[inline]
    fn calls_sub(&self, text: &[u8]) -> bool {
        !self.state.subprograms.obeyed
            && o_word::find(text, self.config.block_delete)
                .is_some_and(|at| by_hand::is_call(text, at))
    }

    /// Whether a line by hand may call the subroutine that changes tools.
    #[inline]
    fn may_change_tool(&self, text: &[u8]) -> bool {
        !self.state.subprograms.obeyed
            && self.config.tool_change.sub.is_some()
            && text.iter().any(|byte| matches!(byte, b'm' | b'M'))
    }

    /// The subroutine that changes tools begins.
    pub(crate) fn begin_tool_change(&mut self) {
        self.state.tools.changing = true;
    }

    /// It has ended: `number` is in the spindle.
    pub(crate) fn end_tool_change(&mut self, number: u32) {
        self.state.tools.changing = false;
        self.state.tools.in_spindle = number;
    }

    /// Ends the program at the end of its text, as M2 would.
    ///
    /// # Errors
    /// A program that `%` has opened and nothing has closed: it is truncated.
    pub fn finish(&mut self, out: &mut Vec<Item>) -> Result<(), Diagnostic> {
        if self.state.ended {
            return Ok(());
        }
        let last_line = self.state.line.max(1);
        if self.phase == Phase::Opened {
            self.state.ended = true;
            let why = "the program is truncated: % opened it, and neither %, M2 nor M30 ends it";
            return Err(Diagnostic::whole_line(
                &self.file,
                last_line,
                b"",
                "truncated",
                why.into(),
            ));
        }
        let open = self.state.curves.end();
        let beside = compensation::off(&mut self.execution(out));
        stop::end(&mut self.execution(out));
        open.and(beside)
            .map_err(|error| Diagnostic::new(&self.file, last_line, b"", error))
    }

    /// The current line with the state that it changes.
    #[inline]
    fn execution<'a>(&'a mut self, out: &'a mut Vec<Item>) -> Line<'a> {
        Line {
            config: &self.config,
            letters: &self.letters,
            words: &self.words,
            orders: &self.orders,
            state: &mut self.state,
            out,
            reads_assumed: &self.reads_assumed,
        }
    }

    fn run(&mut self, text: &[u8], out: &mut Vec<Item>) -> Checked<()> {
        if text.len() > MAX_LINE_BYTES {
            return Err(too_long(text.len()));
        }
        let Some(from) = self.lead(text, out)? else {
            return Ok(());
        };
        self.words.clear();
        self.state.path.begin_line();
        self.reads_assumed.set(false);
        let behind = plain_words(text, from, &mut self.words);
        if behind == text.len() && self.only_goes_straight() {
            return self.go_straight(out);
        }
        self.run_any(text, behind, out)
    }

    /// Whether the line, of which all has been read, says no more than where the next straight line goes: nearly all do.
    #[inline]
    fn only_goes_straight(&mut self) -> bool {
        let state = &self.state;
        !state.curves.is_open()
            && !state.compensation.is_on()
            && self
                .orders
                .sort_straight(&self.words, state.motion, &self.letters)
    }

    /// Executes such a line. What [`Self::run_any`] does beyond this is nothing for it.
    #[inline]
    fn go_straight(&mut self, out: &mut Vec<Item>) -> Checked<()> {
        self.begun = true;
        let done = self.execution(out).execute_motion();
        if done.is_err() {
            self.execution(out).recover(true);
        }
        done
    }

    /// Reads on behind byte `from`, and executes the line.
    fn run_any(&mut self, text: &[u8], from: usize, out: &mut Vec<Item>) -> Checked<()> {
        let context = Context {
            parameters: &self.parameters,
            state: &self.state,
            letters: &self.letters,
            reads_assumed: &self.reads_assumed,
        };
        let parsed = parse(text, from, &context, &mut self.words);
        if let Some(span) = self.words.abort {
            return Err(self.abort(text, span));
        }
        if !self.config.watched.is_empty() && parsed.is_ok() {
            self.look_for_watched(text, out);
        }
        let of_curve = self.state.curves.goes_on(&self.words);
        let done = match of_curve {
            Ok(true) => self.curve_line(parsed, out),
            Ok(false) => self.obey(parsed, out),
            Err(error) => self.obey(parsed.and(Err(error)), out),
        };
        self.state.curves.note(self.state.line, text);
        done
    }

    /// `(ABORT, …)`: the program itself says that it cannot go on, and why.
    #[cold]
    fn abort(&mut self, text: &[u8], span: Span) -> LineError {
        let comment = &text[span.start as usize + 1..span.end as usize - 1];
        let why = comment.trim_ascii_start().get(ABORT.len()..);
        let why = self.context().expanded(why.unwrap_or_default());
        self.state.compensation.spoil();
        self.state.ended = true;
        LineError::new(span, "abort", format!("the program aborts: {}", why.trim()))
    }

    /// What the line, which has been read, states of the names that are watched holds for its own motion already.
    #[cold]
    fn look_for_watched(&mut self, text: &[u8], out: &mut Vec<Item>) {
        let Self {
            config,
            state,
            words,
            unknown,
            ..
        } = self;
        let mut push = |item| {
            if state.compensation.holds() {
                state.compensation.hold(item);
            } else {
                out.push(item);
            }
        };
        let wrong = stated::of_comments(text, &config.watched, &mut push);
        if let (Some(message), None) = (wrong, &unknown) {
            *unknown = Some(Unknown {
                line: state.line,
                message,
            });
        }
        for assignment in &words.assignments {
            let Target::Named(range) = &assignment.target else {
                continue;
            };
            let name = &words.names[range.clone()];
            if let Some(which) = stated::of_parameter(name, &config.watched) {
                let value = assignment.value;
                push(Item::Stated { which, value });
            }
        }
    }

    /// Executes a line of an open curve, if it could be read.
    fn curve_line(&mut self, parsed: Checked<()>, out: &mut Vec<Item>) -> Checked<()> {
        let done = parsed.and_then(|()| self.assign()).and_then(|()| {
            self.orders.clear();
            self.words
                .polar
                .map_or(Ok(()), |polar| Err(polar_misplaced(&polar)))?;
            curve::curve_line(&mut self.execution(out))
        });
        if done.is_err() {
            self.state.curves.spoil();
        }
        done
    }

    /// Executes any other line, if it could be read; otherwise takes over what can be.
    #[inline]
    fn obey(&mut self, parsed: Checked<()>, out: &mut Vec<Item>) -> Checked<()> {
        let sorted = self
            .orders
            .sort(&self.words, self.state.motion, &self.letters);
        let complete = parsed.is_ok();
        let done = parsed
            .and(sorted)
            .and_then(|()| self.assign())
            .and_then(|()| {
                self.refuse_number()?;
                self.execution(out).execute()
            });
        if done.is_err() {
            // What the line would have assigned exists, so that no later line complains of that.
            let _ = self.assign();
            self.execution(out).recover(complete);
            self.state.curves.pass_over(&self.words, self.state.line);
        }
        done
    }

    /// The number of a program stands before all words, that of a subprogram alone in its line.
    #[inline]
    fn refuse_number(&mut self) -> Checked<()> {
        if self.words.has(b'O') && self.begun {
            let of_subprogram = self.state.subprograms.obeyed && self.words.is_number_of_program();
            if !of_subprogram {
                return Err(self.words.error(b'O', "o-word", O_WORDS));
            }
        }
        self.begun |= !self.words.is_empty();
        Ok(())
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
        if self.phase == Phase::Fresh {
            skip_name(scanner);
        }
        scanner.skip_ignorable()?;
        if !scanner.at_end() {
            return Err(LineError::new(
                scanner.since(start),
                "percent",
                "% stands on a line of its own",
            ));
        }
        if self.phase == Phase::Fresh {
            self.phase = Phase::Opened;
        } else {
            self.ended_by_percent = Some((self.state.line, self.phase == Phase::Opened));
            let open = self.state.curves.end();
            let beside = compensation::off(&mut self.execution(out));
            stop::end(&mut self.execution(out));
            open.and(beside)?;
        }
        Ok(None)
    }

    #[inline]
    fn assign(&mut self) -> Checked<()> {
        if self.words.assignments.is_empty() {
            return Ok(());
        }
        self.assign_each()
    }

    fn assign_each(&mut self) -> Checked<()> {
        let assumed = self.reads_assumed.get();
        for assignment in &self.words.assignments {
            match &assignment.target {
                Target::Numbered(number) => {
                    self.parameters
                        .set_numbered(*number, assignment.value, assumed);
                }
                Target::Named(range) => {
                    if !self.parameters.set_named(
                        &self.words.names[range.clone()],
                        assignment.value,
                        assumed,
                    ) {
                        return Err(LineError::new(
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

/// `%` on the first line may be followed by the name of the program: `%prog1`, `%_N_PART_MPF`, `%1000`, `%O1000`. What could be a
/// word, as in `%G0`, is none.
fn skip_name(scanner: &mut Scanner) {
    let rest = scanner.rest().trim_ascii_start();
    let of_name = |byte: &&u8| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'-' | b'.');
    let name = &rest[..rest.iter().take_while(of_name).count()];
    let is_name = match name {
        [b'_', ..] => true,
        [b'O' | b'o', number @ ..] if !number.is_empty() => number.iter().all(u8::is_ascii_digit),
        [first, second, ..] if first.is_ascii_alphabetic() => {
            second.is_ascii_alphabetic() || *second == b'_'
        }
        number => number.iter().all(u8::is_ascii_digit),
    };
    if is_name {
        scanner.skip_blanks();
        scanner.advance(name.len());
    }
}

#[cold]
fn too_long(length: usize) -> LineError {
    let message = format!(
        "the line has {length} bytes, {MAX_LINE_BYTES} are allowed: this is hardly a part program"
    );
    LineError::new(Span::new(0, 1), "line-long", message)
}
