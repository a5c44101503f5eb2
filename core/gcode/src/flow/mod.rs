//! The order in which the lines of a program are executed: one after the other, and as its O-words say.

pub(crate) mod by_hand;
pub(crate) mod o_word;
mod outline;
mod repeats;
mod sources;

use std::ops::Range;

use crate::config::Config;
use crate::diagnostic::{Diagnostic, Severity};
use crate::interpreter::Interpreter;
use crate::item::Item;
use crate::line_error::{LineError, Span};
use crate::program::lines::{Lines, Mark, Next, Pass};
use crate::program::{Program, ProgramError};
use crate::state::parameters::Value;
use crate::syntax::scan::Scanner;
use crate::words::subprogram::Jump;
use o_word::{Keyword, Label, Title};
use outline::Entry;
use repeats::Repeats;
use sources::{Sources, file};

/// Most calls within each other.
const MAX_CALLS: usize = 100;
/// Most callers that a message names.
const MAX_CALLERS_SHOWN: usize = 5;

/// What a step has met. One is made for each line, and hardly ever holds a diagnostic, which is large.
pub(crate) enum Step {
    /// A line has been executed.
    Line,
    /// A line is wrong; what follows can be executed to find more errors.
    Wrong(Box<Diagnostic>),
    /// Nothing more can be executed.
    Stuck(Box<Diagnostic>),
    /// In the first pass: where the program goes on depends on what a probe or an input will answer.
    Open(Box<Diagnostic>),
    /// The file is over.
    End,
}

impl Step {
    #[cold]
    fn wrong(diagnostic: Diagnostic) -> Self {
        Self::Wrong(Box::new(diagnostic))
    }

    #[cold]
    fn stuck(diagnostic: Diagnostic) -> Self {
        Self::Stuck(Box::new(diagnostic))
    }
}

/// A call that has not returned.
struct Frame {
    file: usize,
    /// Where the caller goes on.
    after: Mark,
    call_line: u32,
    callee: Callee,
    /// The tool that is in the spindle when it returns, where it changes tools.
    changes_to: Option<u32>,
    /// Loops that the caller is in.
    repeats: usize,
}

/// What is called.
enum Callee {
    /// A subroutine, as an entry of the file that is executed.
    Sub(usize),
    /// A subprogram, where it begins and how often it is still to be driven.
    Program { number: u32, start: Mark, left: u32 },
}

/// What has made the program go back.
#[derive(Clone, Copy)]
enum Loop {
    /// An O-word: its file and its entry.
    Word(usize, usize),
    /// M99 in the program itself: its line.
    Program(u32),
}

/// A program as it is executed.
pub(crate) struct Execution {
    pub interpreter: Interpreter,
    pass: Pass,
    sources: Sources,
    frames: Vec<Frame>,
    repeats: Repeats,
    /// Lines executed since the first O-word; in the second pass since the last item.
    steps: u64,
    /// The loop that has gone back last.
    last_loop: Option<Loop>,
    /// Something has decided where the program goes on: when it begins again it may go another way.
    decided: bool,
    /// The line that was executed last, in its chunk.
    last: Range<usize>,
    /// Its text, where it may have led elsewhere.
    text: Vec<u8>,
    is_kept: bool,
    values: Vec<Value>,
    /// The number of the line by hand that is all of the program.
    by_hand: Option<u32>,
}

impl Execution {
    pub fn new(program: &mut Program, config: &Config, pass: Pass) -> Self {
        let mut interpreter = Interpreter::new(config.clone());
        interpreter.set_file(&program.name);
        Self::over(interpreter, program, pass)
    }

    /// Executes `program` with an interpreter that has executed others.
    fn over(mut interpreter: Interpreter, program: &mut Program, pass: Pass) -> Self {
        interpreter.obey_jumps();
        Self {
            interpreter,
            pass,
            sources: Sources::new(program, pass),
            frames: Vec::new(),
            repeats: Repeats::default(),
            steps: 0,
            last_loop: None,
            decided: false,
            last: 0..0,
            text: Vec::new(),
            is_kept: false,
            values: Vec::new(),
            by_hand: None,
        }
    }

