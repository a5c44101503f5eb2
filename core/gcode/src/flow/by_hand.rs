//! Subroutines that an operator calls: `o<drill> call [5]` as a line by hand.

use std::sync::Arc;

use super::o_word::{Keyword, OWord, Title};
use super::{Execution, Step};
use crate::diagnostic::Diagnostic;
use crate::interpreter::Interpreter;
use crate::item::Item;
use crate::line_error::{LineError, Span};
use crate::program::lines::Pass;
use crate::program::{Program, ProgramError};
use crate::words::subprogram::Jump;

/// Most lines that a call by hand may execute: all of them are, before the first of them moves.
const MAX_LINES: u32 = 100_000;

/// Whether a line, whose label begins at `at`, calls a subroutine.
pub(crate) fn is_call(text: &[u8], at: usize) -> bool {
    matches!(OWord::read(text, at), Ok(Title::Word(word)) if word.keyword == Keyword::Call)
}

/// Executes the call in line `number`, and all that it calls. Everything bears the number of that line.
///
/// # Errors
/// What is wrong in the line or in what it calls; nothing has changed then. What a probe or an input answers is known only when
/// it has been driven: nothing but the end of the subroutine may follow it.
#[cold]
pub(crate) fn call(
    interpreter: &mut Interpreter,
    number: u32,
    text: &[u8],
    out: &mut Vec<Item>,
) -> Result<(), Diagnostic> {
    let before = interpreter.clone();
    let items_before = out.len();
    let done = execute(interpreter, number, text, out);
    interpreter.end_by_hand(&before);
    if done.is_err() {
        *interpreter = before;
        out.truncate(items_before);
    }
    for item in &mut out[items_before..] {
        match item {
            Item::Block(block, _) => block.line = number,
            Item::Event(event) => event.line = number,
            Item::Wait(wait) => wait.line = number,
            Item::Command(command) => command.line = number,
            Item::Stated { .. } | Item::End => {}
        }
    }
    done.map_err(|mut diagnostic| {
        if Arc::ptr_eq(&diagnostic.file, interpreter.file()) {
            diagnostic.line = number;
        }
        diagnostic
    })
}

/// Executes a line, and the subroutine that changes tools where the line calls it.
///
/// # Errors
/// As in [`call`].
#[cold]
pub(crate) fn with_tool_change(
    interpreter: &mut Interpreter,
    number: u32,
    text: &[u8],
    out: &mut Vec<Item>,
) -> Result<(), Diagnostic> {
    let before = interpreter.clone();
    let items_before = out.len();
    interpreter.plain_line(number, text, out)?;
    let Some((Jump::ToolChange { number: tool }, _)) = interpreter.take_jump() else {
        return Ok(());
    };
    let name = interpreter.config().tool_change.sub.clone();
    let line = format!(
        "o<{}> call [{tool}] [{}]",
        name.unwrap_or_default(),
        interpreter.tool_in_spindle()
    );
    interpreter.begin_tool_change();
    let done = call(interpreter, number, line.as_bytes(), out);
    if done.is_err() {
        *interpreter = before;
        out.truncate(items_before);
    } else {
        interpreter.end_tool_change(tool);
    }
    done
}

fn execute(
    interpreter: &mut Interpreter,
    number: u32,
    text: &[u8],
    out: &mut Vec<Item>,
) -> Result<(), Diagnostic> {
    let file = Arc::clone(interpreter.file());
    let whole = |error: ProgramError| match error {
        ProgramError::Text(diagnostic) => *diagnostic,
        other => Diagnostic::whole_line(&file, 1, text, "o-word", other.to_string()),
    };
    let mut program = Program::spool(&file, text).map_err(whole)?;
    let config = interpreter.config().clone();
    let own = std::mem::replace(interpreter, Interpreter::new(config));
    let mut execution = Execution {
        by_hand: Some(number),
        ..Execution::over(own, &mut program, Pass::First)
    };
    let done = steps(&mut execution, &mut program, out);
    *interpreter = execution.interpreter;
    done.map_err(whole)
}

fn steps(
    execution: &mut Execution,
    program: &mut Program,
    out: &mut Vec<Item>,
) -> Result<(), ProgramError> {
    let mut asked = false;
    for _ in 0..MAX_LINES {
        let items = out.len();
        let refused = match execution.step(program, out)? {
            Step::End => return Ok(()),
            Step::Line if execution.interpreter.ended() => return Ok(()),
            Step::Line if asked && !ends(execution.text()) => {
                "what follows a probe or an input depends on the answer: by hand nothing may follow it in a subroutine"
            }
            Step::Line => {
                let asks = |item: &Item| item.is_probe() || matches!(item, Item::Wait(_));
                asked |= out[items..].iter().any(asks);
                continue;
            }
            Step::Wrong(diagnostic) | Step::Stuck(diagnostic) | Step::Open(diagnostic) => {
                return Err(diagnostic.into());
            }
        };
        return Err(execution.error(refused).into());
    }
    let endless = format!("by hand a subroutine executes at most {MAX_LINES} lines");
    Err(execution.error(&endless).into())
}

/// Whether a line does nothing but end a subroutine without a value, or nothing at all.
fn ends(text: &[u8]) -> bool {
    let Some(first) = text.iter().find(|b| !matches!(b, b' ' | b'\t')) else {
        return true;
    };
    let at = super::o_word::find(text, true);
    let word = at.and_then(|at| OWord::read(text, at).ok());
    match word {
        Some(Title::Word(word)) => {
            matches!(word.keyword, Keyword::EndSub | Keyword::Return) && !text.contains(&b'[')
        }
        _ => matches!(first, b'(' | b';'),
    }
}

impl Execution {
    /// An error of the line that was executed last.
    fn error(&self, message: &str) -> Diagnostic {
        let text = self.text();
        let error = LineError::new(Span::new(0, text.len()), "o-word", message);
        let number = self.sources.current().lines.number;
        self.called(Diagnostic::new(
            self.interpreter.file(),
            number,
            text,
            error,
        ))
    }
}