    /// The lines of the program's own file.
    pub fn lines(&mut self) -> &mut Lines {
        self.sources.own_lines()
    }

    /// The text of the line that was executed last.
    pub fn text(&self) -> &[u8] {
        if self.is_kept {
            &self.text
        } else {
            self.sources.current().lines.text(&self.last)
        }
    }

    /// Keeps the text of the line that is executed: what comes may lead elsewhere.
    fn keep_text(&mut self) {
        self.text.clear();
        self.text
            .extend_from_slice(self.sources.current().lines.text(&self.last));
        self.is_kept = true;
    }

    /// Executes the next line.
    ///
    /// # Errors
    /// A file cannot be read, or has changed since the first pass.
    #[inline]
    pub fn step(
        &mut self,
        program: &mut Program,
        out: &mut Vec<Item>,
    ) -> Result<Step, ProgramError> {
        self.is_kept = false;
        match self.sources.next(program)? {
            Next::Line(range) => self.last = range,
            Next::Bad(diagnostic) => return Ok(Step::wrong(self.called(*diagnostic))),
            Next::End => return Ok(Step::End),
        }
        if self.sources.current().outline.is_some() {
            self.steps += 1;
            if self.steps > self.interpreter.config().max_steps {
                return Ok(Step::stuck(self.endless()));
            }
        }
        let source = self.sources.current();
        let text = source.lines.text(&self.last);
        if let Some(label_at) = o_word::find(text, self.interpreter.config().block_delete) {
            return self.o_word_line(program, label_at, out);
        }
        let items = out.len();
        let done = self.interpreter.line(source.lines.number, text, out);
        if self.pass == Pass::Second && out.len() > items {
            self.steps = 0;
        }
        if let Some((jump, assumed)) = self.interpreter.take_jump() {
            return self.leap(program, jump, assumed, out);
        }
        Ok(done.map_or_else(
            |diagnostic| Step::wrong(self.called(diagnostic)),
            |()| Step::Line,
        ))
    }

    #[cold]
    fn o_word_line(
        &mut self,
        program: &mut Program,
        at: usize,
        out: &mut Vec<Item>,
    ) -> Result<Step, ProgramError> {
        let lines = &self.sources.current().lines;
        let number = lines.number;
        if self.sources.current().outline.is_none() {
            match o_word::OWord::read(lines.text(&self.last), at) {
                // The number of a program is a word as any other.
                Ok(Title::Number(_)) => {
                    let done = self.interpreter.line(number, lines.text(&self.last), out);
                    return Ok(done.map_or_else(Step::wrong, |()| Step::Line));
                }
                Ok(Title::Name) => {
                    let text = lines.text(&self.last).to_vec();
                    return Ok(self.name_of_program(number, &text));
                }
                _ => {}
            }
            let which = self.sources.current;
            self.sources
                .index(program, which, self.interpreter.config())?;
        }
        if let Some(wrong) = self.sources.outline().wrong(number) {
            return Ok(Step::stuck(self.called(wrong.clone())));
        }
        self.keep_text();
        let text = std::mem::take(&mut self.text);
        let found = self.sources.outline().find(number);
        let step = if let Some(index) = found {
            self.obey(program, index, &text, out)
        } else if let Ok(Title::Name) = o_word::OWord::read(&text, at) {
            Ok(self.name_of_program(number, &text))
        } else {
            let done = self.interpreter.line(number, &text, out);
            Ok(done.map_or_else(
                |diagnostic| Step::wrong(self.called(diagnostic)),
                |()| Step::Line,
            ))
        };
        self.text = text;
        step
    }

    /// A `<name>` alone: before all words it names the program; behind them what the O-word does has been forgotten.
    fn name_of_program(&mut self, number: u32, text: &[u8]) -> Step {
        let begun = self.interpreter.has_begun();
        self.interpreter.begin_o_word(number);
        if !begun {
            return Step::Line;
        }
        let error = o_word::without_keyword(Span::new(0, text.len()));
        let diagnostic = Diagnostic::new(self.interpreter.file(), number, text, error);
        Step::wrong(self.called(diagnostic))
    }

    /// M98 and M99, and M6 where a subroutine changes tools.
    #[cold]
    fn leap(
        &mut self,
        program: &mut Program,
        jump: Jump,
        assumed: bool,
        out: &mut Vec<Item>,
    ) -> Result<Step, ProgramError> {
        self.keep_text();
        let number = self.sources.current().lines.number;
        self.decided |= matches!(jump, Jump::Call { .. });
        let error = match jump {
            Jump::End if self.frames.is_empty() && !self.decided => {
                let message = "M99 begins the program again, and nothing in it decides where it goes on: it would never end \
                               (M2 or M30 ends a program)";
                let error = LineError::new(Span::new(0, self.text().len()), "endless", message);
                let text = self.text();
                let diagnostic = Diagnostic::new(self.interpreter.file(), number, text, error);
                return Ok(Step::stuck(diagnostic));
            }
            Jump::Call { .. } if assumed && self.pass == Pass::First => {
                let text = self.text.clone();
                return Ok(self.open(number, &text));
            }
            Jump::Call {
                number: called,
                times,
                span,
            } => match self.call_program(program, called, times)? {
                Ok(()) => return Ok(Step::Line),
                Err(why) => LineError::new(span, "o-word", why),
            },
            Jump::End => match self.end_program(program, out)? {
                Ok(()) => return Ok(Step::Line),
                Err(why) => LineError::new(Span::new(0, self.text().len()), "o-word", why),
            },
            Jump::ToolChange { number: tool } => match self.change_tool(program, tool)? {
                Ok(step) => return Ok(step),
                Err(why) => LineError::new(Span::new(0, self.text().len()), "tool", why),
            },
        };
        let diagnostic = Diagnostic::new(self.interpreter.file(), number, self.text(), error);
        Ok(Step::wrong(self.called(diagnostic)))
    }

    fn call_program(
        &mut self,
        program: &mut Program,
        number: u32,
        times: u32,
    ) -> Result<Result<(), String>, ProgramError> {
        if self.frames.len() == MAX_CALLS {
            return Ok(Err(too_deep()));
        }
        let call_line = self.sources.current().lines.number;
        let config = self.interpreter.config();
        let (target, start) = match self
            .sources
            .find_program(program, number, call_line, config)?
        {
            Ok(found) => found,
            Err(why) => return Ok(Err(why)),
        };
        self.frames.push(Frame {
            file: self.sources.current,
            after: self.sources.current().lines.mark(),
            call_line,
            callee: Callee::Program {
                number,
                start,
                left: times - 1,
            },
            changes_to: None,
            repeats: self.repeats.len(),
        });
        self.interpreter.enter_subprogram();
        self.switch_to(program, target);
        self.jump(program, start)?;
        Ok(Ok(()))
    }

    /// M99.
    fn end_program(
        &mut self,
        program: &mut Program,
        out: &mut Vec<Item>,
    ) -> Result<Result<(), String>, ProgramError> {
        let repeats = self.frames.last().map_or(0, |frame| frame.repeats);
        let again = match self.frames.last_mut().map(|frame| &mut frame.callee) {
            None => {
                if self.sources.current().outline.is_none() {
                    let which = self.sources.current;
                    self.sources
                        .index(program, which, self.interpreter.config())?;
                }
                self.last_loop = Some(Loop::Program(self.sources.current().lines.number));
                self.repeats.truncate(0);
                self.interpreter.begin_again();
                self.jump(program, Mark::START)?;
                return Ok(Ok(()));
            }
            Some(Callee::Sub(_)) => {
                let why =
                    "M99 ends a subprogram that M98 has called: a sub ends with endsub or return";
                return Ok(Err(why.into()));
            }
            Some(Callee::Program { left: 0, .. }) => None,
            Some(Callee::Program { left, start, .. }) => {
                *left -= 1;
                Some(*start)
            }
        };
        self.interpreter.leave_sub(None, out);
        self.repeats.truncate(repeats);
        if let Some(start) = again {
            self.interpreter.enter_subprogram();
            self.jump(program, start)?;
        } else if let Some(frame) = self.frames.pop() {
            self.switch_to(program, frame.file);
            self.jump(program, frame.after)?;
        }
        Ok(Ok(()))
    }

    /// Executes the O-word `index` of the current file, whose line is `text`.
    fn obey(
        &mut self,
        program: &mut Program,
        index: usize,
        text: &[u8],
        out: &mut Vec<Item>,
    ) -> Result<Step, ProgramError> {
        let entry = self.sources.outline().entry(index).clone();
        self.interpreter.begin_o_word(entry.number);
        let jumps = matches!(
            entry.word.keyword,
            Keyword::Sub | Keyword::Else | Keyword::ElseIf | Keyword::Do
        );
        if !jumps && let Err(error) = self.read_values(&entry, text) {
            let diagnostic = Diagnostic::new(self.interpreter.file(), entry.number, text, error);
            self.leave_block(program, &entry)?;
            return Ok(Step::wrong(self.called(diagnostic)));
        }
        let decides = !matches!(
            entry.word.keyword,
            Keyword::Call | Keyword::Return | Keyword::EndSub
        );
        if decides && self.assumes() {
            return Ok(self.open(entry.number, text));
        }
        self.decided |= decides || matches!(entry.word.label, Label::Computed(_));
        match entry.word.keyword {
            Keyword::Call => return self.call(program, &entry, text),
            Keyword::Return | Keyword::EndSub => return self.end_call(program, &entry, text, out),
            Keyword::Sub | Keyword::Else | Keyword::ElseIf => {
                self.jump_behind(program, entry.close)?;
            }
            Keyword::If => return self.choose(program, index),
            Keyword::While if entry.open != index => self.end_do(program, &entry)?,
            Keyword::While if !self.truth() => self.jump_behind(program, entry.close)?,
            Keyword::Do | Keyword::EndIf | Keyword::While => {}
            Keyword::EndWhile => self.go_back(program, entry.open, true)?,
            Keyword::Repeat => self.begin_repeat(program, index, entry.close)?,
            Keyword::EndRepeat => self.end_repeat(program, &entry)?,
            Keyword::Break => {
                self.leave_repeats(entry.open);
                self.jump_behind(program, entry.close)?;
            }
            Keyword::Continue => {
                self.leave_repeats(entry.open + 1);
                let before = self.sources.outline().entry(entry.close).before;
                self.jump(program, before)?;
            }
        }
        Ok(Step::Line)
    }

    /// Reads the `[values]` behind the keyword.
    fn read_values(&mut self, entry: &Entry, text: &[u8]) -> Result<(), LineError> {
        let at = usize::from(entry.word.values_at);
        let (min, max) = entry.word.keyword.values();
        self.interpreter
            .context()
            .bracketed(text, at, max, &mut self.values)?;
        if self.values.len() < min {
            let message = format!("{} needs a value in brackets", entry.word.keyword.name());
            return Err(LineError::new(Span::new(0, at), "value-missing", message));
        }
        Ok(())
    }

    /// In the first pass: whether a value follows from what has been assumed.
    fn assumes(&self) -> bool {
        self.pass == Pass::First && self.values.iter().any(|value| value.assumed)
    }

    fn truth(&self) -> bool {
        self.values.first().is_some_and(|value| value.number != 0.0)
    }

    fn open(&mut self, number: u32, text: &[u8]) -> Step {
        let message = "from here on the program depends on what a probe or an input will answer: \
                       what follows is checked when it is driven";
        let span = Span::new(0, text.len());
        let error = LineError::new(span, "branch-open", message);
        let diagnostic = Diagnostic::new(self.interpreter.file(), number, text, error);
        Step::Open(Box::new(Diagnostic {
            severity: Severity::Warning,
            ..self.called(diagnostic)
        }))
    }

    /// `if`, and the branches after it whose turn it is.
    fn choose(&mut self, program: &mut Program, index: usize) -> Result<Step, ProgramError> {
        if self.truth() {
            return Ok(Step::Line);
        }
        let next = self
            .sources
            .outline()
            .entry(self.sources.outline().entry(index).next)
            .clone();
        if next.word.keyword != Keyword::ElseIf {
            self.jump(program, next.after)?;
            return Ok(Step::Line);
        }
        let at = self.sources.outline().find(next.number).unwrap_or(index);
        self.jump(program, next.before)?;
        let Next::Line(range) = self.sources.next(program)? else {
            return Ok(Step::Line);
        };
        let line = self.sources.current().lines.text(&range).to_vec();
        self.interpreter.begin_o_word(next.number);
        if let Err(error) = self.read_values(&next, &line) {
            let diagnostic = Diagnostic::new(self.interpreter.file(), next.number, &line, error);
            self.leave_block(program, &next)?;
            return Ok(Step::wrong(self.called(diagnostic)));
        }
        if self.assumes() {
            return Ok(self.open(next.number, &line));
        }
        self.choose(program, at)
    }

    /// After an error: goes on behind the block that the O-word opens or continues.
    fn leave_block(&mut self, program: &mut Program, entry: &Entry) -> Result<(), ProgramError> {
        match entry.word.keyword {
            Keyword::If | Keyword::ElseIf | Keyword::While | Keyword::Repeat if entry.close > 0 => {
                self.jump_behind(program, entry.close)
            }
            _ => Ok(()),
        }
    }

    fn end_do(&mut self, program: &mut Program, entry: &Entry) -> Result<(), ProgramError> {
        if self.truth() {
            self.go_back(program, entry.open, false)
        } else {
            Ok(())
        }
    }

    fn begin_repeat(
        &mut self,
        program: &mut Program,
        index: usize,
        close: usize,
    ) -> Result<(), ProgramError> {
        let count = self
            .values
            .first()
            .map_or(0.0, |value| value.number.round_ties_even());
        if count < 1.0 {
            return self.jump_behind(program, close);
        }
        self.leave_repeats(index);
        self.repeats.begin(index, count as u64);
        Ok(())
    }

    fn end_repeat(&mut self, program: &mut Program, entry: &Entry) -> Result<(), ProgramError> {
        self.leave_repeats(entry.open + 1);
        if self.repeats.turn(entry.open) {
            self.go_back(program, entry.open, false)
        } else {
            Ok(())
        }
    }

    /// Forgets the repeats of this call that begin at the O-word `from` or behind it.
    fn leave_repeats(&mut self, from: usize) {
        self.repeats
            .leave(from, self.frames.last().map_or(0, |frame| frame.repeats));
    }

    /// A loop goes on: at its first line, or with the test before it.
    fn go_back(
        &mut self,
        program: &mut Program,
        open: usize,
        with_test: bool,
    ) -> Result<(), ProgramError> {
        self.last_loop = Some(Loop::Word(self.sources.current, open));
        let entry = self.sources.outline().entry(open);
        let mark = if with_test { entry.before } else { entry.after };
        self.jump(program, mark)
    }

    fn jump_behind(&mut self, program: &mut Program, index: usize) -> Result<(), ProgramError> {
        let after = self.sources.outline().entry(index).after;
        self.jump(program, after)
    }

    fn jump(&mut self, program: &mut Program, mark: Mark) -> Result<(), ProgramError> {
        self.sources.seek(program, mark)
    }

    fn call(
        &mut self,
        program: &mut Program,
        entry: &Entry,
        text: &[u8],
    ) -> Result<Step, ProgramError> {
        let label = match &entry.word.label {
            Label::Fixed(label) => label.clone(),
            Label::Computed(at) => {
                match self
                    .interpreter
                    .context()
                    .assumed_value(&mut Scanner::new(text, usize::from(*at)))
                {
                    Ok(value) if value.assumed && self.pass == Pass::First => {
                        return Ok(self.open(entry.number, text));
                    }
                    Ok(value) => format!("{}", value.number.round()).into(),
                    Err(error) => {
                        let diagnostic =
                            Diagnostic::new(self.interpreter.file(), entry.number, text, error);
                        return Ok(Step::wrong(self.called(diagnostic)));
                    }
                }
            }
        };
        let refuse = |this: &Self, why: String| {
            let error = LineError::new(
                Span::new(0, usize::from(entry.word.values_at)),
                "o-word",
                why,
            );
            this.called(Diagnostic::new(
                this.interpreter.file(),
                entry.number,
                text,
                error,
            ))
        };
        if self.frames.len() == MAX_CALLS {
            return Ok(Step::stuck(refuse(self, too_deep())));
        }
        let (target, sub) =
            match self
                .sources
                .find_sub(program, &label, self.interpreter.config())?
            {
                Ok(found) => found,
                Err(why) => return Ok(Step::wrong(refuse(self, why))),
            };
        self.enter(program, (target, sub), entry.number, None)
    }

    /// Calls a subroutine, as an entry of a file, with the values that have been read.
    fn enter(
        &mut self,
        program: &mut Program,
        (target, sub): (usize, usize),
        call_line: u32,
        changes_to: Option<u32>,
    ) -> Result<Step, ProgramError> {
        let called = self.sources.get(target).outline.as_ref();
        let wrong = called.and_then(|outline| outline.wrong(outline.entry(sub).number));
        if let Some(wrong) = wrong {
            return Ok(Step::stuck(self.called(wrong.clone())));
        }
        self.frames.push(Frame {
            file: self.sources.current,
            after: self.sources.current().lines.mark(),
            call_line,
            callee: Callee::Sub(sub),
            changes_to,
            repeats: self.repeats.len(),
        });
        self.interpreter.enter_sub(&self.values);
        self.switch_to(program, target);
        let start = self.sources.outline().entry(sub).after;
        self.jump(program, start)?;
        Ok(Step::Line)
    }

    /// M6: calls the subroutine that changes tools, with the number of the next tool and that of the one in the spindle.
    fn change_tool(
        &mut self,
        program: &mut Program,
        tool: u32,
    ) -> Result<Result<Step, String>, ProgramError> {
        if self.frames.len() == MAX_CALLS {
            return Ok(Err(too_deep()));
        }
        let config = self.interpreter.config();
        let name = config.tool_change.sub.clone().unwrap_or_default();
        let found = match self.sources.find_sub_of_file(program, &name, config)? {
            Ok(found) => found,
            Err(why) => {
                return Ok(Err(format!(
                    "the tool cannot be changed by o<{name}>: {why}"
                )));
            }
        };
        let number = |number: u32| Value {
            number: f64::from(number),
            assumed: false,
        };
        self.values.clear();
        let in_spindle = self.interpreter.tool_in_spindle();
        self.values.extend([tool, in_spindle].map(number));
        self.interpreter.begin_tool_change();
        let line = self.sources.current().lines.number;
        self.enter(program, found, line, Some(tool)).map(Ok)
    }

    /// `return` and `endsub`.
    fn end_call(
        &mut self,
        program: &mut Program,
        entry: &Entry,
        text: &[u8],
        out: &mut Vec<Item>,
    ) -> Result<Step, ProgramError> {
        let of_sub = |frame: &Frame| matches!(frame.callee, Callee::Sub(_));
        let Some(frame) = self.frames.pop_if(|frame| of_sub(frame)) else {
            let keyword = entry.word.keyword.name();
            let why = if self.frames.is_empty() {
                format!("{keyword} without a call")
            } else {
                format!("{keyword} in a subprogram: what M98 has called ends with M99")
            };
            let error = LineError::new(
                Span::new(0, usize::from(entry.word.values_at)),
                "o-word",
                why,
            );
            let diagnostic = Diagnostic::new(self.interpreter.file(), entry.number, text, error);
            return Ok(Step::stuck(diagnostic));
        };
        self.interpreter
            .leave_sub(self.values.first().copied(), out);
        if let Some(tool) = frame.changes_to {
            self.interpreter.end_tool_change(tool);
        }
        self.repeats.truncate(frame.repeats);
        self.switch_to(program, frame.file);
        self.jump(program, frame.after)?;
        Ok(Step::Line)
    }

    /// Makes another file the one that is executed. The blocks of a file of its own bear the line that calls it.
    fn switch_to(&mut self, program: &mut Program, which: usize) {
        self.sources.current = which;
        self.interpreter.set_file(&file(program, which).name);
        let in_program = self.frames.iter().rev().find(|frame| frame.file == 0);
        self.interpreter.reported_line = in_program
            .filter(|_| which != 0)
            .map(|frame| frame.call_line);
    }

    /// Adds to a message who called the subroutine in which it arises.
    fn called(&self, mut diagnostic: Diagnostic) -> Diagnostic {
        use std::fmt::Write as _;
        for (depth, frame) in self.frames.iter().enumerate().rev().take(MAX_CALLERS_SHOWN) {
            let which = self
                .frames
                .get(depth + 1)
                .map_or(self.sources.current, |inner| inner.file);
            let name = match frame.callee {
                Callee::Sub(sub) => {
                    let outline = self.sources.get(which).outline.as_ref();
                    let name = outline.map(|outline| outline.shown(sub));
                    name.unwrap_or_default().replace(" sub", "")
                }
                Callee::Program { number, .. } => format!("O{number}"),
            };
            let by_hand = self.by_hand.filter(|_| frame.file == 0);
            let line = by_hand.unwrap_or(frame.call_line);
            let _ = write!(diagnostic.message, "; in {name}, called from line {line}");
        }
        if self.frames.len() > MAX_CALLERS_SHOWN {
            let _ = write!(
                diagnostic.message,
                "; and {} callers before",
                self.frames.len() - MAX_CALLERS_SHOWN
            );
        }
        diagnostic
    }

    /// The program has executed too many lines.
    fn endless(&self) -> Diagnostic {
        let steps = self.interpreter.config().max_steps;
        let since = if self.pass == Pass::Second {
            " without an item"
        } else {
            ""
        };
        let whose = self.last_loop.and_then(|last| match last {
            Loop::Word(which, open) => {
                let outline = self.sources.get(which).outline.as_ref()?;
                let number = outline.entry(open).number;
                Some(format!("{} of line {number} goes on", outline.shown(open)))
            }
            Loop::Program(number) => Some(format!(
                "the program, which M99 of line {number} begins again, goes on"
            )),
        });
        let whose = whose.unwrap_or_else(|| "the program goes on".into());
        let message =
            format!("{whose} after {steps} lines{since} ([program] max_steps): it may never end");
        let number = self.sources.current().lines.number;
        let text = self.text();
        let error = LineError::new(Span::new(0, text.len()), "endless", message);
        self.called(Diagnostic::new(
            self.interpreter.file(),
            number,
            text,
            error,
        ))
    }
}

fn too_deep() -> String {
    format!("calls lie {MAX_CALLS} deep within each other: a subroutine calls itself without end")
}
